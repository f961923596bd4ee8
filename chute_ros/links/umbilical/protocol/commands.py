"""Every command of the reference by its name: its token, and what telemetry shows of its effect.

Source: Umbilical Reference, section 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol.canopies import CANOPIES
from chute_ros.links.umbilical.protocol.layouts import Layout, Record
from chute_ros.links.umbilical.protocol.modes import IN_FLIGHT, FlightMode
from chute_ros.links.umbilical.protocol.scheduler import HEARTBEAT, Command

#: Degrees: a 32-bit float of a longitude is exact to 8e-6.
_TARGET_TOLERANCE = 2e-5
#: They go before all others.
URGENT = ("safe", "drogue", "main")
#: What a newer command puts an end to, where it is still under way.
SUPERSEDES: dict[str, tuple[str, ...]] = {
    "safe": ("launch", "open_mav", "open_sv"),
    "launch": ("close_mav",),
    "open_mav": ("close_mav",),
    "close_mav": ("open_mav", "launch"),
    "open_sv": ("close_sv",),
    "close_sv": ("open_sv",),
    "key_arm": ("key_disarm",),
    "key_disarm": ("key_arm", "launch"),
    "set_target": ("set_target",),
}


@dataclass(frozen=True)
class Effect:
    """What a record must say. text: the same for a person."""

    text: str
    shown: Callable[[Record], bool]


@dataclass(frozen=True)
class CommandKind:
    """One command. effect None: telemetry shows nothing of it.

    once: never sent a second time. lasting: a long work with lines of its own (memory.py).
    """

    command: Command
    meaning: str
    effect: Effect | None = None
    once: bool = False
    lasting: bool = False


def _flag(name: str, value: int) -> Effect:
    text = f"telemetry reports {name} {value}"
    return Effect(text, lambda r: bool(r[name]) == bool(value))


def mode_shown(*modes: FlightMode) -> Effect:
    """One of these modes shows it; the text names the first."""
    text = f"telemetry reports flight mode {modes[0].label}"
    return Effect(text, lambda r: r["flight_mode"] in modes)


def _deployed(canopy: str) -> Effect:
    flag, mode = CANOPIES[canopy]
    text = f"telemetry reports {flag} 1, or flight mode {mode.label}"
    return Effect(text, lambda r: r[flag] != 0 or r["flight_mode"] == mode)


def _safe(sv_open: int) -> Effect:
    text = f"telemetry reports mav_open 0 and sv_open {sv_open}"
    return Effect(text, lambda r: r["mav_open"] == 0 and r["sv_open"] == sv_open)


#: With <V> this firmware opens the SV, where the reference has it closed.
SAFE_THAT_VENTS = _safe(1)


def _kind(
    name: str, token: str, meaning: str, effect: Effect | None = None, **traits: bool
) -> CommandKind:
    return CommandKind(Command(name, f"<{token}>".encode()), meaning, effect, **traits)


def _payload(event: str) -> CommandKind:
    token, name = event.removeprefix("N"), event.lower()
    flag = f"cmd_{name}"
    effect = Effect(f"telemetry reports {flag} 1", lambda r: flag in r and r[flag] != 0)
    return _kind(f"payload_{name}", token, f"payload event {event}", effect, once=True)


_ALL = (
    CommandKind(HEARTBEAT, "heartbeat", once=True),
    _kind("launch", "L", "launch, if armed and in Standby", mode_shown(*IN_FLIGHT), once=True),
    _kind("safe", "V", "safe the vehicle: close MAV and SV", _safe(0)),
    _kind("key_arm", "KA", "key arm", mode_shown(FlightMode.STANDBY, *IN_FLIGHT)),
    _kind("key_disarm", "KD", "key disarm", mode_shown(FlightMode.STARTUP)),
    _kind("open_mav", "M", "open the MAV", _flag("mav_open", 1)),
    _kind("close_mav", "m", "close the MAV", _flag("mav_open", 0)),
    _kind("open_sv", "S", "open the SV", _flag("sv_open", 1)),
    _kind("close_sv", "s", "close the SV", _flag("sv_open", 0)),
    _kind("drogue", "D", "trigger the drogue", _deployed("drogue")),
    _kind("main", "d", "trigger the main", _deployed("main")),
    *map(_payload, ("N1", "N2", "N3", "N4", "A1", "A2", "A3")),
    _kind("reboot", "R", "reboot the flight computer", once=True),
    _kind("reset_fram", "F", "reset the FRAM", once=True),
    _kind("dump_fram", "f", "dump the FRAM", once=True, lasting=True),
    _kind("dump_flash", "G", "dump the flash", once=True, lasting=True),
    _kind("wipe_flash", "W", "wipe the flash", once=True, lasting=True),
    _kind("flash_info", "I", "report how full the flash is", once=True),
    _kind("wipe_fram_and_reboot", "X", "wipe the FRAM and reboot", once=True, lasting=True),
)
KINDS = {one.command.name: one for one in _ALL}


def set_target(layout: Layout, values: tuple[float, ...]) -> CommandKind:
    """Set the landing target: latitude and longitude of each point, degrees, WGS 84.

    ParameterError where the layout's firmware takes another number of floats, or one is out of
    range.
    """
    if len(values) != layout.target_floats:
        need = "latitude and longitude" if layout.target_floats == 2 else "two points"
        raise ParameterError(
            f"the firmware with layout {layout.name} takes {layout.target_floats} floats "
            f"({need}), not {len(values)}"
        )
    for number, value in enumerate(values):
        name, most = ("longitude", 180.0) if number % 2 else ("latitude", 90.0)
        if not -most <= value <= most:
            raise ParameterError(f"{name} {value} is out of range: need {-most:g} to {most:g}")
    text = ",".join(f"{value:.7f}" for value in values)
    effect = None
    if layout.target_fields:
        told = ", ".join(f"{n} {v:.6f}" for n, v in zip(layout.target_fields, values, strict=True))

        def shown(record: Record) -> bool:
            pairs = zip(layout.target_fields, values, strict=True)
            return all(
                math.isclose(record.number(name), value, rel_tol=0.0, abs_tol=_TARGET_TOLERANCE)
                for name, value in pairs
            )

        effect = Effect(f"telemetry reports {told}", shown)
    return CommandKind(Command("set_target", f"<T,{text}>".encode()), "set the target", effect)
