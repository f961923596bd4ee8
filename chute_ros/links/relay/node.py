"""A parachute without telemetry on a relay, GPIO or PWM output."""

from __future__ import annotations

import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros.links.relay.diagnostics import details_of, link_task, parachute_task
from chute_ros.links.relay.output import make_output
from chute_ros.links.relay.parameters import PARAMETERS, RelayParameters
from chute_ros.links.relay.protocol.link import RelayLink
from chute_ros.links.relay.runtime import RelayRuntime
from chute_ros.ros.device_node import DeviceNode
from chute_ros.runtime.device import Summary
from chute_ros.settings import settings_from
from chute_ros.transport.loop import WireLoop

#: After the end of a pulse its output is written by then, or cannot be, s.
_REST_WITHIN = 1.0


class RelayNode(DeviceNode):
    """The node relay."""

    def __init__(self, **options: Any) -> None:
        super().__init__("relay", PARAMETERS, **options)
        settings = settings_from(RelayParameters, self.values).runtime
        link = RelayLink(settings.link)
        wire = make_output(self.values["connection"])
        self.carry(RelayRuntime(self.get_name(), settings, self, details_of))
        self.loop = WireLoop(link, wire, self.deliver, link.wire_opened, link.not_written)
        self.begin()

    def destroy_node(self) -> None:
        """A pulse under way is given its time, and the output is put to rest: it would fire on."""
        if self.loop is not None:
            link: RelayLink = self.loop.link
            within = link.config.repeat_interval + _REST_WITHIN
            began = time.monotonic()
            while not link.at_rest and time.monotonic() < max(began, link.fires_until) + within:
                time.sleep(0.01)
        super().destroy_node()

    def diagnose(self, summary: Summary) -> list[DiagnosticStatus]:
        assert self.loop is not None
        name, details = self.diagnostic_name, summary.details
        failed = self.loop.send_errors
        return [
            link_task(name, details, self.wire_picture(), failed),
            parachute_task(name, details),
        ]
