"""What the tests of mavlink_parachute share: quick parameters, and devices that remember."""

import time
from typing import Any

from chute_msgs.msg import SafetyState
from node_bench import LOCAL, port_of

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.model import SafetyFlags
from chute_ros.protocol.mavlink.dialect import FORCE_DISARM, dialect
from chute_ros.ros import qos
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.sim.autopilot_kinds import GENERIC

#: Between two heartbeats and two statuses of the simulated devices, s.
INTERVAL = 0.05


def quick(**parameters):
    """Parameters with short limits on a free port."""
    return {
        "connection": f"udpin:{LOCAL}:0",
        "parachute_stale_after": 0.4,
        "parachute_lost_after": 0.8,
        "autopilot_stale_after": 0.6,
        "autopilot_lost_after": 1.2,
        "ack_timeout": 0.15,
        "effect_timeout": 0.4,
        "retry_interval": 0.1,
        "give_up_after": 0.8,
        "late_ack_window": 0.3,
    } | parameters


class Remembering:
    """Remembers the commands that came over the wire: (time, MAV_CMD, params)."""

    commands_heard: list[tuple[float, int, tuple[float, ...]]]

    def _command(self, frame):
        message = frame.message
        params = tuple(getattr(message, f"param{number}") for number in range(1, 8))
        mine = message.target_system in (0, self.system_id)  # type: ignore[attr-defined]
        if mine and message.target_component in (0, self.component_id):  # type: ignore[attr-defined]
            self.commands_heard.append((time.monotonic(), message.command, params))
        super()._command(frame)  # type: ignore[misc]

    def heard_command(self, number, first=None):
        """The commands of this number (and first parameter) so far."""
        return [
            heard
            for heard in self.commands_heard
            if heard[1] == number and first in (None, heard[2][0])
        ]


class Module(Remembering, ParachuteDevice):
    """A parachute module that speaks often and can be stuck."""

    def __init__(self, settings=None, interval=INTERVAL):
        self.commands_heard = []
        #: It says yes, but nothing comes out.
        self.stuck = False
        #: False: it says that it is too near the ground.
        self.cleared = True
        super().__init__(settings or ParachuteSettings(ground_cleared="yes"), [])
        self.default_intervals[dialect.MAVLINK_MSG_ID_HEARTBEAT] = interval
        self.default_intervals[dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS] = interval

    @property
    def releases(self):
        """The commands to release."""
        return self.heard_command(dialect.MAV_CMD_DO_PARACHUTE, float(dialect.PARACHUTE_RELEASE))

    def safety(self):
        flags = super().safety()
        return flags if self.cleared else flags & ~SafetyFlags.GROUND_CLEARED

    def deploy(self, trigger):
        if not self.stuck:
            super().deploy(trigger)


class Autopilot(Remembering, AutopilotDevice):
    """An autopilot that speaks often."""

    def __init__(self, system_id=1, interval=INTERVAL, kind=GENERIC):
        self.commands_heard = []
        #: Names of the parameters that were asked for.
        self.asked_for: set[str] = set()
        super().__init__(system_id, [], kind=kind)
        for message_id in (
            dialect.MAVLINK_MSG_ID_HEARTBEAT,
            dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
            dialect.MAVLINK_MSG_ID_SYSTEM_TIME,
        ):
            self.default_intervals[message_id] = interval

    def heard(self, frame):
        if frame.message.get_type() == "PARAM_REQUEST_READ":
            self.asked_for.add(frame.message.param_id)
        super().heard(frame)

    @property
    def forced(self):
        """The orders to disarm by force."""
        orders = self.heard_command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
        return [heard for heard in orders if heard[2][1] == FORCE_DISARM]


def airborne(height, kind=GENERIC):
    """One that holds its vehicle at height, m."""
    autopilot = Autopilot(kind=kind)
    autopilot.update(time.monotonic())  # it has started, disarmed
    autopilot.take_output()  # which nobody heard
    autopilot.model.height = autopilot.model.target_height = height
    autopilot.model.armed = True
    return autopilot


class Network:
    """The node, and what is plugged into its network."""

    def __init__(self, bench, **parameters):
        self.bench = bench
        self.node = bench.add(MavlinkParachuteNode, **quick(**parameters))
        self.wire = f"udpout:{LOCAL}:{port_of(self.node.loop)}"

    def plug(self, device, **options):
        """Plug a device in; the loop it runs in."""
        return self.bench.simulate(device, self.wire, **options)


class VirtualNetwork:
    """The link and devices, each of which hears all others, in virtual time."""

    def __init__(self, *devices, **config):
        self.link, self.devices = MavlinkLink(MavlinkConfig(**config)), devices
        self.now = max([one.now for one in devices], default=0.0)
        self.events: list[Any] = []

    def run(self, seconds):
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            everybody = (self.link, *self.devices)
            for one in everybody:
                one.update(self.now)
                for frame in one.take_output():
                    for other in everybody:
                        if other is not one:
                            other.receive(frame, self.now)
            self.events += self.link.take_events()
        return self


def do(bench, loop, function):
    """Have function() called in the thread of a simulated device, and wait for it."""
    bench.have(loop, lambda device: function())


class ChainFlight:
    """A vehicle from its supervisor to its wires. A subclass makes what is on them."""

    autopilot: Autopilot

    def __init__(self, bench):
        self.bench = bench
        self.safety = bench.follow(SafetyState, "safety/state", qos.LATCHED)

    def act(self, action):
        do(self.bench, self.autopilot.loop, lambda: self.autopilot.act(action))

    def await_stage(self, *stages):
        self.bench.until(
            lambda: self.safety and self.safety[-1].state in stages, f"the stage is {stages}"
        )
