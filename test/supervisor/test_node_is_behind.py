"""A node whose computer is too busy tells of what was: said before flight, and in flight."""

from dataclasses import replace

from story import LINK, START, Story, shipped

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import block_reasons

TEXT = (
    f"{LINK}: its node looks 0.80 s late at what comes (limit 0.5 s): "
    "its computer's processor is short"
)


def beat(story: Story, behind: float) -> i.LinkHeartbeat:
    return replace(story.heartbeat(), behind=behind)


def test_on_the_ground_it_forbids_take_off_until_it_keeps_up():
    story = Story(shipped("multirotor")).ready()
    story.at(story.t + 0.1, beat(story, 0.5))
    assert story.state.stage is Stage.READY
    story.at(story.t + 0.1, beat(story, 0.8))
    assert block_reasons(story.config, story.state, START + story.t) == (TEXT,)
    assert story.state.stage is Stage.BLOCKED
    story.at(story.t + 0.1, beat(story, 0.0))
    assert story.state.stage is Stage.READY


def test_in_flight_it_is_an_alarm_once_and_takes_nothing_back():
    story = Story(shipped("multirotor")).ready().fly(1.0)
    for _ in range(3):
        story.at(story.t + 0.1, beat(story, 0.8))
    assert story.alarms() == [TEXT]
    assert story.state.stage is Stage.IN_FLIGHT
