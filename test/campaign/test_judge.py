"""What a flight is counted as."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from campaign_bench import SHIPPED, fired, flown, rocket, scenario

from chute_ros.campaign.blind import Need, Seen, blinded, enough_time
from chute_ros.campaign.channel import Spell
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.flight import Flown, fly
from chute_ros.campaign.judge import WRONG, Count, judge
from chute_ros.campaign.scenario import Failure, Person, Stop, WayFault
from chute_ros.campaign.sensors import SensorFault
from chute_ros.campaign.truth import Truth
from chute_ros.sim.flight import Descent
from chute_ros.supervisor.gate import OPERATOR


@pytest.fixture(scope="module")
def good() -> Flown:
    return flown(Failure.MOTOR)


def test_each_thing_that_must_not_be_is_counted_as_such(good: Flown) -> None:
    truth = good.truth
    hard = {"landed": truth.latest + 1.0, "landing_speed": 20.0}
    kill, deploy = fired(good)
    unexplained = replace(deploy, decision=replace(deploy.decision, reasons=()))
    cases = {
        Count.MISSED: {"released": math.nan, **hard},
        Count.LATE: {"released": truth.latest + 0.3, **hard},
        Count.FALSE: {"acted": (replace(kill, at=truth.at - 0.1), deploy)},
        Count.DOUBLED: {"ordered_again": 1},
        Count.OUT_OF_ORDER: {"acted": (deploy, kill)},
        Count.UNEXPLAINED: {"acted": (kill, unexplained)},
        Count.GROUNDED: {"grounded": "a required link is not healthy"},
    }
    assert set(cases) == set(WRONG) - {Count.BROKEN}
    for count, changed in cases.items():
        assert judge(replace(good, **changed)).count is count
    assert judge(good).count is Count.CORRECT


def test_what_a_person_orders_is_never_false(good: Flown) -> None:
    early = tuple(replace(one, at=good.up + 0.5) for one in fired(good))
    assert judge(replace(good, acted=early)).count is Count.FALSE
    wanted = replace(good.scenario, person=Person("kill", 0.4))
    assert judge(replace(good, acted=early, scenario=wanted)).count is Count.CORRECT


def test_what_follows_a_kill_that_asks_for_nothing_more_is_false(good: Flown) -> None:
    """The fall that it brings about is what was asked for."""
    kill, deploy = (act.decision for act in fired(good))
    asked = replace(kill, rule=OPERATOR)
    hard = {"landed": good.truth.latest + 1.0, "landing_speed": 20.0, "released": math.nan}
    person = replace(good.scenario, person=Person("kill_only", 0.5))
    alone = replace(good, scenario=person, decided=((good.killed, asked),), **hard)
    assert judge(alone).count is Count.CORRECT
    followed = replace(alone, decided=((good.killed, asked), (good.released, deploy)))
    assert judge(followed).count is Count.FALSE
    assert "asked for nothing more" in judge(followed).why
    # A rule's kill was there first: its deploy was due.
    late = replace(alone, decided=((good.killed, kill), (good.released, asked)))
    assert judge(replace(late, decided=late.decided[:1])).count is Count.MISSED


def test_what_the_only_parachute_refuses_in_time_is_not_missed(good: Flown) -> None:
    truth = good.truth
    hard = replace(good, released=math.nan, landed=truth.latest + 1.0, landing_speed=20.0)
    judged = judge(replace(hard, refused=truth.latest - 0.1))
    assert judged.count is Count.NOT_TOLD
    assert judged.why.startswith("the only parachute refused")
    assert judge(replace(hard, refused=truth.latest + 0.1)).count is Count.MISSED
    wanted = replace(good.scenario, person=Person("deploy", 0.4), failure=Failure.NOTHING)
    quiet = replace(good, scenario=wanted, truth=Truth(), acted=(), released=math.nan)
    for refused, count in ((good.up + 0.5, Count.NOT_TOLD), (good.up + 9.0, Count.MISSED)):
        assert judge(replace(quiet, landed=math.nan, refused=refused)).count is count


def test_a_parachute_that_is_told_a_wrong_height_refuses_and_another_does_not() -> None:
    wrong = SensorFault("height", "jumps", 0.8, 9.0)
    alone = flown(Failure.MOTOR, wrong, height=38.0)
    assert alone.truth.at < alone.refused < alone.truth.latest
    assert judge(alone).count is Count.NOT_TOLD
    two = flown(Failure.MOTOR, wrong, height=38.0, vehicle="both")
    assert math.isnan(two.refused)
    assert judge(two).count is Count.CORRECT
    assert math.isnan(flown(Failure.MOTOR, height=38.0).refused)


@pytest.mark.parametrize("does", ["deploy", "kill"])
def test_what_a_person_orders_and_is_not_done_is_missed(good: Flown, does: str) -> None:
    wanted = replace(good.scenario, person=Person(does, 0.4), failure=Failure.NOTHING)
    quiet = {"truth": Truth(), "acted": (), "released": math.nan, "landed": math.nan}
    judged = judge(replace(good, scenario=wanted, answer="", **quiet))
    assert (judged.count, judged.why) == (Count.MISSED, f"a person's {does}: no answer")
    hangs = replace(wanted, faults=(Stop("supervisor", 0.0, 9.0),))
    judged = judge(replace(good, scenario=hangs, **quiet))
    assert (judged.count, judged.why) == (Count.NOT_TOLD, "supervisor stopped")


def test_a_kill_under_a_canopy_is_not_false(good: Flown) -> None:
    out = replace(good, acted=fired(good)[:1], released=good.up + 0.1)
    assert judge(out).count is Count.CORRECT


@pytest.mark.parametrize(
    ("faults", "count"),
    [
        (("speed", "jumps", 0.0, 9.0), Count.FALSE),
        (("speed", "jumps", 0.0, 9.0, "tilt", "jumps", 0.0, 9.0), Count.NOT_TOLD),
        # What is gone tells nothing that is not so; nor did who was no reason, or long before.
        (("speed", "jumps", 0.0, 9.0, "tilt", "gone", 0.0, 9.0), Count.FALSE),
        (("speed", "jumps", 0.0, 9.0, "force", "zero", 0.0, 9.0), Count.FALSE),
        (("speed", "jumps", 1.8, 9.0, "tilt", "jumps", 0.0, 0.5), Count.FALSE),
    ],
)
def test_what_two_sensors_that_lied_led_to_is_named(
    good: Flown, faults: tuple, count: Count
) -> None:
    lies = tuple(SensorFault(*faults[n : n + 4]) for n in range(0, len(faults), 4))
    kill, _ = fired(good)
    reasons = ("vertical_speed -15.00 (below -3)", "tilt_deg 170.00 (above 60)")
    early = replace(kill, at=good.up + 2.0, decision=replace(kill.decision, reasons=reasons))
    wrong = replace(good.scenario, faults=lies, failure=Failure.NOTHING)
    ended = replace(good, scenario=wrong, truth=Truth(), acted=(early,), released=math.nan)
    judged = judge(ended)
    assert judged.count is count


CUT = Spell(1.0, 3.0, loss=1.0)


@pytest.mark.parametrize(
    ("faults", "end", "cause"),
    [
        ((), 4.0, ""),
        ((WayFault("autopilot", CUT),), 4.0, "the way autopilot was cut"),
        # 2 s are left after it, or before it.
        ((WayFault("autopilot", CUT),), 5.0, ""),
        ((WayFault("autopilot", Spell(3.0, 9.0, loss=1.0)),), 5.0, ""),
        ((WayFault("autopilot", Spell(1.0, 3.0, loss=0.5)),), 4.0, ""),
        ((Stop("mavlink_parachute", 1.0, 2.5),), 5.0, "mavlink_parachute stopped"),
        # One sensor that lies is no excuse, two are.
        ((SensorFault("speed", "zero", 0.0, 9.0),), 5.0, ""),
        (
            (SensorFault("speed", "zero", 0.0, 9.0), SensorFault("tilt", "gone", 0.0, 9.0)),
            *(5.0, "sensors speed, tilt were wrong"),
        ),
        # One after the other leaves time enough.
        ((SensorFault("speed", "zero", 0.0, 2.0), SensorFault("tilt", "gone", 4.0, 9.0)), 5.0, ""),
    ],
)
def test_what_hid_the_fall(faults, end: float, cause: str) -> None:
    assert blinded(scenario(Failure.MOTOR, *faults), 0.0, Need(1.0, end)) == cause


LEFT = "all that was left was an imu, whose tilt was wrong, and drag carried the vehicle"


@pytest.mark.parametrize(
    ("how", "sensor", "sources", "light_until", "cause"),
    [
        ("jumps", "tilt", ("vehicle/state", "imu"), 2.0, LEFT),
        ("gone", "tilt", ("vehicle/state", "imu"), 2.0, LEFT),
        ("gone", "tilt", ("vehicle/state", "imu"), math.nan, LEFT),
        # A force that is nearly nothing told it for long enough.
        ("jumps", "tilt", ("vehicle/state", "imu"), 4.0, ""),
        # Its attitude told it, or the heights of another source.
        ("jumps", "force", ("vehicle/state", "imu"), 2.0, ""),
        ("jumps", "tilt", ("vehicle/state", "imu", "odometry"), 2.0, ""),
    ],
)
def test_what_falls_like_one_that_flies_well_cannot_be_known(
    how: str, sensor: str, sources: tuple, light_until: float, cause: str
) -> None:
    """Given an autopilot that lost its power at 1 s, and the ground at 8 s."""
    lies = SensorFault(sensor, how, 1.5, 6.0, "imu")
    alone = scenario(Failure.POWER, lies, vehicle_sources=sources)
    assert blinded(alone, 0.0, Need(1.0, 8.0), Seen(light_until=light_until)) == cause
    # An autopilot that has its power tells more.
    told = replace(alone, failure=Failure.MOTOR)
    assert blinded(told, 0.0, Need(1.0, 8.0), Seen(light_until=light_until)) == ""


@pytest.mark.parametrize(("how", "cause"), [("jumps", LEFT), ("gone", "")])
def test_what_lied_a_moment_ago_may_lie_again(how: str, cause: str) -> None:
    lies = SensorFault("tilt", how, 0.0, 3.0, "imu")
    alone = scenario(Failure.POWER, lies, vehicle_sources=("vehicle/state", "imu"))
    assert blinded(alone, 0.0, Need(1.0, 8.0)) == cause
    # Ten seconds later it is taken at its word.
    assert blinded(alone, 0.0, Need(1.0, 16.0)) == ""


SINKS = Descent("partial thrust", 8.0, settles=2.0)


@pytest.mark.parametrize(
    ("fault", "way", "is_hidden"),
    [
        (EstimatorFault("hovers", 0.5, 20.0), SINKS, True),
        (SensorFault("pressure", "jumps", 0.5, 20.0), SINKS, True),
        # It is gone and denies nothing; there is time enough after it; the attitude tells it, too.
        (SensorFault("pressure", "gone", 0.5, 20.0), SINKS, False),
        (EstimatorFault("hovers", 0.5, 2.0), SINKS, False),
        (EstimatorFault("hovers", 0.5, 20.0), replace(SINKS, tilt=1.2), False),
        # Height and speed are two of the estimator's, and the pressure is a third.
        (SensorFault("speed", "zero", 0.5, 20.0), SINKS, False),
    ],
)
def test_a_level_sink_that_one_tells_and_one_denies_cannot_be_known(fault, way, is_hidden) -> None:
    sinks = scenario(Failure.SINK, fault, descent=way)
    assert bool(blinded(sinks, 0.0, Need(1.0, 12.0))) is is_hidden


def test_an_imu_alone_does_not_tell_a_spiral_from_a_turn() -> None:
    dive = Descent("spiral dive", 16.0, 2.5, 1.2, 20.0)
    lost = scenario(Failure.POWER, descent=dive, vehicle_sources=("vehicle/state", "imu"))
    assert "as it turns in flight" in blinded(lost, 0.0, Need(1.0, 12.0))
    both = replace(lost, vehicle_sources=("vehicle/state", "imu", "odometry"))
    assert blinded(both, 0.0, Need(1.0, 12.0)) == ""
    assert blinded(replace(lost, descent=None), 0.0, Need(1.0, 12.0)) == ""


def test_what_sinks_slowly_is_known_once_it_is_faster_than_softly() -> None:
    plain, sinks = scenario(Failure.MOTOR), scenario(Failure.SINK, descent=SINKS)
    assert enough_time(sinks) == pytest.approx(enough_time(plain) + 3.35, abs=0.05)


def test_past_the_height_of_its_take_off_nobody_knows_where_the_ground_is() -> None:
    past = Seen(unclear=(1.0, 3.5))
    assert blinded(scenario(Failure.MOTOR), 0.0, Need(1.0, 5.0), past).startswith("it fell past")
    assert blinded(scenario(Failure.MOTOR), 0.0, Need(1.0, 6.0), past) == ""


def test_on_the_ground_motors_may_be_stopped_and_nothing_is_released(good: Flown) -> None:
    stands = replace(good.scenario, height=0.0, failure=Failure.NOTHING)
    stopped = replace(good, scenario=stands, truth=Truth(), acted=fired(good)[:1])
    assert judge(replace(stopped, released=math.nan)).count is Count.CORRECT
    assert judge(stopped).count is Count.FALSE
    assert judge(replace(stopped, acted=fired(good), released=math.nan)).count is Count.FALSE


def test_a_kill_that_opens_a_parachute_where_none_may_open_is_false(good: Flown) -> None:
    opened = replace(good, opened_by_kill=good.truth.at + 0.1)
    assert judge(opened).count is Count.CORRECT
    assert judge(replace(opened, release_height=8.0)).count is Count.FALSE
    assert judge(replace(opened, opened_by_kill=good.truth.at - 0.1)).count is Count.FALSE


def test_a_canopy_that_does_not_carry_wants_an_alarm_and_the_next_parachute(good: Flown) -> None:
    falls = Truth(good.released + 2.0, good.released + 5.5, 40.0)
    hard = replace(good, another=falls, landed=good.released + 7.0, landing_speed=22.0)
    assert judge(hard).why == "the canopy did not carry, and nobody was alarmed"
    alarmed = replace(hard, alarmed=((good.released + 3.0, "it falls on"),))
    assert judge(alarmed).count is Count.CORRECT, "there is no other"
    both = replace(alarmed, scenario=replace(good.scenario, vehicle="both"))
    assert judge(both).why == "the canopy did not carry, and no other followed in time"
    assert judge(replace(both, released_another=good.released + 4.0)).count is Count.CORRECT
    late = replace(both, another=replace(falls, latest=falls.at + 1.0))
    assert judge(late).count is Count.NO_TIME
    assert judge(replace(hard, landed=good.released + 3.0)).count is Count.NO_TIME
    assert judge(replace(hard, landing_speed=5.0)).count is Count.CORRECT, "it opened in the end"


def test_one_that_glides_does_not_fall_and_one_whose_autopilot_is_gone_does() -> None:
    glide, dive = Descent("glide", 3.0, 1.5, 0.1), Descent("spiral dive", 16.0, 2.5, 1.2, 20.0)
    body = {"profile": "fixed_wing", "descent": glide, "unheld": dive}
    glides = flown(Failure.GLIDE, **body)
    assert not glides.truth.falls
    assert judge(glides).count is Count.CORRECT
    assert flown(Failure.REBOOT, **body).truth.falls


def test_a_fall_is_light_until_drag_carries_half_of_it() -> None:
    fell = flown(Failure.MOTOR, height=80.0, fall_speed=25.0)
    # v = 25 m/s times the root of a half; a fall reaches that after 2.2 s, or its canopy opens.
    assert fell.truth.at < fell.light_until < fell.truth.at + 2.5
    assert math.isnan(flown(Failure.NOTHING).light_until)


def test_where_no_line_of_a_flight_computer_came_whole_nothing_was_told() -> None:
    need, cause = Need(1.0, 8.0), "no line of the flight computer came whole"
    falls = rocket(Failure.NO_DROGUE)
    often = [n * 0.9 for n in range(-10, 10)]
    rests = [at for at in often if not 2.0 < at < 5.0]
    assert blinded(falls, 0.0, need, Seen(often)) == ""
    assert blinded(falls, 0.0, need, Seen(rests)) == cause
    assert blinded(falls, 0.0, need) == cause
    # Before it there was time enough.
    assert blinded(falls, 0.0, Need(-6.0, 8.0), Seen(rests)) == ""
    # Of an aircraft nobody asks for lines.
    assert blinded(scenario(Failure.MOTOR), 0.0, need) == ""


@pytest.mark.parametrize(("loss", "fewest", "most"), [(0.0, 9.0, 11.0), (0.3, 0.8, 3.0)])
def test_lines_come_whole_as_often_as_all_their_packets_do(
    loss: float, fewest: float, most: float
) -> None:
    """Given five packets a line: 0.7 to the power of 5 is a sixth of the lines."""
    loses = WayFault("flight_computer", Spell(2.0, 12.0, loss=loss))
    end = fly(rocket(Failure.NOTHING, loses), SHIPPED)
    came = sum(end.up + 2.0 < at < end.up + 12.0 for at in end.told)
    assert fewest <= came / 10.0 <= most


def test_where_another_stands_by_a_stop_hides_nothing_for_long() -> None:
    stop = Stop("supervisor", 1.0, 8.0)
    need = Need(1.0, 5.0)
    assert blinded(scenario(Failure.MOTOR, stop), 0.0, need) == "supervisor stopped"
    assert blinded(scenario(Failure.MOTOR, stop, standby=True), 0.0, need) == ""


def test_a_standby_that_stops_hides_nothing_while_the_other_leads() -> None:
    away, need = Stop("standby", 0.0, 9.0), Need(1.0, 5.0)
    alone = WayFault("to the supervisor", Spell(0.0, 9.0, loss=1.0))
    assert blinded(scenario(Failure.MOTOR, away, standby=True), 0.0, need) == ""
    both = blinded(scenario(Failure.MOTOR, away, alone, standby=True), 0.0, need)
    assert both == "standby stopped; the way to the supervisor was cut"
