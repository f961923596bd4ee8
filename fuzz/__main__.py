"""make fuzz: writes docs/evidence/fuzz.md. Or: python -m fuzz --replay TARGET FILE

Findings are kept in fuzz/found; new inputs in fuzz/grown, from which --merge takes into the stored
corpus what reaches more than it does.
"""

from __future__ import annotations

import argparse
import math
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from fuzz import run
from fuzz.findings import told as told_error
from fuzz.page import PAGE, page, told
from fuzz.target import attempt, live_long
from fuzz.targets import NAMES, target_of

#: For less, a target had better not be begun: s.
_SHORTEST = 5


def main() -> None:
    """Exit code 1: something was found."""
    options = argparse.ArgumentParser("fuzz", description=__doc__)
    options.add_argument("--minutes", help="how long all targets together may take")
    options.add_argument("--jobs", type=int, default=2, help="targets at once (default 2)")
    options.add_argument("--replay", nargs=2, metavar=("TARGET", "FILE"), help="try one input")
    options.add_argument("--merge", action="store_true", help="renew the stored corpus")
    options.add_argument("targets", nargs="*", metavar="TARGET", help="only these, and no page")
    given = options.parse_args()
    names = given.targets or list(NAMES)
    for name in [*names, *(given.replay or [])[:1]]:
        if name not in NAMES:
            sys.exit(f"fuzz: there is no target {name!r}: need one of {', '.join(NAMES)}")
    if given.replay:
        _replay(given.replay[0], Path(given.replay[1]))
        return
    if reason := run.why_not():
        sys.exit(f"fuzz: {reason}")
    if given.merge:
        for name in names:
            files, size = run.merge(name)
            print(f"{name}: {files} files, {size} bytes", flush=True)
        return
    jobs = max(1, given.jobs)
    minutes, seconds = _time(given.minutes or "", len(names), jobs)
    outcomes = _run_all(names, seconds, jobs)
    if not given.targets:
        PAGE.write_text(page(outcomes, minutes))
    found = [line for one in outcomes for line in told(one)]
    for line in found:
        print(f"found: {line}")
    if found:
        sys.exit(1)


def _time(text: str, targets: int, jobs: int) -> tuple[float, int]:
    """The minutes, and the seconds of each target."""
    try:
        minutes = float(text)
    except ValueError:
        minutes = math.nan
    least = math.ceil(targets / jobs * _SHORTEST / 6) / 10
    # NaN as well, and what no machine would end.
    if not least <= minutes <= 100_000:
        sys.exit(
            f"fuzz: MINUTES is {text!r}: need a number from {least:g} ({_SHORTEST} s for each of "
            f"{targets} targets) to 100000, as in make fuzz MINUTES=10"
        )
    return minutes, int(minutes * 60 * jobs / targets)


def _run_all(names: list[str], seconds: int, jobs: int) -> list[run.Outcome]:
    """All of them, in their order; a line as each ends."""
    print(f"{len(names)} targets, {seconds} s each, {jobs} at once", flush=True)
    done: dict[str, run.Outcome] = {}
    with ThreadPoolExecutor(jobs) as pool:
        waiting = [pool.submit(run.fuzz, name, seconds) for name in names]
        try:
            for one in as_completed(waiting):
                outcome = one.result()
                done[outcome.name] = outcome
                print(f"[{len(done)}/{len(names)}] {outcome.line()}", flush=True)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            sys.exit("fuzz: interrupted")
    return [done[name] for name in names]


def _replay(name: str, path: Path) -> None:
    """Try one input; what it raises is shown whole."""
    try:
        data = path.read_bytes()
    except OSError as error:
        sys.exit(f"fuzz: {path}: {error.strerror}")
    target = target_of(name)
    try:
        seconds = attempt(target, data)
        largest = live_long(target, data)
    except BaseException as error:
        print(f"fuzz: {name}: {told_error(error)}", file=sys.stderr, flush=True)
        raise
    held = f"; its variations leave {largest} entries in one store" if largest else ""
    print(f"{name}: read in {seconds * 1e3:.1f} ms{held}: nothing wrong")


if __name__ == "__main__":
    main()
