"""A loop that does not keep up says by how much; one that has nothing to do does not."""

import threading
import time

from loop_bench import LOCAL, running, udp

from chute_ros.transport.lateness import TOLD_FOR, Lateness

HELD_UP = 0.4


def test_the_most_is_told_until_it_is_over():
    late = Lateness()
    late.note(0.2, 100.0)
    late.note(0.9, 101.0)
    late.note(0.1, 102.0)
    assert late.most(102.0) == 0.9
    assert late.most(101.0 + TOLD_FOR) == 0.0
    late.note(0.1, 107.0)
    assert late.most(107.0) == 0.1


def test_what_came_while_the_loop_was_held_up_waited_for_so_long(await_until):
    goes_on = threading.Event()
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:
        node.link.answer = lambda data: goes_on.wait(20.0) and None
        device.sendto(b"takes long", (LOCAL, node.port))
        await_until(lambda: node.link.received, "it is at work")
        began = time.monotonic()
        device.sendto(b"comes meanwhile", (LOCAL, node.port))
        while time.monotonic() < began + HELD_UP:
            goes_on.wait(0.01)
        goes_on.set()
        await_until(lambda: len(node.link.received) == 2, "it is read")
        assert node.loop.late.most(time.monotonic()) >= HELD_UP


def test_a_loop_to_which_nothing_comes_for_a_while_is_not_late(await_until):
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:
        await_until(lambda: len(node.link.updates) > 4, "it has waited for the best part of 1 s")
        device.sendto(b"at last", (LOCAL, node.port))
        await_until(lambda: node.link.received, "it is read")
        assert node.loop.late.most(time.monotonic()) < HELD_UP


def test_one_that_always_finds_the_next_datagram_is_late_by_one_turn_and_not_since_it_began(
    await_until,
):
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:

        def next_one(data):
            # What comes while this one is worked at waits for so long.
            device.sendto(b"next", (LOCAL, node.port))
            time.sleep(0.002)

        node.link.answer = next_one
        began = time.monotonic()
        device.sendto(b"first", (LOCAL, node.port))
        await_until(lambda: time.monotonic() > began + 2 * HELD_UP, "it goes on for a while")
        assert len(node.link.received) > 50
        assert 0.001 < node.loop.late.most(time.monotonic()) < HELD_UP
        node.link.answer = lambda data: None
