"""umbilical passes the stories of all device nodes, over a real pty."""

import math

from device_suite import DeviceSuite
from simulated_device import SimulatedDevice
from umbilical_bench import Cable


class RocketDevice(SimulatedDevice):
    """The flight computer of sim_flight_computer."""

    def __init__(self, cable):
        self.cable, self.computer = cable, cable.computer

    def plug_in(self):
        self.cable.plug()

    def plug_in_mute(self):
        self.cable.plug_mute()

    def fall_silent(self):
        self.cable.act("silent")

    def speak_again(self):
        self.cable.act("speak")

    def stop_answering(self):
        self.cable.act("mute")

    def be_stuck(self):
        self.cable.act("stuck")

    def break_down(self):
        self.cable.act("fault")
        return "flight mode Fault"

    def clear_the_ground(self):
        self.cable.act("jump=Coast")
        self.cable.await_mode(3)

    def come_to_ground(self):
        self.cable.act("jump=Standby")
        self.cable.await_mode(1)

    def commands_to_deploy(self):
        return self.cable.tokens().count("<D>") + self.computer.receiver.lost["deaf"]

    @property
    def deployed(self):
        return not math.isnan(self.computer.flight.rocket.drogue_out_for)


class TestUmbilical(DeviceSuite):
    """The link of this suite is a serial umbilical, which acknowledges nothing."""

    name = "umbilical"
    acknowledges = False
    not_armed = "the drogue is not fired on the ground"
    too_near = "the drogue is not fired on the ground"

    def make(self, bench, **parameters):
        return RocketDevice(Cable(bench, **parameters))
