"""Transfers out of frames: the whole ones come out once, and every other has its reason."""

import random
from collections import Counter

import pytest
from dronecan_bench import ALLOCATION, GET_NODE_INFO, NODE_STATUS, UID, raw, types
from dronecan_vectors import VECTORS
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import MessageError
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack
from chute_ros.protocol.dronecan.transfer import (
    MOST_PAYLOAD,
    MOST_SESSIONS,
    TRANSFER_IDS,
    Assembler,
    Kind,
    Transfer,
    frames_of,
)

OWN = 10
STATUS = "flyfire.ParachuteStatus"
CRC = "CRC of a transfer wrong (or another definition of its type)"
STORIES = [pytest.param(one, id=one.story) for one in VECTORS]


class Ear:
    """An assembler of node 10."""

    def __init__(self):
        self.counts = Counter()
        self.assembler = Assembler(types(), self.counts)

    def hear(self, frames, now=0.0, node_id=OWN):
        """What came out of these frames."""
        came = [self.assembler.feed(frame, node_id, now) for frame in frames]
        return [one for one in came if one is not None]


def status(source=33, transfer_id=0, payload=bytes(8), priority=16):
    """A ParachuteStatus: two frames, packed."""
    data_type = types().message(STATUS)
    transfer = Transfer(Kind.MESSAGE, data_type.id, source, 0, transfer_id, payload, priority)
    return transfer, [pack(one) for one in frames_of(transfer, data_type.base_crc)]


def information(source=33, transfer_id=0, length=50):
    """A GetNodeInfo response to us: eight frames."""
    data_type = types().response(GET_NODE_INFO)
    payload = bytes(index * 7 & 0xFF for index in range(length))
    transfer = Transfer(Kind.RESPONSE, data_type.id, source, OWN, transfer_id, payload)
    return transfer, [pack(one) for one in frames_of(transfer, data_type.base_crc)]


def single(source=33, transfer_id=0, payload=bytes(7)):
    """A NodeStatus: one frame."""
    transfer = Transfer(Kind.MESSAGE, 341, source, 0, transfer_id, payload)
    return transfer, [pack(one) for one in frames_of(transfer, 0)]


# -- whole ones ---------------------------------------------------------------------------------


@pytest.mark.parametrize("vector", STORIES)
def test_the_librarys_frames_become_the_transfer(vector):
    ear = Ear()
    data_type = types().find(vector.name, vector.mode)
    frames = [pack(one) for one in vector.can_frames]
    came = ear.hear(frames, node_id=vector.destination or OWN)
    assert came == [vector.transfer(data_type.id)]
    assert ear.counts == {}


def test_a_service_between_others_is_not_for_us_and_nothing_is_wrong_with_it():
    ear = Ear()
    _, frames = information()
    assert ear.hear(frames, node_id=11) == []
    assert ear.counts == {}


def test_an_error_of_the_bus_is_handed_out_as_it_is():
    error = CanFrame(0x40, bytes(8), extended=False, error=True)
    assert Ear().hear([pack(error)]) == [error]


def test_transfers_of_many_senders_in_between_each_other():
    ear = Ear()
    pairs = [information(source) for source in range(1, 9)]
    mixed = [
        frame for group in zip(*[frames for _, frames in pairs], strict=True) for frame in group
    ]
    assert ear.hear(mixed) == [transfer for transfer, _ in pairs]


# -- every reason -------------------------------------------------------------------------------


def test_sixteen_other_bytes():
    ear = Ear()
    assert ear.hear([b"", bytes(15), raw(1, "")[:4] + b"\x09" + bytes(11)]) == []
    assert ear.counts == {"no CAN frame": 3}


def test_frames_of_other_protocols():
    ear = Ear()
    standard = pack(CanFrame(0x123, b"\xc0", extended=False))
    remote = pack(CanFrame(0x10015521, b"\xc0", remote=True))
    assert ear.hear([standard, remote]) == []
    assert ear.counts == {"frames that are not of DroneCAN": 2}


def test_a_frame_without_a_tail_byte():
    ear = Ear()
    assert ear.hear([raw(0x10015521, "")]) == []
    assert ear.counts == {"frames without a tail byte": 1}


@pytest.mark.parametrize("identifier", [0x10A38A80, 0x10A300A1], ids=["from", "to"])
def test_services_from_or_to_nobody(identifier):
    ear = Ear()
    assert ear.hear([raw(identifier, "5046505505c0")]) == []
    assert ear.counts == {"services from or to nobody": 1}


def test_types_that_are_not_known():
    ear = Ear()
    assert ear.hear([raw(0x10FFFF21, "00c0"), raw(0x10FF8AA1, "00c0")]) == []
    assert ear.counts == {"transfers of unknown types": 2}


def test_an_anonymous_transfer_has_one_frame():
    ear = Ear()
    start, other = raw(0x1048D100, "4300010203040580"), raw(0x1048D100, "43000102030405e0")
    assert ear.hear([start, other]) == []
    assert ear.counts == {"anonymous transfers of more than one frame": 2}


def test_a_transfer_that_came_twice():
    ear = Ear()
    for transfer, frames in (single(), status(source=34)):
        assert ear.hear([*frames, *frames], 1.0) == [transfer]
    assert ear.counts == {"duplicate transfers": 2, "frames without their beginning": 1}


def test_a_frame_that_came_twice_within_its_transfer():
    ear = Ear()
    transfer, frames = information()
    assert ear.hear([frame for frame in frames for _ in "ab"]) == [transfer]
    assert ear.counts == {"toggle bit wrong": 6, "frames without their beginning": 1}


def test_an_id_that_comes_round_again_is_new_after_the_time_out_or_after_others():
    ear = Ear()
    transfer, frames = single()
    assert ear.hear(frames, 0.0) == [transfer]
    assert ear.hear(frames, 1.999) == []
    assert ear.hear(frames, 2.0) == [transfer]
    # A sender at 100 Hz is through its 32 ids in a third of a second.
    sent = [single(transfer_id=index % TRANSFER_IDS) for index in range(100)]
    heard = [ear.hear(frames, 10.0 + index / 100) for index, (_, frames) in enumerate(sent)]
    assert heard == [[transfer] for transfer, _ in sent]


def test_an_older_transfer_that_is_late_once_more_does_not_count_twice():
    ear = Ear()
    first, second, third = (single(transfer_id=number)[1] for number in range(3))
    assert len(ear.hear([*first, *second, *first, *third, *second], 0.5)) == 3
    assert ear.counts == {"duplicate transfers": 2}


@pytest.mark.parametrize("newest", [2, 8, 31, 0, 1])
@pytest.mark.parametrize(("behind", "heard"), [(1, 0), (8, 0), (9, 1), (31, 1)])
def test_a_message_that_a_newer_one_has_overtaken_is_no_news(newest, behind, heard):
    ear = Ear()
    assert len(ear.hear(status(transfer_id=newest)[1], 10.0)) == 1
    late = status(transfer_id=(newest - behind) % TRANSFER_IDS)[1]
    assert len(ear.hear(late, 10.099)) == heard
    dropped = {"messages that a newer one has overtaken": 1, "frames without their beginning": 1}
    assert ear.counts == ({} if heard else dropped)
    if not heard:
        assert len(ear.hear(late, 10.101)) == 1, "who restarted is heard from then on"


def test_each_node_status_is_heard_as_two_nodes_may_have_one_id():
    ear = Ear()
    for n in range(20):
        one, another = (20 + n) % TRANSFER_IDS, (15 + n) % TRANSFER_IDS
        assert len(ear.hear(single(transfer_id=one)[1], 10.0 + n)) == 1
        assert len(ear.hear(single(transfer_id=another)[1], 10.05 + n)) == 1
    assert ear.counts == {}


def test_an_overtaken_message_of_several_frames_does_not_end_the_newer_one():
    ear = Ear()
    _, old = status(transfer_id=4)
    before, whole = status(transfer_id=5)
    newer, frames = status(transfer_id=6)
    assert ear.hear([*whole, frames[0], *old, *frames[1:]], 1.0) == [before, newer]


def test_an_overtaken_answer_counts_all_the_same():
    ear = Ear()
    newer, older = (information(transfer_id=number) for number in (5, 4))
    assert ear.hear([*newer[1], *older[1]], 1.0) == [newer[0], older[0]]


def test_a_device_that_restarted_and_counts_from_0_again_is_heard():
    ear = Ear()
    for number in range(3):
        assert len(ear.hear(single(transfer_id=number)[1], number / 10)) == 1
    for number in range(3):
        assert len(ear.hear(single(transfer_id=number)[1], 0.4 + number / 10)) == 1
    assert ear.counts == {}


def test_a_device_that_restarts_at_once_with_the_same_id_is_heard_if_it_says_something_new():
    ear = Ear()
    before, frames = single(payload=b"before!")
    after, again = single(payload=b"anew...")
    assert ear.hear(frames, 0.0) == [before]
    assert ear.hear([*again, *again], 0.1) == [after]
    assert ear.counts == {"duplicate transfers": 1}


def test_a_lost_frame_loses_its_transfer_and_not_the_next():
    for lost in range(8):
        ear = Ear()
        _, frames = information(transfer_id=0)
        next_one, next_frames = information(transfer_id=1, length=48)
        assert ear.hear([*frames[:lost], *frames[lost + 1 :], *next_frames]) == [next_one]
        assert sum(ear.counts.values()) > 0


def test_a_transfer_cut_short_by_the_next():
    ear = Ear()
    _, frames = information(transfer_id=0)
    next_one, next_frames = information(transfer_id=1)
    assert ear.hear([*frames[:4], *next_frames, *frames[4:]]) == [next_one]
    assert ear.counts == {"transfers cut short": 1, "frames without their beginning": 4}


def test_a_transfer_of_one_frame_cuts_short_as_well():
    ear = Ear()
    _, frames = status(transfer_id=0)
    (after,) = ear.hear([frames[0], raw(0x10067F21, "0000c1"), frames[1]])
    assert (after.transfer_id, after.payload) == (1, b"\0\0")
    assert ear.counts == {"transfers cut short": 1, "frames without their beginning": 1}


def test_a_transfer_that_pauses_too_long_is_given_up():
    ear = Ear()
    _, frames = status()
    assert ear.hear(frames[:1], 0.0) == []
    assert ear.hear(frames[1:], 2.0) == []
    assert ear.counts == {"frames without their beginning": 1}
    # The same id again is a new transfer, and the old one was cut short.
    assert len(ear.hear(frames, 2.5)) == 1
    assert ear.counts["transfers cut short"] == 1


def test_the_pause_is_between_two_frames_however_long_it_all_takes():
    ear = Ear()
    transfer, frames = information()
    came = [ear.hear([frame], index * 1.9) for index, frame in enumerate(frames)]
    assert came == [[]] * 7 + [[transfer]]


def test_the_beginning_of_a_transfer_starts_with_the_toggle_at_0():
    ear = Ear()
    assert ear.hear([raw(0x10015521, "00000000000000e0")]) == []
    assert ear.counts == {"toggle bit wrong": 1}


def test_a_first_frame_that_is_not_full():
    ear = Ear()
    _, frames = status()
    assert ear.hear([frames[0], raw(0x10067F21, "1bbb81"), frames[1]]) != []
    assert ear.counts == {"first frame too short": 1}


def test_a_wrong_crc_and_the_same_id_sent_again():
    ear = Ear()
    transfer, frames = status()
    bad = bytearray(frames[1])
    bad[8] ^= 1
    assert ear.hear([frames[0], bytes(bad)]) == []
    assert ear.counts == {CRC: 1}
    assert ear.hear(frames) == [transfer]


def test_another_definition_of_the_type_shows_as_a_wrong_crc():
    ear = Ear()
    data_type = types().message(STATUS)
    frames = frames_of(Transfer(Kind.MESSAGE, 1663, 33, 0, 0, bytes(8)), data_type.base_crc ^ 1)
    assert ear.hear([pack(one) for one in frames]) == []
    assert ear.counts == {CRC: 1}


def test_a_transfer_without_an_end():
    ear = Ear()
    ear.hear([raw(0x10067F21, "00" * 7 + "80")])
    toggles = ("20", "00")
    frames = [raw(0x10067F21, "00" * 7 + toggles[index % 2]) for index in range(100)]
    assert ear.hear(frames) == []
    needed = (MOST_PAYLOAD - 5) // 7
    assert ear.counts == {
        "transfers that are too long": 1,
        "frames without their beginning": 100 - needed - 1,
    }


def test_every_type_fits_into_what_is_put_together():
    for data_type in types()._by_id.values():
        kind = data_type._type
        longest = (
            max(kind.get_max_bitlen_request(), kind.get_max_bitlen_response())
            if data_type.is_service
            else kind.get_max_bitlen()
        )
        assert longest <= 8 * MOST_PAYLOAD


# -- what a caller cannot send ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("transfer", "why"),
    [
        (Transfer(Kind.MESSAGE, 1, 0, 0, 0, bytes(8)), "one frame"),
        (Transfer(Kind.MESSAGE, 341, 0, 0, 0, bytes(7)), "0 to 3"),
        (Transfer(Kind.MESSAGE, 0x10000, 5, 0, 0, b""), "0 to 65535"),
        (Transfer(Kind.MESSAGE, 341, 128, 0, 0, b""), "0 to 127"),
        (Transfer(Kind.MESSAGE, 341, 5, 7, 0, b""), "0 to 0"),
        (Transfer(Kind.MESSAGE, 341, 5, 0, 0, b"", 32), "0 to 31"),
        (Transfer(Kind.MESSAGE, 341, 5, 0, 0, b"", -1), "0 to 31"),
        (Transfer(Kind.REQUEST, 163, 0, 33, 0, b""), "1 to 127"),
        (Transfer(Kind.REQUEST, 163, 5, 0, 0, b""), "1 to 127"),
        (Transfer(Kind.RESPONSE, 163, 5, 128, 0, b""), "1 to 127"),
        (Transfer(Kind.RESPONSE, 256, 5, 33, 0, b""), "0 to 255"),
    ],
    ids=str,
)
def test_a_transfer_that_cannot_be_is_the_callers_mistake(transfer, why):
    with pytest.raises(MessageError, match=why):
        frames_of(transfer, 0)


# -- whatever comes -----------------------------------------------------------------------------


def test_a_flood_of_made_up_senders_and_types_does_not_grow_it():
    ear = Ear()
    ids = [one.id for one in types()._by_id.values() if not one.is_service]
    start = bytes(7) + b"\x80"
    for number in ids:
        for source in range(1, 128):
            ear.hear([pack(CanFrame(16 << 24 | number << 8 | source, start))])
    assert len(ids) * 127 > MOST_SESSIONS
    assert len(ear.assembler._sessions) == MOST_SESSIONS


def test_a_device_that_speaks_on_during_a_flood_is_heard():
    ear = Ear()
    numbers = [one.id for one in types()._by_id.values() if not one.is_service]
    made_up = [
        raw(16 << 24 | number << 8 | source, "00" * 7 + "80")
        for source in range(40, 128)
        for number in numbers
    ]
    transfer, frames = information()
    step = len(made_up) // len(frames)
    mixed = []
    for index, frame in enumerate(frames):
        mixed += [frame, *made_up[index * step : (index + 1) * step]]
    assert step < MOST_SESSIONS < len(made_up)
    assert ear.hear(mixed) == [transfer]


KNOWN = st.sampled_from([one.id for one in types()._by_id.values()])
IDENTIFIER = st.one_of(
    st.integers(0, 0x1FFFFFFF),
    st.builds(lambda number, source: 16 << 24 | number << 8 | source, KNOWN, st.integers(0, 127)),
    st.builds(
        lambda number, request, source: (
            16 << 24 | number << 16 | request << 15 | OWN << 8 | 0x80 | source
        ),
        KNOWN.filter(lambda number: number < 256),
        st.booleans(),
        st.integers(0, 127),
    ),
)
FRAME = st.builds(CanFrame, IDENTIFIER, st.binary(max_size=8)).map(pack)


@given(
    st.lists(st.tuples(FRAME | st.binary(min_size=16, max_size=16), st.floats(0, 3)), max_size=40),
    st.sampled_from([0, OWN]),
)
def test_any_bytes_never_raise_and_each_frame_ends_somewhere(steps, node_id):
    ear, now = Ear(), 0.0
    for data, pause in steps:
        now += pause
        ear.hear([data], now, node_id)
    assert sum(ear.counts.values()) <= len(steps) * 2


@given(st.integers(0, 2**32), st.floats(0.0, 0.3), st.integers(1, 6))
def test_what_comes_out_of_lost_doubled_and_reordered_frames_was_sent_and_comes_once(
    seed, trouble, senders
):
    """Each sender has up to 30 transfers under way, within the time-out."""
    chance = random.Random(seed)
    queue, sent = [], []
    for source in range(1, senders + 1):
        at = 0.0
        for number in range(chance.randint(1, 30)):
            payload = bytes(chance.randrange(256) for _ in range(chance.choice([8, 8, 20, 50])))
            make = chance.choice([status, single])
            if make is single:
                transfer, frames = single(source, number, payload[:7])
            else:
                transfer, frames = status(source, number, payload)
            sent.append(transfer)
            for frame in frames:
                at += 0.01
                if chance.random() < trouble:
                    continue
                # Late by up to a few frames of the same sender.
                queue.append((at + 0.05 * trouble * chance.random(), len(queue), frame))
                if chance.random() < trouble:
                    queue.append((at + 0.05 * chance.random(), len(queue), frame))
    ear = Ear()
    came = [one for at, _, frame in sorted(queue) for one in ear.hear([frame], at / 10)]
    assert all(one in sent for one in came)
    keys = [(one.type_id, one.source, one.transfer_id) for one in came]
    assert len(set(keys)) == len(keys)
    if trouble == 0.0:
        assert sorted(map(repr, came)) == sorted(map(repr, sent))


@given(st.binary(max_size=MOST_PAYLOAD), st.integers(0, 31), st.integers(1, 127), st.data())
def test_every_transfer_arrives_as_it_was_sent(payload, transfer_id, source, data):
    kind = data.draw(st.sampled_from(Kind))
    data_type = {
        Kind.MESSAGE: types().message(NODE_STATUS),
        Kind.REQUEST: types().request(GET_NODE_INFO),
        Kind.RESPONSE: types().response(GET_NODE_INFO),
    }[kind]
    to = 0 if kind is Kind.MESSAGE else OWN
    priority = data.draw(st.integers(0, 31))
    transfer = Transfer(kind, data_type.id, source, to, transfer_id, payload, priority)
    frames = frames_of(transfer, data_type.base_crc)
    assert Ear().hear([pack(one) for one in frames]) == [transfer]
    assert len(frames) == (1 if len(payload) <= 7 else -(-(len(payload) + 2) // 7))


def test_an_anonymous_message_says_the_low_bits_of_its_type_and_the_discriminator():
    data_type = types().message(ALLOCATION)
    transfer = Transfer(Kind.MESSAGE, data_type.id, 0, 0, 3, b"\1" + UID[:6], 30)
    (frame,) = frames_of(transfer, data_type.base_crc, 0xFFFF)
    assert frame == CanFrame(30 << 24 | 0x3FFF << 10 | 1 << 8, b"\1" + UID[:6] + b"\xc3")
    assert Ear().hear([pack(frame)]) == [transfer]
