"""What a supervisor leaves for its next start, so that what is under way goes on.

A restart is to the core an update that comes late: silence meanwhile does not count, measurements
have aged, and what no device has begun is decided anew under the next epoch.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

from chute_ros.errors import RecordError
from chute_ros.supervisor.codec import Codec
from chute_ros.supervisor.handover import check_numbers
from chute_ros.supervisor.machine import ON_GROUND
from chute_ros.supervisor.state import State


@dataclass(frozen=True)
class SavedState:
    """What was left. boot: names the start of the host, with which its monotonic time began;
    settings: names the configuration."""

    boot: str
    settings: str
    state: State


_CODEC = Codec(SavedState)


def worth_saving(state: State) -> bool:
    """On the ground with nothing under way a start anew is as good, and clears alarms."""
    return state.flight.airborne or state.stage not in ON_GROUND


def dump_parachutes(those: frozenset[tuple[str, str]]) -> str:
    """(link, device) of each, as JSON text; empty: there is none."""
    return json.dumps(sorted(those)) if those else ""


def load_parachutes(text: str) -> frozenset[tuple[str, str]]:
    """What was written. RecordError: nothing that was."""
    try:
        told = json.loads(text)
    except ValueError as error:
        raise RecordError(str(error)) from error
    listed = isinstance(told, list) and all(
        isinstance(one, list) and [type(part) for part in one] == [str, str] for one in told
    )
    if not listed:
        raise RecordError(f"no list of links and devices: {text[:80]!r}")
    return frozenset((link, device) for link, device in told)


def dump(left: SavedState) -> str:
    """As JSON text."""
    return _CODEC.to_json(left, whole=True)


def load(text: str, boot: str, settings: str, within: float, now: float) -> State:
    """The state to go on with: of one that looks on until it takes over. now: monotonic s, within:
    so old it may be, s. RecordError: it is not to be gone on with, and why."""
    left = _CODEC.from_json(text)
    if not isinstance(left, SavedState) or not isinstance(left.state, State):
        raise RecordError(f"nothing that was left: {text[:80]!r}")
    if left.boot != boot:
        raise RecordError("the computer has restarted since")
    if left.settings != settings:
        raise RecordError("the parameters or the profile have changed since")
    age = now - left.state.own.updated_at
    if not 0.0 <= age <= within:
        raise RecordError(f"it is {age:.1f} s old (limit {within:g} s)")
    check_numbers(left.state)
    # Who waited for an outcome waits no more.
    return replace(
        left.state, own=replace(left.state.own, leading=False, kill_tokens=(), deploy_tokens=())
    )
