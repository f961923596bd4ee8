"""Stories of requests over a whole link: the closed loop of a release, kill, what is refused."""

import pytest
from link_bench import Bench, ack, copter, heartbeat, status

from chute_ros.links.mavlink.protocol import results
from chute_ros.protocol.events import RequestReport
from chute_ros.protocol.mavlink.dialect import dialect as d

CHUTE, PILOT = (1, 161), (1, 1)
RELEASE, TRIGGERS, REQUEST, DISARM = 208, 225, 512, 400


def ready(**config):
    bench = Bench(**config).hear(CHUTE, heartbeat(), status(armed=12)).hear(PILOT, copter(True))
    bench.clear()
    return bench.at(0.5)


def steps(bench, token):
    reports = [e.report for e in bench.events if isinstance(e, RequestReport)]
    return [report.outcome.name for report in reports if report.token == token]


def test_release_is_done_when_the_parachute_itself_says_deployed():
    bench = ready().call("deploy", 1, False).at(0.6).hear(CHUTE, ack(RELEASE))
    assert steps(bench, 1) == ["SENT", "ACCEPTED"]
    assert bench.commands(REQUEST)[0].param1 == 430  # does not wait for the 1 Hz stream
    bench.at(0.8).hear(CHUTE, status(boot_ms=5300, deployed=4))
    assert steps(bench, 1) == ["SENT", "ACCEPTED", "CONFIRMED"]
    assert bench.end(1).finished.message == (
        "PARACHUTE_STATUS reports deployed after 0.30 s; acknowledged after 0.10 s; "
        "WARNING: autopilot 1/1 reports armed: the motors may turn"
    )
    count = len(bench.commands(RELEASE))
    bench.at(10.0)
    assert len(bench.commands(RELEASE)) == count  # nothing more is sent


def test_release_is_done_without_an_acknowledgement_but_not_without_being_shown():
    bench = ready().call("deploy", 1, False)
    end = bench.at(0.8).hear(CHUTE, status(boot_ms=5300, deployed=4)).end(1).finished
    assert (end.success, end.accepted) == (True, False)
    bench = ready().call("deploy", 1, False)
    end = bench.at(0.6).hear(CHUTE, ack(RELEASE)).at(20.0).end(1).finished
    assert (end.success, end.accepted) == (False, True)
    assert "never showed that PARACHUTE_STATUS reports deployed" in end.message


def test_release_that_nobody_answers_is_resent_and_given_up_in_time():
    bench = ready().call("deploy", 1, False).at(20.0)
    orders = bench.commands(RELEASE)
    assert [order.confirmation for order in orders[:3]] == [0, 1, 2]
    end = bench.end(1).finished
    assert (end.success, end.accepted, end.result) == (False, False, results.NO_ACKNOWLEDGEMENT)
    assert "given up after 5.0 s" in end.message


def test_release_without_ground_clearance_goes_on_until_it_is_accepted():
    bench = ready().call("deploy", 1, False)
    bench.at(0.6).hear(CHUTE, ack(RELEASE, d.MAV_RESULT_TEMPORARILY_REJECTED))
    bench.at(1.0).hear(CHUTE, ack(RELEASE), status(boot_ms=5500, deployed=4))
    assert bench.end(1).finished.success


def test_release_with_force_arms_the_trigger_on_the_way():
    bench = ready().call("deploy", 1, True)
    arm, order = bench.commands()
    assert (arm.command, arm.param1, arm.param2) == (TRIGGERS, 12, 12)
    assert (order.command, order.param1) == (RELEASE, 2)


def test_acknowledgement_by_or_to_another_component_is_not_ours():
    for foreign in ((2, 161), (1, 162), (255, 190), (1, 1)):
        bench = ready().call("deploy", 1, False)
        bench.at(0.6).hear(foreign, heartbeat(), ack(RELEASE), status(deployed=4))
        assert steps(bench, 1) == ["SENT"], foreign
    bench = ready().call("deploy", 1, False)
    bench.at(0.6).hear(CHUTE, ack(RELEASE, target=(255, 190)), ack(RELEASE, target=(1, 1)))
    assert steps(bench, 1) == ["SENT"]
    assert bench.link.counts["acknowledgements for another component"] == 2
    bench.hear(CHUTE, ack(RELEASE, target=(1, 191)))
    assert steps(bench, 1) == ["SENT", "ACCEPTED"]


def test_deployed_parachute_is_not_released_again_by_its_old_word():
    # Deployed parachute is not released again.
    bench = ready().hear(CHUTE, status(boot_ms=5200, deployed=2)).call("deploy", 1, False)
    assert bench.end(1).finished.success
    assert bench.commands() == []
    # Old word of having deployed does not hold back a release.
    bench = ready().hear(CHUTE, status(boot_ms=5200, deployed=2))
    bench.stream(6.0, 1.0, CHUTE, heartbeat).call("deploy", 1, False)
    assert len(bench.commands(RELEASE)) == 1
    assert bench.ends(1) == []
    bench.at(6.1).hear(CHUTE, status(boot_ms=11_000, deployed=2))
    assert bench.end(1).finished.success


@pytest.mark.parametrize(
    ("quiet", "sent"), [(3.0, 0), (5.5, 1)], ids=["heartbeats are STALE", "it is LOST"]
)
def test_a_young_word_of_having_deployed_counts_until_the_device_is_lost(quiet, sent):
    bench = ready().stream(quiet, 0.5, CHUTE, lambda: status(boot_ms=5200, deployed=2))
    bench.clear().call("deploy", 1, False)
    assert len(bench.commands(RELEASE)) == sent
    assert [end.finished.success for end in bench.ends(1)] == [True] * (1 - sent)


def test_nothing_makes_a_parachute_less_ready_while_it_is_being_released():
    bench = ready().call("deploy", 1, False).call("set_triggers", 2, 0, 4, "")
    bench.call("parachute_action", 3, d.PARACHUTE_DISABLE, "")
    for token in (2, 3):
        assert "a release is under way" in bench.end(token).finished.message
    assert [order.command for order in bench.commands()] == [RELEASE]
    # Disarm under way gives way to a release.
    bench = ready().call("arm", 1, False, 0).call("deploy", 2, False)
    bench.stream(6.0, 0.5, CHUTE, heartbeat)
    assert not bench.end(1).finished.success
    assert "a release was ordered" in bench.end(1).finished.message
    assert len(bench.commands(TRIGGERS)) <= 1


def test_kill_before_deploy_go_side_by_side():
    bench = ready().call("kill", 1).call("deploy", 2, False)
    assert [order.command for order in bench.commands()] == [DISARM, RELEASE]
    bench.at(0.6).hear(PILOT, ack(DISARM)).hear(CHUTE, ack(RELEASE))
    bench.hear(CHUTE, status(boot_ms=5100, deployed=4))
    assert bench.end(2).finished.success
    bench.at(0.7).hear(PILOT, copter(False))
    assert bench.end(1).finished.success


def test_kill_is_sent_even_if_the_motors_are_thought_to_be_off():
    bench = Bench().hear(PILOT, copter(armed=False)).at(0.5).call("kill", 1)
    assert len(bench.commands(DISARM)) == 1
    assert bench.ends(1) == []
    bench.at(0.6).hear(PILOT, copter(armed=False))
    assert bench.end(1).finished.success


def test_kill_that_is_refused_is_tried_on_until_time_is_up():
    denied = ack(DISARM, d.MAV_RESULT_DENIED)
    bench = ready().call("kill", 1).stream(6.0, 0.1, PILOT, lambda: denied)
    assert len(bench.commands(DISARM)) > 10
    assert bench.end(1).finished.result == d.MAV_RESULT_DENIED
    bench = Bench().hear(CHUTE, heartbeat()).call("kill", 1)
    assert "no autopilot of ours was received yet" in bench.end(1).finished.message


ALL = [
    lambda link, token, device, now: link.set_triggers(token, 4, 4, device, now),
    lambda link, token, device, now: link.deploy(token, False, now, device),
    lambda link, token, device, now: link.parachute_action(token, 1, device, now),
    lambda link, token, device, now: link.request_message(token, 430, device, now),
    lambda link, token, device, now: link.set_message_interval(token, 430, 1, device, now),
]


@pytest.mark.parametrize("ask", ALL)
def test_device_that_is_not_there_is_refused_and_every_request_ends_exactly_once(ask):
    bench = ready()
    ask(bench.link, 9, "1/7", bench.now)
    text = "no parachute '1/7' was received on this link (received: 1/161)"
    assert bench.collect().end(9).finished.message == text
    assert bench.commands() == []
    bench = ready()
    ask(bench.link, 9, "", bench.now)
    assert not bench.stream(30.0, 1.0, CHUTE, heartbeat).end(9).finished.success


def test_action_that_does_not_exist_is_refused():
    for action in (3, 7, 255, -1):
        bench = ready().call("parachute_action", 9, action, "")
        assert not bench.end(9).finished.success, action
        assert bench.commands() == []


def test_arm_by_default_and_by_mask():
    for arm, triggers, masks in ((True, 0, (12, 12)), (False, 6, (0, 6))):
        (order,) = ready().call("arm", 1, arm, triggers).commands(TRIGGERS)
        assert (order.param1, order.param2) == masks


def test_public_emulator_speaks_as_255_0_and_is_answered_there():
    bench = Bench(system_id=1).hear((255, 0), heartbeat(), status())
    bench.call("deploy", 1, False)
    (order,) = bench.commands()
    assert (order.target_system, order.target_component) == (255, 0)
    bench.at(0.1).hear((255, 0), ack(RELEASE), status(boot_ms=5100, deployed=4))
    assert bench.end(1).finished.success


def test_copy_of_an_acknowledgement_settles_nothing_twice():
    bench = ready().hear(CHUTE, heartbeat()).call("parachute_action", 1, 1, "")
    raw = bench.encoder(CHUTE).encode(ack(RELEASE), bench.now)
    bench.link.receive(raw, bench.now)
    bench.call("parachute_action", 2, 0, "")
    bench.link.receive(raw, bench.now)
    bench.collect()
    assert bench.end(1).finished.success
    assert bench.ends(2) == []
    assert bench.link.counts["duplicate acknowledgements"] == 1


STREAMED = [245, 33, 30, 26, 1]


def needed(bench):
    return [order for order in bench.commands(511) if order.param1 in STREAMED]


def test_autopilots_messages_are_asked_for_at_the_set_rate():
    bench = Bench(autopilot_message_rate=20.0).hear(PILOT, copter())
    orders = bench.commands(511)
    asked = [(order.param1, order.param2) for order in orders]
    assert asked == [(message, 50_000) for message in STREAMED[:-1]] + [(STREAMED[-1], 1_000_000)]
    bench.stream(4.6, 0.5, PILOT, copter)
    assert len(needed(bench)) == 5 * 10, "often at first"
    bench.clear().stream(40.0, 0.5, PILOT, copter)
    assert 5 * 6 <= len(needed(bench)) <= 5 * 9, "then now and then"
    bench.clear().call("set_autopilot_message_rate", 4.0)
    assert [order.param2 for order in bench.commands(511)] == [250_000] * 4 + [1_000_000]
    bench.clear().call("set_autopilot_message_rate", 0.0).stream(20.0, 0.5, PILOT, copter)
    assert bench.commands() == []


@pytest.mark.parametrize("rate", [5e-324, 1e-300, 0.01, 100.0])
def test_no_rate_that_may_be_set_is_too_much_for_a_command(rate):
    bench = Bench(autopilot_message_rate=rate).hear(PILOT, copter())
    assert [order.param1 for order in bench.commands(511)] == STREAMED


def test_a_rate_that_is_set_later_is_asked_for_once_the_autopilot_is_there():
    bench = Bench(autopilot_message_rate=0.0).hear(PILOT, copter())
    bench.call("set_autopilot_message_rate", 10.0)
    assert [order.param2 for order in bench.commands(511)] == [100_000] * 4 + [1_000_000]


def refused(result, **told):
    """The end of a release that a parachute refuses that says this of itself."""
    bench = Bench().hear(CHUTE, heartbeat(), status(**told)).call("deploy", 1, False)
    return bench.at(0.1).hear(CHUTE, ack(RELEASE, result)).end(1).finished.message


def test_a_refused_release_names_what_the_parachute_says_of_itself():
    message = refused(d.MAV_RESULT_FAILED, armed=2)
    assert "armed triggers: ATS; need FC or OFFBOARD, which force arms on the way" in message
    assert "does not report GROUND_CLEARED" in message
    said = "armed triggers: OFFBOARD; this module may need FC, which force arms on the way"
    assert said in refused(d.MAV_RESULT_FAILED, armed=8, safety=1)
    message = refused(d.MAV_RESULT_DENIED, armed=4, safety=1)
    assert "armed triggers" not in message
    assert "GROUND_CLEARED" not in message
