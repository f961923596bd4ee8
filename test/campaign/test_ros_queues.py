"""What becomes of messages between processes that hang, die, or whose clocks are set."""

from __future__ import annotations

import pytest

from chute_ros.campaign.channel import Spell
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.sensor_messages import Imu, Vector, rolled
from chute_ros.campaign.world import World


class Network:
    """One that talks, and one that listens."""

    def __init__(self) -> None:
        self.world = World()
        self.ros = Ros(self.world, 1)
        self.talker, self.listener = Process("talker"), Process("listener")
        self.heard: list[tuple[int, float, float]] = []
        self.ros.subscribe(int, self.listener, lambda *told: self.heard.append(told))
        self.ros.subscribe(int, self.talker, lambda *told: pytest.fail("it hears itself"))

    def say_each_tenth(self, count: int) -> None:
        for number in range(count):
            self.world.post(
                number / 10.0, lambda _, number=number: self.ros.publish(self.talker, number)
            )
        self.world.run(60.0, lambda: False)

    @property
    def numbers(self) -> list[int]:
        return [number for number, _, _ in self.heard]


def test_what_is_said_is_heard_soon_and_by_others() -> None:
    net = Network()
    net.say_each_tenth(3)
    assert net.numbers == [0, 1, 2]
    assert [difference for _, difference, _ in net.heard] == pytest.approx([0.0005] * 3)


def test_one_that_hangs_reads_the_newest_ten_when_it_goes_on() -> None:
    net = Network()
    net.listener.hang(net.world, 2.05)
    net.say_each_tenth(22)
    assert net.numbers == [*range(11, 21), 21]
    assert net.heard[0][1:] == pytest.approx((0.95, 2.05)), "its age is told as it is"


def test_of_sensors_it_reads_the_newest_five() -> None:
    net = Network()
    heard: list[float] = []
    net.ros.subscribe(Imu, net.listener, lambda one, *_: heard.append(one.linear_acceleration.z))
    net.listener.hang(net.world, 2.05)
    for number in range(12):
        told = Imu(rolled(0.0), Vector(z=float(number)))
        net.world.post(number / 10.0, lambda _, told=told: net.ros.publish(net.talker, told))
    net.world.run(60.0, lambda: False)
    assert heard == [7.0, 8.0, 9.0, 10.0, 11.0]


def test_one_that_dies_has_heard_nothing_when_it_starts() -> None:
    net = Network()
    net.listener.die()
    net.world.post(1.05, net.listener.start)
    net.say_each_tenth(12)
    assert net.numbers == [11]


def test_what_was_written_before_a_reader_was_there_never_reaches_it() -> None:
    net = Network()
    net.talker.outward.append(Spell(0.0, 0.95, delay=0.9))
    net.listener.die()
    net.world.post(0.55, net.listener.start)
    net.say_each_tenth(12)
    assert net.numbers == [6, 7, 8, 9, 10, 11]


def test_a_clock_that_is_set_shows_in_the_difference() -> None:
    net = Network()
    net.listener.clock = 3600.0
    net.talker.clock = -60.0
    net.say_each_tenth(1)
    assert net.heard[0][1] == pytest.approx(3660.0005)


@pytest.mark.parametrize("side", ["talker", "listener"])
def test_what_is_cut_on_either_side_is_lost(side: str) -> None:
    net = Network()
    way = net.talker.outward if side == "talker" else net.listener.inward
    way.append(Spell(0.0, 0.25, loss=1.0))
    net.say_each_tenth(5)
    assert net.numbers == [3, 4]
