"""A supervisor without a standby dies in flight, and its next start goes on where it stopped."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import DOWN, START, Story, parachute, shipped

from chute_ros.errors import RecordError
from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.handover import told
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.resume import SavedState, dump, load, worth_saving
from chute_ros.supervisor.state import State

K, D = Action.KILL, Action.DEPLOY
BOOT, SETTINGS = "this start of the computer", "these settings"


def left(story: Story) -> str:
    assert worth_saving(story.state)
    return dump(SavedState(BOOT, SETTINGS, story.state))


def restart(story: Story, after: float) -> list[i.Output]:
    """It dies now and is there again so much later, s: no deadline wakes it in between."""
    now = START + story.t + after
    story.state = load(left(story), BOOT, SETTINGS, 30.0, now)
    story.t += after
    return story._update((i.TakeOver(8),), story.t)


def test_killed_between_the_kill_and_the_deploy_it_deploys_at_once():
    story = Story().flying()
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    assert story.fired() == ["KILL"]
    outputs = restart(story, 2.0)
    # The kill first once more, as nobody reported on it; both under the next epoch.
    decided = [o.decision for o in outputs if isinstance(o, i.Decide) and not o.again]
    assert [(d.epoch, d.action) for d in decided if d.action >= K] == [(8, K), (8, D)]
    assert not any(isinstance(o, i.Finish) for o in outputs), "who asked waits no more"


def test_a_vehicle_that_was_falling_meanwhile_is_not_believed_to_stand():
    story = Story(shipped("multirotor")).ready().fly(5.0)
    assert story.state.stage is Stage.IN_FLIGHT
    restart(story, 2.5)
    # 2.5 s into the fall; its autopilot says disarmed and landed.
    start = story.t
    story.fall(start + 3.0, 100.0, **DOWN)
    assert story.fired()[-2:] == ["KILL", "DEPLOY"]


def test_what_a_device_has_begun_is_not_sent_again():
    story = Story().flying()
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.report(D, Outcome.SENT))
    restart(story, 1.0)
    story.alive(story.t + 1.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    earlier = story.newest(D)
    report = i.ActionReport(
        earlier.epoch, earlier.id, "mavlink_parachute", Outcome.CONFIRMED, "out", 7
    )
    story.at(story.t, report)
    assert story.state.stage is Stage.DEPLOYED, "its confirmation counts"


def test_a_released_parachute_stays_released():
    story = Story().flying()
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    story.at(1.1, parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    restart(story, 1.0)
    assert story.state.stage is Stage.DEPLOYED
    assert not story.decisions(D), "it opened by itself after the kill"


def test_while_it_was_away_nobody_was_silent():
    story = Story().flying()
    story.alive(3.0)
    restart(story, 4.0)
    assert "silence meanwhile does not count" in story.alarms()[-1]
    assert not story.state.evidence("mavlink_parachute").silent(1.0, START + story.t)


def test_on_the_ground_with_nothing_under_way_it_starts_anew():
    story = Story()
    assert not worth_saving(story.state)
    story.ready()
    assert not worth_saving(story.state)
    story.at(0.0, i.KillRequest(4, "operator", "smoke"))
    assert story.state.stage is Stage.KILLING
    assert worth_saving(story.state)


@pytest.mark.parametrize(
    ("boot", "settings", "within", "after", "why"),
    [
        ("another", SETTINGS, 30.0, 1.0, "the computer has restarted since"),
        (BOOT, "others", 30.0, 1.0, "the parameters or the profile have changed since"),
        (BOOT, SETTINGS, 30.0, 31.0, "it is 31.0 s old (limit 30 s)"),
        (BOOT, SETTINGS, 30.0, -1.0, "it is -1.0 s old (limit 30 s)"),
    ],
)
def test_what_does_not_belong_here_is_not_gone_on_with(boot, settings, within, after, why):
    story = Story().flying()
    with pytest.raises(RecordError) as error:
        load(left(story), boot, settings, within, START + after)
    assert str(error.value) == why


def test_up_to_its_limit_it_is():
    story = Story().flying()
    for age in (0.0, 30.0):
        state = load(left(story), BOOT, SETTINGS, 30.0, START + age)
        assert state.stage is Stage.IN_FLIGHT
        assert not state.own.leading


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        "7",
        told(Story().state, START),
        dump(SavedState(BOOT, SETTINGS, Story().state)).replace('"epoch":7', '"epic":7'),
        dump(SavedState(BOOT, SETTINGS, Story().state))[:-20],
        dump(SavedState("this start of the computer", "these settings", 7)),  # type: ignore[arg-type]
    ],
)
def test_garbage_is_an_error_in_words(text):
    with pytest.raises(RecordError):
        load(text, BOOT, SETTINGS, 30.0, START)


@given(st.data())
def test_a_damaged_file_never_raises_anything_else(data):
    text = dump(SavedState(BOOT, SETTINGS, Story(SupervisorConfig()).flying().state))
    at = data.draw(st.integers(0, len(text) - 1))
    damaged = text[:at] + data.draw(st.characters()) + text[at + 1 :]
    with contextlib.suppress(RecordError):
        assert isinstance(load(damaged, BOOT, SETTINGS, 30.0, START), State)
