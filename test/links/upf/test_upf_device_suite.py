"""upf_can passes the stories of all device nodes, over real CAN frames."""

from device_suite import DeviceSuite
from simulated_device import SimulatedDevice
from upf_bench import Network


class UpfDevice(SimulatedDevice):
    """The controller and the trigger of sim_upf."""

    def __init__(self, network):
        self.network, self.bench = network, network.bench
        self.controller, self.trigger = network.controller(), network.trigger()
        self.loop = None

    def plug_in(self):
        self.loop = self.network.plug(self.controller, self.trigger)

    def _act(self, action):
        self.bench.have(self.loop, lambda bus: bus.act(action))

    def fall_silent(self):
        self._act("silent")

    def speak_again(self):
        self._act("speak")

    def stop_answering(self):
        self._act("mute")

    def be_stuck(self):
        self._act("trigger-stuck")

    def break_down(self):
        self._act("error=IMU")
        return "IMU"

    def come_to_ground(self):
        self.controller.cleared = False

    def commands_to_deploy(self):
        return len([name for name in self.controller.came if name.startswith("TYPE_DEPLOY")])

    @property
    def deployed(self):
        return self.trigger.fired


class TestUpfCan(DeviceSuite):
    """The link of this suite is DroneCAN."""

    name = "upf_can"

    def make(self, bench, **parameters):
        return UpfDevice(Network(bench, **parameters))
