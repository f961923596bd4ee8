"""What the tests of umbilical share: quick parameters, and a flight computer on a pty."""

from collections.abc import Callable
from typing import Any

from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, Telem
from chute_msgs.srv import Arm, Deploy, Dump, SetTarget, UmbilicalCommand
from node_bench import Bench

from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.node import UmbilicalNode
from chute_ros.links.umbilical.protocol.layouts import Layout
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


def quick(**parameters: Any) -> dict[str, Any]:
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

    def __init__(
        self,
        bench: Bench,
        settings: FlightComputerSettings | None = None,
        sends: str = "telem57_airbrake_state",
        **parameters: Any,
    ) -> None:
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
    def shipped_layouts() -> list[Layout]:
        """Those that were built."""
        return load_layouts("", "test")

    # -- the cable -----------------------------------------------------------------------------

    def plug(self) -> None:
        """The flight computer is at the end of the cable."""
        self.loop = self.bench.simulate_on(PtyWire(str(self.path)), self.computer)

    def plug_mute(self) -> None:
        """Something is at the end of the cable that never says a word."""
        wire = PtyWire(str(self.path))
        wire.open()
        self.bench.at_end.callback(wire.close)

    def pull(self) -> None:
        """The cable is pulled."""
        assert self.loop is not None
        self.bench.unplug(self.loop)
        self.loop = None

    def call(self, function: Callable[[Any], Any]) -> Any:
        """Have function(flight computer) called in its own thread, and wait for what it gives."""
        assert self.loop is not None
        done: list[Any] = []
        self.loop.call(lambda link, now: done.append(function(link)))
        self.bench.until(lambda: done, "the simulator has done so")
        return done[0]

    def act(self, action: str) -> None:
        """An action of --at."""
        self.call(lambda computer: computer.act(action))

    def tokens(self) -> list[str]:
        """The commands that came, oldest first."""
        return [token for _, token in self.computer.came]

    # -- awaiting ------------------------------------------------------------------------------

    def await_link(self, state: LinkState) -> None:
        self.bench.until(
            lambda: self.heartbeats and self.heartbeats[-1].link_state == state,
            f"the link is {state.name}",
        )

    def await_telemetry(self, condition: Callable[[Telem], Any], what: str) -> Telem:
        self.bench.until(lambda: self.telemetry and condition(self.telemetry[-1]), what)
        return self.telemetry[-1]

    def await_mode(self, mode: int) -> None:
        self.await_telemetry(lambda t: t.flight_mode == mode, f"flight mode {mode}")

    def plugged(self) -> None:
        """Plugged in, heard and healthy."""
        self.plug()
        self.await_link(LinkState.OK)
        self.bench.until(lambda: self.heartbeats[-1].device_healthy, "it is healthy")
        self.bench.until(lambda: self.statuses, "its picture is told")

    # -- services ------------------------------------------------------------------------------

    def command(self, name: str, force: bool = False) -> Any:
        """~/command."""
        return self.bench.call(
            UmbilicalCommand, "umbilical/command", command=name, force=force, reason="a test"
        )

    def arm(self, arm: bool = True, **fields: Any) -> Any:
        """~/arm."""
        return self.bench.call(Arm, "umbilical/arm", arm=arm, **fields)

    def deploy(self, force: bool = False) -> Any:
        """~/deploy."""
        return self.bench.call(Deploy, "umbilical/deploy", force=force, reason="a test")

    def set_target(self, *values: float) -> Any:
        """~/set_target."""
        names = ("latitude", "longitude", "third", "fourth")
        padded = [*values, *[float("nan")] * (4 - len(values))]
        return self.bench.call(
            SetTarget, "umbilical/set_target", **dict(zip(names, padded, strict=True))
        )

    def dump(self, memory: str, path: str = "") -> Any:
        """~/dump."""
        return self.bench.call(Dump, "umbilical/dump", memory=memory, path=path)
