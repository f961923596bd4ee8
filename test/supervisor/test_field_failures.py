"""What the field has lived through, told once more: each of these has cost a vehicle, or more."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from story import DOWN, LINK, STANDING, START, Story, falling, parachute, shipped

from chute_ros.model import Action, Armed, LandedState, Outcome, ParachuteState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.state import State

K, D = Action.KILL, Action.DEPLOY
GROUND = LandedState.ON_GROUND
UPF = "upf_can"
EACH = pytest.mark.parametrize("name", ["multirotor", "fixed_wing", "rocket"])


def aloft(name: str = "multirotor", **settings: Any) -> Story:
    """In flight for a second."""
    return Story(shipped(name, **settings)).ready().fly(1.0)


@pytest.mark.parametrize("pressed", [True, False])
@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("last", [9.7, 11.0, 12.0, 13.0, 14.0])
def test_what_falls_flat_is_deployed(last, power, pressed):
    """Given motors that stop, and drag that carries it ever more, with its speed (PX4's simulator,
    9.7 m/s in the end) or the square of it. Nobody tells what was commanded."""
    story, height, speed = aloft(), 80.0, 0.0
    while "DEPLOY" not in story.fired() and height > 20.0:
        force = 9.81 * abs(speed / last) ** power
        told = {"height": height, "vertical_speed": speed, "acceleration": force}
        if pressed:
            told |= {"pressure": 101_325.0 - 12.0 * height, "pressure_age": 0.0}
        story.fly(story.t + 0.1, every=0.1, **told)
        speed -= 0.1 * (9.81 - force)
        height += 0.1 * speed
    assert story.fired() == ["KILL", "DEPLOY"]
    assert height > 80.0 - 2.2 * last


@pytest.mark.parametrize("begins", [0.0, 0.4, 0.8])
def test_a_silence_of_its_telemetry_hides_no_fall(begins):
    """The same fall, of which 0.6 s are not told."""
    story, height, speed, since = aloft(), 80.0, 0.0, 0.0
    while "DEPLOY" not in story.fired() and height > 20.0:
        force = 9.81 * abs(speed / 10.5)
        if begins <= since < begins + 0.6:
            story.at(story.t + 0.1, story.heartbeat())
        else:
            told = {"height": height, "vertical_speed": speed, "acceleration": force}
            story.fly(story.t + 0.1, every=0.1, **told)
        speed -= 0.1 * (9.81 - force)
        height += 0.1 * speed
        since += 0.1
    assert story.fired() == ["KILL", "DEPLOY"]
    assert height > 50.0


@pytest.mark.parametrize("says", [{"battery_remaining": 0.0}, {"system_status": 6}])
@pytest.mark.parametrize("sinks", [6.5, 7.3])
def test_who_comes_down_fast_with_an_empty_battery_is_not_ended(says, sinks):
    """By hand, which tells no target; MAV_STATE_EMERGENCY is said by what still flies."""
    story, height = aloft(), 90.0
    while height > 15.0:
        height -= 0.1 * sinks
        told = {"height": height, "vertical_speed": -sinks, "acceleration": 9.8, **says}
        story.fly(story.t + 0.1, every=0.1, **told)
    assert story.fired() == []


@pytest.mark.parametrize("sinks", [6.5, 7.3])
@pytest.mark.parametrize("chopped", [0.45, 0.7, 0.9])
def test_a_pilot_who_chops_the_throttle_and_sinks_on_is_not_ended(chopped, sinks):
    """As in STABILIZE and ACRO, which tell no target: 0.8 s later it sinks steadily."""
    story, height, speed, since = aloft(), 120.0, 0.0, 0.0
    while height > 30.0:
        force = 1.5 if since < chopped else 9.81 - (sinks + speed) * 2.5
        speed -= 0.1 * (9.81 - force)
        height += 0.1 * speed
        since += 0.1
        told = {"height": height, "vertical_speed": speed, "acceleration": force}
        story.fly(story.t + 0.1, every=0.1, **told)
    assert story.fired() == []


@pytest.mark.parametrize("dropped", [0.5, 0.7, 0.9])
def test_what_is_dropped_and_caught_flies_on(dropped):
    """As it is thrown, or launched from another: 1.5 g catch it."""
    story, height, speed = aloft(), 80.0, 0.0
    begun = story.t
    while speed < 0.0 or story.t <= begun + dropped:
        force = 0.5 if story.t < begun + dropped else 14.7
        speed -= 0.1 * (9.81 - force)
        height += 0.1 * speed
        told = {"height": height, "vertical_speed": speed, "acceleration": force}
        story.fly(story.t + 0.1, every=0.1, **told)
    story.fly(story.t + 3.0, height=height)
    assert story.fired() == []


def boosted(seconds: float) -> Iterator[tuple[float, float, float]]:
    """(height, vertical speed, force) of a rocket, ten times a second, until it is back down:
    60 m/s^2 for so long, then drag alone."""
    height, speed, step = 0.0, 0.0, 0
    while step < 10 or height > 0.0:
        drag = 0.0006 * speed * abs(speed)
        thrust = 60.0 if step < 10 * seconds else 0.0
        speed += 0.1 * (thrust - drag - 9.81)
        height += 0.1 * speed
        step += 1
        yield height, speed, abs(thrust - drag)


def test_a_rocket_whose_launch_nobody_recognised_and_that_tells_no_speed_is_seen_to_fall():
    """Given a flight computer that stays in Standby, and a receiver that loses the satellites in
    the boost: the force of the motor is no sensor that is wrong on the ground."""
    story = Story(shipped("rocket")).ready()
    silent = {"vertical_speed": math.nan, "latitude": math.nan, "longitude": math.nan}
    stood = {**silent, "landed_state": GROUND, "tilt": math.nan, "battery_remaining": math.nan}
    story.fly(3.0, 0.1, **stood, height=0.0)
    released = []
    for height, speed, force in boosted(2.0):
        story.fly(story.t + 0.1, 0.1, **stood, height=height, acceleration=force)
        if "DEPLOY" in story.fired():
            released.append((height, speed))
    assert story.fired() == ["KILL", "DEPLOY"]
    height, speed = released[0]
    assert speed < -20.0, "not on its way up"
    assert height > 150.0


@pytest.mark.parametrize("felt", [None, 6.0])
def test_a_rocket_whose_motor_has_no_valve_flies_by_its_height(felt):
    """Given IN_AIR beside motors that are off, and an accelerometer that failed in the boost, or
    turns with the rocket and feels that."""
    story = Story(shipped("rocket")).ready()
    told = {"armed": Armed.DISARMED, "tilt": math.nan, "battery_remaining": math.nan}
    story.fly(3.0, 0.1, **told, landed_state=GROUND, height=0.0)
    for height, speed, force in boosted(2.0):
        moves = {"height": height, "vertical_speed": speed}
        feels = force if felt is None else max(felt, force)
        story.fly(story.t + 0.1, 0.1, **told, **moves, acceleration=feels)
    assert story.fired() == ["KILL", "DEPLOY"]


def launched(deployed: bool) -> i.ParachuteReport:
    """Its drogue is out."""
    told = parachute(deployed=deployed)
    return replace(told, status=replace(told.status, state=ParachuteState.LAUNCHED))


@pytest.mark.parametrize(("sink", "height", "warned"), [(42.0, 2800.0, 1), (38.0, 2800.0, 0)])
@pytest.mark.parametrize("deployed", [True, False])
def test_a_drogue_that_hardly_brakes_is_told_while_there_is_time(sink, height, warned, deployed):
    """Whether the drogue is the parachute (deploy_stage) or not."""
    story = Story(shipped("rocket")).ready().fly(1.0)
    said = launched(deployed)
    for _ in range(80):
        height -= 0.1 * sink
        flies = story.told(height=height, vertical_speed=-sink, tilt=math.nan)
        story.at(story.t + 0.1, story.heartbeat(), said, flies)
    warning = "rule 'falls fast under its drogue'"
    assert sum(warning in text for text in story.alarms()) == warned
    assert "DEPLOY" not in story.fired()


def test_ten_kilometres_up_a_drogue_that_works_may_be_faster():
    story = Story(shipped("rocket")).ready().fly(1.0)
    height, said = 14_000.0, launched(True)
    while height > 10_500.0:
        height -= 7.0
        flies = story.told(height=height, vertical_speed=-70.0, tilt=math.nan)
        story.at(story.t + 0.1, story.heartbeat(), said, flies)
    assert "DEPLOY" not in story.fired()


ANEW = {"reboot_count": 1, "rebooted_in_flight": True, "height": 0.0}
RESTS: dict[str, Any] = {"vertical_speed": 0.0, "height": 0.0, **DOWN}
SPEED = {"vertical_speed": -14.0, "height": math.nan}


@pytest.mark.parametrize(
    ("told", "fired"),
    [
        # A vertical speed that is wrong alone; one that jumped, where no height can be used, and
        # the same beside a sign that is told.
        ([(29.0, {"vertical_speed": -20.0})], []),
        ([(9.0, SPEED)], []),
        ([(2.0, {**SPEED, "acceleration": 4.5})], ["KILL", "DEPLOY"]),
        # A landing in earnest.
        (
            [
                (4.0, {"vertical_speed": -1.5, "height": 2.0}),
                (0.1, {"vertical_speed": 0.0, "acceleration": 25.0, "height": 0.0}),
                (3.9, RESTS),
            ],
            [],
        ),
        # After it it is carried about; its battery is changed.
        (
            [
                (3.0, RESTS),
                (6.0, {**DOWN, "tilt": 120.0, "vertical_speed": -3.0, "acceleration": 3.0}),
            ],
            [],
        ),
        ([(3.0, RESTS), (16.0, {**ANEW, **DOWN, "tilt": 90.0})], []),
    ],
)
def test_what_is_told_after_a_second_of_flight(told, fired):
    story = aloft()
    for seconds, parts in told:
        story.fly(story.t + seconds, **parts)
        rests = parts.get("armed") is Armed.DISARMED
        assert (story.state.stage is Stage.READY) is rests
    assert story.fired() == fired
    assert {kill.rule for kill in story.decisions(K)} <= {"critical sink"}


def released() -> Story:
    """It fell, and is under its canopy at 3.0."""
    story = aloft().fall(3.0)
    story.at(3.0, story.report(D, Outcome.CONFIRMED), parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    return story


# -- ground deployment at start-up from barometer drift ------------------------------------------


@EACH
@pytest.mark.parametrize("armed", [Armed.DISARMED, Armed.ARMED])
def test_a_barometer_that_drifts_at_start_up_deploys_nothing_on_the_ground(name, armed):
    story = Story(shipped(name))
    height = 0.0
    for n in range(400):
        # It warms up: the height runs away and back, as fast as anything that falls.
        speed = -35.0 * math.sin(n / 20.0)
        height += speed * 0.05
        told = {"height": height, "vertical_speed": speed}
        story.fly(story.t + 0.05, armed=armed, landed_state=GROUND, **told)
    assert story.fired() == []
    # It is named, and nobody takes off with it.
    assert story.state.stage is Stage.BLOCKED
    assert "vertical_speed cannot be used: it reports" in story.said()


def test_a_land_detector_that_believes_the_drift_deploys_nothing_while_disarmed():
    story = Story(shipped("multirotor"))
    story.fly(20.0, armed=Armed.DISARMED, vertical_speed=-20.0, height=200.0)
    assert story.state.stage is Stage.READY
    assert story.fired() == []


def test_a_barometer_that_jumps_in_flight_is_not_a_fall():
    story = aloft()
    for n in range(40):
        # A gust on the static port: single samples far off, and back.
        story.fly(story.t + 0.05, vertical_speed=-60.0 if n % 3 == 0 else 0.0)
    assert story.fired() == []


# -- deployment missed because a counter was reset -----------------------------------------------


def test_a_tumbling_vehicle_whose_attitude_swings_through_the_upright_is_deployed():
    story = aloft()
    start = story.t
    story.fly(story.t + 0.05, tilt=60.0, vertical_speed=-3.5)  # nothing turns over in one sample
    for n in range(60):
        # It tumbles: three samples out of four are beyond the limit, never six in a row.
        tilt = 20.0 if n % 4 == 3 else 120.0
        story.fly(story.t + 0.05, tilt=tilt, vertical_speed=-3.5)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.when(K) - start < 1.0


def test_a_fall_with_gusts_is_deployed_although_single_samples_look_well():
    story = aloft().fall(2.0)
    start = story.t
    for n in range(80):
        speed = -11.0 if n % 5 == 4 else -14.0
        story.fly(story.t + 0.05, vertical_speed=speed, acceleration=4.5)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.when(K) - start < 2.5


def test_dropped_messages_do_not_reset_the_count():
    story = aloft()
    start = story.t
    for n in range(40):
        # Two samples out of three never arrive.
        told = story.told(**{**falling(0.15 * n), "tilt": 5.0})
        story.at(start + 0.15 * (n + 1), story.heartbeat(), told)
        if story.fired():
            break
    assert story.when(K) - start < 1.5


# -- kill vetoed by "landed" while falling -------------------------------------------------------


@pytest.mark.parametrize("armed", [Armed.ARMED, Armed.DISARMED])
def test_a_fall_that_the_autopilot_takes_for_a_landing_is_killed_and_deployed(armed):
    story = aloft()
    story.fall(3.5, landed_state=GROUND, armed=armed)
    assert story.fired() == ["KILL", "DEPLOY"]


def test_a_steady_fall_at_one_g_that_is_taken_for_standing_is_deployed():
    story = aloft()
    # It has reached its final speed: the accelerometer feels what it feels on the ground.
    lie = {"landed_state": GROUND, "armed": Armed.DISARMED}
    for n in range(40):
        height = 150.0 - 14.0 * 0.05 * n
        story.fly(story.t + 0.05, height=height, vertical_speed=-14.0, acceleration=9.8, **lie)
    assert story.fired() == ["KILL", "DEPLOY"]


def test_a_vertical_speed_is_believed_alone_where_no_height_can_be_used():
    story = aloft()
    story.sink(story.t + 3.5, 14.0, height=math.nan)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert any("taken to be so" in reason for reason in story.newest(K).reasons)


# -- the parachute that fails to pull out --------------------------------------------------------

LADDER = {
    "deploy_links": (LINK, UPF),
    "deploy_ladder": (Rung(LINK), Rung(UPF), Rung(UPF, "trigger")),
}


def test_a_parachute_that_does_not_come_out_is_followed_by_the_next_down_to_the_triggers():
    story = aloft(**LADDER)
    for n in range(1, 161):
        beats = [story.heartbeat(), story.heartbeat(UPF)]
        told = story.told(**falling(n * 0.05, 300.0), armed=Armed.ARMED)
        story.at(1.0 + n * 0.05, *beats, told)
        for decision in story.decisions(D)[-1:]:
            # Each node has sent it and its device has acknowledged; no canopy comes.
            link = decision.targets[0]
            story.at(
                story.t,
                story.report(D, Outcome.SENT, link),
                story.report(D, Outcome.ACCEPTED, link),
            )
    steps = [(d.targets[0], d.device) for d in story.decisions(D)]
    assert steps == [(LINK, ""), (UPF, ""), (UPF, "trigger")]
    assert story.decisions(K)[0].id < story.decisions(D)[0].id
    story.at(9.1, story.report(D, Outcome.CONFIRMED, UPF))
    assert story.state.stage is Stage.DEPLOYED


def test_when_none_comes_out_the_alarm_does_not_stop():
    story = aloft(**LADDER).fall(2.0, 2000.0)
    story.at(60.0)
    assert story.state.stage is Stage.FAULT
    said = [
        t for t, o in story.outputs if isinstance(o, i.LogMessage) and "no parachute" in o.text
    ]
    assert said[-1] > 58.0
    assert len(story.decisions(D)) == 3


# -- a late ACK taken for a confirmation ---------------------------------------------------------


def test_an_ack_however_late_is_no_confirmation():
    story = aloft(**LADDER).fall(2.6, 2000.0)
    first = story.newest(D)
    late = i.ActionReport(first.epoch, first.id, LINK, Outcome.ACCEPTED, "ACK", first.epoch)
    story.at(2.6, story.heartbeat(UPF), late)
    story.at(5.0, story.heartbeat(UPF), late)
    assert story.state.stage is Stage.DEPLOYING
    story.at(60.0)
    assert story.state.stage is Stage.FAULT


def test_a_confirmation_of_the_last_flight_is_none_of_this_one():
    story = aloft().fall(3.0)
    old = story.newest(D)
    story.at(3.0, story.report(D, Outcome.CONFIRMED), parachute(deployed=True))
    story.fly(5.0, vertical_speed=0.0, **DOWN)
    story.at(5.0, parachute(deployed=False), i.ResetRequest(1))
    assert story.answer(1).success
    story.fly(6.0, **DOWN).fly(7.0).fall(9.0)
    again = i.ActionReport(old.epoch, old.id, LINK, Outcome.CONFIRMED, "out", old.epoch, old.id)
    story.at(9.0, again)
    assert story.state.stage is Stage.DEPLOYING
    assert story.fired() == ["KILL", "DEPLOY", "KILL", "DEPLOY"]


# -- the autopilot that starts anew at height ----------------------------------------------------


@pytest.mark.parametrize("name", ["multirotor", "fixed_wing"])
def test_an_autopilot_that_starts_anew_at_height_and_falls_is_deployed(name):
    story = aloft(name)
    # All that it says of itself is as on the ground: disarmed, landed, at height 0.
    for n in range(1, 50):
        told = {**falling(n * 0.05), **ANEW, **DOWN}
        story.fly(story.t + 0.05, **told)
    assert story.fired() == ["KILL", "DEPLOY"]
    rules = ("autopilot rebooted in flight", "free fall", "disarmed in flight")
    assert story.newest(D).rule in rules


def test_an_autopilot_that_starts_anew_and_flies_on_is_not_deployed():
    story = aloft().fly(20.0, **ANEW)
    assert story.fired() == []
    assert story.alarms() == ["the autopilot restarted in flight"]


def test_its_height_that_starts_at_zero_does_not_hold_the_deploy_back():
    story = aloft().fly(1.5, **ANEW)
    story.sink(4.7, 14.0, **ANEW)
    assert story.fired() == ["KILL", "DEPLOY"]


# -- the link that flaps at its limit ------------------------------------------------------------


@EACH
@pytest.mark.parametrize("gap", [0.49, 0.51, 0.99, 1.01, 2.0])
def test_a_link_that_flaps_at_its_limit_fires_nothing(name, gap):
    story = aloft(name)
    for n in range(1, 150):
        beat = [story.heartbeat()] if (n * 0.1) % gap < 0.1 else []
        story.at(1.0 + n * 0.1, *beat, story.told())
    assert story.fired() == []
    assert story.state.stage is Stage.IN_FLIGHT


def test_a_deploy_over_a_link_that_flaps_reaches_the_device_and_ends_with_it():
    story = aloft()
    for n in range(1, 60):
        beat = [story.heartbeat()] if n % 24 == 0 else []  # every 1.2 s: lost each time
        story.at(1.0 + n * 0.05, *beat, story.told(**falling(n * 0.05)))
    # The kill is decided anew for a node that is back; the deploy follows it all the same.
    assert story.fired()[0] == "KILL"
    assert "DEPLOY" in story.fired()
    assert any(isinstance(o, i.Decide) and o.again for _, o in story.outputs)
    story.at(story.t + 0.1, story.report(D, Outcome.CONFIRMED))
    count = len(story.decisions(D))
    for _ in range(40):
        story.at(story.t + 1.2, story.heartbeat())
    assert len(story.decisions(D)) == count, "a device that confirmed is not told again"


# -- a restart under the canopy ------------------------------------------------------------------


def test_a_release_that_nobody_ordered_and_that_is_taken_back_leaves_the_rules_alive():
    """One damaged status says that a parachute is out, and the motors are stopped for it."""
    story = aloft()
    story.at(story.t + 0.05, story.heartbeat(), parachute(deployed=True))
    assert story.fired() == ["KILL"]
    assert story.state.stage is Stage.DEPLOYED
    story.at(story.t + 0.1, parachute(deployed=False))
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.alarms()[-1].endswith("1/161 no longer reports deployed")
    story.fall(story.t + 3.0, armed=Armed.DISARMED)
    assert story.fired()[-1] == "DEPLOY"
    story.at(story.t + 0.1, story.heartbeat(), parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED


def test_a_device_that_restarts_after_its_own_release_takes_nothing_back():
    story = aloft()
    out = parachute(deployed=True)
    story.at(
        story.t + 0.05, story.heartbeat(), replace(out, status=replace(out.status, uptime=60.0))
    )
    packed = parachute(deployed=False)
    story.at(story.t + 0.5, replace(packed, status=replace(packed.status, uptime=0.4)))
    assert story.state.stage is Stage.DEPLOYED
    assert "a forced deploy continues" in story.alarms()[-1]
    story.fall(story.t + 3.0, armed=Armed.DISARMED)
    assert story.fired() == ["KILL"], "it hangs under the canopy that it had released"


def test_a_supervisor_that_restarts_under_the_canopy_does_not_deploy_again():
    story = released()
    story.state = State(epoch=11, started_at=START + 3.0)
    story.at(3.1, story.heartbeat(), parachute(deployed=True))
    fired = len(story.decisions(D))
    story.fly(8.0, vertical_speed=-5.0, tilt=80.0)
    assert story.state.stage is Stage.DEPLOYED
    assert len(story.decisions(D)) == fired


def test_a_device_node_that_restarts_after_the_release_takes_nothing_back():
    story = released()
    story.seq = -1
    story.at(3.1, story.heartbeat(), parachute(deployed=False, alive=False))
    story.at(3.2, parachute(deployed=False))
    story.fly(6.0, vertical_speed=-5.0)
    assert story.state.stage is Stage.DEPLOYED
    assert len(story.decisions(D)) == 1
    assert story.alarms()[-1] == (
        "mavlink_parachute 1/161 no longer reports deployed; a forced deploy continues "
        "with the next"
    )


def test_a_parachute_that_is_exchanged_on_the_ground_is_no_alarm():
    story = released()
    story.fly(8.0, vertical_speed=0.0, height=0.0, **DOWN)
    alarms = story.alarms()
    story.at(story.t, parachute(deployed=False))
    assert story.alarms() == alarms


def test_a_supervisor_that_starts_on_the_ground_with_the_parachute_out_fires_nothing():
    story = Story(shipped("multirotor"))
    for _ in range(30):
        story.at(
            story.t + 0.1,
            story.heartbeat(healthy=False),
            i.VehicleReport(STANDING),
            parachute(deployed=True),
        )
    assert story.fired() == []
    assert story.decisions()[-1].action is Action.FLIGHT_BLOCK
