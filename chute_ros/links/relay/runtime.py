"""What relay does with decisions, and how it says that it cannot know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from chute_ros.links.relay.protocol.link import RelayConfig, RelayLink
from chute_ros.model import NAN, Action, Decision, LinkState, Outcome
from chute_ros.protocol.events import AskSupervisor
from chute_ros.runtime.device import DeviceRuntime, DeviceSettings, Summary
from chute_ros.runtime.topics import DeviceRequest
from chute_ros.settings import nested

_UNMONITORED = "nothing comes back from a relay output: what its parachute is can only be hoped"
_NOT_WRITTEN = "its output cannot be written"


@dataclass(frozen=True)
class RelaySettings(DeviceSettings):
    """Settings of a RelayRuntime."""

    link: RelayConfig = nested(RelayConfig())


class RelayRuntime(DeviceRuntime[RelaySettings]):
    """Its link is a RelayLink."""

    BLOCKS_FLIGHT = False

    def summarise(self, link: RelayLink, now: float) -> Summary:
        unmonitored = link.state is LinkState.UNMONITORED
        return Summary(link.state, False, NAN, (_UNMONITORED if unmonitored else _NOT_WRITTEN,))

    def event(self, event: Any) -> None:
        if isinstance(event, AskSupervisor):
            self.shell.publish(DeviceRequest(self.name, event.device, event.ask, event.reason))
        else:
            super().event(event)

    def carry_out(self, decision: Decision) -> None:
        if decision.action is Action.DEPLOY and decision.device:
            text = f"device {decision.device!r}: a relay has one output; nothing was sent"
            self.decisions.report(decision, Outcome.FAILED, text)
        elif decision.action is Action.DEPLOY:
            self.deploy_for(decision, lambda link, token, now: link.deploy(token, True, now))
        elif decision.action is Action.KILL:
            text = "a relay output stops no motors: take relay out of kill_links"
            self.decisions.report(decision, Outcome.FAILED, text)
        elif decision.action is not Action.NONE:
            text = "noted; a relay output keeps nothing on the ground"
            self.decisions.report(decision, Outcome.CONFIRMED, text)
