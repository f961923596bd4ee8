"""What /diagnostics says of a relay output: whether it can be written, and when it fired."""

from __future__ import annotations

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros.links.relay.protocol.link import RelayLink
from chute_ros.model import LinkState
from chute_ros.ros import diagnostics


@dataclass(frozen=True)
class RelayDetails:
    """A picture of the link, made in its thread and read in the executor's."""

    state: LinkState
    received: int
    fired: int
    fired_ago: float


def details_of(link: RelayLink, now: float) -> RelayDetails:
    """In the link's turn: all that the task below says."""
    return RelayDetails(link.state, link.received, link.fired, now - link.fired_at)


def link_task(
    node: str, one: RelayDetails, wire: diagnostics.WirePicture, not_written: int
) -> DiagnosticStatus:
    """The output: whether it can be written is all that can be known."""
    level, text = diagnostics.ERROR, wire.text
    if one.state is LinkState.UNMONITORED:
        level = diagnostics.OK
    elif wire.is_open:
        text = f"{text}, and cannot be written"
    values = {
        "link": one.state.name,
        "writes that failed": not_written,
        "bytes received, which say nothing": one.received,
    }
    return diagnostics.status(node, "link", level, text, values, wire.connection)


def parachute_task(node: str, one: RelayDetails) -> DiagnosticStatus:
    """The parachute. It is never OK."""
    text = "UNMONITORED: a relay output reports nothing of its parachute"
    values = {"times fired": one.fired, "fired (s ago)": one.fired_ago}
    return diagnostics.status(node, "parachute", diagnostics.WARN, text, values, "")
