"""Which command may be sent in which situation: the one table.

A command leaves only through it. Default is deny: a pair that the table does not list raises, and
where the flight mode is not known nothing leaves that could hurt unless a person insists.

Source: Umbilical Reference, section 2 (launch only if armed and in Standby; key arm gates the
Startup to Standby transition; drogue and main are a manual override for recovery).
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

from chute_ros.errors import TransitionError


class Situation(enum.Enum):
    """The flight mode of fresh telemetry, or that there is none."""

    STARTUP = "Startup"
    STANDBY = "Standby"
    ASCENT = "Ascent"
    COAST = "Coast"
    DROGUE_DEPLOYED = "DrogueDeployed"
    MAIN_DEPLOYED = "MainDeployed"
    FAULT = "Fault"
    LOST_IN_FLIGHT = "lost in flight: a fault, a restart or an unknown mode since"
    UNKNOWN = "not known: no fresh telemetry"


class CommandVerdict(enum.Enum):
    """What becomes of a command."""

    ALLOWED = "sent"
    FORCE = "sent only if forced"
    CONFIRM = "sent only with an explicit confirmation (force)"
    NEVER = "never sent"


_A, _F, _C, _N = (
    CommandVerdict.ALLOWED,
    CommandVerdict.FORCE,
    CommandVerdict.CONFIRM,
    CommandVerdict.NEVER,
)

#: In the order of Situation:
#: Startup, Standby, Ascent, Coast, Drogue, Main, Fault, lost in flight, unknown.
_ROWS: dict[str, tuple[CommandVerdict, ...]] = {
    "heartbeat": (_A, _A, _A, _A, _A, _A, _A, _A, _A),
    "launch": (_N, _C, _N, _N, _N, _N, _N, _N, _N),
    "safe": (_A, _A, _A, _A, _A, _A, _A, _A, _A),
    "key_arm": (_A, _A, _F, _F, _F, _F, _F, _F, _F),
    "key_disarm": (_A, _A, _F, _F, _F, _F, _A, _F, _A),
    "open_mav": (_A, _A, _F, _F, _F, _F, _F, _F, _F),
    "close_mav": (_A, _A, _F, _A, _A, _A, _A, _A, _A),
    "open_sv": (_A, _A, _F, _F, _A, _A, _A, _A, _F),
    "close_sv": (_A, _A, _A, _A, _A, _A, _A, _A, _A),
    "drogue": (_F, _F, _A, _A, _A, _A, _F, _A, _F),
    "main": (_F, _F, _A, _A, _A, _A, _F, _A, _F),
    **{f"payload_{event}": (_A,) * 9 for event in ("n1", "n2", "n3", "n4", "a1", "a2", "a3")},
    "reboot": (_A, _A, _F, _F, _F, _F, _F, _F, _F),
    "reset_fram": (_A, _A, _F, _F, _F, _F, _F, _F, _F),
    "dump_fram": (_A, _A, _F, _F, _F, _F, _A, _F, _F),
    "dump_flash": (_A, _A, _F, _F, _F, _F, _A, _F, _F),
    "wipe_flash": (_A, _A, _F, _F, _F, _F, _F, _F, _F),
    "flash_info": (_A, _A, _A, _A, _A, _A, _A, _A, _A),
    "wipe_fram_and_reboot": (_A, _A, _F, _F, _F, _F, _F, _F, _F),
    "set_target": (_A, _A, _A, _A, _A, _A, _A, _A, _A),
}
TABLE: dict[tuple[str, Situation], CommandVerdict] = {
    (name, situation): verdict
    for name, row in _ROWS.items()
    for situation, verdict in zip(Situation, row, strict=True)
}

#: Why a row is not all "allowed", for the person who is refused.
_REASONS = {
    "launch": "launch needs the key armed and Standby",
    "drogue": "the drogue is not fired on the ground, nor if it may be on the ground",
    "main": "the main is not fired on the ground, nor if it may be on the ground",
    "close_mav": "closing the MAV stops the motor",
    "open_mav": "the MAV is not opened by hand in flight",
    "open_sv": "the SV is not opened by hand in flight",
    "key_arm": "the key is turned on the ground",
    "key_disarm": "the key is turned on the ground",
    "reboot": "a flight computer that reboots fires no parachute",
    "reset_fram": "its stored data is needed in flight",
    "dump_fram": "it may send no telemetry while it dumps",
    "dump_flash": "it sends no telemetry while it dumps",
    "wipe_flash": "it does nothing else while it wipes",
    "wipe_fram_and_reboot": "a flight computer that reboots fires no parachute",
}


@dataclass(frozen=True)
class Ruling:
    """Whether a command goes, and why not; empty: it does."""

    verdict: CommandVerdict
    refusal: str


def rule(name: str, situation: Situation, force: bool) -> Ruling:
    """The table's word on one command; force: a person confirms, or insists."""
    try:
        verdict = TABLE[name, situation]
    except KeyError:
        raise TransitionError(f"no rule for {name!r} in {situation}") from None
    if verdict is CommandVerdict.ALLOWED or (force and verdict is not CommandVerdict.NEVER):
        return Ruling(verdict, "")
    mode = f"flight mode {situation.value}"
    if verdict is CommandVerdict.CONFIRM:
        return Ruling(verdict, f"{name} ({mode}) needs an explicit confirmation: set force")
    fix = "" if verdict is CommandVerdict.NEVER else "; force sends it all the same"
    return Ruling(verdict, f"{name} refused: {_REASONS[name]} ({mode}){fix}; nothing was sent")
