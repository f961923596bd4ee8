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
    Transfer,
    TransferKind,
    frames_of,
)

OWN = 10
STATUS = "flyfire.ParachuteStatus"
CRC = "CRC of a transfer wrong (or another definition of its type)"


def test_the_librarys_frames_become_the_transfer():
    for vector in VECTORS:
        ear = Ear()
        data_type = types().find(vector.name, vector.mode)
        frames = [pack(one) for one in vector.can_frames]
        came = ear.hear(frames, node_id=vector.destination or OWN)
        assert came == [vector.transfer(data_type.id)], vector.story
        assert ear.counts == {}, vector.story


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
    transfer = Transfer(
        TransferKind.MESSAGE, data_type.id, source, 0, transfer_id, payload, priority
    )
    return transfer, [pack(one) for one in frames_of(transfer, data_type.base_crc)]


def information(source=33, transfer_id=0, length=50):
    """A GetNodeInfo response to us: eight frames."""
    data_type = types().response(GET_NODE_INFO)
    payload = bytes(index * 7 & 0xFF for index in range(length))
    transfer = Transfer(TransferKind.RESPONSE, data_type.id, source, OWN, transfer_id, payload)
    return transfer, [pack(one) for one in frames_of(transfer, data_type.base_crc)]


def single(source=33, transfer_id=0, payload=bytes(7)):
    """A NodeStatus: one frame."""
    transfer = Transfer(TransferKind.MESSAGE, 341, source, 0, transfer_id, payload)
    return transfer, [pack(one) for one in frames_of(transfer, 0)]


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


#: Reason -> frames that end with it at once.
DROPPED = {
    "no CAN frame": [b"", bytes(15), raw(1, "")[:4] + b"\x09" + bytes(11)],
    "frames that are not of DroneCAN": [
        pack(CanFrame(0x123, b"\xc0", extended=False)),
        pack(CanFrame(0x10015521, b"\xc0", remote=True)),
    ],
    "frames without a tail byte": [raw(0x10015521, "")],
    "services from or to nobody": [raw(n, "5046505505c0") for n in (0x10A38A80, 0x10A300A1)],
    "transfers of unknown types": [raw(0x10FFFF21, "00c0"), raw(0x10FF8AA1, "00c0")],
    "anonymous transfers of more than one frame": [
        raw(0x1048D100, "4300010203040580"),
        raw(0x1048D100, "43000102030405e0"),
    ],
    "toggle bit wrong": [raw(0x10015521, "00000000000000e0")],
}


@pytest.mark.parametrize("reason", DROPPED)
def test_each_frame_that_is_none_of_a_transfer_ends_with_its_reason(reason):
    for frame in DROPPED[reason]:
        ear = Ear()
        assert ear.hear([frame]) == []
        assert ear.counts == {reason: 1}


def test_what_is_doubled_late_or_cut_short_comes_out_once_or_not_at_all():
    (one, frame), (two, pair), (info, eight) = single(), status(source=34), information()
    singles = [single(transfer_id=number) for number in range(3)]
    (first, a), (second, b), (third, c) = singles
    (_, old), (before, whole), (newer, last) = (status(transfer_id=n) for n in (4, 5, 6))
    (late, late_eight), (next_one, next_eight) = (information(transfer_id=n) for n in (4, 5))
    beginning = "frames without their beginning"
    for story, frames, came, counts in (
        ("twice", [*frame, *frame], [one], {"duplicate transfers": 1}),
        ("two frames twice", pair * 2, [two], {"duplicate transfers": 1, beginning: 1}),
        (
            "each frame twice",
            [frame for frame in eight for _ in "ab"],
            [info],
            {"toggle bit wrong": 6, beginning: 1},
        ),
        ("older", [*a, *b, *a, *c, *b], [first, second, third], {"duplicate transfers": 2}),
        (
            "overtaken within the newer",
            [*whole, last[0], *old, *last[1:]],
            [before, newer],
            {"messages that a newer one has overtaken": 1, beginning: 1},
        ),
        ("overtaken answer", [*next_eight, *late_eight], [next_one, late], {}),
        (
            "cut short by the next",
            [*late_eight[:4], *next_eight, *late_eight[4:]],
            [next_one],
            {"transfers cut short": 1, beginning: 4},
        ),
    ):
        ear = Ear()
        assert ear.hear(frames, 1.0) == came, story
        assert ear.counts == counts, story


def test_an_id_that_comes_round_again_is_new_after_the_time_out_or_after_others():
    ear = Ear()
    transfer, frames = information()
    assert ear.hear(frames, 0.0) == [transfer]
    assert ear.hear(frames, 1.999) == []
    assert ear.hear(frames, 2.0) == [transfer]
    # Of a NodeStatus, sooner: two nodes may count in step.
    transfer, frames = single()
    assert ear.hear(frames, 0.0) == [transfer]
    assert ear.hear(frames, 0.099) == []
    assert ear.hear(frames, 0.1) == [transfer]
    # A sender at 100 Hz is through its 32 ids in a third of a second.
    sent = [single(transfer_id=index % TRANSFER_IDS) for index in range(100)]
    heard = [ear.hear(frames, 10.0 + index / 100) for index, (_, frames) in enumerate(sent)]
    assert heard == [[transfer] for transfer, _ in sent]


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


def test_a_device_that_restarted_and_counts_from_0_again_is_heard():
    ear = Ear()
    for number in (0, 1, 2, 4, 5, 6):
        assert len(ear.hear(single(transfer_id=number % 4)[1], number / 10)) == 1
    assert ear.counts == {}
    ear = Ear()
    before, frames = single(payload=b"before!")
    after, again = single(payload=b"anew...")
    assert ear.hear(frames, 0.0) == [before]
    assert ear.hear([*again, *again], 0.1) == [after], "the same id, but something new"
    assert ear.counts == {"duplicate transfers": 1}


def test_a_lost_frame_loses_its_transfer_and_not_the_next():
    for lost in range(8):
        ear = Ear()
        _, frames = information(transfer_id=0)
        next_one, next_frames = information(transfer_id=1, length=48)
        assert ear.hear([*frames[:lost], *frames[lost + 1 :], *next_frames]) == [next_one]
        assert sum(ear.counts.values()) > 0


def test_a_pause_between_two_frames_that_is_too_long_ends_a_transfer():
    # A transfer that pauses too long is given up.
    ear = Ear()
    _, frames = status()
    assert ear.hear(frames[:1], 0.0) == []
    assert ear.hear(frames[1:], 2.0) == []
    assert ear.counts == {"frames without their beginning": 1}
    # The same id again is a new transfer, and the old one was cut short.
    assert len(ear.hear(frames, 2.5)) == 1
    assert ear.counts["transfers cut short"] == 1
    # The pause is between two frames however long it all takes.
    ear = Ear()
    transfer, frames = information()
    came = [ear.hear([frame], index * 1.9) for index, frame in enumerate(frames)]
    assert came == [[]] * 7 + [[transfer]]


def test_a_first_frame_that_is_not_full_and_a_transfer_of_one_frame():
    # A first frame that is not full.
    ear = Ear()
    _, frames = status()
    assert ear.hear([frames[0], raw(0x10067F21, "1bbb81"), frames[1]]) != []
    assert ear.counts == {"first frame too short": 1}
    # A transfer of one frame cuts short as well.
    ear = Ear()
    _, frames = status(transfer_id=0)
    (after,) = ear.hear([frames[0], raw(0x10067F21, "0000c1"), frames[1]])
    assert (after.transfer_id, after.payload) == (1, b"\0\0")
    assert ear.counts == {"transfers cut short": 1, "frames without their beginning": 1}


def test_a_wrong_crc_is_damage_or_another_definition_of_the_type():
    ear = Ear()
    transfer, frames = status()
    bad = bytearray(frames[1])
    bad[8] ^= 1
    assert ear.hear([frames[0], bytes(bad)]) == []
    other = frames_of(transfer, types().message(STATUS).base_crc ^ 1)
    assert ear.hear([pack(one) for one in other]) == []
    assert ear.counts == {CRC: 2}
    assert ear.hear(frames) == [transfer], "the same id sent again"


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


def test_a_transfer_that_cannot_be_is_the_callers_mistake():
    message, request, response = TransferKind.MESSAGE, TransferKind.REQUEST, TransferKind.RESPONSE
    for why, *transfer in (
        ("one frame", message, 1, 0, 0, 0, bytes(8)),
        ("0 to 3", message, 341, 0, 0, 0, bytes(7)),
        ("0 to 65535", message, 0x10000, 5, 0, 0, b""),
        ("0 to 127", message, 341, 128, 0, 0, b""),
        ("0 to 0", message, 341, 5, 7, 0, b""),
        ("0 to 31", message, 341, 5, 0, 0, b"", 32),
        ("0 to 31", message, 341, 5, 0, 0, b"", -1),
        ("1 to 127", request, 163, 0, 33, 0, b""),
        ("1 to 127", request, 163, 5, 0, 0, b""),
        ("1 to 127", response, 163, 5, 128, 0, b""),
        ("0 to 255", response, 256, 5, 33, 0, b""),
    ):
        with pytest.raises(MessageError, match=why):
            pytest.fail(f"sent: {frames_of(Transfer(*transfer), 0)}")


def test_a_flood_of_made_up_senders_and_types_does_not_grow_it_and_silences_nobody():
    numbers = [one.id for one in types()._by_id.values() if not one.is_service]
    made_up = [
        raw(16 << 24 | number << 8 | source, "00" * 7 + "80")
        for source in range(40, 128)
        for number in numbers
    ]
    ear, (transfer, frames) = Ear(), information()
    step = len(made_up) // len(frames)
    mixed = []
    for index, frame in enumerate(frames):
        mixed += [frame, *made_up[index * step : (index + 1) * step]]
    assert step < MOST_SESSIONS < len(made_up)
    assert ear.hear(mixed) == [transfer]
    assert len(ear.assembler._sessions) == MOST_SESSIONS


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
    kind = data.draw(st.sampled_from(TransferKind))
    data_type = {
        TransferKind.MESSAGE: types().message(NODE_STATUS),
        TransferKind.REQUEST: types().request(GET_NODE_INFO),
        TransferKind.RESPONSE: types().response(GET_NODE_INFO),
    }[kind]
    to = 0 if kind is TransferKind.MESSAGE else OWN
    priority = data.draw(st.integers(0, 31))
    transfer = Transfer(kind, data_type.id, source, to, transfer_id, payload, priority)
    frames = frames_of(transfer, data_type.base_crc)
    assert Ear().hear([pack(one) for one in frames]) == [transfer]
    assert len(frames) == (1 if len(payload) <= 7 else -(-(len(payload) + 2) // 7))


def test_an_anonymous_message_says_the_low_bits_of_its_type_and_the_discriminator():
    data_type = types().message(ALLOCATION)
    transfer = Transfer(TransferKind.MESSAGE, data_type.id, 0, 0, 3, b"\1" + UID[:6], 30)
    (frame,) = frames_of(transfer, data_type.base_crc, 0xFFFF)
    assert frame == CanFrame(30 << 24 | 0x3FFF << 10 | 1 << 8, b"\1" + UID[:6] + b"\xc3")
    assert Ear().hear([pack(frame)]) == [transfer]
