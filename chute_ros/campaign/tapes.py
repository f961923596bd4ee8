"""The tapes that a campaign flies, found by their name or drawn by their profile."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace
from pathlib import Path

from chute_ros.campaign.scenario import (
    Canopy,
    ClockJump,
    Failure,
    Fault,
    HomeMove,
    Scenario,
    Stalls,
    Stop,
    Taped,
    WayFault,
)
from chute_ros.errors import RecordError
from chute_ros.sim.tape import Label, Tape, read_tapes

#: So many flights have a tape for their body, and of those in so many nothing else goes wrong.
_TAPED, _CALM = 0.5, 0.5


@dataclass(frozen=True)
class TapeFile:
    """As it was asked for. only: no flight but those on tapes."""

    path: Path
    only: bool = False


class Tapes:
    """All of a file. RecordError: it is none."""

    def __init__(self, file: TapeFile) -> None:
        self._only = file.only
        self._named: dict[str, Tape] = {}
        self._of: dict[str, list[Tape]] = {}
        for tape in read_tapes(file.path):
            if tape.label.name in self._named:
                raise RecordError(f"{file.path}: two tapes are named {tape.label.name!r}")
            self._named[tape.label.name] = tape
            self._of.setdefault(tape.label.profile, []).append(tape)

    @property
    def labels(self) -> list[Label]:
        """Of all of them."""
        return [one.label for one in self._named.values()]

    def named(self, name: str) -> Tape:
        """RecordError: there is none."""
        if name not in self._named:
            raise RecordError(f"no tape {name!r}: name the file that has it (--tapes)")
        return self._named[name]

    def drawn(self, scenario: Scenario) -> Scenario:
        """The same flight, or with a tape for its body and its failure."""
        chance = random.Random(f"{scenario.seed} tape")
        fitting = self._of.get(scenario.profile, [])
        if not fitting or not (self._only or chance.random() < _TAPED):
            return scenario
        return on_tape(scenario, chance.choice(fitting), chance)


def on_tape(scenario: Scenario, tape: Tape, chance: random.Random) -> Scenario:
    """It flies the tape. What else goes wrong goes wrong around the tape's failure, or nothing
    does."""
    label = tape.label
    is_lost = not math.isnan(label.lost_at)
    failed_at = label.lost_at if is_lost else label.failed_at
    failed_at = 0.0 if math.isnan(failed_at) else failed_at
    shows_after = round(label.shows_at - label.lost_at, 2) if is_lost else 0.0
    taped = Taped(
        *(label.name, label.body, label.failed, round(tape.lasts, 2)),
        *(is_lost, shows_after, label.ends_hard, label.level),
    )
    begins = tape.unpack()["height"][0]
    drawn = replace(
        scenario,
        height=round(begins, 2),
        gusts=0.0,
        fall_speed=label.fall_speed,
        failure=Failure.TAPE if is_lost else Failure.NOTHING,
        failure_at=failed_at,
        ground=0.0,
        manoeuvre=None,
        descent=None,
        tape=taped,
        # The parachute of a UPF that may release itself has limits of its own for what is flown.
        aps=False,
    )
    if chance.random() < _CALM:
        return replace(drawn, faults=(), person=None, canopy=Canopy())
    around = failed_at + chance.choice((0.0, shows_after))
    by = max(0.0, round(around - scenario.failure_at, 3))
    return replace(drawn, faults=tuple(_later(one, by) for one in scenario.faults))


def _later(fault: Fault, by: float) -> Fault:
    if isinstance(fault, WayFault):
        return replace(fault, spell=fault.spell.later(by))
    if isinstance(fault, (Stop, ClockJump, HomeMove)):
        return replace(fault, at=round(fault.at + by, 3))
    if isinstance(fault, Stalls):
        return replace(fault, begin=fault.begin + by, end=fault.end + by)
    return fault.later(by)
