"""mavlink_parachute passes the stories of all device nodes, over real UDP."""

from device_suite import DeviceSuite
from mavlink_bench import Module, quick
from node_bench import LOCAL, port_of
from simulated_device import SimulatedDevice

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteSettings


class MavlinkDevice(SimulatedDevice):
    """The module of sim_mavlink_parachute."""

    def __init__(self, bench, port):
        self.bench, self.port = bench, port
        self.module = Module(ParachuteSettings(ground_cleared="yes"))
        self.loop = None

    def plug_in(self):
        self.loop = self.bench.simulate(self.module, f"udpout:{LOCAL}:{self.port}")

    def _act(self, action):
        self.bench.have(self.loop, lambda module: module.act(action))

    def fall_silent(self):
        self._act("silent")

    def speak_again(self):
        self._act("speak")

    def stop_answering(self):
        self._act("mute")

    def be_stuck(self):
        self.module.stuck = True

    def break_down(self):
        self._act("error=LOW_POWER")
        return "LOW_POWER"

    def come_to_ground(self):
        self.module.cleared = False

    def commands_to_deploy(self):
        return len(self.module.releases)

    @property
    def deployed(self):
        return bool(self.module.deployment)


class TestMavlinkParachute(DeviceSuite):
    """The link of this suite is MAVLink."""

    name = "mavlink_parachute"

    def make(self, bench, **parameters):
        node = bench.add(MavlinkParachuteNode, **quick(), **parameters)
        return MavlinkDevice(bench, port_of(node.loop))
