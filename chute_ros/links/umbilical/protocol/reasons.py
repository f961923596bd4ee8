"""Why a rocket's flight computer is not healthy, in words: what is so, and what is needed."""

from __future__ import annotations

from chute_ros.model import LinkState, ParachuteStatus

_NEEDED = "need READY or ARMED"


def reasons_of(
    status: ParachuteStatus, received_bytes: int, stale_after: float
) -> tuple[str, ...]:
    """Every reason; none if it is healthy. stale_after: s."""
    if status.healthy:
        return ()
    if status.link_state is LinkState.NEVER_SEEN:
        heard = f"{received_bytes} bytes received, no $TELEM record"
        return (f"the flight computer was never received: {heard}, need one",)
    found = [
        f"{fault}, need younger than {stale_after:g} s" if fault.endswith(" s old") else fault
        for fault in status.faults
    ]
    out = ", the parachute is out" if status.deployed else ""
    return (*found, f"flight computer: state {status.state.name}{out}, {_NEEDED}")
