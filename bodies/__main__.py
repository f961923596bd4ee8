"""make tapes: flies multirotors in RotorPy and aeroplanes in JSBSim, drawn from seeds, and writes
what they did to FOLDER/bodies.tapes, for make campaign TAPES=FOLDER/bodies.tapes."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from bodies.flights import Flight, flown
from chute_ros.sim.tape import MAGIC, written

_NAME = "bodies.tapes"
_TELL_EVERY = 5.0  # s


def main() -> None:
    """Exit code 1: not one flight could be flown."""
    options = argparse.ArgumentParser("bodies", description=__doc__)
    options.add_argument("folder", type=Path, help="for the file; made if it is not there")
    for kind in ("multirotors", "aeroplanes"):
        options.add_argument(f"--{kind}", type=whole, default=300, help="flights (default: 300)")
    options.add_argument("--seed", type=int, default=0, help="of the first of each (default: 0)")
    options.add_argument("--jobs", type=whole, default=os.cpu_count() or 1, help="processes")
    given = options.parse_args()
    if not given.jobs:
        options.error("argument --jobs: need 1 at least")
    flights = [("multirotor", given.seed + one) for one in range(given.multirotors)]
    flights += [("aeroplane", given.seed + one) for one in range(given.aeroplanes)]
    if not flights:
        options.error("no flight: need --multirotors or --aeroplanes of 1 or more")
    try:
        given.folder.mkdir(parents=True, exist_ok=True)
        sys.exit(_record(flights, given.folder / _NAME, given.jobs))
    except OSError as error:
        sys.exit(f"bodies: {error.filename}: {error.strerror}")
    except BrokenProcessPool:
        sys.exit("bodies: a process ended by itself (for want of memory?); nothing was written")
    except KeyboardInterrupt:
        sys.exit("bodies: interrupted, nothing was written")


def whole(text: str) -> int:
    """0 or more."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text}: need a whole number, 0 or more")
    return int(text)


def _record(flights: list[Flight], path: Path, jobs: int) -> int:
    counts: Counter[tuple[str, str, str]] = Counter()
    unflyable, part, told_at = [], path.with_suffix(".part"), time.monotonic()
    try:
        with part.open("wb") as file:
            file.write(MAGIC)
            every = zip(flights, flown(flights, jobs), strict=True)
            for done, (flight, outcome) in enumerate(every, 1):
                if isinstance(outcome, str):
                    unflyable.append(f"{flight[0]} {flight[1]}: {outcome}")
                else:
                    file.write(written(outcome))
                    label = outcome.label
                    counts[label.body, label.failed, label.end] += 1
                if time.monotonic() - told_at >= _TELL_EVERY or done == len(flights):
                    told_at = time.monotonic()
                    print(f"{done} of {len(flights)} flights", file=sys.stderr, flush=True)
        if counts:
            part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    for (body, failed, end), number in sorted(counts.items()):
        print(f"{number:6d}  {body}: {failed}: {end}")
    for line in unflyable:
        print(f"left out: {line}")
    print(f"{counts.total()} tapes, {len(unflyable)} flights left out")
    if counts:
        print(f"{path}: {path.stat().st_size} bytes")
    return 0 if counts else 1


if __name__ == "__main__":
    main()
