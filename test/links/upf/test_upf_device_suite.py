"""upf_can passes the stories of all device nodes, over real CAN frames, with either data types."""

from device_suite import DeviceSuite
from simulated_device import SimulatedDevice
from upf_bench import OTHER_LAYOUT, Network


class UpfDevice(SimulatedDevice):
    """The controller and the trigger of sim_upf."""

    def __init__(self, network, fault):
        self.network, self.bench, self.fault = network, network.bench, fault
        self.controller, self.trigger = network.controller(), network.trigger()
        self.loop = None

    def plug_in(self):
        self.loop = self.network.plug(self.controller, self.trigger)

    def _act(self, action):
        done = []

        def act(link, now):
            link.act(action)
            done.append(now)

        self.loop.call(act)
        self.bench.until(lambda: done, "the simulator has done so")

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
        return self.fault

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
    folder = ""
    fault = "IMU"

    def make(self, bench, **parameters):
        network = Network(bench, dsdl_path=self.folder, **parameters)
        return UpfDevice(network, self.fault)


class TestUpfCanWithOtherDataTypes(TestUpfCan):
    """The same with data types that are laid out differently."""

    folder = str(OTHER_LAYOUT)
    fault = "error_imu"
