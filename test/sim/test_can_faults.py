"""Faults of a CAN bus on demand: as many as asked for, and only those that were asked for."""

import math

import pytest
from fault_bench import BOTH_WAYS, Echo, differing, flat, pass_in

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.can_frame import ERROR_BUS_OFF, CanFrame, pack, unpack
from chute_ros.sim.can_faults import OVERTAKEN, CanFaultKnobs, CanFaultyLink

START, END, TOGGLE = 0x80, 0x40, 0x20
COUNT = 3000
KNOBS = ("loss", "duplicate", "corrupt", "reorder", "toggle", "half")


def single(number):
    """A transfer of one frame."""
    data = number.to_bytes(2, "little") + bytes((START | END | number % 32,))
    return [pack(CanFrame(0x100 + number % 7, data))]


def triple(number):
    """A transfer of three frames."""
    head, identifier = number.to_bytes(2, "little"), 0x10_000 + number % 7
    tails = (START, TOGGLE, END)
    return [
        pack(CanFrame(identifier, head + bytes((i,)) * 5 + bytes((tail | number % 32,))))
        for i, tail in enumerate(tails)
    ]


SINGLES = [single(number) for number in range(COUNT)]
TRIPLES = [triple(number) for number in range(COUNT)]


@BOTH_WAYS
def test_nothing_is_spoiled_where_nothing_is_asked(way):
    for transfers in (SINGLES, TRIPLES):
        assert way(CanFaultyLink, CanFaultKnobs(), transfers) == flat(transfers)


@BOTH_WAYS
def test_only_the_toggle_bit_is_wrong_at_the_rate_asked_for(way):
    sent = flat(TRIPLES)
    arrived = way(CanFaultyLink, CanFaultKnobs(toggle=0.3), TRIPLES)
    spoiled = 0
    for one, other in zip(arrived, sent, strict=True):
        if one != other:
            spoiled += 1
            got, was = unpack(one), unpack(other)
            assert got.data == was.data[:-1] + bytes((was.data[-1] ^ TOGGLE,))
            assert got.identifier == was.identifier
    assert spoiled / len(sent) == pytest.approx(0.3, abs=0.03)


@BOTH_WAYS
def test_half_of_a_transfer_is_its_first_frame_alone(way):
    arrived = way(CanFaultyLink, CanFaultKnobs(half=0.3), TRIPLES)
    came = {}
    for frame in arrived:
        number = int.from_bytes(unpack(frame).data[:2], "little")
        came.setdefault(number, []).append(frame)
    assert len(came) == COUNT, "a first frame always comes"
    halves = 0
    for number, frames in came.items():
        assert frames in (TRIPLES[number], TRIPLES[number][:1])
        halves += len(frames) == 1
    assert halves / COUNT == pytest.approx(0.3, abs=0.04)


@BOTH_WAYS
def test_half_of_a_transfer_of_one_frame_is_all_of_it(way):
    assert way(CanFaultyLink, CanFaultKnobs(half=1.0), SINGLES) == flat(SINGLES)


def test_transfers_of_several_senders_are_halved_each_by_itself():
    """Given frames of two senders in turn: what is cut of one is not cut of the other."""
    arrived = pass_in(
        CanFaultyLink, CanFaultKnobs(half=0.5), [_mixed(number) for number in range(COUNT)]
    )
    by_sender = {0x11: {}, 0x22: {}}
    for frame in map(unpack, arrived):
        number = int.from_bytes(frame.data[:2], "little")
        counts = by_sender[frame.identifier]
        counts[number] = counts.get(number, 0) + 1
    for counts in by_sender.values():
        assert set(counts.values()) == {1, 3}
        halves = sum(count == 1 for count in counts.values())
        assert halves / COUNT == pytest.approx(0.5, abs=0.04)
    one, other = by_sender.values()
    assert any(one[number] != other[number] for number in range(COUNT))


def _mixed(number):
    frames = []
    for tail in (START, TOGGLE, END):
        for identifier in (0x11, 0x22):
            data = number.to_bytes(2, "little") + bytes(5) + bytes((tail | number % 32,))
            frames.append(pack(CanFrame(identifier, data)))
    return frames


@BOTH_WAYS
def test_a_frame_is_overtaken_at_the_rate_asked_for(way):
    arrived = way(CanFaultyLink, CanFaultKnobs(reorder=0.2), TRIPLES)
    assert sorted(arrived) == sorted(flat(TRIPLES)), "none is lost, none is spoiled"
    in_order = 0
    for begin in range(0, len(arrived), 3):
        frames = arrived[begin : begin + 3]
        number = int.from_bytes(unpack(frames[0]).data[:2], "little")
        assert sorted(frames) == sorted(TRIPLES[number]), "by its neighbours only"
        in_order += frames == TRIPLES[number]
    # In order are: none late; only the last; the two last; all.
    stays = 0.8**3 + 0.2 * 0.8**2 + 0.2**2 * 0.8 + 0.2**3
    assert in_order / COUNT == pytest.approx(stays, abs=0.04)


def test_an_overtaken_frame_comes_two_milliseconds_later_and_the_loop_knows():
    device = Echo()
    link = CanFaultyLink(device, CanFaultKnobs(reorder=1.0), 1)
    link.receive(SINGLES[0][0], 5.0)
    assert device.received == []
    assert link.next_deadline() == pytest.approx(5.0 + OVERTAKEN)
    link.update(link.next_deadline())
    assert [data for _, data in device.received] == SINGLES[0]


@BOTH_WAYS
def test_one_byte_of_the_data_is_wrong_at_the_rate_asked_for(way):
    sent = flat(TRIPLES)
    arrived = way(CanFaultyLink, CanFaultKnobs(corrupt=0.4), TRIPLES)
    spoiled = 0
    for one, other in zip(map(unpack, arrived), map(unpack, sent), strict=True):
        assert one.identifier == other.identifier
        assert one.extended
        wrong = differing(one.data, other.data)
        assert wrong <= 1
        spoiled += wrong
    assert spoiled / len(sent) == pytest.approx(0.4, abs=0.03)


@BOTH_WAYS
def test_frames_are_lost_and_doubled_at_the_rate_asked_for(way):
    lossy = way(CanFaultyLink, CanFaultKnobs(loss=0.3), SINGLES)
    assert 1 - len(lossy) / COUNT == pytest.approx(0.3, abs=0.04)
    doubled = way(CanFaultyLink, CanFaultKnobs(duplicate=0.3), SINGLES)
    assert len(doubled) / COUNT - 1 == pytest.approx(0.3, abs=0.04)


@BOTH_WAYS
def test_the_same_seed_spoils_the_same_frames(way):
    knobs = CanFaultKnobs(**dict.fromkeys(KNOBS, 0.2), delay=0.01)
    once, again, other = (way(CanFaultyLink, knobs, TRIPLES[:200], seed) for seed in (7, 7, 8))
    assert once == again != other


@pytest.mark.parametrize("name", KNOBS)
def test_what_is_no_frame_of_a_transfer_passes_untouched(name):
    """An error frame is said by the controller at hand, and never was on the bus."""
    others = [
        pack(CanFrame(ERROR_BUS_OFF, bytes(8), extended=False, error=True)),
        pack(CanFrame(0x123, b"\xc0", extended=False)),
        pack(CanFrame(0x123, b"", extended=True, remote=True)),
        pack(CanFrame(0x12345, b"")),
        b"no frame",
        b"",
    ]
    assert pass_in(CanFaultyLink, CanFaultKnobs(**{name: 1.0}), [others]) == others


@pytest.mark.parametrize("name", KNOBS)
@pytest.mark.parametrize("value", [-0.1, 1.1, math.nan, math.inf])
def test_what_is_no_probability_is_named(name, value):
    with pytest.raises(ParameterError, match=f"{name} is {value}: need 0 to 1"):
        CanFaultKnobs(**{name: value})


@pytest.mark.parametrize("value", [-1.0, 61.0, math.nan])
def test_what_is_no_delay_is_named(value):
    with pytest.raises(ParameterError, match=f"delay is {value}: need 0 to 60 s"):
        CanFaultKnobs(delay=value)
