"""A deploy over motors that are known to turn says so, loudly, in its answer."""

import pytest
from upf_link_bench import flying, landed

LOUD = "STOP THEM"


def answer_of(story, vehicle=None, kill=False, by_triggers=False):
    """The answer to a deploy beside this vehicle, which goes on saying what it said."""
    if vehicle is not None:
        story.call("vehicle", vehicle)
    if kill:
        story.call("kill_confirmed")
    begin = story.link.fire_triggers if by_triggers else story.link.deploy
    begin(1, *(() if by_triggers else (True,)), story.now)
    for _ in range(20):
        story.after(0.1)
        if vehicle is not None and not kill:
            story.call("vehicle", vehicle)
    end = story.end(1)
    assert end.success
    return end.message


@pytest.mark.parametrize("by_triggers", [False, True])
def test_over_turning_motors_it_is_said_loudly(bench, by_triggers):
    story = bench().in_flight()
    story.supervised = False
    answer = answer_of(story, flying(), by_triggers=by_triggers)
    assert answer.startswith("WARNING: the vehicle reported armed 0.")
    assert " s ago, and no kill was confirmed: the motors may turn" in answer
    assert LOUD in answer
    assert sum(LOUD in text for text in story.notices()) == 1, "and in the log, once"


def test_after_a_confirmed_kill_it_is_not_said(bench):
    story = bench().in_flight()
    assert LOUD not in answer_of(story, flying(), kill=True)


def test_over_motors_that_are_off_it_is_not_said(bench):
    assert LOUD not in answer_of(bench().in_flight(), landed())


def test_of_a_vehicle_that_nobody_knows_of_it_is_not_said(bench):
    assert LOUD not in answer_of(bench().in_flight())
