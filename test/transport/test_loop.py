"""The loop between a wire and a protocol: prompt, in order, and not to be killed by a mistake."""

import math
import threading
import time

import pytest
from loop_bench import LOCAL, Running, descriptors, loop_threads, running, udp

from chute_ros.transport import loop
from chute_ros.transport.wire_events import LoopFault, WireChange


def test_bytes_are_answered_at_once_without_any_deadline():
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:
        node.link.answer = lambda data: data
        device.sendto(b"ping", (LOCAL, node.port))
        assert device.recv(100) == b"ping"
        # The loop has turned for what came and at its slowest pace, not in a busy circle.
        assert len(node.link.updates) < 20


def test_calls_from_other_threads_are_made_in_the_order_of_each(await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        made = []

        def caller(name):
            for number in range(200):
                node.loop.call(lambda link, now, number=number: made.append((name, number)))

        callers = [threading.Thread(target=caller, args=(name,)) for name in "ab"]
        for one in callers:
            one.start()
        for one in callers:
            one.join()
        await_until(lambda: len(made) == 400, "all calls are made")
        for name in "ab":
            assert [n for who, n in made if who == name] == list(range(200))


def test_a_call_is_made_with_the_protocol_and_what_it_sends_is_sent(await_until):
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:
        node.link.answer = lambda data: data
        device.sendto(b"hello", (LOCAL, node.port))
        assert device.recv(100) == b"hello"
        for number in range(50):
            seen = []

            def say(link, now, number=number, seen=seen):
                seen.append((link, now))
                link.output.append(b"%d" % number)
                link.events.append(number)

            node.loop.call(say)
            assert device.recv(100) == b"%d" % number
            ((link, now),) = seen
            assert link is node.link
            assert abs(now - time.monotonic()) < 20.0
            await_until(lambda number=number: node.delivered[-1] == number, "its event is told")


def test_no_two_threads_touch_the_protocol_at_once(await_until):
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:
        touching, clashes, times = [], [], []

        def touch(now=None):
            touching.append(threading.get_ident())
            if now is not None:
                times.append(now)
            # Others get the interpreter here, if they are let.
            time.sleep(0.0)
            if len(touching) > 1:
                clashes.append(list(touching))
            touching.pop()

        node.link.answer = lambda data: touch()
        node.link.update = touch

        def caller():
            for _ in range(200):
                node.loop.call(lambda link, now: touch(now))

        callers = [threading.Thread(target=caller) for _ in range(3)]
        for one in callers:
            one.start()
        while any(one.is_alive() for one in callers):
            device.sendto(b"x", (LOCAL, node.port))
        for one in callers:
            one.join()
        await_until(lambda: len(times) >= 600, "all calls are made")
        assert clashes == []
        assert times == sorted(times), "time never goes back for the protocol"


@pytest.fixture
def forever(monkeypatch):
    """A loop turns only for what happens."""
    monkeypatch.setattr(loop, "LONGEST_WAIT", 1000.0)


def test_while_the_loop_waits_its_caller_makes_the_call(forever):
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:
        node.link.answer = lambda data: data
        device.sendto(b"hello", (LOCAL, node.port))
        assert device.recv(100) == b"hello"
        callers = []

        def say(link, now):
            callers.append(threading.current_thread())
            link.output.append(b"at once")

        # Now and then the loop is still in the turn of the call before.
        for _ in range(50):
            node.loop.call(say)
            assert device.recv(100) == b"at once"
        assert threading.current_thread() in callers


def test_a_deadline_that_a_call_sets_is_kept(forever, await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        due = time.monotonic() + 0.05
        node.loop.call(lambda link, now: setattr(link, "deadline", due))
        await_until(lambda: any(type(one) is tuple for one in node.delivered), "the deadline")


@pytest.mark.parametrize("deadline", [-math.inf, 0.0])
def test_a_deadline_that_is_long_over_is_kept_at_once(deadline, forever, await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        # As a call leaves it that is made between two turns of the loop.
        node.link.deadline = deadline
        assert node.loop._watched(time.monotonic())[1] == 0
        node.loop._wake()
        await_until(lambda: any(type(one) is tuple for one in node.delivered), "the deadline")


def test_a_call_before_the_start_is_made_after_it(await_until):
    node, made = Running(f"udpin:{LOCAL}:0"), []
    node.loop.call(lambda link, now: made.append(node.wire.is_open))
    assert made == []
    node.loop.start()
    try:
        await_until(lambda: made, "it is made")
        assert made == [True]
    finally:
        node.loop.stop()


def test_what_is_called_at_a_turns_end_is_called_by_the_loop(await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        seen = []
        node.loop.call_at_turns_end(
            lambda link, now: seen.append((link, threading.current_thread().name, now))
        )
        await_until(lambda: seen, "it is called")
        ((link, thread, now),) = seen
        assert link is node.link
        assert [thread] == loop_threads()
        assert now == node.link.updates[-1], "after the update of this turn"


@pytest.mark.parametrize("what", ["update", "next_deadline", "take_events"])
def test_a_loop_that_fails_or_hangs_does_not_reach_a_turns_end(what, await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        seen = []

        def broken(*_):
            raise RuntimeError("each time")

        setattr(node.link, what, broken)
        await_until(lambda: len(node.delivered) > 1, "it fails")
        run = node.loop.last_run
        for _ in range(2):
            before = len(node.delivered)
            node.loop.call_at_turns_end(lambda link, now: seen.append(now))
            await_until(lambda before=before: len(node.delivered) > before + 1, "it fails again")
        assert seen == []
        assert node.loop.last_run == run
        delattr(node.link, what)
        await_until(lambda: seen, "it turns again")
        assert len(seen) == 1, "what nobody awaits any more is left out"


def test_a_lock_that_nobody_gives_back_does_not_keep_it_from_ending():
    node = Running(f"udpin:{LOCAL}:0")
    node.loop.start()
    assert node.loop._touching.acquire(timeout=10.0)  # by one that a Ctrl-C has ended
    node.loop.stop()
    assert loop_threads() == []


def test_a_call_that_makes_another_has_it_made_after_itself(await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        made = []

        def first(link, now):
            node.loop.call(lambda link, now: made.append("second"))
            made.append("first")

        node.loop.call(first)
        await_until(lambda: len(made) == 2, "both are made")
        assert made == ["first", "second"]


def test_a_loop_that_hangs_does_not_hang_who_calls(await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        hung, go_on, made = threading.Event(), threading.Event(), []

        def hang(now):
            hung.set()
            go_on.wait()

        node.link.update = hang
        try:
            node.loop.call(lambda link, now: None)
            assert hung.wait(10.0)
            began = time.monotonic()
            for number in range(5):
                node.loop.call(lambda link, now, number=number: made.append(number))
            assert time.monotonic() - began < 5.0
            assert made == []
        finally:
            go_on.set()
        await_until(lambda: made == [0, 1, 2, 3, 4], "they are made in order once it goes on")


def test_a_wire_that_a_call_loses_is_closed_by_the_loop_and_opened_again(await_until):
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:

        def broken(data):
            raise ConnectionResetError("pulled")

        closers, close = [], node.wire.close

        def closing():
            closers.append(threading.current_thread().name)
            close()

        node.link.answer = lambda data: data
        node.wire.write, node.wire.close = broken, closing
        node.send(b"lost")
        await_until(lambda: len(node.changes) > 1, "it is told")
        assert [change.is_open for change in node.changes[:2]] == [True, False]
        assert closers == loop_threads()
        del node.wire.write
        await_until(lambda: node.wire.is_open, "it is opened again")
        device.sendto(b"back", (LOCAL, node.port))
        assert device.recv(100) == b"back"
        assert node.loop.send_errors == 1


def test_a_mistake_in_a_wire_is_not_the_callers(await_until):
    with running(f"udpin:{LOCAL}:0") as node:

        def broken(data):
            raise RuntimeError("a mistake of ours")

        node.wire.write = broken
        node.send(b"lost")
        await_until(lambda: len(node.delivered) > 1, "it is reported")
        assert "RuntimeError: a mistake of ours" in node.delivered[1].text


def test_a_deadline_is_kept_and_never_early(await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        for wait in (0.0, 0.03, 0.35):
            node.delivered.clear()
            due = time.monotonic() + wait
            node.loop.call(lambda link, now, due=due: setattr(link, "deadline", due))
            await_until(lambda: node.delivered, "the deadline")
            ((_, when),) = node.delivered
            assert when >= due


def test_an_idle_loop_still_shows_that_it_runs(await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        before = node.loop.last_run
        await_until(lambda: node.loop.last_run > before, "it turns by itself")


def test_an_exception_in_the_protocol_is_reported_and_survived(await_until):
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:

        def answer(data):
            if data == b"poison":
                raise RuntimeError("a mistake of ours")
            return data

        node.link.answer = answer
        device.sendto(b"poison", (LOCAL, node.port))
        device.sendto(b"bread", (LOCAL, node.port))
        assert device.recv(100) == b"bread"
        faults = [event for event in node.delivered if isinstance(event, LoopFault)]
        assert len(faults) == 1
        assert "RuntimeError: a mistake of ours" in faults[0].text
        assert "in answer" in faults[0].text, "the report says where"


def test_a_call_that_fails_does_not_keep_the_next_from_being_made(await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        made = []
        node.loop.call(lambda link, now: 1 / 0)
        node.loop.call(lambda link, now: made.append(now))
        await_until(lambda: made, "the next call")
        assert "ZeroDivisionError" in node.delivered[-1].text


def test_a_mistake_in_every_turn_leaves_the_processor_to_others(await_until):
    with running(f"udpin:{LOCAL}:0") as node:

        def broken(now):
            raise RuntimeError("each time")

        node.link.update = broken
        node.link.deadline = 0.0  # always overdue: nothing else makes the loop wait
        await_until(lambda: len(node.delivered) > 2, "it is reported")
        before, began = len(node.delivered), time.monotonic()
        await_until(lambda: len(node.delivered) >= before + 20, "it goes on")
        assert time.monotonic() - began > 0.15
        del node.link.update
        made = []
        node.loop.call(lambda link, now: made.append(now))
        await_until(lambda: made, "it recovers")


def test_what_the_protocol_wants_to_send_while_the_wire_is_down_is_counted_not_kept(await_until):
    holder = udp()
    with running(f"udpin:{LOCAL}:{holder.getsockname()[1]}") as node:
        node.send(b"too early")
        await_until(lambda: node.loop.send_errors == 1, "it is counted")
        holder.close()
        await_until(lambda: node.wire.is_open, "the wire is opened")
        with udp() as device:
            node.link.answer = lambda data: data
            device.sendto(b"now", (LOCAL, node.port))
            assert device.recv(100) == b"now", "an old command does not come late"


def test_opening_is_told_with_the_port_that_was_bound():
    with running(f"udpin:{LOCAL}:0") as node:
        assert node.delivered == [WireChange(True, f"udpin:{LOCAL}:{node.port} is open")]
        assert node.port > 0


def test_stop_leaves_no_thread_and_no_descriptor():
    before = descriptors()
    with running(f"tcpin:{LOCAL}:0") as node:
        assert loop_threads() != []
        assert descriptors() > before
    assert loop_threads() == []
    assert descriptors() == before
    assert not node.wire.is_open


def test_a_loop_that_never_started_can_be_stopped():
    before = descriptors()
    Running(f"udpin:{LOCAL}:0").loop.stop()
    assert descriptors() == before


def test_two_hundred_times_open_and_closed_leak_nothing():
    before = descriptors()
    for number in range(200):
        kind = ("udpin", "tcpin")[number % 2]
        with running(f"{kind}:{LOCAL}:0") as node:
            assert node.wire.is_open
    assert descriptors() == before
    assert loop_threads() == []


def test_a_call_after_the_end_is_made_by_nobody_and_harms_nobody():
    with running(f"udpin:{LOCAL}:0") as node:
        loop = node.loop
    called = []
    loop.call(lambda link, now: called.append(now))
    loop.call_at_turns_end(lambda link, now: called.append(now))
    assert called == []
