"""make soak: faults on real processes, in a loop; writes docs/evidence/soak.md. As root:

python3 -m faults.soak [--loops N] [--seed S] [--supervisors 1|2] [--kind PART ...] [--only LOOP]

Exit code 1: a loop found a problem. `--only LOOP` with the same seed repeats one loop.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import tempfile
import time
from pathlib import Path

from bench.command import at_least
from bench.report import load
from chute_ros.tools.isolation import isolated_ros
from chute_ros.tools.machine import machine
from faults import soak_picture, soak_report
from faults.ending import take_down_when_ended
from faults.network import Network, why_not
from faults.soak_judge import ANSWER_WITHIN, WHOLE_WITHIN
from faults.soak_measure import LIMITS
from faults.soak_plan import KINDS, Plan, draw
from faults.soak_run import Loops, Result
from faults.soak_vehicle import SoakError, Vehicle
from faults.soak_wires import HOSTS, VEHICLE, Ports

PAGE = Path(__file__).resolve().parent.parent / "docs" / "evidence" / "soak.md"
_FIRST_PORT = 21000


def main() -> None:
    """Run the loops; exit code 1 if something was found."""
    chosen = _options().parse_args()
    if reason := why_not():
        sys.exit(f"soak: {reason}")
    take_down_when_ended("soak")
    shares = _share(chosen)
    before, started = load(), time.monotonic()
    results: list[Result] = []
    more: list[str] = []
    with _apart():
        for supervisors, plans in shares:
            more += _soak(supervisors, plans, results)
    more += soak_report.not_flat(results)
    took = f"{len(results)} loops in {(time.monotonic() - started) / 60.0:.0f} minutes."
    said = soak_report.findings(results, more)
    print(soak_report.by_kind(results), soak_report.by_cause(results), sep="\n\n")
    print(f"\n{soak_report.holds(results)}\n\n{took} Findings:\n{said}")
    if chosen.page:
        drawn = chosen.page.with_suffix(".svg")
        drawn.write_text(soak_picture.picture(results))
        soak_report.write(
            chosen.page,
            loops=str(chosen.loops),
            seed=str(chosen.seed),
            machine=machine(),
            load=before,
            answer=f"{ANSWER_WITHIN:g}",
            whole=f"{WHOLE_WITHIN:g}",
            took=took,
            faults=soak_report.by_kind(results),
            causes=soak_report.by_cause(results),
            limits=", ".join(
                f"{name} {one.total:g} in all and {one.per_hundred:g} in 100 loops"
                for name, one in LIMITS.items()
            ),
            holds=soak_report.holds(results),
            picture=drawn.name,
            findings=said,
        )
    if said != "None.":
        sys.exit(f"soak: found a problem; repeat a loop with --seed {chosen.seed} --only LOOP")


def _apart() -> contextlib.AbstractContextManager[object]:
    """A ROS domain of its own: what processes share in memory no network namespace keeps apart."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    if "ROS_DOMAIN_ID" in os.environ:
        return contextlib.nullcontext()
    return isolated_ros()


def _options() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser("soak", description=__doc__)
    options.add_argument(
        "--loops", type=at_least(int, 1), default=20, help="number of loops (default: 20)"
    )
    options.add_argument(
        "--seed", type=int, default=0, help="seed of all random choices (default: 0)"
    )
    options.add_argument(
        "--supervisors", type=int, choices=(1, 2), help="default: first one, then two"
    )
    options.add_argument(
        "--kind",
        action="append",
        default=[],
        metavar="PART",
        help=f"only faults whose name contains it: {', '.join(KINDS)}".replace("%", "%%"),
    )
    options.add_argument("--only", type=int, metavar="LOOP", help="repeat this loop alone")
    options.add_argument("--page", type=Path, help=f"write the results there ({PAGE.name})")
    return options


def _share(chosen: argparse.Namespace) -> list[tuple[int, list[Plan]]]:
    """How many supervisors, and their loops: half of the loops with one, half with two."""
    half = chosen.loops // 2
    numbers = {1: range(half), 2: range(half, chosen.loops)}
    if chosen.supervisors:
        numbers = {chosen.supervisors: range(chosen.loops)}
    # In the second half of each supervisors live on.
    spared = {count: (some.start + some.stop) // 2 for count, some in numbers.items()}
    if chosen.only is not None:
        numbers = {
            count: range(chosen.only, chosen.only + 1)
            for count, some in numbers.items()
            if chosen.supervisors or chosen.only in some
        }
    kinds = tuple(chosen.kind)
    if kinds and not any(part in kind for part in kinds for kind in KINDS):
        sys.exit(f"soak: --kind {', '.join(kinds)}: need a part of one of {', '.join(KINDS)}")
    return [
        (count, [draw(chosen.seed, one, count, kinds, one >= spared[count]) for one in some])
        for count, some in numbers.items()
        if some
    ]


def _soak(supervisors: int, plans: list[Plan], results: list[Result]) -> list[str]:
    """Run plans on a vehicle; one that something was found on, or that does not get into the air
    any more, is replaced by another. What was found besides the loops."""
    more: list[str] = []
    waiting = list(plans)
    while waiting:
        with Network(HOSTS) as network, tempfile.TemporaryDirectory(prefix="soak_") as folder:
            network.enter(VEHICLE)
            vehicle = Vehicle(network, Path(folder), Ports.from_first(_FIRST_PORT), supervisors)
            try:
                loops = Loops(vehicle)
                while waiting:
                    plan = waiting.pop(0)
                    began = time.monotonic()
                    result = loops.run(plan)
                    results.append(result)
                    _tell(result, time.monotonic() - began)
                    if result.findings:
                        break  # what it did must not be found again in the loops that follow
                vehicle.end()
            except SoakError as error:
                more.append(f"before loop {plan.number}, {supervisors} supervisors: {error}")
                print(f"soak: {more[-1]}", flush=True)
            finally:
                vehicle.close()
                more += vehicle.keeper.findings
    return more


def _tell(result: Result, took: float) -> None:
    plan = result.plan
    whole = (
        f"whole after {result.until_whole:.1f} s"
        if not plan.cause
        else (f"kill {result.until_kill:+.2f} s, out {result.until_out:+.2f} s")
    )
    verdict = "; ".join(result.findings) or "correct"
    print(f"{plan.number:4d}  {plan.text()}: {whole} ({took:.1f} s): {verdict}", flush=True)


if __name__ == "__main__":
    main()
