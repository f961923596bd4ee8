"""Node ids for those that have none: given out once, kept before they are told, never doubled."""

import pytest
from dronecan_bench import ALLOCATION, NODE_STATUS, OWN, UID, Bench, information, raw, shown
from hypothesis import given, settings
from hypothesis import strategies as st

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.allocation import HIGHEST, LOWEST, Allocator

OTHER = bytes(range(100, 116))
NEVER = (OWN, 33, 34)


class Desk:
    """An allocator on a bus where everybody is known, whose tables are kept at once."""

    def __init__(self, table=None, never=NEVER, keep=True):
        self.allocator = Allocator(table or {}, never)
        self.in_use = {OWN: UID}
        self.all_discovered = True
        self.keep = keep
        self.kept = []
        self.now = 0.0

    def part(self, part, first=False, node_id=0, source=0):
        """One part of a request comes; what is answered."""
        values = {"unique_id": part, "first_part_of_unique_id": first, "node_id": node_id}
        allocator = self.allocator
        allocator.heard(source, values, self.in_use, self.all_discovered, self.now)
        self.kept += allocator.take_keep()
        answers = allocator.take_answers()
        if self.keep and self.kept:
            allocator.kept(self.kept[-1].number)
            answers += allocator.take_answers()
        return [(one["unique_id"], one["node_id"]) for one in answers]

    def ask(self, unique_id, node_id=0):
        """All three parts; the id that was given, or None."""
        self.part(unique_id[:6], True, node_id)
        self.part(unique_id[6:12], False, node_id)
        answers = self.part(unique_id[12:], False, node_id)
        given_ids = [number for answered, number in answers if answered == unique_id]
        return given_ids[0] if given_ids else None


def asking(bench):
    """The three anonymous frames of a node without an id, one after the other."""
    for data in ("01000102030405c0", "00060708090a0bc1", "000c0d0e0fc2"):
        bench.feed(raw(0x1048D100, data))


def known(bench, node_id):
    """This node is on the bus, and has said who it is."""
    bench.hear(node_id, NODE_STATUS, uptime_sec=100)
    (question,) = bench.requests("uavcan.protocol.GetNodeInfo")
    return bench.answer(question, node_id, **information())


def test_golden_the_exchange_of_three_stages():
    bench = Bench(allocator=True).at(1.2).clear()
    asking(bench)
    # Each part is echoed with those before; and nothing yet after the third.
    assert shown(bench.frames) == [
        "1000010a#00000102030405c0",
        "1000010a#585d000001020381",
        "1000010a#0405060708090a21",
        "1000010a#0b41",
    ]
    (table,) = bench.tables()
    assert table.table == {UID: 125}
    bench.node.table_kept(table.number)
    bench.at(1.2)
    assert shown(bench.frames)[4:] == [
        "1000010a#8a68fa0001020382",
        "1000010a#0405060708090a22",
        "1000010a#0b0c0d0e0f42",
    ]
    assert bench.said(ALLOCATION)[-1][1] == {
        "unique_id": UID,
        "node_id": 125,
        "first_part_of_unique_id": False,
    }


def test_nobody_gets_an_id_before_the_bus_was_listened_to_and_all_have_said_who_they_are():
    bench = Bench(allocator=True).at(1.1)
    asking(bench)
    assert bench.tables() == []
    assert bench.node.allocator.refusal == "not every node has identified itself yet"
    asking(bench.at(1.9))
    assert len(bench.tables()) == 1
    bench = Bench(allocator=True).at(1.5).hear(40, NODE_STATUS, uptime_sec=100)
    asking(bench)
    assert bench.tables() == []
    (question,) = bench.requests("uavcan.protocol.GetNodeInfo")
    asking(bench.answer(question, 40, **information()))
    assert len(bench.tables()) == 1


def test_an_id_that_somebody_uses_is_not_given_out_nor_those_of_the_devices_as_delivered():
    bench = Bench(allocator=True, never=(124, 123)).at(1.5)
    asking(known(bench, 125))
    assert bench.tables()[0].table == {UID: 122}


def test_who_is_not_to_allocate_does_not():
    bench = Bench(allocator=False).at(1.5)
    asking(bench)
    assert bench.said(ALLOCATION) == []
    assert bench.hear(50, ALLOCATION, unique_id=OTHER).node.troubles() == []


def test_another_allocator_makes_ours_silent_and_is_told_of():
    bench = Bench(allocator=True).at(1.5).hear(50, ALLOCATION, unique_id=OTHER, node_id=7)
    (notice,) = bench.notices()
    assert notice.startswith("node 50 gives out node ids as well: switch one of the two off")
    asking(bench)
    assert bench.said(ALLOCATION) == []
    assert bench.node.allocator.refusal == "node 50 allocates as well"
    bench.at(11.6)
    assert bench.notices()[1:] == [f"resolved: {notice}"]
    asking(bench)
    assert len(bench.tables()) == 1


def test_each_part_is_echoed_with_those_before():
    desk = Desk()
    assert desk.part(OTHER[:6], True) == [(OTHER[:6], 0)]
    assert desk.part(OTHER[6:12]) == [(OTHER[:12], 0)]
    assert desk.part(OTHER[12:]) == [(OTHER, 125)]
    assert desk.allocator.refusal == ""


def test_a_known_unit_gets_its_old_id_without_anything_to_keep():
    desk = Desk({OTHER: 77})
    assert desk.ask(OTHER) == 77
    assert desk.ask(OTHER, 99) == 77
    assert desk.kept == []
    # It had the id until a moment ago, and is still thought to be there.
    desk.in_use[77] = OTHER
    assert desk.ask(OTHER) == 77


def test_a_known_unit_gets_another_id_if_its_own_is_in_use_or_not_to_be_given_out_any_more():
    for owner in (UID, b""):
        desk = Desk({OTHER: 77})
        desk.in_use[77] = owner
        assert desk.ask(OTHER) == 125, owner
        assert desk.kept[-1].table == {OTHER: 125}
    assert Desk({OTHER: 33}).ask(OTHER) == 125


def test_the_wanted_id_or_the_next_above_it_or_else_the_highest_below():
    given_ids = {0: 125, 50: 50, 33: 35, 34: 35, 10: 11, 125: 125, 126: 125, 127: 125}
    assert {wanted: Desk().ask(OTHER, wanted) for wanted in given_ids} == given_ids
    desk = Desk()
    desk.in_use |= {number: bytes(16) for number in range(60, 126)}
    assert desk.ask(OTHER, 100) == 59


def test_with_all_ids_taken_nobody_gets_one():
    taken = [number for number in range(LOWEST, HIGHEST + 1) if number not in NEVER]
    desk = Desk({bytes([number] * 16): number for number in taken})
    desk.in_use |= {number: bytes([number] * 16) for number in taken}
    assert desk.ask(OTHER) is None
    assert desk.allocator.refusal == "no node id is free"
    assert desk.kept == []
    assert desk.ask(bytes([44] * 16)) == 44
    assert desk.allocator.refusal == ""


def test_the_answer_waits_until_the_table_is_kept():
    desk = Desk(keep=False)
    assert desk.ask(OTHER) is None
    (table,) = desk.kept
    assert table.table == {OTHER: 125}
    desk.allocator.kept(table.number)
    assert [one["node_id"] for one in desk.allocator.take_answers()] == [125]
    desk.allocator.kept(table.number)
    assert desk.allocator.take_answers() == []


def test_a_table_that_could_not_be_kept_is_handed_out_again_and_nobody_answered():
    desk = Desk(keep=False)
    for _ in range(3):
        assert desk.ask(OTHER) is None
    assert [table.table for table in desk.kept] == [{OTHER: 125}] * 3
    assert len({table.number for table in desk.kept}) == 3
    desk.allocator.kept(desk.kept[1].number)
    assert [one["node_id"] for one in desk.allocator.take_answers()] == [125]
    assert desk.ask(OTHER) == 125


def test_a_later_table_keeps_what_was_in_the_earlier_ones():
    desk = Desk(keep=False)
    desk.ask(OTHER)
    desk.ask(UID)
    desk.allocator.kept(desk.kept[1].number)
    answers = {one["unique_id"]: one["node_id"] for one in desk.allocator.take_answers()}
    assert answers == {OTHER: 125, UID: 124}


def test_a_part_that_comes_too_late_starts_nothing():
    desk = Desk()
    desk.part(OTHER[:6], True)
    desk.now = 0.5
    assert desk.part(OTHER[6:12]) != []
    desk.now = 1.01
    assert desk.part(OTHER[12:]) == []
    assert desk.ask(OTHER) == 125


def test_a_part_of_another_length_is_not_answered():
    for story, *lengths in (
        ("first part too short", 5),
        ("second part too short", 6, 5),
        ("third part too long", 6, 6, 6),
        ("third part second", 6, 4),
        ("all at once", 16),
        ("nothing", 6, 0),
    ):
        desk = Desk()
        answers = [desk.part(bytes(length), n == 0) for n, length in enumerate(lengths)]
        assert answers[-1] == [], story
        assert desk.kept == []
    assert Desk().part(bytes(6), False) == [], "second part first"


def test_two_nodes_that_ask_in_between_each_other_get_two_ids():
    desk = Desk()
    assert desk.part(OTHER[:6], True) == [(OTHER[:6], 0)]
    assert desk.part(UID[:6], True) == [(UID[:6], 0)]
    # The first one hears that it is not being served and keeps quiet; the second goes on.
    assert desk.part(UID[6:12]) == [(UID[:12], 0)]
    assert desk.part(UID[12:]) == [(UID, 125)]
    assert desk.ask(OTHER) == 124


def test_a_table_that_nobody_can_have_kept_is_refused():
    for table in ({OTHER[:15]: 5}, {OTHER: 0}, {OTHER: 126}, {OTHER: 5, UID: 5}):
        with pytest.raises(ParameterError, match="table of node ids"):
            Allocator(table, NEVER)


def yielding(table=None):
    desk = Desk(table)
    desk.allocator = Allocator(table or {}, NEVER, yields=True)
    return desk


def asks_until(desk, end, every=0.8, unique_id=OTHER, answered_by=0):
    """A unit asks again and again; the id that we gave, or None. answered_by: who answers it."""
    while desk.now < end:
        given_id = desk.ask(unique_id)
        if given_id is not None:
            return given_id
        if answered_by:
            desk.part(unique_id[:6], source=answered_by)
        desk.now += every
    return None


def test_requests_that_nobody_else_answers_are_ours_after_two_seconds():
    desk = yielding()
    assert asks_until(desk, 1.9) is None
    assert desk.allocator.refusal == "waiting for another allocator to answer"
    assert asks_until(desk, 4.0) == 125
    assert (desk.allocator.refusal, desk.allocator.left_to) == ("", 0)
    assert desk.ask(UID) == 124, "at once from then on"


def test_an_allocator_that_answers_is_left_to_it_for_good_also_one_that_appears_later():
    # Given an autopilot that answers, an hour passes, and it answers again.
    desk = yielding()
    assert asks_until(desk, 60.0, answered_by=10) is None
    assert desk.allocator.left_to == 10
    desk.now += 3600.0
    assert asks_until(desk, desk.now + 60.0, answered_by=10) is None
    assert desk.allocator.left_to == 10
    assert desk.kept == []
    # An allocator that appears later is left to it.
    desk = yielding()
    assert asks_until(desk, 5.0) == 125
    desk.part(UID[:6], source=10)
    assert desk.allocator.left_to == 10
    assert desk.ask(UID) is None


def test_the_duty_is_taken_again_when_requests_go_unanswered_for_long():
    desk = yielding()
    asks_until(desk, 5.0, answered_by=10)
    desk.now = begin = 100.0
    assert asks_until(desk, begin + 9.9) is None
    assert desk.allocator.left_to == 10
    assert asks_until(desk, begin + 12.0) == 125
    assert desk.allocator.left_to == 0


def test_who_gives_out_the_ids_is_told_once_each_time_it_changes():
    bench = Bench(allocator=True, allocator_yields=True).at(1.5)
    for second in range(2, 8):
        asking(bench.at(float(second)))
        bench.hear(50, ALLOCATION, unique_id=UID[:6])
    assert bench.said(ALLOCATION) == []
    left = "node 50 gives out node ids, so this node does not (parameter allocator)"
    assert bench.notices() == [left]
    assert bench.node.troubles() == [], "it is no error, and forbids nothing"
    for second in range(20, 32):
        asking(bench.at(float(second)))
    again = "node 50 no longer answers requests for a node id: this node gives them out again"
    assert bench.notices() == [left, again]
    assert len(bench.tables()) >= 1


def stranger(number):
    return bytes([number % 256, number // 256]) * 8


def flood(desk, count, every):
    """So many units that were never seen before ask, one each every s; how many got an id."""
    got = 0
    for number in range(count):
        got += desk.ask(stranger(number)) is not None
        desk.allocator.update(desk.in_use, desk.now)
        desk.now += every
    return got


def test_ten_new_units_a_minute_get_an_id():
    desk = Desk()
    assert flood(desk, 200, 0.25) == 10
    assert desk.allocator.refusal == "more than 10 new units within 60 s"


def test_known_units_are_served_whoever_else_asks():
    desk = Desk({OTHER: 77})
    flood(desk, 200, 0.25)
    assert desk.ask(OTHER) == 77


def test_strangers_never_fill_the_table_and_true_devices_keep_theirs():
    """Given one device that was heard with its id, and a stranger each 6 s for ten hours."""
    desk = Desk()
    assert desk.ask(OTHER) == 125
    desk.in_use[125] = OTHER
    desk.allocator.update(desk.in_use, desk.now)
    flood(desk, 6000, 6.0)
    assert desk.allocator.refusal == ""
    assert len(desk.allocator.table) < 110
    del desk.in_use[125]  # switched off
    assert desk.ask(OTHER) == 125


def test_an_id_that_was_given_and_is_not_used_goes_back_after_ten_minutes():
    desk = Desk()
    desk.ask(OTHER)
    desk.now = 599.0
    desk.allocator.update(desk.in_use, desk.now)
    assert desk.allocator.table == {OTHER: 125}
    desk.now = 600.0
    desk.allocator.update(desk.in_use, desk.now)
    assert desk.allocator.table == {}
    assert desk.allocator.take_keep()[-1].table == {}


def test_where_no_id_is_left_the_unit_that_never_used_its_own_gives_way():
    ids = [number for number in range(LOWEST, HIGHEST + 1) if number not in NEVER]
    desk = Desk({stranger(number): number for number in ids})
    first, second = ids[:2]
    desk.in_use[first] = stranger(first)
    desk.allocator.update(desk.in_use, desk.now)
    del desk.in_use[first]
    assert desk.ask(OTHER) == second, "the first was heard, as it is kept, a moment ago"


def test_the_order_of_the_table_tells_who_used_its_id_last():
    desk = Desk({OTHER: 77, UID: 78})
    desk.in_use |= {77: OTHER}
    desk.allocator.update(desk.in_use, 0.0)
    desk.ask(stranger(1))
    assert list(desk.kept[-1].table) == [stranger(1), UID, OTHER]


UNITS = [bytes([number]) * 16 for number in range(1, 9)]
STEP = st.one_of(
    st.tuples(st.just("ask"), st.integers(0, 7), st.sampled_from([0, 5, 33, 124, 127])),
    st.tuples(st.just("use"), st.integers(118, 125), st.sampled_from([*UNITS, b""])),
    st.tuples(st.just("leave"), st.integers(118, 125)),
    st.tuples(st.just("keep")),
    st.tuples(
        st.just("part"),
        st.binary(max_size=16) | st.sampled_from([UNITS[0][:6], UNITS[1][:4]]),
        st.booleans(),
    ),
    st.tuples(st.just("wait"), st.sampled_from([0.1, 0.6])),
)


@settings(max_examples=200)
@given(st.lists(STEP, max_size=60))
def test_no_two_units_have_the_same_id_nor_one_that_is_in_use(steps):
    desk, promised = Desk(never=(*NEVER, 1), keep=False), {}

    def check(unique_id, node_id):
        if node_id:
            assert LOWEST <= node_id <= HIGHEST
            assert node_id not in (*NEVER, 1)
            assert desk.in_use_when_decided.get(node_id, unique_id) == unique_id
            assert any(table.table.get(unique_id) == node_id for table in desk.kept)
            promised[unique_id] = node_id
            assert len(set(promised.values())) == len(promised)

    for step, *what in steps:
        desk.in_use_when_decided = dict(desk.in_use)
        if step == "ask":
            unit = UNITS[what[0]]
            for part, first in ((unit[:6], True), (unit[6:12], False), (unit[12:], False)):
                for answer in desk.part(part, first, what[1]):
                    check(*answer)
        elif step == "use":
            desk.in_use[what[0]] = what[1]
        elif step == "leave":
            desk.in_use.pop(what[0], None)
        elif step == "keep" and desk.kept:
            desk.allocator.kept(desk.kept[-1].number)
            # Decided when it was asked for; the disk takes far less than a node to appear.
            desk.in_use_when_decided = {}
            for answer in desk.allocator.take_answers():
                check(answer["unique_id"], answer["node_id"])
        elif step == "part":
            for answer in desk.part(what[0], what[1]):
                check(*answer)
        elif step == "wait":
            desk.now += what[0]
    table = desk.allocator.table
    assert len(set(table.values())) == len(table)
