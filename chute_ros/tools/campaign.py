"""Executable campaign: many flights in virtual time with faults at every layer, counted.

A flight that must not be is saved by its seed: --replay SEED tells it step by step.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from pathlib import Path

from chute_ros.campaign import campaign
from chute_ros.campaign.judge import WRONG, Count
from chute_ros.campaign.page import page, picture
from chute_ros.campaign.scenario import draw
from chute_ros.nodes.config_folder import config_folder

_TELL_EVERY = 5.0  # s


def main() -> None:
    """Fly; exit code 1 if a flight was what must not be."""
    options = argparse.ArgumentParser("campaign", description=__doc__)
    options.add_argument("--flights", type=positive, default=1000, help="how many (default: 1000)")
    options.add_argument("--seed", type=int, default=0, help="of the first flight (default: 0)")
    options.add_argument("--jobs", type=positive, default=os.cpu_count() or 1, help="processes")
    options.add_argument("--page", type=writable, help="write the results there, beside a picture")
    options.add_argument("--replay", type=int, metavar="SEED", help="tell one flight")
    # `ros2 run` adds arguments for nodes, which this is none of.
    chosen, _ = options.parse_known_args()
    profiles = config_folder() / "profiles"
    if chosen.replay is not None:
        _replay(profiles, chosen.replay)
        return
    told = {"at": time.monotonic()}

    def progress(tally: campaign.Tally) -> None:
        if time.monotonic() - told["at"] >= _TELL_EVERY:
            told["at"] = time.monotonic()
            wrong = sum(tally.counts[one] for one in WRONG)
            rate = tally.flights / tally.took * 60.0
            print(
                f"{tally.flights} of {chosen.flights} flights, {rate:.0f} a minute, "
                f"{wrong} that must not be",
                file=sys.stderr,
                flush=True,
            )

    tally = campaign.run(profiles, chosen.flights, chosen.seed, chosen.jobs, progress)
    for count in Count:
        print(f"{tally.counts[count]:8d}  {count.value}")
    for line in tally.wrong[:20]:
        print(f"  seed {line.seed}, {line.profile}, {line.failure}: {line.count.name}: {line.why}")
    print(f"{tally.flights} flights in {tally.took:.0f} s")
    if chosen.page:
        drawn = chosen.page.with_suffix(".svg")
        drawn.write_text(picture(tally))
        chosen.page.write_text(page(tally, chosen.seed, drawn.name))
    if tally.wrong:
        sys.exit(1)


def positive(text: str) -> int:
    """1 or more."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text}: need 1 or more")
    return number


def writable(text: str) -> Path:
    """Said before the flights, not after them."""
    path = Path(text)
    if not os.access(path.parent, os.W_OK) or path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: no file can be written there")
    return path


def _replay(profiles: Path, seed: int) -> None:
    """What was drawn, what happened, what it is counted as."""
    scenario = draw(seed)
    print(
        f"seed {seed}: {scenario.profile}, {scenario.height:g} m, gusts {scenario.gusts:g} m/s^2"
    )
    print(f"  {scenario.failure.value} at {scenario.failure_at:g} s")
    for fault in scenario.faults:
        print(f"  {fault}")
    flight, flown, judged = campaign.fly_here(profiles, seed)
    up = flight.up_at
    lines = [(at, f"said: {text}") for at, text in flight.supervisor.said]
    lines += [
        (at, f"decided {one.action.name} by {one.rule!r}: {'; '.join(one.reasons)}")
        for at, one in flown.decided
    ]
    lines += [(at, f"acted on {one.action.name}") for at, one in flown.acted]
    for at, what in (
        (flown.took_off, "takes off"),
        (up, "is up"),
        (flown.truth.at, "ONLY A PARACHUTE HELPS"),
        (flown.truth.latest, "the last moment for its release"),
        (flown.released, "RELEASED"),
        (flown.landed, f"lands at {flown.landing_speed:.1f} m/s"),
    ):
        if not math.isnan(at):
            lines.append((at, what))
    for at, text in sorted(lines):
        print(f"  {at - up:8.3f} s  {text}")
    print(f"  {judged.count.value}{': ' if judged.why else ''}{judged.why}")


if __name__ == "__main__":
    main()
