"""Each link is never seen, ok, stale, lost or regained, by limits of its own."""

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import DOWN, LINK, STANDING, Story, shipped

from chute_ros.errors import ParameterError
from chute_ros.model import LinkState, ParachuteState, ParachuteStatus
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.link_evidence import (
    MOST_DEVICES,
    LinkEvidence,
    LinkJudgement,
    LinkLimits,
)
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import TWO_NODES, block_reasons

J = LinkJudgement
LIMITS = LinkLimits(stale_after=0.5, lost_after=1.0, regain_after=1.0, startup_grace=10.0)


def heard(*times: float, limits: LinkLimits = LIMITS, **said: Any) -> LinkEvidence:
    """After healthy heartbeats at these times."""
    evidence = LinkEvidence()
    for seq, t in enumerate(times):
        one = i.LinkHeartbeat(LINK, said.get("state", LinkState.OK), True, seq)
        evidence = evidence.with_heartbeat(one, limits, t)
    return evidence


@pytest.mark.parametrize(
    ("times", "now", "judged"),
    [
        ((), 5.0, J.NEVER_SEEN),
        ((1.0,), 1.0, J.OK),
        ((1.0,), 1.49, J.OK),
        ((1.0,), 1.5, J.STALE),
        ((1.0,), 1.99, J.STALE),
        ((1.0,), 2.0, J.LOST),
        ((1.0,), 900.0, J.LOST),
        # Stale and back: it was never lost, so nothing is to be regained.
        ((1.0, 1.8), 1.8, J.OK),
        # Lost and back: heard for a whole second without a break before it is relied on.
        ((1.0, 5.0), 5.0, J.REGAINED),
        ((1.0, 5.0, 5.4, 5.8), 5.99, J.REGAINED),
        ((1.0, 5.0, 5.4, 5.8), 6.0, J.OK),
        # A break at the very end of the wait does not begin it anew.
        ((1.0, 5.0, 5.4, 6.0), 6.0, J.OK),
        # A break while it is being regained begins the wait anew.
        ((1.0, 5.0, 5.6), 6.05, J.REGAINED),
        ((1.0, 5.0, 5.6, 6.0, 6.4), 6.59, J.REGAINED),
        ((1.0, 5.0, 5.6, 6.0, 6.4), 6.6, J.OK),
    ],
)
def test_silence_is_judged_by_its_length(times, now, judged):
    assert heard(*times).judged(LIMITS, now) is judged


@pytest.mark.parametrize(
    ("said", "judged"),
    [
        (LinkState.NEVER_SEEN, J.NEVER_SEEN),
        (LinkState.STALE, J.STALE),
        (LinkState.LOST, J.LOST),
        (LinkState.OK, J.OK),
    ],
)
def test_a_node_that_lives_tells_of_its_device(said, judged):
    assert heard(1.0, state=said).judged(LIMITS, 1.1) is judged


def beat(
    seq: int = 1, state: LinkState = LinkState.OK, difference: float = 0.0
) -> i.LinkHeartbeat:
    return i.LinkHeartbeat(LINK, state, True, seq, clock_difference=difference)


def beats(*told: tuple[float, i.LinkHeartbeat]) -> LinkEvidence:
    evidence = LinkEvidence()
    for t, one in told:
        evidence = evidence.with_heartbeat(one, LIMITS, t)
    return evidence


def test_the_silence_of_the_node_is_worse_than_what_it_said_last():
    assert heard(1.0, state=LinkState.STALE).judged(LIMITS, 2.0) is J.LOST


def test_a_device_that_was_lost_behind_a_living_node_is_regained_like_a_node():
    lost = beat(state=LinkState.LOST)
    assert beats((1.0, lost), (1.1, lost), (1.2, beat())).judged(LIMITS, 1.2) is J.REGAINED


def test_each_loss_is_counted_once():
    assert heard(1.0, 1.4, 1.8).lost_count == 0
    assert heard(1.0, 5.0, 9.0, 9.4).lost_count == 2
    lost, well = beat(state=LinkState.LOST), beat()
    assert beats((1.0, lost), (1.1, lost), (1.2, well)).lost_count == 1
    assert beats((1.0, well), (1.2, lost), (1.4, lost), (1.6, lost)).lost_count == 1
    assert beats((1.0, well), (1.2, lost), (1.4, well), (1.6, lost)).lost_count == 2


def test_links_have_limits_of_their_own():
    slow = LinkLimits(2.0, 4.0, regain_after=0.0)
    assert heard(1.0, limits=slow).judged(slow, 2.9) is J.OK
    assert heard(1.0).judged(LIMITS, 2.9) is J.LOST
    assert heard(1.0, 9.0, limits=slow).judged(slow, 9.0) is J.OK, "nothing to wait for"


def test_a_slow_link_is_followed_by_its_own_limits_in_the_whole_core():
    slow = LinkLimits(2.0, 4.0, 1.0, startup_grace=20.0)
    story = Story(SupervisorConfig((LINK, "slow"), link_limits={"slow": slow}))
    for n in range(15):
        story.at(n * 0.1, story.heartbeat(), i.VehicleReport(STANDING))
        if n == 0:
            story.at(0.0, story.heartbeat("slow"))
    assert story.state.stage is Stage.READY
    story.alive(2.1)
    assert story.state.stage is Stage.BLOCKED
    assert "slow: STALE, heartbeat of its node 2.00 s old (limit 2 s)" in story.said()


def test_a_link_that_flaps_at_its_limit_keeps_flight_blocked_and_fires_nothing():
    story = Story().ready()
    for n in range(1, 21):
        # Once a second: just lost each time, just heard again each time.
        story.at(n * 1.01, story.heartbeat(), i.VehicleReport(STANDING))
        assert story.state.stage is Stage.BLOCKED
    assert story.fired() == []
    assert story.state.heard.links[LINK].lost_count == 20
    for n in range(1, 13):
        story.at(20.2 + n * 0.1, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.READY


NEED = "need a number (1.0, not 1) from"


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ((0.04, 1.0), f"stale_after is 0.04: {NEED} 0.05 to 600 s (silence of a node after"),
        ((math.nan, 1.0), f"stale_after is nan: {NEED} 0.05 to 600 s"),
        ((1.0, 1.0), "stale_after is 1.0 and lost_after is 1.0: a link is STALE before"),
        ((1.0, 601.0), "lost_after is 601.0: need a number (1.0, not 1) from"),
        ((0.5, 1.0, -1.0), f"regain_after is -1.0: {NEED} 0 to 60 s"),
        ((0.5, 1.0, 60.5), f"regain_after is 60.5: {NEED} 0 to 60 s (a node whose link"),
        ((0.5, 1.0, 1.0, -0.5), f"startup_grace is -0.5: {NEED} 0 to 60 s (links may take"),
        ((0.5, 1.0, 1.0, 61.0), f"startup_grace is 61.0: {NEED} 0 to 60 s"),
    ],
)
def test_limits_past_their_ends_are_told_in_full(wrong, words):
    with pytest.raises(ParameterError) as caught:
        LinkLimits(*wrong)
    assert str(caught.value).startswith(f"parameter {words}")
    for ends in (LinkLimits(0.5, 600.0, 60.0, 60.0), LinkLimits(0.5, 1.0, 0.0, 0.0)):
        assert ends.stale_after == 0.5


def status(
    device: str = "1/161", deployed: bool = False, state: LinkState = LinkState.OK
) -> ParachuteStatus:
    return ParachuteStatus(device, state, ParachuteState.READY, deployed=deployed)


def test_what_a_device_said_released_stays_so_while_it_is_lost():
    evidence = LinkEvidence().with_status(status(deployed=True), 3.0)
    evidence = evidence.with_status(status(deployed=False, state=LinkState.LOST), 4.0)
    assert evidence.deployed == {"1/161"}
    assert evidence.released_at == 3.0


def test_a_lost_device_cannot_say_that_it_is_released():
    for known in (LinkEvidence(), LinkEvidence().with_status(status(), 3.0)):
        evidence = known.with_status(status(deployed=True, state=LinkState.LOST), 4.0)
        assert evidence.deployed == set()
        assert evidence.devices["1/161"].deployed is False
        assert math.isnan(evidence.released_at)


@pytest.mark.parametrize(("uptime", "released"), [(20.9, False), (21.0, False), (21.1, True)])
def test_what_a_lost_device_says_by_its_own_clock_just_now_is_so(uptime, released):
    """Its heartbeats were lost on the way, and its newest status was not."""
    known = LinkEvidence().with_status(replace(status(), uptime=21.0), 3.0)
    told = replace(status(deployed=True, state=LinkState.LOST), uptime=uptime)
    evidence = known.with_status(told, 9.0)
    assert evidence.deployed == ({"1/161"} if released else set())
    assert math.isnan(evidence.released_at) is not released
    later = replace(status(state=LinkState.LOST), uptime=30.0)
    assert evidence.with_status(later, 10.0).deployed == evidence.deployed, "not taken back"


def test_made_up_devices_do_not_grow_it_and_the_known_ones_go_on_being_heard():
    evidence = LinkEvidence()
    for n in range(100):
        evidence = evidence.with_status(status(f"made up {n}"), 1.0)
    assert len(evidence.devices) == MOST_DEVICES
    evidence = evidence.with_status(status("made up 0", deployed=True), 2.0)
    assert evidence.deployed == {"made up 0"}


def test_a_heartbeat_tells_its_number_its_device_and_its_clock():
    evidence = beats((1.0, beat(seq=8, difference=0.02)), (1.1, beat(seq=9, difference=0.03)))
    assert (evidence.heard, evidence.seq, evidence.clock_difference) == (1.1, 9, 0.03)
    assert evidence.device_healthy
    assert evidence.reported is LinkState.OK


def test_it_is_looked_at_again_when_it_grows_stale_lost_or_is_regained():
    never = beats((2.0, beat())).deadlines(LIMITS)
    assert never[:2] == (2.5, 3.0)
    assert math.isnan(never[2]), "it was never lost"
    assert math.isnan(never[3]), "none was released"
    regained = beats((2.0, beat()), (8.0, beat()), (8.4, beat())).deadlines(LIMITS)
    assert regained[:3] == (8.9, 9.4, 9.0)
    released = LinkEvidence(released_at=5.0).deadlines(LIMITS)
    assert released[3] == 6.0, "its word counts no longer than its node may be silent"


def clocks(*told: tuple[float, float]) -> LinkEvidence:
    return beats(*((t, beat(seq=n, difference=d)) for n, (t, d) in enumerate(told)))


def test_a_clock_is_judged_by_the_smallest_difference_of_this_spell_and_the_one_before():
    first = clocks((10.0, 0.5), (10.5, 0.3), (10.9, 0.4))
    assert (first.clock_spell_since, first.clock_least) == (10.0, 0.3)
    assert math.isnan(first.clocks_differ_by), "one spell is not enough"
    second = clocks((10.0, 0.5), (10.5, 0.3), (11.0, 0.6), (11.9, 0.7))
    assert (second.clock_spell_since, second.clock_least) == (11.0, 0.6)
    assert second.clocks_differ_by == 0.3
    third = clocks((10.0, 0.5), (10.5, 0.3), (11.0, 0.6), (12.0, 0.8))
    assert (third.clock_least_before, third.clock_least, third.clocks_differ_by) == (0.6, 0.8, 0.6)


@pytest.mark.parametrize(("pause", "known"), [(2.9, True), (3.0, False), (3.5, False)])
def test_what_was_heard_before_a_long_silence_says_nothing_of_a_clock(pause, known):
    after = clocks((10.0, 0.5), (10.0 + pause, 0.6))
    assert after.clock_least == 0.6
    assert after.clock_least_before == 0.5 if known else math.isnan(after.clock_least_before)


@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.sampled_from(LinkState)), max_size=30))
def test_between_two_heartbeats_a_link_only_gets_worse_or_is_relied_on_after_its_wait(beats):
    now, evidence = 100.0, LinkEvidence()
    for seq, (wait, said) in enumerate(beats):
        judged = {evidence.judged(LIMITS, now + wait * part) for part in (0.0, 0.3, 0.6, 0.99)}
        if J.NEVER_SEEN in judged:
            assert judged <= {J.NEVER_SEEN, J.LOST}
        now += wait
        before = evidence.judged(LIMITS, now)
        evidence = evidence.with_heartbeat(i.LinkHeartbeat(LINK, said, True, seq), LIMITS, now)
        after = evidence.judged(LIMITS, now)
        if before is J.LOST:
            assert after not in (J.OK, J.UNMONITORED), (
                "never relied on at the first heartbeat after a loss"
            )
        if said is LinkState.OK and before is J.OK:
            assert after is J.OK
        heard = (LinkState.OK, LinkState.UNMONITORED)
        assert evidence.is_heard(LIMITS, now) == (said in heard)


# -- two nodes of one name ----------------


def numbered(story: Story, *numbers: int, healthy: bool = True) -> None:
    """Heartbeats with these numbers, one each tenth of a second, of a vehicle that stands."""
    for number in numbers:
        beat = replace(story.heartbeat(healthy=healthy), seq=number)
        story.at(story.t + 0.1, beat, story.told(**DOWN))


@pytest.mark.parametrize("second", [3, 100, 101, 104, 5000])
def test_two_nodes_of_one_name_are_one_clear_reason_and_no_flapping(second):
    """Given that the second one has no device."""
    story = Story(shipped("multirotor")).ready()
    numbered(story, *range(100, 110))
    assert story.state.stage is Stage.READY
    for k in range(40):
        numbered(story, 110 + k)
        numbered(story, second + 10 + k, healthy=False)
        assert k < 4 or story.state.stage is Stage.BLOCKED
    reasons = block_reasons(story.config, story.state, story.t)
    assert f"{LINK}: {TWO_NODES}" in reasons
    # Given that the second one is ended, when its last sign is over, then it is READY.
    numbered(story, *range(150, 210))
    assert story.state.stage is Stage.READY


def test_decisions_are_not_repeated_at_each_word_of_two_nodes():
    story = Story(shipped("multirotor")).ready()
    numbered(story, *range(100, 110))
    before = len(story.decisions())
    for k in range(50):
        numbered(story, 110 + k, 10 + k)
    assert len(story.decisions()) <= before + 3


@pytest.mark.parametrize("numbers", [(1, 2, 3, 4, 5), (1, 3, 4, 6), (3, 1, 2, 3, 4, 5, 6)])
def test_one_that_restarts_again_and_again_is_not_two(numbers):
    story = Story(shipped("multirotor")).ready()
    numbered(story, *range(100, 110))
    for _ in range(3):
        numbered(story, *numbers)
        assert not story.state.evidence(LINK).is_two(story.t)
