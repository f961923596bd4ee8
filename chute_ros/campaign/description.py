"""Reads the description of a user's vehicle from YAML, and says for each mistake its line and the
fix."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chute_ros.campaign.described import DescribedVehicle, Range
from chute_ros.campaign.draw_world import ENDS, PARTIAL_THRUST
from chute_ros.campaign.scenario import PROFILES, flown_vehicles, is_rocket
from chute_ros.errors import ProfileError
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY, VEHICLE_STATE
from chute_ros.sim.autopilot_kinds import ARDUCOPTER, ARDUPLANE, GENERIC, PX4
from chute_ros.supervisor.yaml_lines import ProfileLines, Where, compose
from chute_ros.transport.regular_file import read_regular_text

KINDS = PROFILES[:2]
#: Autopilots of each kind of vehicle, the default first.
AUTOPILOTS = {
    "multirotor": (PX4.name, ARDUCOPTER.name, GENERIC.name),
    "fixed_wing": (PX4.name, ARDUPLANE.name, GENERIC.name),
}
#: Descents whose sink a description may give, of each kind of vehicle.
SINKS = {"multirotor": (PARTIAL_THRUST,), "fixed_wing": tuple(ENDS)}
SOURCES = (VEHICLE_STATE, IMU, ODOMETRY)
#: A canopy that opens settles to its speed from above, and reaches only what is a little faster.
_SOFTER = 1.05
#: A soft landing, where the file gives none, is faster than the canopy sinks by this.
_SOFT = 1.25


@dataclass(frozen=True)
class DescribedNumber:
    """A number of the description. default: in words; empty: needed. spread: it may be [least,
    most]."""

    meaning: str
    unit: str
    least: float
    most: float
    default: str = ""
    spread: bool = False

    @property
    def allowed(self) -> str:
        """In words."""
        spread = ", or [least, most]" if self.spread else ""
        return f"{self.least:g} to {self.most:g} {self.unit}{spread}"


NUMBERS = {
    "mass": DescribedNumber("mass at the take-off", "kg", 0.1, 1000.0),
    "drag_area": DescribedNumber(
        "drag coefficient times area of the vehicle as it falls; with the mass it gives the speed "
        "of the fall",
        *("m^2", 0.001, 50.0),
        spread=True,
    ),
    "descent_rate": DescribedNumber("sink under the open canopy with this mass", "m/s", 1.0, 12.0),
    "opening_time": DescribedNumber(
        "from the release to the open canopy", "s", 0.05, 10.0, "", spread=True
    ),
    "soft_landing": DescribedNumber(
        f"the fastest touchdown that counts as soft; at least {_SOFTER:g} of `descent_rate`",
        *("m/s", 1.0, 15.0),
        f"{_SOFT:g} of `descent_rate`",
    ),
    "heights": DescribedNumber(
        "heights above the ground that it flies at", "m", 5.0, 300.0, "", True
    ),
    "descent_speed": DescribedNumber(
        "the fastest descent that is commanded; each failure is flown in it as well as in level "
        "flight",
        *("m/s", 0.5, 10.0),
        "level flight alone",
    ),
    "wind": DescribedNumber("the strongest wind that it flies in", "m/s", 0.0, 20.0, "8"),
}


@dataclass(frozen=True)
class Choice:
    """A field of the description that is no number. allowed: in words; default: empty: needed."""

    meaning: str
    allowed: str
    default: str = ""


CHOICES = {
    "vehicle": Choice("its name, for the page", "words"),
    "kind": Choice("what falls, and how", " or ".join(KINDS)),
    "parachute": Choice(
        "how its parachute is spoken to: name of a vehicle of `config/`, as in "
        "`config/NAME_vehicle.yaml`",
        "mavlink, upf, both, relay, or a vehicle of another link that the campaign flies",
        "mavlink",
    ),
    "self_release": Choice(
        "the controller of a UPF parachute may release it by itself", "true or false", "false"
    ),
    "autopilot": Choice(
        "whose autopilot it is: how it answers a kill, and what its home does",
        "; ".join(f"{kind}: {', '.join(names)}" for kind, names in AUTOPILOTS.items()),
        PX4.name,
    ),
    "vehicle_sources": Choice(
        "where the supervisor learns of the vehicle, as its node's parameter; all but "
        f"{VEHICLE_STATE} outlive the autopilot",
        f"one or more of {', '.join(SOURCES)}",
        VEHICLE_STATE,
    ),
    "profile": Choice(
        "the rules of the supervisor",
        "name of a shipped profile, or path of a file from the folder of the description",
        "the kind",
    ),
    "sinks": Choice(
        "sinks in the end, m/s, a number or [least, most] for each name",
        "; ".join(f"{kind}: {', '.join(names)}" for kind, names in SINKS.items()),
        "as the campaign draws",
    ),
}
FIELDS: dict[str, Choice | DescribedNumber] = {**CHOICES, **NUMBERS}


def parachutes() -> tuple[str, ...]:
    """What a described vehicle may carry, by the names of VehicleKinds."""
    return tuple(one.name for one in flown_vehicles() if not is_rocket(one.name))


def read_description(path: Path, profiles: Path) -> DescribedVehicle:
    """The vehicle in this file. profiles: folder of the shipped ones. ProfileError lists every
    mistake with its line and the fix."""
    try:
        text = read_regular_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise ProfileError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    reader = _Description(path, profiles)
    vehicle = reader.read(compose(text, str(path)))
    if vehicle is None or reader.mistakes:
        raise ProfileError("\n".join(reader.mistakes))
    return vehicle


class _Description(ProfileLines):
    def __init__(self, path: Path, profiles: Path) -> None:
        super().__init__(str(path), ())
        self._folder, self._profiles = path.parent, profiles

    def read(self, where: Where) -> DescribedVehicle | None:
        """What is written; mistakes are collected, and None is returned after one."""
        entries = self.mapping(where, FIELDS, "a description of a vehicle")
        for key, field in FIELDS.items():
            if not field.default and key not in entries:
                self.wrong(where.line, f"{key} is missing: {_needs(key)}")
        kind = self._kind(entries)
        readers: dict[str, Callable[[Where], Any]] = {
            "vehicle": lambda w: self.text(w, "vehicle"),
            "parachute": lambda w: self.choice(w, "parachute", parachutes()),
            "autopilot": lambda w: self.choice(w, "autopilot", AUTOPILOTS[kind]),
            "self_release": lambda w: self.truth(w, "self_release"),
            "vehicle_sources": self._sources,
            "profile": self._profile,
            "sinks": lambda w: self._sinks(w, SINKS[kind]),
        }
        values = {key: read(entries[key]) for key, read in readers.items() if key in entries}
        for key, number in NUMBERS.items():
            if key in entries:
                values[key] = self._number(entries[key], key, number)
        if self.mistakes:
            return None
        values["name"] = values.pop("vehicle")
        values.setdefault("soft_landing", _SOFT * values["descent_rate"])
        values.setdefault("profile", kind)
        vehicle = DescribedVehicle(kind=kind, **values)
        self._check(entries, vehicle)
        return vehicle

    def _kind(self, entries: dict[str, Where]) -> str:
        return self.choice(entries["kind"], "kind", KINDS) if "kind" in entries else KINDS[0]

    def _number(self, where: Where, key: str, field: DescribedNumber) -> float | Range:
        what = f"{key} ({field.unit})"
        if not field.spread:
            return self.number(where, what, field.least, field.most)
        return self._range(where, what, field.least, field.most)

    def _range(self, where: Where, what: str, least: float, most: float) -> Range:
        ends = [self.number(one, what, least, most) for one in self.many(where, what)]
        if len(ends) > 2 or ends != sorted(ends):
            text = ", ".join(f"{one:g}" for one in ends)
            self.wrong(where.line, f"{what} is [{text}]: need one number, or [least, most]")
        return Range(ends[0], ends[-1]) if ends else Range(math.nan, math.nan)

    def _sources(self, where: Where) -> tuple[str, ...]:
        sources = [self.choice(one, "vehicle_sources", SOURCES) for one in self.many(where, "it")]
        if VEHICLE_STATE not in sources or len({*sources}) < len(sources):
            text = f"vehicle_sources is {', '.join(sources)}: need {VEHICLE_STATE}, and each once"
            self.wrong(where.line, text)
        return tuple(sources)

    def _profile(self, where: Where) -> str | Path:
        named = self.text(where, "profile")
        shipped = sorted(file.stem for file in self._profiles.glob("*.yaml"))
        if "/" not in named and not named.endswith((".yaml", ".yml")):
            return self.choice(where, "profile", shipped)
        file = self._folder / named
        if not file.is_file():
            text = f"profile is {named!r}: no file {file}: need one of {', '.join(shipped)}"
            self.wrong(where.line, f"{text}, or the path of a file from this folder")
        return file

    def _sinks(self, where: Where, names: tuple[str, ...]) -> tuple[tuple[str, Range], ...]:
        entries = self.mapping(where, names, "sinks")
        return tuple(
            (name, self._range(one, f"sink of {name} (m/s)", 1.0, 60.0))
            for name, one in entries.items()
        )

    def _check(self, entries: dict[str, Where], vehicle: DescribedVehicle) -> None:
        """What cannot be together."""
        soft, rate = vehicle.soft_landing, vehicle.descent_rate
        if soft < _SOFTER * rate:
            line = entries.get("soft_landing", entries["descent_rate"]).line
            text = f"soft_landing is {soft:g} m/s: a canopy with a descent_rate of {rate:g} m/s"
            self.wrong(line, f"{text} never lands so softly: need {_SOFTER * rate:.2f} or more")
        slowest = vehicle.fall_speed.least
        if slowest <= soft:
            text = f"a mass of {vehicle.mass:g} kg and a drag_area of {vehicle.drag_area.most:g}"
            self.wrong(
                entries["drag_area"].line,
                f"{text} m^2 fall with {slowest:.1f} m/s, no faster than soft_landing "
                f"({soft:g} m/s): such a vehicle needs no parachute",
            )
        if vehicle.self_release and "upf_can" not in _links(vehicle.parachute):
            text = f"self_release is true: the parachute {vehicle.parachute} does not release"
            self.wrong(entries["self_release"].line, f"{text} itself in the campaign: need upf")


def _links(parachute: str) -> tuple[str, ...]:
    return next(one.links for one in flown_vehicles() if one.name == parachute)


def _needs(key: str) -> str:
    one = FIELDS[key]
    return f"need {one.allowed}: {one.meaning}"
