"""Stories of requests over a whole link: the closed loop of a release, kill, what is refused."""

import pytest
from link_bench import Bench, ack, copter, heartbeat, status

from chute_ros.links.mavlink.protocol import results
from chute_ros.protocol.events import RequestReport
from chute_ros.protocol.goal import EffectLimits
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
        "WARNING: autopilot 1/1 reports armed: the motors may turn; "
        "PARACHUTE_STATUS reports deployed after 0.30 s; acknowledged after 0.10 s"
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


def test_release_with_force_arms_each_trigger_on_the_way_and_waits_for_none():
    bench = ready().call("deploy", 1, True)
    assert {t for t, _ in bench.sent} == {0.5}
    fc, offboard, order = bench.commands()
    assert (fc.command, fc.param1, fc.param2) == (TRIGGERS, 4, 4)
    assert (offboard.command, offboard.param1, offboard.param2) == (TRIGGERS, 8, 8)
    assert (order.command, order.param1) == (RELEASE, 2)


def test_release_with_force_arms_again_each_time_that_it_is_sent():
    """A burst that loses the first of both would else cost a whole try."""
    bench = ready().call("deploy", 1, True).at(0.75)
    again = [(order.command, order.param1) for t, order in bench.sent if t == pytest.approx(0.7)]
    assert again == [(TRIGGERS, 4), (TRIGGERS, 8), (RELEASE, 2)]
    # And one without force that joins it takes nothing from it.
    bench = ready().call("deploy", 1, True).at(0.55).call("deploy", 2, False).clear().at(0.8)
    assert [order.command for order in bench.commands()] == [TRIGGERS, TRIGGERS, RELEASE]


class Module:
    """A parachute with some trigger sources, which denies a mask with any other."""

    def __init__(self, bench, ids=CHUTE, has=0xFF, armed=0):
        self.bench, self.ids, self.has, self.armed = bench, ids, has, armed
        self.deployed = self.boot = self.seen = 0
        self.beat = 0.0

    def live(self, until, others=()):
        """Answer what is sent, each 10 ms, and what the others are sent."""
        while self.bench.t < until:
            self.bench.at(self.bench.t + 0.01)
            for one in (self, *others):
                one.turn()
        return self.bench

    def turn(self):
        fresh, self.seen = self.bench.sent[self.seen :], len(self.bench.sent)
        if self.bench.t >= self.beat + 1.0:
            self.beat = self.bench.t
            self.bench.hear(self.ids, heartbeat())
        for _, order in fresh:
            if order.get_type() == "COMMAND_LONG" and self._is_meant(order):
                self._obey(order)

    def _is_meant(self, order):
        return (order.target_system, order.target_component) == self.ids

    def _obey(self, order):
        if order.command == TRIGGERS:
            arm, select = int(order.param1), int(order.param2)
            allowed = not select & ~self.has
            if allowed:
                self.armed = self.armed & ~select | arm & select
            self._answer(order, allowed, d.MAV_RESULT_DENIED)
        elif order.command == RELEASE:
            self.deployed = self.deployed or (3 if self.armed & 12 else 0)
            self._answer(order, self.deployed, d.MAV_RESULT_FAILED)
        elif order.command == REQUEST:
            self._answer(order, True, None)
            self.boot = round(self.bench.t * 1000)
            told = status(boot_ms=self.boot + 5000, armed=self.armed, deployed=self.deployed)
            self.bench.hear(self.ids, told)

    def _answer(self, order, allowed, otherwise):
        result = d.MAV_RESULT_ACCEPTED if allowed else otherwise
        self.bench.hear(self.ids, ack(order.command, result))


def started(*ids, **config):
    bench = Bench(**config)
    for one in ids or (CHUTE,):
        bench.hear(one, heartbeat(), status(boot_ms=4000))
    return bench


@pytest.mark.parametrize("has", [4, 8], ids=["FC alone", "OFFBOARD alone"])
def test_a_module_that_lacks_a_source_is_released_by_force_as_fast_as_any(has):
    bench = started()
    module = Module(bench, has=has)
    bench.at(0.5).call("deploy", 1, True)
    end = module.live(1.0).end(1).finished
    assert (end.success, end.accepted) == (True, True)
    assert "after 0.01 s" in end.message


def test_a_refusal_to_arm_on_the_way_is_told_when_the_release_fails():
    bench = started()
    module = Module(bench, has=0)
    bench.at(0.5).call("deploy", 1, True)
    end = module.live(6.0).end(1).finished
    assert not end.success
    assert "arming FC or OFFBOARD on the way: denied" in end.message
    # But no earlier one's.
    bench = started(effect=EffectLimits(give_up_after=0.5))
    module = Module(bench, has=0)
    bench.at(0.5).call("arm", 1, True, 0)
    module.live(1.0)
    bench.call("deploy", 2, False)
    assert "on the way: denied" not in module.live(2.0).end(2).finished.message


def test_an_arming_that_is_refused_arms_no_half_and_names_the_choice():
    bench = started()
    module = Module(bench, has=4)
    bench.at(0.5).call("arm", 1, True, 0)
    end = module.live(1.0).end(1).finished
    assert not end.success
    assert "denied" in end.message
    text = "it may lack one of FC, OFFBOARD: choose those that it has by triggers, or by "
    assert text + "default_triggers" in end.message
    assert module.armed == 0


@pytest.mark.parametrize("has", [4, 8], ids=["FC alone", "OFFBOARD alone"])
def test_a_module_that_lacks_a_source_is_disarmed_all_the_same(has):
    bench = started()
    module = Module(bench, has=has, armed=has)
    bench.at(0.5).call("arm", 1, False, 0)
    assert module.live(1.0).end(1).finished.success
    assert module.armed == 0


SECOND, THIRD = (1, 162), (1, 163)


@pytest.mark.parametrize("arm", [True, False])
def test_arming_without_a_device_goes_to_every_parachute(arm):
    bench = started(CHUTE, SECOND)
    first, second = (Module(bench, ids, armed=0 if arm else 12) for ids in (CHUTE, SECOND))
    bench.at(0.5).call("arm", 1, arm, 0)
    end = first.live(1.0, [second]).end(1).finished
    assert (end.success, end.accepted, end.shown) == (True, True, True)
    assert (first.armed, second.armed) == ((12, 12) if arm else (0, 0))
    assert "1/161: PARACHUTE_STATUS reports FC" in end.message
    assert "1/162: PARACHUTE_STATUS reports FC" in end.message
    assert steps(bench, 1).count("CONFIRMED") == 1


def test_arming_fails_if_one_parachute_refuses_and_names_it_first():
    bench = started(CHUTE, SECOND)
    first, second = Module(bench, CHUTE), Module(bench, SECOND, has=4)
    bench.at(0.5).call("arm", 1, True, 0)
    end = first.live(1.0, [second]).end(1).finished
    assert (end.success, end.result) == (False, d.MAV_RESULT_DENIED)
    assert end.message.startswith("1/162: MAV_CMD_SET_PARACHUTE_ARM denied")
    assert "; 1/161: PARACHUTE_STATUS reports FC armed, OFFBOARD armed" in end.message
    assert steps(bench, 1)[-1] == "FAILED"
    assert "CONFIRMED" not in steps(bench, 1)


def test_arming_fails_in_time_if_one_parachute_is_silent_and_the_other_is_sent_no_more():
    bench = started(CHUTE, SECOND)
    first = Module(bench, CHUTE)
    bench.at(0.5).call("arm", 1, False, 0)
    end = first.live(6.0).end(1).finished
    assert not end.success
    assert "1/162: MAV_CMD_SET_PARACHUTE_ARM given up after 5.0 s" in end.message
    to_first = [one for one in bench.commands(TRIGGERS) if one.target_component == 161]
    assert len(to_first) == 1


def test_what_shows_without_its_answer_is_not_sent_again_for_the_sake_of_another():
    bench = started(CHUTE, SECOND).at(0.5).call("arm", 1, False, 0)
    bench.at(0.55).hear(CHUTE, status(boot_ms=5000)).clear().at(2.0)
    assert {order.target_component for order in bench.commands(TRIGGERS)} == {162}


def test_a_lost_parachute_is_not_waited_for_and_is_named():
    bench = started(CHUTE, SECOND)
    first = Module(bench, CHUTE, armed=12)
    first.live(6.0).call("arm", 1, False, 0)
    end = first.live(6.5).end(1).finished
    assert end.success
    assert end.message.startswith("LOST, and nothing was sent to it: 1/162; ")
    # Where all are lost, to the first.
    bench = started(CHUTE, SECOND).at(6.0).call("arm", 1, False, 0)
    (order,) = bench.commands(TRIGGERS)
    assert order.target_component == 161
    # Where there is none, to nobody.
    bench = Bench().call("arm", 1, False, 0)
    assert "no parachute was received on this link" in bench.end(1).finished.message


def test_a_release_of_one_parachute_ends_the_disarming_of_all():
    bench = started(CHUTE, SECOND).at(0.5).call("arm", 1, False, 0).call("deploy", 2, False)
    assert "a release was ordered" in bench.end(1).finished.message
    assert len(bench.clear().at(3.0).commands(TRIGGERS)) == 0


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


def test_of_one_that_force_has_armed_and_that_did_not_release_it_is_said_that_it_is_armed():
    bench = Bench().hear(CHUTE, heartbeat(), status()).call("deploy", 1, True)
    bench.at(0.1).hear(CHUTE, ack(TRIGGERS), status(armed=4), ack(RELEASE, d.MAV_RESULT_FAILED))
    message = bench.at(6.0).end(1).finished.message
    assert "it is ARMED now (FC): on the ground disarm it" in message


PROGRESS = d.MAV_RESULT_IN_PROGRESS


@pytest.mark.parametrize(("force", "number"), [(False, RELEASE), (None, DISARM)])
def test_a_device_that_is_at_it_is_not_waited_for_longer_than_for_an_effect(force, number):
    """It may have forgotten it: a release, and a kill, is sent again."""
    bench, ids = ready(), PILOT if force is None else CHUTE
    bench = bench.call("kill", 1) if force is None else bench.call("deploy", 1, force)
    bench.at(0.6).hear(ids, ack(number, PROGRESS)).clear().at(1.9)
    assert bench.commands(number) == []
    assert len(bench.at(2.05).commands(number)) == 1
    # Though it goes on to say so.
    bench.stream(5.4, 0.1, ids, lambda: ack(number, PROGRESS))
    assert len(bench.commands(number)) == 3
    message = bench.at(6.0).end(1).finished.message
    assert "given up after 5.0 s: IN_PROGRESS was the last answer, and the device's" in message


def test_that_it_was_at_it_is_told_when_nothing_more_came():
    bench = ready().call("deploy", 1, False).at(0.6).hear(CHUTE, ack(RELEASE, PROGRESS))
    message = bench.at(6.0).end(1).finished.message
    text = "no acknowledgement after 5 sends in 1.00 s; IN_PROGRESS was the last answer"
    assert f"given up after 5.0 s: {text}" in message


def test_an_order_that_a_restart_has_made_a_device_forget_is_sent_again_at_once():
    bench = ready().call("deploy", 1, False).at(0.6).hear(CHUTE, ack(RELEASE, PROGRESS))
    bench.clear().at(1.0).hear(CHUTE, status(boot_ms=100)).at(1.1)
    bench.hear(CHUTE, status(boot_ms=200))
    assert "parachute 1/161 restarted" in bench.notices()
    assert [t for t, one in bench.sent if getattr(one, "command", 0) == RELEASE] == [1.1]


def test_what_is_not_urgent_is_left_in_progress_for_longer():
    bench = ready().call("parachute_action", 1, 1, "").at(0.6).hear(CHUTE, ack(RELEASE, PROGRESS))
    assert bench.clear().at(4.9).commands(RELEASE) == []
    bench.hear(CHUTE, ack(RELEASE))
    assert bench.end(1).finished.success
