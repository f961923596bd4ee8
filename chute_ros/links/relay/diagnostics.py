"""What /diagnostics says of a relay output: whether it can be written, and what was written."""

from __future__ import annotations

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros.links.relay.protocol.link import RelayLink
from chute_ros.model import LinkState
from chute_ros.nodes import diagnostics


@dataclass(frozen=True)
class Details:
    """A picture of the link, made in its thread and read in the executor's."""

    state: LinkState
    received: int
    fired: int
    fired_ago: float


def details_of(link: RelayLink, now: float) -> Details:
    """In the link's turn: all that the task below says."""
    return Details(link.state, link.received, link.fired, now - link.fired_at)


def output_task(
    node: str, one: Details, wire: diagnostics.WirePicture, not_written: int
) -> DiagnosticStatus:
    """The output. It is never OK: nothing comes back."""
    level, text = diagnostics.ERROR, wire.text
    if one.state is LinkState.UNMONITORED:
        level, text = diagnostics.WARN, f"{text}, UNMONITORED: nothing comes back"
    elif wire.is_open:
        text = f"{text}, and cannot be written"
    values = {
        "link": one.state.name,
        "times fired": one.fired,
        "fired (s ago)": one.fired_ago,
        "writes that failed": not_written,
        "bytes received, which say nothing": one.received,
    }
    return diagnostics.status(node, "link", level, text, values, wire.connection)
