"""What a body does, row by row, and what that comes to: the tape and its label."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from chute_ros.campaign.truth import SOFT
from chute_ros.protocol.rotation import tilt_of
from chute_ros.sim.flight import GRAVITY
from chute_ros.sim.tape import GRAINS, STEP, Label, Tape, pack

#: It comes down hard if it lies more than this as it touches the ground; a fall shows by as much.
MOST_TILT = math.radians(60.0)
#: A flight in which nothing fails is lost when it is never again within this of its command, rad.
_OBEYS = math.radians(30.0)
#: A sink was commanded if it is within this of what was; what lies over sinks by more, m/s.
_BEYOND = 3.0
#: What is like a level flight in attitude (rad) and force (m/s^2), for so long after it shows, s.
_LEVEL_TILT, _LEVEL_FORCE, _LOOKED_AT = 0.9, 4.0, 3.0
#: The strongest force that is recorded, m/s^2: sensors end there as well.
_STRONGEST = 320.0


class UnflyableError(Exception):
    """The physics gave no number, or more than any vehicle does."""


@dataclass(frozen=True)
class Row:
    """As the columns of a tape; a command that is None has no column."""

    height: float
    vertical_speed: float
    roll: float
    pitch: float
    yaw: float
    force: float
    ground_speed: float
    commanded_roll: float
    commanded_pitch: float
    commanded_yaw: float
    commanded_height: float
    commanded_vertical_speed: float
    commanded_thrust: float

    @property
    def tilt(self) -> float:
        """From upright, rad."""
        return tilt_of(self.roll, self.pitch)

    @property
    def disobeys(self) -> float:
        """Between its vertical axis and the commanded one, rad."""
        own = _upward(self.roll, self.pitch, self.yaw)
        told = _upward(self.commanded_roll, self.commanded_pitch, self.commanded_yaw)
        return math.acos(max(-1.0, min(1.0, sum(map(float.__mul__, own, told)))))

    @property
    def alarms(self) -> bool:
        """It sinks faster than a soft landing, or lies over."""
        return self.vertical_speed < -SOFT or self.tilt > MOST_TILT

    @property
    def strays(self) -> bool:
        """The same, and nobody commanded it."""
        lies_over = self.tilt > MOST_TILT and self.disobeys > _OBEYS
        return self._sinks or lies_over

    @property
    def shows(self) -> bool:
        """It sinks so, or strays and sinks: attitude alone is one sign, and ends no flight."""
        return self._sinks or (self.strays and self.vertical_speed < -_BEYOND)

    @property
    def _sinks(self) -> bool:
        return self.vertical_speed < min(-SOFT, self.commanded_vertical_speed - _BEYOND)


class Recorder:
    """Of one flight, a row each STEP."""

    def __init__(self) -> None:
        self._rows: list[Row] = []

    @property
    def passed(self) -> float:
        """s."""
        return len(self._rows) * STEP

    @property
    def is_down(self) -> bool:
        """It has touched the ground, or is below it."""
        return bool(self._rows) and self._rows[-1].height <= 0.0

    def add(self, row: Row) -> None:
        """The next one. UnflyableError: no vehicle does so."""
        values = vars(row)
        if not all(map(math.isfinite, values.values())):
            raise UnflyableError("not a number")
        for name, most in (("vertical_speed", 150.0), ("ground_speed", 300.0), ("height", 2000.0)):
            if abs(values[name]) > most:
                raise UnflyableError(f"{name} {values[name]:.0f}")
        self._rows.append(replace(row, force=min(row.force, _STRONGEST)))

    def tape(
        self, name: str, body: str, profile: str, failed: str, failed_at: float, **more: Any
    ) -> Tape:
        """All of it. failed_at: s; NaN: nothing fails. more: as in a label."""
        label = Label(name, body, profile, failed, failed_at, **more)
        columns = {one: [getattr(row, one) for row in self._rows] for one in GRAINS}
        try:
            packed = pack(columns)
        except ValueError as error:
            raise UnflyableError(str(error)) from None
        return Tape(self._judged(label), len(self._rows), tuple(columns), packed)

    def _judged(self, label: Label) -> Label:
        rows, last = self._rows, self._rows[-1]
        parameters = {
            **label.parameters,
            "ends": (
                f"touches down with {-last.vertical_speed:.1f} m/s, "
                f"{math.degrees(last.tilt):.0f} degrees over"
                if self.is_down
                else f"in the air, at {last.height:.0f} m"
            ),
        }
        label = replace(label, parameters=parameters, ends_hard=self.is_down and last.alarms)
        if not math.isnan(label.failed_at):
            first = math.ceil(round(label.failed_at / STEP, 3))
        elif label.ends_hard:
            first = self._lost()
        else:
            return label
        after = range(first, len(rows))
        if not label.ends_hard and not any(rows[at].strays for at in after):
            return label
        shows = next((at for at in after if rows[at].shows), len(rows) - 1)
        seen = rows[shows : shows + round(_LOOKED_AT / STEP)]
        level = all(
            row.tilt <= _LEVEL_TILT and abs(row.force - GRAVITY) <= _LEVEL_FORCE for row in seen
        )
        return replace(
            label, lost_at=round(first * STEP, 2), shows_at=round(shows * STEP, 2), level=level
        )

    def _lost(self) -> int:
        """From which row on it never obeyed again."""
        obeyed = [at for at, row in enumerate(self._rows) if row.disobeys < _OBEYS]
        return min(obeyed[-1] + 1, len(self._rows) - 1) if obeyed else 0


def _upward(roll: float, pitch: float, yaw: float) -> tuple[float, float, float]:
    forward, right = math.cos(roll) * math.sin(pitch), math.sin(roll)
    return (
        forward * math.cos(yaw) + right * math.sin(yaw),
        forward * math.sin(yaw) - right * math.cos(yaw),
        math.cos(roll) * math.cos(pitch),
    )
