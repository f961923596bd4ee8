"""Virtual time, and what happens to messages on their way."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.campaign.bus import spoil_can
from chute_ros.campaign.channel import Channel, Delivery, Spell
from chute_ros.campaign.world import World
from chute_ros.sim.faults import flip_a_byte


class Alarm:
    """Wakes at these times."""

    def __init__(self, *times: float) -> None:
        self.times, self.woken = list(times), []

    def update(self, now: float) -> None:
        self.woken.append(now)
        self.times.pop(0)

    def next_deadline(self) -> float:
        return self.times[0] if self.times else math.inf


def never() -> bool:
    return False


def test_it_goes_from_one_moment_to_the_next() -> None:
    world, alarm = World(), Alarm(1.0, 2.5)
    world.add(alarm)
    heard = []
    world.post(2.0, heard.append)
    world.post(2.0, lambda at: heard.append(-at))
    world.run(10.0, never)
    assert alarm.woken == [1.0, 2.5]
    assert heard == [2.0, -2.0], "the one posted first"
    assert world.now == 10.0


def test_it_stops_when_it_is_over() -> None:
    world, alarm = World(), Alarm(1.0, 2.0, 3.0)
    world.add(alarm)
    world.run(10.0, lambda: len(alarm.woken) == 2)
    assert world.now == 2.0


def test_one_that_is_given_something_to_do_earlier_wakes_earlier() -> None:
    world, alarm = World(), Alarm(5.0)
    world.add(alarm)

    def sooner(now: float) -> None:
        alarm.times.insert(0, 2.0)
        world.stir(alarm)

    world.post(1.0, sooner)
    world.run(10.0, never)
    assert alarm.woken == [2.0, 5.0]


class Busy(Alarm):
    """Is due all the time."""

    def update(self, now: float) -> None:
        self.woken.append(now)

    def next_deadline(self) -> float:
        return 0.0


def test_one_that_is_due_all_the_time_does_not_stop_time() -> None:
    world, busy = World(), Busy()
    world.add(busy)
    world.run(0.00101, lambda: len(busy.woken) > 900)
    assert len(busy.woken) == 901
    assert busy.woken == sorted(set(busy.woken))


def sent(messages: int, every: float, in_order: bool = True, **spell: float) -> list[tuple]:
    """(number, arrival) of messages sent at these intervals from 0 on; they take 1 ms."""
    world, arrived = World(), []
    spells = [Spell(0.0, **{"end": math.inf, **spell})]
    delivery = Delivery(0.001, in_order, overtaken=0.05)
    channel: Channel[int] = Channel(world, "4", delivery, (spells, []))
    for number in range(messages):
        world.post(
            number * every,
            lambda _, number=number: channel.send(
                (number,), lambda ones, at: arrived.append((ones[0], at))
            ),
        )
    world.run(1e6, never)
    return arrived


def test_without_a_spell_everything_arrives_once_and_in_time() -> None:
    arrived = sent(5, 0.1, end=0.0)
    assert [message for message, _ in arrived] == [0, 1, 2, 3, 4]
    assert [at for _, at in arrived] == pytest.approx(
        [0.001, 0.101, 0.201, 0.301, 0.401], abs=1e-5
    )


@pytest.mark.parametrize(
    ("spell", "arrives"),
    [
        ({"loss": 1.0}, []),
        ({"loss": 1.0, "end": 0.25}, [3, 4, 5]),
        ({"double": 1.0}, [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]),
        # There for 0.2 s of each 0.4 s is the spell, which loses everything.
        ({"loss": 1.0, "flaps": 0.2}, [2, 3]),
    ],
)
def test_what_a_spell_does(spell: dict[str, float], arrives: list[int]) -> None:
    assert [message for message, _ in sent(6, 0.1, **spell)] == arrives


def test_some_are_lost_where_some_shall_be() -> None:
    assert 600 < len(sent(1000, 0.01, loss=0.3)) < 800


@pytest.mark.parametrize("spell", [{"delay": 0.2}, {"reorder": 0.5}])
def test_a_writer_of_ros_keeps_its_order_and_datagrams_do_not(spell: dict[str, float]) -> None:
    ordered = [message for message, _ in sent(100, 0.01, **spell)]
    assert ordered == sorted(ordered)
    loose = [message for message, _ in sent(100, 0.01, in_order=False, **spell)]
    assert sorted(loose) == ordered
    assert loose != ordered


@given(st.binary(min_size=1, max_size=50), st.integers())
def test_a_damaged_datagram_differs_in_one_byte(data: bytes, seed: int) -> None:
    damaged = flip_a_byte(data, random.Random(seed))
    assert sum(a != b for a, b in zip(data, damaged, strict=True)) == 1


@given(st.binary(max_size=8), st.integers())
def test_a_damaged_can_frame_differs_in_its_data_only(data: bytes, seed: int) -> None:
    frame = b"\x01\x02\x03\x84" + bytes((len(data), 0, 0, 0)) + data.ljust(8, b"\0")
    damaged = spoil_can(frame, random.Random(seed))
    assert len(damaged) == len(frame)
    places = [place for place in range(len(frame)) if frame[place] != damaged[place]]
    assert len(places) == bool(data)
    assert all(8 <= place < 8 + len(data) for place in places)
