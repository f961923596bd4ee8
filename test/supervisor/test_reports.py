"""Reports of nodes, parachutes and the vehicle: what they block, and in which words."""

import itertools
import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import (
    DOWN,
    FLYING,
    IDLING,
    LINK,
    STANDING,
    START,
    Story,
    parachute,
    vehicle,
    with_rules,
)

from chute_ros.model import Action, Armed, LandedState, LinkState, Outcome, VehicleState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import PreflightLimits, Rung, SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.link_evidence import LinkLimits
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import block_reasons
from chute_ros.supervisor.state import State

K, D = Action.KILL, Action.DEPLOY
BLOCK, RELEASE = Action.FLIGHT_BLOCK, Action.FLIGHT_BLOCK_RELEASE
UPF = "upf_can"
BOTH = SupervisorConfig(kill_links=(LINK, UPF), deploy_links=(LINK, UPF))


def reasons(story: Story) -> str:
    return "; ".join(block_reasons(story.config, story.state, 1000.0 + story.t))


def test_flight_is_blocked_from_the_first_moment_until_links_are_healthy():
    story = Story()
    story.at(0.0)
    assert [d.action for d in story.decisions()] == [BLOCK]
    assert "nothing received from its node" in reasons(story)
    story.at(0.05, story.heartbeat())
    assert story.state.stage is Stage.STARTUP
    assert "armed or disarmed was never reported" in reasons(story)
    story.at(0.1, i.VehicleReport(STANDING))
    assert [d.action for d in story.decisions()] == [BLOCK, RELEASE]
    assert story.state.stage is Stage.READY
    story = Story(SupervisorConfig(require_vehicle_state=False))
    story.at(0.0, story.heartbeat())
    assert story.state.stage is Stage.READY, "the vehicle state can be done without"


@pytest.mark.parametrize("links", [{"deploy_links": ("mistyped",)}, {"kill_links": ("mistyped",)}])
def test_a_link_that_does_not_exist_blocks_flight_and_is_named(links):
    story = Story(SupervisorConfig(**links))
    story.at(0.0, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.STARTUP
    assert reasons(story) == "mistyped: nothing received from its node"


@pytest.mark.parametrize(
    ("heartbeat", "words"),
    [
        ((False, LinkState.OK), "its device is not healthy"),
        ((False, LinkState.NEVER_SEEN), "nothing received from its device"),
        ((False, LinkState.STALE), "its device is STALE"),
        ((False, LinkState.LOST), "its device is LOST"),
    ],
)
def test_missing_stale_lost_and_unhealthy_are_different(heartbeat, words):
    story = Story().ready()
    story.at(0.1, story.heartbeat(healthy=heartbeat[0], state=heartbeat[1]))
    assert story.state.stage is Stage.BLOCKED
    assert words in reasons(story)
    assert words in "; ".join(story.newest(BLOCK).reasons)


def test_the_faults_of_the_device_are_named():
    story = Story().ready()
    story.at(0.1, parachute(LINK, "1/161", False, ("LOW_POWER",)))
    story.at(0.1, story.heartbeat(healthy=False))
    assert "1/161 LOW_POWER" in reasons(story)


def test_a_silent_node_is_stale_and_then_lost_each_at_its_limit():
    story = Story().ready()
    story.at(0.49)
    assert story.state.stage is Stage.READY
    story.at(0.5)
    assert story.state.stage is Stage.BLOCKED
    assert "STALE, heartbeat of its node 0.50 s old (limit 0.5 s)" in reasons(story)
    story.at(1.0)
    assert "LOST, heartbeat of its node 1.00 s old" in reasons(story)


def test_a_link_that_comes_back_releases_flight_again():
    story = Story().ready()
    story.at(2.0)
    story.at(2.1, story.heartbeat(), i.VehicleReport(STANDING))
    assert reasons(story) == f"{LINK}: REGAINED, received again for 0.00 s (need 1 s)"
    story.alive(3.05)
    assert story.state.stage is Stage.BLOCKED
    story.alive(3.25)
    assert story.state.stage is Stage.READY
    assert story.decisions()[-1].action is RELEASE


def test_a_link_that_is_not_required_does_not_block():
    story = Story(SupervisorConfig(deploy_links=(LINK, "upf_can"))).ready()
    assert story.state.stage is Stage.READY


def test_a_link_that_is_not_ours_is_not_followed():
    story = Story().ready()
    story.at(0.0, story.heartbeat("stranger"), parachute("stranger", "9", True, ()))
    assert set(story.state.heard.links) == {LINK}


def test_a_node_that_restarts_before_its_second_heartbeat_is_noticed_too():
    story = Story()
    story.at(0.0, parachute(LINK, "1/161", False, ()))
    story.at(0.1, i.LinkHeartbeat(LINK, LinkState.OK, False, 0))
    assert len(story.decisions()) == 1
    story.at(0.2, i.LinkHeartbeat(LINK, LinkState.OK, False, 0))
    assert len(story.decisions()) == 2


def test_a_node_that_never_reports_is_asked_ever_more_rarely_but_once_a_second():
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    for tick in range(1, 3000):
        story.at(tick * 0.1, story.heartbeat(healthy=False))
    times = [t for t, o in story.outputs if isinstance(o, i.Decide) and o.again]
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert gaps[0] == pytest.approx(0.1)
    assert max(gaps) <= 1.1
    assert len(times) < 320


def test_a_block_is_sent_again_until_reported_but_only_to_a_node_that_lives():
    story = Story()
    story.at(5.0)
    assert not [o for _, o in story.outputs if isinstance(o, i.Decide) and o.again]
    story.at(5.1, story.heartbeat(healthy=False))
    again = [o for _, o in story.outputs if isinstance(o, i.Decide) and o.again]
    assert [o.decision.action for o in again] == [BLOCK]
    story.at(5.2, story.report(BLOCK, Outcome.CONFIRMED))
    count = len(story.outputs)
    story.alive(5.3)
    assert not [o for _, o in story.outputs[count:] if isinstance(o, i.Decide) and o.again]


def test_a_lost_link_in_flight_neither_blocks_nor_fires():
    story = Story().flying()
    before = len(story.decisions())
    story.at(60.0)
    assert story.state.stage is Stage.IN_FLIGHT
    assert len(story.decisions()) == before


def test_after_landing_it_is_ready_again_once_it_is_disarmed_and_its_links_are_healthy():
    """By its parachute or by its autopilot, without a reset."""
    for disarmed in (i.ArmDone(0, False, True, "done"), i.VehicleReport(STANDING)):
        story = Story().flying()
        story.at(0.1, story.heartbeat(), i.VehicleReport(IDLING))
        assert story.state.stage is Stage.LANDED
        story.at(0.2, disarmed)
        assert story.state.stage is Stage.READY
        story.at(0.3, i.VehicleReport(FLYING))
        assert story.state.stage is Stage.IN_FLIGHT
    story = Story().flying()
    story.at(0.1, story.heartbeat(healthy=False), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.BLOCKED
    assert story.decisions()[-1].action is BLOCK


def test_a_report_on_the_decision_of_another_supervisor_moves_no_epoch():
    # Two that overtook each other at every report would never end.
    story = Story().ready()
    story.at(0.1, i.ActionReport(900, 1, LINK, Outcome.SENT, "told", newest_epoch=900))
    assert story.state.epoch == 7


def test_a_vehicle_state_that_stops_blocks_flight_at_its_limit():
    story = Story().ready()
    story.alive(2.4)
    assert story.state.stage is Stage.READY
    story.alive(2.6)
    assert story.state.stage is Stage.BLOCKED
    assert "armed or not is 2.6 s old (limit 2.5 s)" in reasons(story)


# -- heartbeats ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("difference", "differs"),
    [(0.5, False), (-0.5, False), (0.5625, True), (-0.5625, True), (math.nan, False)],
)
def test_a_wall_clock_that_differs_is_an_alarm_once(difference, differs):
    story = Story(SupervisorConfig(preflight=PreflightLimits(max_clock_difference=0.5)))
    for tick in range(15):
        story.at(tick * 0.1, replace(story.heartbeat(), clock_difference=difference))
    text = "mavlink_parachute: its wall clock differs; it may refuse decisions as too old"
    assert story.alarms() == [text] * differs


@pytest.mark.parametrize(
    ("before", "seq", "t", "why"),
    [
        (5, 6, 0.2, None),
        (5, 5, 0.2, "mavlink_parachute restarted"),
        (5, 4, 0.2, "mavlink_parachute restarted"),
        (5, 6, 0.9, None),
        (5, 6, 1.0, "mavlink_parachute is back"),
        (5, 5, 1.0, "mavlink_parachute restarted"),
    ],
)
def test_a_node_that_may_have_restarted_is_told_again_and_why(before, seq, t, why):
    story = Story()
    story.at(0.0, i.LinkHeartbeat(LINK, LinkState.OK, False, before))
    story.at(0.1, story.report(BLOCK, Outcome.CONFIRMED))
    story.at(t, i.LinkHeartbeat(LINK, LinkState.OK, False, seq))
    reasons = story.decisions(BLOCK)[0].reasons
    anew = [d.reasons for d in story.decisions(BLOCK)[1:]]
    assert anew == ([(*reasons, why)] if why else [])


def test_for_how_long_a_node_may_be_silent_is_its_own_setting():
    limits = MappingProxyType({LINK: LinkLimits(lost_after=5.0)})
    story = Story(SupervisorConfig(link_limits=limits))
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(0.1, story.report(BLOCK, Outcome.CONFIRMED))
    story.at(4.0, story.heartbeat(healthy=False))
    assert len(story.decisions(BLOCK)) == 1


def under_way() -> Story:
    """Only the second parachute is on the way, and the second node alone was told of the block."""
    config = SupervisorConfig(
        deploy_links=(LINK, UPF),
        deploy_ladder=(Rung(UPF), Rung(LINK)),
        require_vehicle_state=False,
    )
    story = Story(config).flying()
    beats = story.heartbeat(), i.LinkHeartbeat(UPF, LinkState.OK, True, 900)
    story.at(0.1, *beats, i.DeployRequest(5, False, "it falls"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert [d.targets for d in story.decisions(D)] == [(UPF,)]
    return story


def test_a_node_that_restarts_hears_of_what_it_was_told_and_of_nothing_else():
    story = under_way()
    count = len(story.decisions())
    story.at(0.3, i.LinkHeartbeat(LINK, LinkState.OK, True, 0))
    assert len(story.decisions()) == count, "the kill is confirmed, and the deploy is not for it"
    story.at(0.4, i.LinkHeartbeat(UPF, LinkState.OK, True, 0))
    anew = story.decisions()[count:]
    assert [(d.action, d.targets) for d in anew] == [(D, (UPF,))], (
        "although the kill was not for it"
    )
    assert anew[0].reasons[-1] == "upf_can restarted"


@pytest.mark.parametrize("outcome", [Outcome.SENT, Outcome.FAILED])
def test_of_what_it_has_begun_one_that_was_only_silent_is_not_told_again(outcome):
    story = Story(BOTH).flying()
    beats = story.heartbeat(), story.heartbeat(UPF)
    story.at(0.1, *beats, i.KillRequest(5, "operator", "stop"))
    story.at(0.2, story.report(K, outcome))
    story.at(2.0, story.heartbeat())
    anew = [d.action for d in story.decisions() if d.reasons[-1] == "mavlink_parachute is back"]
    assert anew == ([] if outcome is Outcome.SENT else [K])


# -- parachutes ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("later", "counts"),
    [
        ({"deployed": False}, True),
        ({"deployed": False, "alive": False}, False),
        ({"deployed": True}, False),
        ({"deployed": False, "device": "1/162"}, False),
        ({"deployed": False, "link": UPF}, False),
    ],
)
def test_one_that_was_out_before_counts_only_after_it_says_itself_that_it_is_packed(later, counts):
    story = Story(BOTH).ready()
    story.at(0.1, parachute(deployed=True), story.heartbeat(), i.VehicleReport(STANDING))
    story.at(0.2, parachute(**later), i.VehicleReport(FLYING))
    story.at(0.3, parachute(deployed=True))
    assert (story.state.stage is Stage.DEPLOYED) is counts


def test_a_parachute_that_is_out_counts_although_its_node_was_never_heard():
    story = Story(BOTH).flying()
    story.at(0.1, parachute(UPF, "33", deployed=True))
    assert story.state.stage is Stage.DEPLOYED


def test_the_picture_of_one_takes_nothing_of_what_is_known_of_its_link():
    story = Story().ready()
    story.at(0.1, parachute(device="1/161"))
    story.at(0.2, parachute(device="1/162"))
    evidence = story.state.evidence(LINK)
    assert set(evidence.devices) == {"1/161", "1/162"}
    assert evidence.heard == START


BACK = "mavlink_parachute 1/161 no longer reports deployed"


@pytest.mark.parametrize(
    ("one", "told", "alarms"),
    [
        ({}, FLYING, [BACK]),
        ({}, VehicleState(), [BACK]),
        ({}, STANDING, []),
        ({"alive": False}, FLYING, []),
        ({"deployed": True}, FLYING, []),
        ({"device": "1/162"}, FLYING, []),
        ({"link": "stranger"}, FLYING, []),
    ],
)
def test_a_release_that_is_taken_back_in_the_air_is_an_alarm_in_these_words(one, told, alarms):
    story = Story(BOTH).flying()
    story.at(0.1, parachute(deployed=True), story.report(RELEASE, Outcome.SENT))
    assert story.state.stage is Stage.DEPLOYED
    story.at(0.2, i.VehicleReport(told))
    story.at(0.3, parachute(**one))
    assert story.alarms() == alarms


def test_one_that_is_taken_back_before_a_flight_was_released_all_the_same():
    """Although nothing is known of the vehicle."""
    story = Story()
    story.at(0.1, parachute(deployed=True))
    story.at(0.2, parachute(deployed=False))
    told = f"{LINK} 1/161 was released: repack or replace it, then call safety/reset"
    assert story.alarms() == [told]


# -- the vehicle ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("before", "now", "height"),
    [
        (Armed.DISARMED, Armed.ARMED, 7.0),
        (Armed.UNKNOWN, Armed.ARMED, 0.0),
        (Armed.DISARMED, Armed.UNKNOWN, 0.0),
        (Armed.ARMED, Armed.ARMED, 0.0),
    ],
)
def test_the_height_at_which_it_was_armed_is_kept(before, now, height):
    story = Story()
    story.at(0.0, vehicle(armed=before))
    story.at(0.1, vehicle(armed=now, height=7.0))
    assert story.state.flight.armed_height == height
    # Armed without a height it is taken for 0.
    story.at(0.2, vehicle(armed=Armed.DISARMED))
    story.at(9.0, vehicle(armed=Armed.ARMED, height=math.nan))
    assert story.state.flight.armed_height == 0.0


def test_each_measurement_goes_on_from_its_own_past_and_the_distance_from_home():
    story = Story(with_rules()).ready().fly(0.2, latitude=48.0, longitude=11.0)
    story.fly(0.4, latitude=48.5, longitude=11.0)
    assert story.state.measured("height").count == 8
    assert story.state.measured("tilt_deg").value == pytest.approx(5.0)
    assert story.state.measured("distance_from_home").value == pytest.approx(55_600, rel=0.01)


def heights(*told: tuple[float, float]) -> list[tuple[float, float]]:
    """What is kept after these (t, height)."""
    story = Story()
    for t, height in told:
        story.at(t, vehicle(height=height))
    return [(at - START, height) for at, height in story.state.heard.heights]


EIGHTHS = [(tick / 8, float(tick)) for tick in range(20)]
FAST = [(tick / 64, float(tick)) for tick in range(65)]
TWO_HEIGHTS = [(0.125, 1.0), (0.25, 2.0)]


@pytest.mark.parametrize(
    ("told", "kept"),
    [
        # The oldest is just a second old.
        (EIGHTHS, EIGHTHS[-9:]),
        # Of heights that come fast ten a second.
        (FAST, FAST[::7]),
        # Without a height the last ones as they are.
        ([*TWO_HEIGHTS, (0.375, math.nan)], TWO_HEIGHTS),
        ([(0.125, math.nan)], []),
    ],
)
def test_the_heights_of_the_last_second_are_kept(told, kept):
    assert heights(*told) == kept


def test_a_height_just_a_tenth_of_a_second_after_the_last_is_kept():
    state = State(epoch=7, started_at=0.0)
    for now in (0.0, 0.1):
        state, _ = update(SupervisorConfig(), state, (vehicle(height=now),), now)
    assert state.heard.heights == ((0.0, 0.0), (0.1, 0.1))


def test_heights_from_before_a_clock_was_set_back_are_not_kept():
    story = Story()
    for tick in range(8):
        story.at(tick / 8, vehicle(height=float(tick)))
    for tick in range(8, 14):
        story.at(tick / 8, vehicle(height=float(tick), age=30.0))
    assert all(at < START - 25.0 for at, _ in story.state.heard.heights)


def reboots(*told: tuple[dict[str, Any], int, bool]) -> Story:
    """The vehicle tells this, with so many restarts, the last of them in flight or not."""
    story = Story(with_rules())
    for number, (parts, count, in_flight) in enumerate(told):
        one = vehicle(**parts, reboot_count=count, rebooted_in_flight=in_flight)
        story.at(number * 0.1, story.heartbeat(), one)
    return story


UP: dict[str, Any] = {"armed": Armed.ARMED, "landed_state": LandedState.IN_AIR}
ANEW = ["the autopilot restarted in flight"]


@pytest.mark.parametrize(
    ("told", "alarms"),
    [
        # In flight it counts, once.
        ([(DOWN, 2, False), (UP, 2, False), (UP, 3, True), (UP, 3, True)], ANEW),
        ([(DOWN, 2, False), (UP, 2, False), (UP, 3, True), (UP, 4, True)], ANEW),
        # It does not say that this was in flight, or it is none more than before.
        ([(DOWN, 2, False), (UP, 2, False), (UP, 3, False)], []),
        ([(DOWN, 2, False), (UP, 2, False), (UP, 2, True)], []),
        # On the ground it does not, and is not taken for one in the next flight.
        ([(DOWN, 2, False), (DOWN, 3, True)], []),
        ([(DOWN, 2, False), (DOWN, 3, True), (UP, 3, True), (UP, 3, True)], []),
        # A node that has restarted counts from 0 again.
        ([(DOWN, 2, False), (UP, 2, False), (UP, 0, False), (UP, 1, True)], ANEW),
        # The report with which it takes off belongs to the flight.
        ([(DOWN, 2, False), (UP, 3, True), (UP, 3, True)], ANEW),
    ],
)
def test_a_restart_of_the_autopilot_counts_in_flight(told, alarms):
    story = reboots(*told)
    assert story.alarms() == alarms
    assert story.state.flight.rebooted is bool(alarms)


# -- how decisions fare --------------------------------------------------------------------------


def older(story: Story, action: Action, link: str = LINK, detail: str = "older") -> i.ActionReport:
    return story.report(action, Outcome.FAILED, link, detail)


def test_the_newest_details_are_kept_each_once():
    story = Story().flying()
    story.at(0.1, i.KillRequest(5, "operator", "stop"))
    for number in (*range(10), 5, 9):
        story.at(story.t + 0.1, story.report(K, Outcome.SENT, detail=f"try {number}"))
    assert story.state.killing.kill is not None
    assert story.state.killing.kill.details == tuple(f"{LINK}: try {n}" for n in range(2, 10))


def test_a_report_reaches_the_decision_that_it_is_about_behind_others_that_it_is_not():
    """The block and the kill are not for this link, the first step of the ladder neither."""
    config = SupervisorConfig(
        deploy_links=(LINK, UPF),
        deploy_ladder=(Rung(LINK), Rung(UPF)),
        require_vehicle_state=False,
    )
    story = Story(config).flying()
    story.at(0.1, story.heartbeat(), story.heartbeat(UPF), i.DeployRequest(5, False, "it falls"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    story.at(0.3, story.report(D, Outcome.FAILED))
    assert story.newest(D).targets == (UPF,)
    story.at(0.4, story.report(D, Outcome.CONFIRMED, UPF))
    assert story.state.stage is Stage.DEPLOYED
    assert story.state.killing.kill is not None
    assert story.state.killing.kill.of(UPF) == frozenset()


def test_a_deploy_that_a_later_kill_overtook_leaves_again_under_a_new_number_and_says_why():
    story = Story().flying()
    story.at(0.1, i.DeployRequest(5, False, "it falls"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    story.at(0.3, i.KillRequest(6, "operator", "stop"))
    old = story.newest(D)
    story.at(0.4, older(story, D))
    new = story.newest(D)
    assert new.id > story.newest(K).id > old.id
    assert new.reasons == (*old.reasons, "mavlink_parachute saw a newer decision first")
    assert story.state.deploy is not None
    assert story.state.deploy.of(LINK) == frozenset(), "it was refused, not tried"
    story.at(0.5, older(story, D, detail="broken"))
    assert story.state.stage is Stage.FAULT, "nothing is newer any more"


def test_a_kill_that_its_deploy_overtook_leaves_again_although_a_parachute_is_out():
    """Motors that turn tear an open canopy."""
    story = Story().flying()
    story.at(0.1, i.DeployRequest(5, False, "it falls"))
    story.at(0.7, parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    story.at(0.8, older(story, K))
    assert len(story.decisions(K)) == 2
    assert story.newest(K).reasons[-1] == "mavlink_parachute saw a newer decision first"


def test_a_kill_that_was_overtaken_is_not_tried_again_once_all_is_given_up():
    for at, decided in ((5.09, 2), (5.11, 1)):
        story = Story(SupervisorConfig(deploy_timeout=1.0, kill_timeout=5.0)).flying()
        story.at(0.1, i.DeployRequest(5, False, "it falls"))
        story.at(2.0)
        assert story.state.stage is Stage.FAULT
        story.at(at, older(story, K))
        assert len(story.decisions(K)) == decided


def test_a_kill_that_was_sent_and_failed_then_was_not_overtaken():
    story = Story().flying()
    story.at(0.1, i.DeployRequest(5, False, "it falls"))
    story.at(0.2, story.report(K, Outcome.SENT))
    story.at(0.7, older(story, K, detail="no acknowledgement"))
    assert story.newest(D).id > story.newest(K).id
    assert len(story.decisions(K)) == 1


def test_a_newer_decision_for_another_link_overtakes_nothing():
    config = SupervisorConfig(deploy_links=(UPF,), kill_links=(LINK,))
    story = Story(config)
    story.at(0.0, story.heartbeat(UPF))
    story.flying().at(0.1, i.DeployRequest(5, False, "it falls"))
    story.at(0.7)
    assert story.newest(D).id > story.newest(K).id
    story.at(0.8, older(story, K))
    assert len(story.decisions(K)) == 1
    assert story.state.killing.kill is not None
    assert story.state.killing.kill.all_failed()


def test_an_older_number_that_failed_on_a_link_that_was_asked_again_says_nothing():
    story = Story(BOTH).flying()
    story.at(0.1, story.heartbeat(), story.heartbeat(UPF), i.DeployRequest(5, False, "it falls"))
    story.at(0.2, story.report(K, Outcome.SENT, UPF))
    story.at(0.7)
    first = story.newest(K)
    story.at(0.8, older(story, K))
    second = story.newest(K)
    assert (second.id > first.id, second.targets) == (True, (LINK,))

    def old(outcome: Outcome, link: str) -> i.ActionReport:
        return i.ActionReport(first.epoch, first.id, link, outcome, "told", first.epoch)

    assert story.state.killing.kill is not None
    story.at(0.81, old(Outcome.FAILED, LINK))
    assert story.state.killing.kill.of(LINK) == frozenset(), "it was asked again since"
    story.at(0.82, old(Outcome.FAILED, UPF))
    assert story.state.killing.kill.of(UPF) == {Outcome.SENT, Outcome.FAILED}, "it was not"
    story.at(0.83, old(Outcome.CONFIRMED, LINK))
    assert story.state.killing.kill.of(LINK) == {Outcome.CONFIRMED}, "done is done"


# -- epochs --------------------------------------------------------------------------------------


def seen(epoch: int, number: int = 0, outcome: Outcome = Outcome.FAILED) -> i.ActionReport:
    """A report on our first decision by a node that has seen this one."""
    return i.ActionReport(7, 1, LINK, outcome, "older", epoch, number)


def test_a_newer_epoch_is_overtaken_in_these_words():
    story = Story().ready()
    old = story.newest(RELEASE)
    story.at(0.1, seen(900))
    assert "mavlink_parachute has seen epoch 900: continuing as 904" in story.said().splitlines()
    new = story.newest(RELEASE)
    assert (new.epoch, story.state.epoch) == (904, 904)
    assert new.reasons == (*old.reasons, "mavlink_parachute knows a newer epoch")
    assert story.alarms() == []


def test_the_largest_epoch_cannot_be_overtaken_and_is_an_alarm_in_these_words():
    story = Story().ready()
    story.at(0.1, seen(2**32 - 1))
    assert story.state.epoch == 7
    assert story.alarms() == [
        "mavlink_parachute has seen epoch 4294967295, the largest: restart it"
    ]


@pytest.mark.parametrize(("link", "outcome"), [("stranger", Outcome.FAILED), (LINK, Outcome.NONE)])
def test_who_is_not_ours_or_says_nothing_moves_no_epoch(link, outcome):
    story = Story().ready()
    story.at(0.1, i.ActionReport(7, 1, link, outcome, "older", newest_epoch=900))
    assert story.state.epoch == 7


@pytest.mark.parametrize("rank", [0, 1, 2, 3])
def test_the_largest_epoch_of_each_rank_can_still_be_used(rank):
    story = Story(SupervisorConfig(rank=rank)).ready()
    largest = 2**32 - 4 + rank
    story.at(0.1, seen(largest - 1))
    assert story.state.epoch == largest
    assert story.alarms() == []


@pytest.mark.parametrize(("epoch", "number", "foreign"), [(7, 1, False), (7, 2, True)])
def test_under_our_epoch_a_number_that_we_never_gave_is_anothers(epoch, number, foreign):
    story = Story().ready()
    assert story.state.next_id == 2
    story.at(0.1, seen(epoch, number, Outcome.CONFIRMED))
    assert story.state.epoch == (8 if foreign else 7)
    assert story.newest(RELEASE).epoch == story.state.epoch
    assert story.state.block is not None
    assert story.state.block.confirmed is not foreign


@pytest.mark.parametrize(
    ("standby", "epoch", "yields", "then"),
    [(True, 9, True, 7), (True, 900, False, 904), (False, 9, False, 12)],
)
def test_a_standby_yields_to_another_but_not_to_itself_before_its_restart(
    standby, epoch, yields, then
):
    """One that is alone goes on above whoever was there."""
    story = Story(SupervisorConfig(standby=standby)).ready()
    outputs = story.at(0.1, seen(epoch))
    assert (i.Refused(epoch) in outputs) is yields
    assert story.state.epoch == then


def test_one_that_follows_leaves_epochs_alone():
    story = Story().ready().follows()
    story.at(0.1, seen(900))
    assert story.state.epoch == 7
