"""The loop between a wire and a protocol: prompt, in order, and not to be killed by a mistake."""

import threading
import time

from loop_bench import LOCAL, Running, descriptors, loop_threads, running, udp

from chute_ros.transport.loop import LoopFault, WireChange


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


def test_calls_run_in_the_loops_own_thread_with_the_protocol(await_until):
    with running(f"udpin:{LOCAL}:0") as node:
        seen = []
        node.loop.call(lambda link, now: seen.append((link, threading.current_thread().name, now)))
        await_until(lambda: seen, "the call is made")
        link, thread, now = seen[0]
        assert link is node.link
        assert [thread] == loop_threads()
        assert abs(now - time.monotonic()) < 20.0


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
