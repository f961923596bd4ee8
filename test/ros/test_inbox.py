"""Events from a link's thread to the executor: in order, none but pictures ever left out."""

import pytest

from chute_ros.ros import inbox as inbox_module
from chute_ros.ros.inbox import MOST_AT_ONCE, MOST_WAITING, Inbox


class Picture:
    """The next one tells the same."""


class Executor:
    """Fetches when it is told to."""

    def __init__(self):
        self.taken, self.wakes = [], 0
        self.inbox = Inbox(self.taken.append, self._wake, (Picture,))

    def _wake(self):
        self.wakes += 1


def test_what_is_put_in_is_taken_out_in_order():
    executor = Executor()
    executor.inbox.put([1, 2])
    executor.inbox.put([3])
    assert executor.wakes == 2
    executor.inbox.drain()
    assert executor.taken == [1, 2, 3]
    assert executor.wakes == 2, "nothing is left"


def test_what_comes_while_it_is_drained_waits_for_its_turn():
    executor = Executor()
    inbox = Inbox(lambda event: inbox.put([event + 1]), executor._wake, ())
    inbox.put([1])
    inbox.drain()
    assert executor.wakes == 3, "put, put meanwhile, and once more for what is left"


class Remark:
    """Nobody waits for it."""


def test_what_nobody_waits_for_wakes_nobody_and_comes_with_the_next_that_does():
    executor = Executor()
    inbox = Inbox(executor.taken.append, executor._wake, (), unhurried=(Remark,))
    remark = Remark()
    inbox.put([remark])
    assert executor.wakes == 0
    inbox.put(["a report"])
    assert executor.wakes == 1
    inbox.put([Remark(), "another report"])
    assert executor.wakes == 2
    inbox.drain()
    assert executor.taken[:2] == [remark, "a report"]


def test_a_picture_that_is_left_out_among_many_remarks_wakes_all_the_same():
    executor = Executor()
    inbox = Inbox(executor.taken.append, executor._wake, (Picture,), unhurried=(Remark,))
    for _ in range(MOST_WAITING + 1):
        inbox.put([Remark()])
    assert executor.wakes == 0
    inbox.put([Picture()])
    assert (executor.wakes, inbox.left_out) == (1, 1)


class Whole(Picture):
    """Each tells all that the one before told."""


def test_a_newer_whole_picture_takes_the_place_of_one_that_waits_just_ahead():
    taken = []
    inbox = Inbox(taken.append, lambda: None, (Picture,), (Whole,))
    pictures = [Whole() for _ in range(5)]
    inbox.put(pictures[:2])
    inbox.put([pictures[2], "a report", pictures[3]])
    inbox.drain()
    assert taken == [pictures[2], "a report", pictures[3]], "in order with what is not left out"
    inbox.put([pictures[4]])
    inbox.drain()
    assert taken[-1] is pictures[4], "what was taken is not taken back"


def test_an_executor_that_does_not_keep_up_loses_pictures_and_nothing_else():
    executor = Executor()
    for _ in range(MOST_WAITING + 1):
        executor.inbox.put([Picture()])
    executor.inbox.put([Picture(), "the end of a request", Picture()])
    assert executor.inbox.left_out == 2
    executor.inbox.drain()
    assert len(executor.taken) == MOST_AT_ONCE, "others have their turn in between"
    for _ in range(MOST_WAITING // MOST_AT_ONCE + 1):
        executor.inbox.drain()
    assert len(executor.taken) == MOST_WAITING + 2
    assert executor.taken[-1] == "the end of a request"
    executor.inbox.put([Picture()])
    executor.inbox.drain()
    assert isinstance(executor.taken[-1], Picture), "and then they come again"


def test_how_long_events_waited_is_told(monkeypatch):
    executor, now = Executor(), [100.0]
    monkeypatch.setattr(inbox_module.time, "monotonic", lambda: now[0])
    executor.inbox.put([1])
    now[0] = 100.2
    executor.inbox.put([2])
    now[0] = 100.7
    executor.inbox.drain()
    assert executor.inbox.late.most(now[0]) == pytest.approx(0.7)
    now[0] = 110.0
    executor.inbox.put([3])
    executor.inbox.drain()
    assert executor.inbox.late.most(now[0]) == 0.0, "nothing waited since"
