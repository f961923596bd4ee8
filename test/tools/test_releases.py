"""Each release of a recorded flight: by whose order, what was reported, and what did not come."""

import pytest

from chute_ros.model import Action, Decision, LinkState, Outcome, ParachuteStatus, VehicleState
from chute_ros.supervisor import inputs as i
from chute_ros.tools.flight_story import Asked, Decided, FlightStory
from chute_ros.tools.release_orders import Fate, MotionThen
from chute_ros.tools.releases import releases

LINK, END = "mavlink_parachute", 30.0
NO_ORDER = "no order is in this recording: the device itself, by hand, or past the nodes"


class Story:
    """A flight as it is told: what is said of it, in any order, at t seconds from its start."""

    def __init__(self):
        self.story = FlightStory()

    def decision(self, at, rule="free fall", targets=(LINK,), reasons=("it falls",), **fields):
        one = Decision(7, len(self.story.decisions) + 1, Action.DEPLOY, rule, reasons, targets)
        for name, value in fields.items():
            object.__setattr__(one, name, value)
        self.story.decisions.append(Decided(at, one))
        return self

    def report(self, after, outcome, detail="", link=LINK):
        report = i.ActionReport(7, 1, link, outcome, detail)
        self.story.decisions[-1].reports.append((after, report))
        return self

    def status(self, at, deployed, device="1/161", link=LINK, **fields):
        fields = {"link_state": LinkState.OK, **fields}
        status = ParachuteStatus(device, deployed=deployed, **fields)
        self.story.statuses.append((at, i.ParachuteReport(link, status)))
        return self

    def call(self, at, details="force=False, reason='a test'", what="~/deploy", **answer):
        asked = Asked(at, what, details, link=LINK)
        if answer:
            after = answer.pop("after")
            asked.answer = (after, i.Finish(0, **answer))
        self.story.calls.append(asked)
        return self

    def vehicle(self, at, height, speed, age=0.1):
        state = VehicleState(
            height=height, height_age=age, vertical_speed=speed, vertical_speed_age=age
        )
        self.story.vehicle.append((at, state))
        return self

    def told(self):
        return releases(self.story, END)


def lines(release):
    """Its steps in words."""
    return [f"{one.after:.2f} {one.who} {one.what} {one.detail}".strip() for one in release.steps]


def test_a_decision_that_is_carried_out_has_every_step_and_lacks_nothing():
    """Given a parachute that is in; at t+10 a rule decides, and all goes well."""
    story = Story().status(9.9, False).vehicle(9.95, 40.0, -12.0).vehicle(10.5, 33.0, -13.0)
    story.decision(10.0).report(0.05, Outcome.SENT, "on the wire")
    story.report(0.1, Outcome.ACCEPTED).report(0.4, Outcome.CONFIRMED, "deployed")
    story.status(10.3, True, deployment_trigger=4)
    (one,) = story.told()
    assert one.at == 10.0
    assert one.parachute == "mavlink_parachute 1/161"
    assert one.order == "rule 'free fall', decision 1 of epoch 7"
    assert one.reasons == ("it falls",)
    assert one.motion == MotionThen(40.0, pytest.approx(0.15), -12.0, pytest.approx(0.15))
    assert lines(one) == [
        "0.05 mavlink_parachute SENT on the wire",
        "0.10 mavlink_parachute ACCEPTED",
        "0.30 own status deployed 1/161, trigger MAVLINK; not deployed 0.4 s before",
        "0.40 mavlink_parachute CONFIRMED deployed",
    ]
    assert one.missing == []


@pytest.mark.parametrize(
    ("story", "missing"),
    [
        (
            Story().status(9.9, False).decision(10.0).report(0.05, Outcome.SENT),
            ["no ACCEPTED, no CONFIRMED in the 20.0 s to the recording's end"],
        ),
        (
            Story().status(9.9, False).decision(10.0),
            [f"no report of {LINK} on this decision in the 20.0 s to the recording's end"],
        ),
        (
            Story().status(9.9, False).call(10.0),
            ["no answer in the 20.0 s to the recording's end"],
        ),
    ],
    ids=["sent, not confirmed", "nobody reported on it", "a call that nobody answered"],
)
def test_what_did_not_come_is_said_plainly(story, missing):
    """Given a parachute that says nothing after the order, or that it is still in."""
    (one,) = story.told()
    silent = f"no status of a parachute of {LINK} in the 20.0 s to the recording's end"
    still_in = "no own status that says deployed in the 20.0 s to the recording's end"
    assert one.missing == [*missing, silent]
    (one,) = story.status(29.9, False).told()
    assert one.missing == [*missing, still_in]


def test_a_decision_to_two_links_is_two_releases():
    story = Story().status(9.0, False).status(9.0, False, "33", "upf_can")
    story.decision(10.0, targets=(LINK, "upf_can")).report(0.1, Outcome.CONFIRMED)
    story.status(10.2, True).status(20.0, False, "33", "upf_can")
    first, second = story.told()
    assert (first.parachute, first.missing) == ("mavlink_parachute 1/161", [])
    assert second.parachute == "upf_can 33"
    assert second.missing[0].startswith("no report of upf_can on this decision")


def test_a_shadow_decision_was_not_sent_and_explains_no_release():
    """Given a decision in SHADOW at t+10; the device fires by itself at t+11."""
    story = Story().status(9.9, False).decision(10.0, shadow=True)
    shadow, release = story.status(11.0, True, deployment_trigger=2).told()
    assert shadow.missing == ["not sent: the decision is marked SHADOW"]
    assert release.at == 11.0
    assert release.order == NO_ORDER
    assert lines(release) == [
        "0.00 own status deployed 1/161, trigger ATS; not deployed 1.1 s before"
    ]


def test_a_decision_without_a_target_was_not_sent():
    (one,) = Story().decision(10.0, targets=()).told()
    assert (one.parachute, one.missing) == (
        "nobody",
        ["not sent: the decision names no parachute"],
    )


def test_a_call_of_deploy_is_an_order_with_its_answer():
    """Given a drone on the ground; at t+5 ~/deploy is called, at t+5.3 it is out."""
    story = Story().status(4.9, False).vehicle(4.9, 0.0, 0.0)
    story.call(5.0, after=0.5, success=True, accepted=True, message="deployed after 0.3 s")
    (one,) = story.status(5.3, True).told()
    assert one.order == "a call of ~/deploy of mavlink_parachute, past the supervisor"
    assert one.reasons == ("force=False, reason='a test'",)
    assert one.motion.height == 0.0
    assert lines(one) == [
        "0.30 own status deployed 1/161, no trigger named; not deployed 0.4 s before",
        "0.50 mavlink_parachute answered: success, accepted deployed after 0.3 s",
    ]
    assert one.missing == []


@pytest.mark.parametrize(
    ("service", "details", "orders"),
    [
        ("~/parachute_action", "action=2, device='', reason='now'", True),
        ("~/parachute_action", "action=1, device='', reason='now'", False),
        ("~/command", "command=5, node_id=0, reason=''", True),
        ("~/command", "command=6, node_id=0, reason=''", True),
        ("~/command", "command=2, node_id=0, reason=''", False),
        ("~/command", "command='main', force=True, reason=''", True),
        ("~/command", "command='launch', force=True, reason='main'", False),
        ("~/arm", "arm=True, triggers=0", False),
    ],
)
def test_other_calls_that_release_are_orders_too(service, details, orders):
    assert len(Story().call(5.0, details, service).told()) == orders


def test_the_newest_order_explains_a_release():
    story = Story().status(0.0, False).decision(10.0).call(12.0)
    decision, call = story.status(12.4, True).told()
    assert decision.missing == [
        "no report of mavlink_parachute on this decision in the 20.0 s to the recording's end",
        "not deployed by it: its own status says so at 12.400 s",
    ]
    assert decision.steps == []
    assert [one.what for one in call.steps] == ["deployed"]


def test_a_newer_order_that_was_refused_does_not_explain_a_release():
    story = Story().status(0.0, False).decision(10.0)
    story.call(12.0, after=0.1, success=False, accepted=False, message="refused")
    decision, call = story.status(12.4, True).told()
    assert [one.what for one in decision.steps] == ["deployed"]
    assert call.missing == ["not deployed by it: its own status says so at 12.400 s"]


def test_a_newer_decision_that_failed_does_not_explain_a_release():
    story = Story().status(0.0, False).decision(10.0).decision(11.0)
    first, second = story.report(0.1, Outcome.FAILED).status(12.4, True).told()
    assert [one.what for one in first.steps] == ["deployed"]
    assert [one.what for one in second.steps] == ["FAILED"]


def test_the_same_number_on_another_link_is_another_parachute():
    """Given a decision to one link; the device of another fires by itself."""
    story = Story().status(9.0, False).status(9.0, False, link="upf_can").decision(10.0)
    order, release = story.status(10.5, True, link="upf_can").told()
    assert "deployed" not in [one.what for one in order.steps]
    assert release.parachute == "upf_can 1/161"
    assert release.order == NO_ORDER


def test_a_deploy_past_the_controller_is_shown_by_its_status():
    story = Story().status(9.0, False, "33", "upf_can")
    story.decision(10.0, targets=("upf_can",), device="trigger")
    (one,) = story.status(10.5, True, "33", "upf_can").told()
    assert one.parachute == "upf_can 33"


def test_what_is_still_reported_makes_an_order_last():
    """Given orders whose last word comes after five seconds; the effect comes nine later."""
    decision = Story().status(9.0, False).decision(10.0).report(5.0, Outcome.SENT)
    assert len(decision.status(24.0, True).told()) == 1
    call = Story().status(9.0, False)
    call.call(10.0, after=5.0, success=False, accepted=True, message="")
    assert len(call.status(24.0, True).told()) == 1
    foreign = Story().status(9.0, False)
    foreign.story.foreign_reports += [
        (at, i.ActionReport(3, 5, LINK, Outcome.SENT, "")) for at in (10.0, 15.0)
    ]
    (one,) = foreign.status(24.0, True).told()
    assert one.order.startswith("decision 5 of epoch 3")


@pytest.mark.parametrize(("at", "explained"), [(20.0, True), (20.2, False)])
def test_a_release_long_after_the_last_report_is_not_taken_for_the_orders_effect(at, explained):
    story = Story().status(9.0, False).decision(10.0).report(0.1, Outcome.SENT)
    assert len(story.status(at, True).told()) == (1 if explained else 2)


def test_an_order_for_another_device_explains_nothing():
    story = Story().status(9.0, False, "1/162").decision(10.0, device="1/161")
    order, release = story.status(10.5, True, "1/162").told()
    assert order.parachute == "mavlink_parachute 1/161"
    assert release.parachute == "mavlink_parachute 1/162"


def test_a_parachute_that_was_out_before_the_order_is_said_to_be():
    story = Story().status(8.0, False).status(9.0, True).decision(10.0).status(11.0, True)
    first, order = story.told()
    assert first.order == NO_ORDER
    assert lines(order) == ["0.00 own status deployed already 1/161 reported it before the order"]
    assert "own status" not in " ".join(order.missing)


def test_where_calls_were_not_recorded_nobody_is_said_to_have_ordered_nothing():
    """Given a recording of a version before safety/person."""
    story = Story().status(1.0, False).status(2.0, True)
    story.story.has_calls = False
    (one,) = story.told()
    assert one.order == "no order is in this recording"


def test_a_parachute_that_is_out_from_the_first_report_on_is_no_release_of_this_flight():
    assert Story().status(0.0, True).status(1.0, True).told() == []


def test_what_a_node_repeats_of_a_lost_device_is_not_the_devices_word():
    story = Story().status(1.0, True).status(2.0, False, link_state=LinkState.LOST)
    assert story.status(3.0, True).told() == []


def test_a_deploy_of_another_supervisor_is_known_by_its_reports():
    """Given a standby, which records what devices report on the leader's decisions."""
    story = Story().status(9.0, False)
    story.story.foreign_reports += [
        (10.1, i.ActionReport(3, 5, LINK, Outcome.SENT, "on the wire")),
        (10.4, i.ActionReport(3, 5, LINK, Outcome.CONFIRMED, "deployed")),
        (12.0, i.ActionReport(3, 6, LINK, Outcome.CONFIRMED, "something else")),
    ]
    (one,) = story.status(10.3, True).told()
    assert one.order == (
        "decision 5 of epoch 3, not in this recording: of another supervisor, or before it"
    )
    assert [step.what for step in one.steps] == ["SENT", "deployed", "CONFIRMED"]


def test_a_request_of_a_person_that_was_decided_is_told_with_the_decision():
    story = Story()
    answer = i.Finish(1, True, True, "deployed")
    story.story.requests.append(
        Asked(9.4, "deploy", "force: False, reason: it falls", (1.0, answer))
    )
    story.decision(10.0, rule="operator", reasons=("operator: it falls",))
    (one,) = story.told()
    assert one.order == (
        "a person's request at safety/deploy (rule 'operator'), decision 1 of epoch 7"
    )
    assert one.reasons == ("operator: it falls",)


def test_a_request_of_a_person_that_was_refused_released_nothing_and_is_told():
    story = Story()
    answer = i.Finish(1, False, False, "refused: on the ground")
    story.story.requests.append(Asked(5.0, "deploy", "force: False", (0.1, answer)))
    (one,) = story.told()
    assert (one.parachute, one.order) == ("none", "a person's request at safety/deploy")
    assert lines(one) == ["0.10 supervisor answered: no success refused: on the ground"]
    assert one.missing == ["no decision to deploy followed"]
    # A later decision is not that of the request.
    assert [one.parachute for one in story.decision(10.0).told()] == ["none", LINK]


def test_releases_are_in_the_order_of_time():
    story = Story().status(1.0, False).call(20.0, "command=5, node_id=0", "~/command")
    story.decision(10.0).status(3.0, True)
    assert [one.at for one in story.told()] == [3.0, 10.0, 20.0]


def test_a_height_that_nobody_reported_is_not_known():
    (one,) = Story().vehicle(11.0, 40.0, 0.0).decision(10.0).told()
    assert one.motion.height != one.motion.height


REFUSED = {"success": False, "accepted": False, "message": "no"}
OUT = {"success": True, "accepted": True, "message": "deployed"}


@pytest.mark.parametrize(
    ("story", "fates"),
    [
        # Its own status says so, whoever ordered it, or nobody.
        (Story().status(9.0, False).decision(10.0).status(10.5, True), [Fate.RELEASED]),
        (Story().status(9.0, False).status(10.5, True), [Fate.RELEASED]),
        # Its node says so, and nothing of its own status is recorded; or that denies it.
        (Story().decision(10.0).report(0.3, Outcome.CONFIRMED), [Fate.RELEASED]),
        (Story().call(10.0, after=0.3, **OUT), [Fate.RELEASED]),
        (
            Story().decision(10.0).report(0.3, Outcome.CONFIRMED).status(11.0, False),
            [Fate.UNCONFIRMED],
        ),
        # It is not said twice that one parachute was released.
        (
            Story().status(8.0, False).status(9.0, True).call(10.0, after=0.3, **OUT),
            [Fate.RELEASED, Fate.UNCONFIRMED],
        ),
        (Story().decision(10.0).report(0.1, Outcome.ACCEPTED), [Fate.UNCONFIRMED]),
        (Story().decision(10.0).report(0.1, Outcome.FAILED), [Fate.REFUSED]),
        (Story().decision(10.0).report(0.1, Outcome.REFUSED), [Fate.REFUSED]),
        (Story().call(10.0, after=0.1, **REFUSED), [Fate.REFUSED]),
        (Story().call(10.0), [Fate.UNCONFIRMED]),
        (Story().decision(10.0, shadow=True), [Fate.NOT_SENT]),
        (Story().decision(10.0, targets=()), [Fate.NOT_SENT]),
    ],
)
def test_what_was_released_is_told_apart_from_what_was_only_ordered(story, fates):
    assert [one.fate for one in story.told()] == fates


@pytest.mark.parametrize(
    ("answer", "fate"),
    [((0.1, i.Finish(1, False, False, "refused")), Fate.REFUSED), (None, Fate.UNCONFIRMED)],
)
def test_a_request_that_led_to_no_decision_released_nothing(answer, fate):
    story = Story()
    story.story.requests.append(Asked(5.0, "deploy", "force: False", answer))
    (one,) = story.told()
    assert one.fate is fate
