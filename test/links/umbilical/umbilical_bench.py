"""What the tests of umbilical share: quick parameters, and a flight computer on a pty."""

from typing import Any

from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, Telem
from chute_msgs.srv import Arm, Deploy, Dump, SetTarget, UmbilicalCommand

from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.node import UmbilicalNode
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings
from chute_ros.model import LinkState
from chute_ros.sim.pty_wire import PtyWire
from chute_ros.transport.loop import WireLoop

#: Lines a second.
RATE = 20.0
#: Limits of a node whose flight computer answers, however busy this machine is.
PATIENT = {
    "effect_timeout": 5.0,
    "give_up_after": 10.0,
    "telemetry_stale_after": 5.0,
    "telemetry_lost_after": 15.0,
}


def quick(**parameters):
    """Parameters with short limits."""
    return {
        "telemetry_stale_after": 0.4,
        "telemetry_lost_after": 0.8,
        "settle_time": 0.02,
        "umbilical_heartbeat_interval": 0.25,
        "effect_timeout": 0.5,
        "retry_interval": 0.1,
        "give_up_after": 0.9,
        # A deploy on the ground must be seen to be refused.
        "decided_deploy_forces": False,
        **parameters,
    }


class Cable:
    """A node, and a flight computer that can be plugged into its cable. sends: its layout."""

    def __init__(self, bench, settings=None, sends="telem57_airbrake_state", **parameters):
        self.bench = bench
        self.path = bench.folder / "ttyACM0"
        self.heartbeats = bench.follow(LinkHeartbeat, "safety/heartbeat")
        self.statuses = bench.follow(ParachuteStatus, "parachute/status")
        self.telemetry = bench.follow(Telem, "umbilical/telem")
        self.node = bench.add(
            UmbilicalNode,
            **quick(
                connection=f"serial:{self.path}",
                dump_folder=str(bench.folder / "dumps"),
                **parameters,
            ),
        )
        layouts = {one.name: one for one in self.shipped_layouts()}
        settings = settings or FlightComputerSettings(rate=RATE)
        self.computer = FlightComputer(settings, layouts[sends])
        self.loop: WireLoop[Any] | None = None

    @staticmethod
    def shipped_layouts():
        """Those that were built."""
        return load_layouts("", "test")

    # -- the cable -----------------------------------------------------------------------------

    def plug(self):
        """The flight computer is at the end of the cable."""
        self.loop = self.bench.simulate_on(PtyWire(str(self.path)), self.computer)

    def plug_mute(self):
        """Something is at the end of the cable that never says a word."""
        wire = PtyWire(str(self.path))
        wire.open()
        self.bench.at_end.callback(wire.close)

    def pull(self):
        """The cable is pulled."""
        assert self.loop is not None
        self.bench.unplug(self.loop)
        self.loop = None

    def call(self, function):
        """Have function(flight computer) called in its own thread, and wait for what it gives."""
        assert self.loop is not None
        return self.bench.have(self.loop, function)

    def act(self, action):
        """An action of --at."""
        self.call(lambda computer: computer.act(action))

    def tokens(self):
        """The commands that came, oldest first."""
        return [token for _, token in self.computer.came]

    # -- awaiting ------------------------------------------------------------------------------

    def await_link(self, state):
        self.bench.until(
            lambda: self.heartbeats and self.heartbeats[-1].link_state == state,
            f"the link is {state.name}",
        )

    def await_telemetry(self, condition, what):
        self.bench.until(lambda: self.telemetry and condition(self.telemetry[-1]), what)
        return self.telemetry[-1]

    def await_mode(self, mode):
        self.await_telemetry(lambda t: t.flight_mode == mode, f"flight mode {mode}")

    def plugged(self):
        """Plugged in, heard and healthy."""
        self.plug()
        self.await_link(LinkState.OK)
        self.bench.until(lambda: self.heartbeats[-1].device_healthy, "it is healthy")
        self.bench.until(lambda: self.statuses, "its picture is told")

    # -- services ------------------------------------------------------------------------------

    def command(self, name, force=False):
        """~/command."""
        return self.bench.call(
            UmbilicalCommand, "umbilical/command", command=name, force=force, reason="a test"
        )

    def arm(self, arm=True, **fields):
        """~/arm."""
        return self.bench.call(Arm, "umbilical/arm", arm=arm, **fields)

    def deploy(self, force=False):
        """~/deploy."""
        return self.bench.call(Deploy, "umbilical/deploy", force=force, reason="a test")

    def set_target(self, *values):
        """~/set_target."""
        names = ("latitude", "longitude", "third", "fourth")
        padded = [*values, *[float("nan")] * (4 - len(values))]
        return self.bench.call(
            SetTarget, "umbilical/set_target", **dict(zip(names, padded, strict=True))
        )

    def dump(self, memory, path=""):
        """~/dump."""
        return self.bench.call(Dump, "umbilical/dump", memory=memory, path=path)
