"""Who is on the bus: found, asked, restarted, doubled, gone."""

import math

from hypothesis import given
from hypothesis import strategies as st

from chute_ros.protocol.dronecan.node_monitor import NodeMonitor

UID = bytes(range(16))


def status(uptime, health=0):
    return {"uptime_sec": uptime, "health": health, "mode": 0, "vendor_specific_status_code": 7}


def info(unique_id=UID, name=b"org.test.parachute"):
    return {"hardware_version": {"unique_id": unique_id}, "name": name}


def speak(monitor, begin, end, booted, node_id=33, every=1.0):
    """Statuses of a node that was switched on at booted."""
    now = begin
    while now <= end:
        monitor.status(node_id, status(int(now - booted)), now)
        now += every
    return monitor


def met(node_id=33, uptime=5):
    """A monitor that heard this node at t+0, and who it is."""
    monitor = NodeMonitor()
    monitor.status(node_id, status(uptime), 0.0)
    monitor.information(node_id, info(), 0.0)
    return monitor


def test_a_restart_soon_after_the_start_is_a_restart_and_no_conflict():
    """Given a node that starts anew 3.4 s after its start, and tells whole seconds."""
    monitor = NodeMonitor()
    for start in (100.0, 103.4):
        for tick in range(34):
            now = start + tick * 0.1
            values = {"uptime_sec": int(now - start), "health": 0, "mode": 0}
            monitor.status(33, values | {"vendor_specific_status_code": 0}, now)
    assert monitor.take_restarted() == [33]
    assert monitor.conflicts(106.8) == []


def test_a_new_node_is_asked_who_it_is_and_known_once_it_answers():
    monitor = NodeMonitor()
    assert monitor.next_deadline() == math.inf
    assert monitor.all_discovered(0.0)
    monitor.status(33, status(100, health=1), 0.0)
    entry = monitor.get(33)
    assert entry.uptime == 100
    assert (entry.unique_id, entry.name, entry.discovered) == (b"", "", False)
    assert not monitor.all_discovered(0.0)
    assert monitor.to_ask(0.0) == [33]
    assert monitor.to_ask(0.0) == []
    monitor.information(33, info(), 0.1)
    assert (entry.unique_id, entry.name) == (UID, "org.test.parachute")
    assert monitor.all_discovered(0.1)
    assert monitor.next_deadline() == 1.0, "it is asked again: another may answer"
    assert monitor.to_ask(1.0) == [33]


def test_a_name_that_is_no_text_is_shown_as_far_as_it_is():
    monitor = met()
    monitor.information(33, info(name=b"a\xffb"), 0.0)
    assert monitor.get(33).name == "a\ufffdb"
    monitor = NodeMonitor()
    monitor.information(33, info(), 0.0)
    assert monitor.all() == [], "the answer of a node that is not there says nothing"


def test_a_node_that_never_tells_is_asked_five_times_and_taken_as_it_is():
    monitor, asked = NodeMonitor(), []
    for tick in range(100):
        now = tick / 10
        monitor.status(33, status(int(now)), now)
        asked += [now for _ in monitor.to_ask(now)]
        # After the fifth question it has the time for an answer.
        assert monitor.all_discovered(now) == (now >= 5.0)
    assert asked == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_restart_is_told_once_and_the_node_is_asked_again():
    monitor = NodeMonitor()
    speak(monitor, 0.0, 10.0, booted=-100.0)
    monitor.to_ask(10.0)
    monitor.information(33, info(), 10.0)
    speak(monitor, 12.0, 15.0, booted=11.5)
    assert monitor.take_restarted() == [33]
    assert monitor.take_restarted() == []
    entry = monitor.get(33)
    assert (entry.restarts, entry.information) == (1, None)
    assert monitor.to_ask(15.0) == [33]
    assert monitor.conflicts(15.0) == []


def test_a_node_that_only_counts_roughly_has_not_restarted():
    monitor = NodeMonitor()
    for now, uptime in ((0.0, 50), (1.0, 51), (2.0, 51), (2.9, 54), (3.9, 54), (4.9, 55)):
        monitor.status(33, status(uptime), now)
    assert monitor.take_restarted() == []
    assert monitor.conflicts(5.0) == []


def test_two_nodes_under_one_id_are_found_by_their_clocks():
    monitor = NodeMonitor()
    for tick in range(4):
        speak(monitor, tick, tick, booted=-100.0)
        assert monitor.conflicts(tick) == ([33] if tick else [])
        speak(monitor, tick + 0.5, tick + 0.5, booted=-7.0)
    # One of them goes: half a minute later nothing is wrong any more.
    speak(monitor, 4.0, 34.0, booted=-100.0)
    assert monitor.conflicts(33.9) == [33]
    assert monitor.conflicts(34.1) == []
    assert len(monitor.take_restarted()) <= 1


def test_two_nodes_under_one_id_that_are_both_switched_off_are_over_at_once():
    monitor = NodeMonitor()
    for tick in range(4):
        speak(monitor, tick, tick, booted=-100.0)
        speak(monitor, tick + 0.5, tick + 0.5, booted=-7.0)
    assert monitor.conflicts(3.5) == [33]
    monitor.forget_gone(7.0)
    assert monitor.conflicts(7.0) == []
    speak(monitor, 10.0, 20.0, booted=9.0)
    assert monitor.conflicts(20.0) == []


def test_the_older_of_two_under_one_id_may_come_last():
    monitor = NodeMonitor()
    speak(monitor, 0.0, 3.0, booted=-7.0)
    speak(monitor, 3.5, 3.5, booted=-100.0)
    assert monitor.take_restarted() == []
    speak(monitor, 4.0, 4.0, booted=-7.0)
    assert monitor.conflicts(4.0) == [33]


def test_two_unique_ids_under_one_node_id_are_a_conflict():
    monitor = met()
    monitor.information(33, info(), 0.1)
    assert monitor.conflicts(0.1) == []
    monitor.information(33, info(b"\x55" * 16), 0.2)
    assert monitor.conflicts(0.2) == [33]


def test_two_under_one_id_of_which_one_is_rarely_heard_are_one_conflict_that_lasts():
    """Given one each second, and one each seven seconds, for a minute."""
    monitor, restarts, seen = NodeMonitor(), 0, []
    for tick in range(60):
        speak(monitor, tick, tick, booted=-100.0)
        if tick % 7 == 3:
            speak(monitor, tick + 0.5, tick + 0.5, booted=-7.0)
        restarts += len(monitor.take_restarted())
        seen.append(monitor.conflicts(tick + 0.9))
    assert restarts <= 1
    begin = seen.index([33])
    assert seen[begin:] == [[33]] * (60 - begin)
    assert monitor.take_news(60.0) == [], "it is no restart"


def test_two_that_were_switched_on_together_are_found_by_how_they_count():
    monitor = NodeMonitor()
    for tick in range(5):
        monitor.status(33, status(tick), tick, tick % 32)
        monitor.status(33, status(tick), tick + 0.4, (tick + 7) % 32)
    assert monitor.conflicts(5.0) == [33]
    # One that loses messages and wraps around counts forwards.
    monitor = NodeMonitor()
    for tick in range(200):
        monitor.status(33, status(tick // 10), tick / 10, (tick * 3) % 32)
    assert monitor.conflicts(20.0) == []


def answers(monitor, now, *unique_ids, node_id=33):
    monitor.status(node_id, status(int(now) + 50), now)
    for unique_id in unique_ids:
        monitor.information(node_id, info(unique_id), now)


def test_a_known_node_is_asked_again_and_a_second_unit_is_asked_each_second():
    monitor, asked = NodeMonitor(), []
    for tick in range(40):
        answers(monitor, tick, UID)
        asked += [tick for _ in monitor.to_ask(tick)]
    assert asked == [0, 1, 2, 3, 4, 5, 15, 25, 35]
    for tick in range(40, 45):
        answers(monitor, tick, UID, b"\x55" * 16)
        assert monitor.conflicts(tick) == [33]
        assert monitor.to_ask(tick) == [33]


def test_two_of_which_each_answers_every_other_question_are_one_conflict_that_lasts():
    """Given two that were switched on together, and answer in turns."""
    monitor, seen = NodeMonitor(), []
    units, number = (UID, b"\x55" * 16), 0
    for tick in range(60):
        monitor.status(33, status(tick), tick)
        for _ in monitor.to_ask(tick):
            monitor.information(33, info(units[number % 2]), tick)
            number += 1
        seen.append(monitor.conflicts(tick))
    begin = seen.index([33])
    assert begin <= 11
    assert seen[begin:] == [[33]] * (60 - begin)
    assert monitor.take_news(60.0) == [], "it is no exchange of a device"


def test_another_device_under_a_node_id_is_told_once():
    monitor = NodeMonitor()
    answers(monitor, 0.0, UID)
    monitor.forget_gone(10.0)
    answers(monitor, 60.0, b"\x55" * 16)
    assert monitor.take_news(61.0) == []
    (text,) = monitor.take_news(62.5)
    assert text.startswith("node 33 is another device than before: unique id 5555")
    assert monitor.take_replaced() == [33]
    assert monitor.take_news(70.0) == []


def test_two_devices_that_swap_their_ids_are_one_error():
    other = b"\x55" * 16
    monitor = NodeMonitor()
    answers(monitor, 0.0, UID)
    answers(monitor, 0.0, other, node_id=34)
    monitor.forget_gone(10.0)
    answers(monitor, 20.0, other)
    answers(monitor, 21.0, UID, node_id=34)
    (text,) = monitor.take_news(23.0)
    assert text.startswith("nodes 33 and 34 have swapped their node ids")
    assert sorted(monitor.take_replaced()) == [33, 34]
    assert monitor.take_news(30.0) == []


def test_a_silent_node_is_forgotten_and_may_be_another_when_it_comes_back():
    monitor = met()
    monitor.status(34, status(5), 2.0)
    monitor.forget_gone(2.999)
    assert [entry.node_id for entry in monitor.all()] == [33, 34]
    monitor.forget_gone(3.0)
    assert [entry.node_id for entry in monitor.all()] == [34]
    monitor.status(33, status(1), 4.0)
    assert monitor.get(33).information is None
    assert monitor.take_restarted() == []
    for passed in (3.0, 60.0):
        monitor = met()
        monitor.status(33, status(5 + int(passed)), passed)
        assert monitor.get(33).information is None, "so may one that nobody has forgotten"
        assert not monitor.all_discovered(passed)
    # Nor is one that is gone waited for.
    monitor = NodeMonitor()
    monitor.status(33, status(5), 0.0)
    assert monitor.all_discovered(3.0)
    assert monitor.to_ask(3.0) == []


@given(
    st.floats(0, 1e6),
    st.lists(st.tuples(st.floats(0, 4), st.integers(1, 4), st.integers(0, 9)), max_size=40),
)
def test_every_deadline_is_served_and_in_the_end_everybody_is_gone(now, steps):
    monitor = NodeMonitor()

    def serve(now):
        monitor.forget_gone(now)
        monitor.to_ask(now)
        assert monitor.next_deadline() > now

    for pause, node_id, uptime in steps:
        now += pause
        monitor.status(node_id, status(uptime), now)
        serve(now)
    for _ in range(40):
        if monitor.next_deadline() == math.inf:
            break
        serve(monitor.next_deadline())
    assert monitor.all() == []
