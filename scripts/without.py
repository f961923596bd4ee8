"""Flies a campaign as it is, and again without a part of the decision: a rule of a profile, a
condition of a rule, a heuristic that is named below. A part that no flight needs can go.

The stored wrong flights are flown as well. A line names the flights that are wrong without a part
and right with it, and the other way round. --together removes all named parts at once, flies each
flight that differs again without each part alone, and so covers far more flights in the same time.
--rules-page flies without each rule only the flights in which it decided, and writes what each
rule contributes.

    make without [FLIGHTS=1000] [SEED=0] [WITHOUT_ARGS="--together 'multirotor: falling' ..."]
    make without [FLIGHTS=1000] [SEED=0] WITHOUT_ARGS="--rules-page docs/evidence/contributions.md"
"""

from __future__ import annotations

import argparse
import difflib
import functools
import json
import math
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple, NoReturn

from chute_ros.campaign.draw import draw
from chute_ros.campaign.flight import Flight
from chute_ros.campaign.judge import WRONG, Count, judge
from chute_ros.campaign.scenario import PROFILES, Scenario
from chute_ros.campaign.scenario_text import scenario_of
from chute_ros.campaign.shipped import Shipped
from chute_ros.errors import ChuteError
from chute_ros.interrupts import at_ctrl_c
from chute_ros.model import FIRES, Action
from chute_ros.supervisor import (
    contradictions,
    counter,
    flight,
    measured,
    readings,
    samples,
    vehicle_reports,
)
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.supervisor.rules import Profile, Rule
from chute_ros.tools.arguments import positive
from chute_ros.tools.entry import INTERRUPTED
from chute_ros.tools.machine import machine
from chute_ros.tools.page_file import MARKDOWN, require_output, write_page
from chute_ros.tools.pages import table

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDER = ROOT / "config" / "profiles"
STORED = ROOT / "test" / "campaign" / "regressions"
#: So often a process is started that ends by itself, as PyPy does now and then.
_STARTS = 3


def _nan(*_: Any) -> float:
    return math.nan


def _no(*_: Any) -> bool:
    return False


def _no_words(*_: Any) -> str:
    return ""


#: Heuristic -> where it is, its name there, and what stands in its place.
HEURISTICS: dict[str, tuple[Any, str, Any]] = {
    "flight: a landed state is believed later of one armed aloft": (
        flight,
        "_LANDED_HOLD_ALOFT",
        0.0,
    ),
    "flight: a landed state is believed later after a kill": (flight, "_DOWN_AFTER_KILL", 0.0),
    "flight: one that says that it stands falls all the same": (
        flight,
        "_falls_against_its_word",
        _no,
    ),
    "flight: a word of later says that what was killed does not fall": (
        flight,
        "_seen_not_to_fall",
        _no,
    ),
    "flight: an estimator in a rush has not taken off": (flight, "_CALM_SPEED", math.inf),
    "flight: an estimator that leans has not taken off": (flight, "_CALM_TILT", math.inf),
    "flight: without a height it is high after a while": (flight, "HIGH_AFTER", 0.0),
    "flight: the heights tell the speed where nothing else does": (readings, "climb_rate", _nan),
    "flight: the kill is waited for less below low_height": (
        flight,
        "low_at",
        lambda *_: math.inf,
    ),
    "flight: a ground below home": (flight, "above_its_ground", _nan),
    "measurements: a jump that was believed is doubted": (measured, "JUMP_DOUBTED", 0.0),
    "measurements: what follows one that was not taken is doubted": (
        measured,
        "REJECTION_DOUBTED",
        0.0,
    ),
    "measurements: an acceleration of exactly 0 is doubted": (
        measured,
        "_FAILED_ACCELERATION",
        math.nan,
    ),
    "measurements: a doubt is of its source alone": (
        measured.Measured,
        "told_by",
        lambda self, source: self,
    ),
    "measurements: one that is lower than commanded sinks uncommanded": (
        samples,
        "_MISSES_TARGET",
        math.inf,
    ),
    "counter: it stands while nothing can be said": (counter, "UNKNOWN_STANDS", 0.0),
    "counter: a sign goes on to its last limit": (counter, "LINGERS", 0.0),
    "contradictions: a sink of which no force tells": (contradictions, "_not_felt", _no_words),
    "contradictions: a force that no speed follows": (contradictions, "_fall_denied", _no_words),
    "contradictions: a tilt that is carried": (contradictions, "_tilt_denied", _no_words),
    "contradictions: a sink that the barometer does not tell": (
        contradictions,
        "_sink_denied",
        lambda motion, *_: contradictions._not_felt(motion),
    ),
    "contradictions: a speed that is noise denies nothing": (
        contradictions,
        "_speed_lives",
        lambda _: True,
    ),
    "contradictions: what is commanded is no accident": (
        vehicle_reports,
        "commanded",
        lambda *_: {},
    ),
    "contradictions: the last command of a silent autopilot counts": (
        vehicle_reports,
        "commanded_last",
        lambda *_: {},
    ),
    "readings: heights tell a sink beside a speed in doubt": (
        readings,
        "_sink_beyond_target",
        _nan,
    ),
}


def shipped_rules() -> Iterator[tuple[str, Rule]]:
    """Each rule, with the name of its profile."""
    for name in PROFILES:
        for rule in read_profile((FOLDER / f"{name}.yaml").read_text(), name, ("any",)).rules:
            yield name, rule


def profile_parts() -> Iterator[str]:
    """Each rule that fires, and each of its conditions where it has more than one."""
    for name, rule in shipped_rules():
        if rule.action is Action.NONE:
            continue
        yield f"{name}: {rule.name}"
        for number, one in enumerate(rule.conditions):
            if len(rule.conditions) > 1 and isinstance(one, MeasurementCondition):
                yield f"{name}: {rule.name}: {number + 1}, {one.measurement}"


def changed(profile: Profile, what: str) -> Profile:
    """Without the rule, or the condition, that is named so; as it is if it has none."""
    of, _, rest = what.partition(": ")
    rule_name, _, condition = rest.partition(": ")
    if of != profile.name:
        return profile
    rules = []
    for rule in profile.rules:
        if rule.name != rule_name:
            rules.append(rule)
        elif condition:
            gone = int(condition.partition(",")[0]) - 1
            left = tuple(one for n, one in enumerate(rule.conditions) if n != gone)
            # Where all of them are needed, all that are left are.
            every = sum(one.weight for one in rule.conditions)
            weight = rule.conditions[gone].weight
            needed = rule.needed - weight if rule.needed >= every - 1e-9 else rule.needed
            rules.append(replace(rule, conditions=left, needed=needed))
    return replace(profile, rules=tuple(rules))


def scenario_named(name: str) -> Scenario:
    """A seed, or a stored flight."""
    if name.isdigit():
        return draw(int(name))
    return scenario_of((STORED / f"{name}.json").read_text(encoding="utf-8"), name)[0]


def concerns(names: Sequence[str], profile: str) -> bool:
    """A part of one profile changes nothing of a flight with another."""
    of = [name.partition(": ")[0] for name in names]
    return not names or any(one not in PROFILES or one == profile for one in of)


class Without(Shipped):
    """The profiles without parts of them."""

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__(FOLDER)
        # Of several conditions of a rule the last one first: their numbers stay.
        self._names = sorted(names, reverse=True)

    def config(self, vehicle: str, profile: str, standby: bool, rank: int) -> SupervisorConfig:
        """The settings of a supervisor."""
        config = super().config(vehicle, profile, standby, rank)
        return replace(config, profile=functools.reduce(changed, self._names, config.profile))


class Outcome(NamedTuple):
    """What became of a flight. count: the name of a Count; decided: "profile: rule" of each rule
    that decided something."""

    count: str
    decided: Sequence[str]


def fly(names: Sequence[str], flights: Sequence[str]) -> dict[str, Outcome]:
    """Flight -> its outcome, for all that the parts of these names concern."""
    for name in names:
        if name in HEURISTICS:
            where, attribute, instead = HEURISTICS[name]
            setattr(where, attribute, instead)
    shipped, flown = Without(names), {}
    for flight_name in flights:
        scenario = scenario_named(flight_name)
        if concerns(names, scenario.profile):
            lived = Flight(scenario, shipped).run()
            decided = {f"{scenario.profile}: {one.rule}" for _, one in lived.decided}
            flown[flight_name] = Outcome(judge(lived).count.name, sorted(decided))
    return flown


def wrong_of(flown: Mapping[str, Outcome]) -> dict[str, str]:
    """Flight -> how it is counted, for all that are wrong."""
    return {name: one.count for name, one in flown.items() if Count[one.count] in WRONG}


class Pool:
    """Flies in as many processes as there are jobs. python: the command of their interpreter."""

    def __init__(self, python: Sequence[str], jobs: int) -> None:
        self._python, self.jobs = python, jobs
        self._threads = ThreadPoolExecutor(jobs)
        self._running: set[subprocess.Popen[str]] = set()

    def each(
        self, works: Sequence[tuple[Sequence[str], Sequence[str]]]
    ) -> Iterator[dict[str, Outcome]]:
        """The outcomes of each (names, flights), in their order."""
        return self._threads.map(lambda one: self._in_own_process(*one), works)

    def shared(self, names: Sequence[str], flights: Sequence[str]) -> dict[str, Outcome]:
        """The same of one, by all processes."""
        parts = [(names, flights[n :: self.jobs]) for n in range(self.jobs)]
        return {name: one for flown in self.each(parts) for name, one in flown.items()}

    def end(self, *_: object) -> NoReturn:
        """At a Ctrl-C: nobody waits for what they fly now."""
        for process in tuple(self._running):
            process.kill()
        print("without: interrupted", file=sys.stderr, flush=True)
        os._exit(INTERRUPTED)

    def _in_own_process(self, names: Sequence[str], flights: Sequence[str]) -> dict[str, Outcome]:
        """What was taken away comes back with it. A process that dies is started again."""
        work = json.dumps({"names": names, "flights": flights})
        command = [*self._python, __file__, "--work"]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        for _ in range(_STARTS):
            process = subprocess.Popen(command, text=True, **pipes)
            self._running.add(process)
            out, err = process.communicate(work)
            self._running.remove(process)
            if not process.returncode:
                return {name: Outcome(*one) for name, one in json.loads(out).items()}
        why = "".join(err.strip().splitlines()[-1:]) or f"exit code {process.returncode}"
        sys.exit(f"without: one of its processes ended {_STARTS} times: {why}")


def differing(
    names: Sequence[str], base: dict[str, str], wrong: dict[str, str]
) -> tuple[list[str], list[str]]:
    """The flights that are wrong without these and were right with them, and the others."""
    worse = [name for name in wrong if name not in base]
    right = [name for name in base if name not in wrong]
    return worse, [name for name in right if concerns(names, scenario_named(name).profile)]


def says(what: str) -> None:
    """What takes its time now."""
    print(f"without: {what} ...", file=sys.stderr, flush=True)


def some(flights: Sequence[str], counts: dict[str, str]) -> str:
    """How many, and the first of them."""
    first = ", ".join(f"{name} {counts[name]}" for name in flights[:4])
    return f"{len(flights)} ({first})" if flights else "0"


def each_alone(pool: Pool, names: Sequence[str], flights: Sequence[str]) -> None:
    """A table with a line for each."""
    says(f"flies {len(flights)} flights as they are")
    base = wrong_of(pool.shared((), flights))
    says(f"and as often without each of {len(names)}")
    print("| without | wrong, right with it | right, wrong with it |\n|---|---|---|", flush=True)
    flown = pool.each([((name,), flights) for name in names])
    for name, one in zip(names, flown, strict=True):
        wrong = wrong_of(one)
        worse, better = differing((name,), base, wrong)
        print(f"| {name} | {some(worse, wrong)} | {some(better, base)} |", flush=True)


def together(pool: Pool, names: Sequence[str], flights: Sequence[str]) -> None:
    """A table with a line for each that a flight needs by itself."""
    says(f"flies {len(flights)} flights as they are")
    base = wrong_of(pool.shared((), flights))
    print(f"{len(base)} of {len(flights)} are wrong with all", flush=True)
    says(f"and without all of {len(names)}")
    wrong = wrong_of(pool.shared(names, flights))
    worse, better = differing(names, base, wrong)
    print(f"without: wrong {some(worse, wrong)}; right {some(better, base)}", flush=True)
    differ = (*worse, *better)
    says(f"{len(differ)} that differ, without each of {len(names)}")
    alone = [wrong_of(one) for one in pool.each([((name,), differ) for name in names])]
    print("| without | wrong, right with it | right, wrong with it |\n|---|---|---|")
    unclear = set(differ)
    base = {name: count for name, count in base.items() if name in differ}
    for name, found in zip(names, alone, strict=True):
        worse, better = differing((name,), base, found)
        unclear -= {*worse, *better}
        print(f"| {name} | {some(worse, found)} | {some(better, base)} |")
    print(f"by none of them alone: {', '.join(sorted(unclear)) or 'none'}")


def deciding_rules() -> list[str]:
    """ "profile: rule" of each rule that stops motors or releases, in the profile's order."""
    return [f"{name}: {rule.name}" for name, rule in shipped_rules() if rule.action in FIRES]


def contributions(pool: Pool, flights: Sequence[str]) -> list[tuple[str, ...]]:
    """A row for each rule: without it, only the flights in which it decided can end otherwise."""
    says(f"flies {len(flights)} flights as they are")
    base = pool.shared((), flights)
    used = {
        rule: [name for name in flights if rule in base[name].decided] for rule in deciding_rules()
    }
    some_used = [rule for rule, names in used.items() if names]
    again = sum(map(len, used.values()))
    says(
        f"and {again} again, without a rule that decided in them ({len(some_used)} of {len(used)})"
    )
    flown = pool.each([((rule,), used[rule]) for rule in some_used])
    without = dict(zip(some_used, flown, strict=True))
    rows, wrong_before = [], wrong_of(base)
    for rule, names in used.items():
        wrong = wrong_of(without.get(rule, {}))
        worse, spoilt = differing(
            (rule,), {n: wrong_before[n] for n in names if n in wrong_before}, wrong
        )
        counts = Counter(wrong[name] for name in worse)
        saved = (counts.pop(one.name, 0) for one in (Count.MISSED, Count.LATE))
        numbers = (len(names), *saved, counts.total(), len(spoilt))
        profile, _, name = rule.partition(": ")
        rows.append((profile, name, *map(str, numbers), ", ".join(spoilt[:4])))
    return rows


INTRODUCTION = """\
Each rule of a profile that stops motors or releases: in how many flights of the [fault
campaign](campaign.md) it decided something, and how those flights are counted when they are flown
again without the rule. A flight in which a rule decided nothing is the same without it.

- **Only it saves**: the flight is correct with the rule, and missed or late without it.
- **Wrong otherwise**: the flight is correct with the rule, and false, doubled or out of order
  without it, as where a later rule decides something else.
- **Only it spoils**: the flight is wrong with the rule, and correct without it; its first seeds.

Where a rule decided, and neither saves nor spoils, another rule decides in time without it, or a
person had decided. A rule with few flights is no proof that it is not needed: some of what the
rules are for (`source` in the profile) is drawn seldom or not at all, as what field reports
tell."""

_HEAD = (
    *("profile", "rule", "decided in", "only it saves: missed", "late", "wrong otherwise"),
    *("only it spoils", "seeds"),
)


def write_contributions(pool: Pool, flights: Sequence[str], seed: int, path: pathlib.Path) -> None:
    """The page of what each rule contributes."""
    begun = time.monotonic()
    rows = contributions(pool, flights)
    command_of_it = f"make without FLIGHTS={len(flights)} SEED={seed}"
    told = f"{time.monotonic() - begun:.0f} s, {pool.jobs} at a time on {machine()}"
    parts = [
        "# What each rule contributes",
        f'Written by `{command_of_it} WITHOUT_ARGS="--rules-page {path}"`: {told}.',
        INTRODUCTION,
        table(_HEAD, rows),
    ]
    write_page(path, "\n\n".join(parts) + "\n", MARKDOWN)
    print(f"without: {path} is written")


def command(text: str) -> list[str]:
    """Of an interpreter; argparse tells a user why it is none."""
    words = shlex.split(text)
    if not words or not shutil.which(words[0]):
        raise argparse.ArgumentTypeError(f"{text!r} is no command here: name a Python or PyPy")
    return words


def part(text: str) -> str:
    """A name of a part; argparse tells a user why it is none."""
    every = [*HEURISTICS, *profile_parts()]
    if text not in every:
        near = (
            ", ".join(map(repr, difflib.get_close_matches(text, every))) or "one that --list has"
        )
        raise argparse.ArgumentTypeError(f"there is no {text!r}: need {near}")
    return text


def main() -> None:
    """Run."""
    parser = argparse.ArgumentParser("without", description=__doc__)
    parser.add_argument("what", nargs="*", type=part, help="only these (default: each)")
    parser.add_argument("--list", action="store_true", help="name all, and end")
    parser.add_argument("--together", action="store_true", help="all of them at once")
    parser.add_argument(
        "--rules-page", type=pathlib.Path, metavar="FILE", help="write what each rule contributes"
    )
    parser.add_argument(
        "--flights", type=positive, default=1000, help="number of flights (default: 1000)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the first flight (default: 0)")
    parser.add_argument("--jobs", type=positive, default=os.cpu_count() or 1, help="processes")
    parser.add_argument(
        "--python", type=command, default=[sys.executable], help="interpreter of the processes"
    )
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        print(json.dumps(fly(**json.load(sys.stdin))))
        return
    chosen = options.what or [*HEURISTICS, *profile_parts()]
    if options.list:
        print("\n".join(chosen))
        return
    flights = [str(seed) for seed in range(options.seed, options.seed + options.flights)]
    pool = Pool(options.python, options.jobs)
    if options.rules_page:
        try:
            require_output(options.rules_page, MARKDOWN)
        except ChuteError as error:
            parser.error(str(error))
        with at_ctrl_c(pool.end):
            write_contributions(pool, flights, options.seed, options.rules_page)
        return
    flights += sorted(path.stem for path in STORED.glob("*.json"))
    with at_ctrl_c(pool.end):
        (together if options.together else each_alone)(pool, chosen, flights)


if __name__ == "__main__":
    main()
