"""What a person must have allowed before bytes may leave for a flight computer."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from chute_ros.conformance.bench import NotAllowedError
from chute_ros.conformance.clause import Risk
from chute_ros.links.umbilical.protocol.commands import KINDS

#: Options that clauses need, beside the risk.
REBOOT, WIPE = "--reboot", "--wipe"
_ARMS = ("key_arm", "key_disarm", "safe", "close_mav", "close_sv")
_FIRES = ("launch", "open_mav", "open_sv", "drogue", "main")
_WIPES = ("reset_fram", "wipe_flash", "wipe_fram_and_reboot")
#: A target, whose digits are no payload events.
_TARGET = re.compile(rb"T,[-0-9.,]*")


@dataclass(frozen=True)
class _Permit:
    risk: Risk = Risk.NONE
    option: str = ""


def _permit(name: str) -> _Permit:
    if name in _FIRES or name.startswith("payload_"):
        return _Permit(Risk.FIRES)
    if name in _ARMS:
        return _Permit(Risk.ARMS)
    return _Permit(option=WIPE if name in _WIPES else REBOOT if name == "reboot" else "")


_BY_TOKEN = {kind.command.token: _permit(name) for name, kind in KINDS.items()}


def risk_of(data: bytes) -> Risk:
    """What a device may do that gets these bytes.

    Bytes that are no command count as the most dangerous command that a device could read into
    them that is careless of brackets and of case.
    """
    return max((permit.risk for permit in _permits(data)), default=Risk.NONE)


def check_options(data: bytes, risk: Risk, options: Collection[str]) -> None:
    """NotAllowedError: data needs an option that is not among these. risk: what is allowed."""
    for permit in _permits(data):
        # Whoever lets it fire lets it start again as well: nothing else ends a launch.
        if permit.option == REBOOT and risk is Risk.FIRES:
            continue
        if permit.option and permit.option not in options:
            raise NotAllowedError(f"{data!r} needs {permit.option}")


def _permits(data: bytes) -> list[_Permit]:
    if data in _BY_TOKEN:
        return [_BY_TOKEN[data]]
    rest = _TARGET.sub(b"", data.upper())
    return [one for token, one in _BY_TOKEN.items() if token[1:-1].upper() in rest]
