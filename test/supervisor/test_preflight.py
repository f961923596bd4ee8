"""Arming runs every pre-flight check and returns each that fails, with its value and limit."""

import datetime
import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import (
    DOWN,
    LINK,
    SINKS,
    STANDING,
    START,
    Story,
    changed,
    parachute,
    rule,
    shipped,
    vehicle,
    with_rules,
)

from chute_ros.model import (
    Action,
    Airframe,
    Armed,
    ErrorFlags,
    LinkState,
    ParachuteState,
    ParachuteStatus,
    SafetyFlags,
    TriggerFlags,
    VehicleState,
)
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.config import PreflightLimits, Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkEvidence, LinkLimits
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import arm_reasons, block_reasons
from chute_ros.supervisor.rules import Clears
from chute_ros.supervisor.state import State

TODAY = (datetime.date(2026, 7, 1) - datetime.date(1970, 1, 1)).days
GOOD = ParachuteStatus(
    "1/161",
    LinkState.OK,
    ParachuteState.READY,
    armed_triggers=TriggerFlags.ATS_AUTO_ARM,
    backup_voltage=4.0,
    packed_date="2026-06-01",
)
STRICT = PreflightLimits(
    require_pack_date=True, require_self_arm=True, min_battery_voltage=21.0, min_backup_voltage=3.5
)


def standing(limits: PreflightLimits = STRICT, **told: Any) -> Story:
    """On the ground with healthy links."""
    story = Story(SupervisorConfig(preflight=limits))
    battery = {"battery_remaining": 0.9, "battery_voltage": 24.0, "battery_age": 0.0}
    state = replace(STANDING, **{**battery, **told})
    story.at(0.0, story.heartbeat(), i.VehicleReport(state), i.ParachuteReport(LINK, GOOD))
    return story


def after_hearing(*devices: ParachuteStatus) -> tuple[str, ...]:
    """Why flight is blocked where the ladder names 1/162, and these devices are heard."""
    ladder = (Rung(LINK), Rung(LINK, "1/162"), Rung(LINK, "trigger"))
    story = Story(SupervisorConfig(deploy_ladder=ladder))
    reports = [i.ParachuteReport(LINK, one) for one in devices]
    story.at(0.0, story.heartbeat(), i.VehicleReport(STANDING), *reports)
    return block_reasons(story.config, story.state, START)


def test_a_step_for_a_device_that_is_not_there_blocks_flight():
    """It would stop the motors and release nothing."""
    step = "deploy_ladder names mavlink_parachute:1/162, which"
    second = replace(GOOD, device="1/162")
    assert after_hearing() == (f"{step} was never received (received: none)",)
    assert after_hearing(GOOD) == (f"{step} was never received (received: 1/161)",)
    assert after_hearing(GOOD, replace(second, link_state=LinkState.LOST)) == (f"{step} is LOST",)
    assert after_hearing(GOOD, second) == ()


def test_a_step_on_a_link_that_may_be_missing_blocks_nothing_while_it_is():
    other = "upf_can"
    ladder = (Rung(LINK), Rung(other, "34"))
    config = SupervisorConfig(deploy_links=(LINK, other), deploy_ladder=ladder)
    story = Story(config)
    story.at(0.0, story.heartbeat(), i.VehicleReport(STANDING))
    assert block_reasons(config, story.state, START) == ()
    story.at(0.1, story.heartbeat(other))
    (reason,) = block_reasons(config, story.state, START + 0.1)
    assert reason == "deploy_ladder names upf_can:34, which was never received (received: none)"


def reasons(story: Story, day: int = TODAY) -> tuple[str, ...]:
    return arm_reasons(story.config, story.state, day, START + story.t)


def with_device(limits: PreflightLimits = STRICT, **changes: Any) -> Story:
    """Standing, with a parachute that tells something else."""
    story = standing(limits)
    story.at(0.0, i.ParachuteReport(LINK, replace(GOOD, **changes)))
    return story


def test_when_all_is_well_it_arms():
    story = standing()
    assert reasons(story) == ()
    outputs = story.at(0.1, i.ArmRequest(1, True, 0, TODAY))
    assert i.ArmDevices(1, True, 0, (LINK,)) in outputs


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"state": ParachuteState.NOT_READY}, "its state is NOT_READY (need READY, TAKEOFF or"),
        ({"state": ParachuteState.UNKNOWN}, "its state is UNKNOWN"),
        ({"state": ParachuteState.ABNORMAL}, "its state is ABNORMAL"),
        (
            {"error_flags": ErrorFlags.LOW_POWER | ErrorFlags.IMU_ERROR, "faults": ("IMU_ERROR",)},
            "errors IMU_ERROR, LOW_POWER (need none)",
        ),
        ({"error_flags": ErrorFlags(1 << 30), "faults": ("bit 30",)}, "errors bit 30 (need none)"),
        ({"packed_date": ""}, "no pack date (need one)"),
        ({"packed_date": "last spring"}, "no pack date (need one)"),
        ({"packed_date": "2025-06-30"}, "packed on 2025-06-30, 366 days ago (limit 365)"),
        ({"packed_date": "2026-07-03"}, "packed on 2026-07-03, 2 days from now"),
        ({"armed_triggers": TriggerFlags.ATS}, "ATS_AUTO_ARM is off (need on: it arms itself"),
        (
            {"safety_flags": SafetyFlags.GROUND_CLEARED},
            "GROUND_CLEARED is set on the ground (need not set)",
        ),
        ({"backup_voltage": 3.49}, "backup voltage 3.49 V (need 3.5 V)"),
    ],
)
def test_what_is_wrong_with_a_device_is_said_in_words(changes, words):
    told = reasons(with_device(**changes))
    assert len(told) == 1
    assert told[0].startswith(f"{LINK} 1/161: {words}")


def test_one_that_is_released_is_and_was():
    assert reasons(with_device(deployed=True)) == (
        f"{LINK} 1/161 was released: repack or replace it, then call safety/reset",
        "the vehicle is BLOCKED (need READY)",
        f"{LINK} 1/161: it is released",
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"state": ParachuteState.TAKEOFF},
        {"state": ParachuteState.ARMED},
        {"packed_date": "2025-07-01"},
        {"packed_date": "2026-07-02"},  # made where the day has begun
        {"safety_flags": SafetyFlags.ON_GROUND},
        {"backup_voltage": 3.5},
        {"backup_voltage": math.nan},  # it does not say
    ],
)
def test_what_is_just_right_is_nothing_against_it(changes):
    assert reasons(with_device(**changes)) == ()


@pytest.mark.parametrize(
    ("limits", "changes"),
    [
        ({"require_pack_date": False}, {"packed_date": ""}),
        ({"max_pack_age": 0}, {"packed_date": "1999-01-01"}),
        ({"require_self_arm": False}, {"armed_triggers": TriggerFlags(0)}),
        ({"forbid_ground_cleared": False}, {"safety_flags": SafetyFlags.GROUND_CLEARED}),
        ({"min_backup_voltage": 0.0}, {"backup_voltage": 0.0}),
    ],
)
def test_each_check_can_be_left_out(limits, changes):
    assert reasons(with_device(replace(STRICT, **limits), **changes)) == ()


def test_where_today_is_not_known_the_age_of_the_pack_is_not_held_against_it():
    assert reasons(with_device(packed_date="1999-01-01"), day=-1) == ()


def test_flags_in_which_its_node_finds_no_fault_are_not_held_against_it():
    """Given a parachute of which a flag does not apply (ignored_error_flags of its node)."""
    assert reasons(with_device(error_flags=ErrorFlags.LOW_POWER, faults=())) == ()


def test_a_device_that_is_lost_is_told_of_by_its_link_not_by_its_last_words():
    broken = {"error_flags": ErrorFlags.LOW_POWER, "faults": ("LOW_POWER",)}
    story = with_device(**broken, link_state=LinkState.LOST)
    assert reasons(story) == ()


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"battery_remaining": 0.29}, "battery_remaining 0.29 (need 0.3)"),
        ({"battery_voltage": 20.9}, "battery_voltage 20.90 V (need 21 V)"),
    ],
)
def test_an_empty_battery_is_said_with_its_limit(told, words):
    assert reasons(standing(**told)) == (words,)


def test_a_full_battery_and_one_that_is_not_told_are_nothing_against_it():
    assert reasons(standing(battery_remaining=0.3, battery_voltage=21.0)) == ()
    assert reasons(standing(battery_age=math.nan)) == ()


@pytest.mark.parametrize("difference", [0.26, -0.26])
def test_a_clock_that_differs_is_said_with_its_limit(difference):
    story = standing()
    beat = i.LinkHeartbeat(LINK, LinkState.OK, True, 9, clock_difference=difference)
    story.at(0.1, beat)
    assert reasons(story) == (f"{LINK}: its clock differs by {difference:+.3f} s (limit 0.25 s)",)
    story.at(0.2, replace(beat, seq=10, clock_difference=0.25))
    assert reasons(story) == ()


def test_one_late_heartbeat_is_no_clock_that_differs():
    """Given 3 s of heartbeats in time; at t+3.1 s one that took 0.4 s, at t+3.2 s one in time."""
    story = standing()

    def told_after(k: int, late: float) -> list[str]:
        beat = i.LinkHeartbeat(LINK, LinkState.OK, True, 9 + k, clock_difference=late)
        story.at(0.1 * k, beat)
        return [one for one in reasons(story) if "clock" in one]

    for k in range(33):
        assert told_after(k, 0.4 if k == 31 else 0.01) == []
    # A clock that is set shows in all that comes.
    told = [told_after(k, 0.4) for k in range(33, 60)]
    assert told[-1] == [f"{LINK}: its clock differs by +0.400 s (limit 0.25 s)"]


def test_a_vehicle_that_moves_is_not_armed():
    story = standing(vertical_speed=-3.0, vertical_speed_age=0.0)
    (told,) = reasons(story)
    assert told == "the vehicle moves: vertical_speed -3.0 m/s (nothing on the ground beyond 2)"


def test_every_reason_is_told_at_once():
    broken = {"error_flags": ErrorFlags.GPS_ERROR, "faults": ("GPS_ERROR",)}
    story = with_device(state=ParachuteState.ABNORMAL, **broken)
    story.at(0.1, i.ModeRequest(1, i.Mode.SHADOW, force=False), story.heartbeat(healthy=False))
    story.at(0.2, i.BlockRequest("upf_can", "33", True, "ABNORMAL"))
    story.at(3.0, i.ArmRequest(2, True, 0, 0))
    message = story.answer(2).message
    for words in (
        "refused: ",
        f"{LINK}: LOST, heartbeat of its node 2.90 s old (limit 0.5 s)",
        "upf_can 33 asks to block flight: ABNORMAL",
        "vehicle/state: armed or not is 3.0 s old (limit 2.5 s)",
        "supervisor mode is SHADOW (need ACTIVE)",
        "the vehicle is BLOCKED (need READY)",
        "the wall clock shows 1970-01-01",
        "1/161: its state is ABNORMAL",
        "1/161: errors GPS_ERROR",
    ):
        assert words in message


# -- rules that block flight ---------------------------------------------------------------------

LOW = rule(
    replace(SINKS, measurement="battery_voltage", below=22.0),
    action=Action.FLIGHT_BLOCK,
    states=(Stage.STARTUP, Stage.BLOCKED, Stage.READY, Stage.ARMED),
    clears=Clears.BY_ITSELF,
    name="low battery",
    says="land and charge",
)


def test_a_rule_may_block_flight_at_once_and_releases_it_by_itself():
    story = Story(with_rules(LOW)).ready()
    outputs = story.at(0.1, vehicle(**DOWN, battery_voltage=21.0))
    assert story.state.stage is Stage.BLOCKED
    assert any(isinstance(o, i.Decide) for o in outputs), "not only at the next update"
    told = block_reasons(story.config, story.state, START + story.t)
    assert told == ("rule 'low battery': land and charge",)
    story.at(0.2, story.heartbeat(), vehicle(**DOWN, battery_voltage=23.0))
    assert story.state.stage is Stage.READY
    assert "rule 'low battery' has cleared" in story.said()


def test_a_rule_without_words_blocks_all_the_same():
    story = Story(with_rules(replace(LOW, says=""))).ready()
    story.at(0.1, vehicle(**DOWN, battery_voltage=21.0))
    told = block_reasons(story.config, story.state, START + story.t)
    assert told == ("rule 'low battery': fulfilled",)


def test_a_rule_of_another_action_blocks_nothing():
    broken = rule(DeviceCondition(DeviceFact.ABNORMAL), action=Action.NONE, states=(Stage.READY,))
    story = Story(with_rules(broken)).ready()
    abnormal = replace(GOOD, state=ParachuteState.ABNORMAL)
    story.at(0.1, i.ParachuteReport(LINK, abnormal))
    assert story.state.stage is Stage.READY
    assert len(story.alarms()) == 1


def test_what_a_vehicle_does_not_tell_is_said_to_be_not_seen():
    story = Story(shipped("multirotor")).ready()
    # Given that an autopilot was asked for them, when they had time to come, not sooner.
    story.fly(4.8, **DOWN)
    assert "not seen" not in story.said()
    story.fly(5.2, **DOWN)
    assert "not seen in flight: no target is reported" in story.said()
    assert "no pressure is reported" in story.said()
    assert not any("not seen" in text for text in story.alarms())
    # Given that one comes after all.
    story.fly(6.0, **DOWN, pressure=101_325.0)
    said = [text for text in story.said().splitlines() if "not seen" in text]
    assert [("no pressure" in text) for text in said] == [True, False]


def test_of_a_vehicle_that_tells_all_nothing_is_said_to_be_not_seen():
    story = Story(shipped("multirotor")).ready()
    all_of_it = {"pressure": 101_325.0, "attitude_error": 1.0, "target_vertical_speed": 0.0}
    story.fly(8.0, **DOWN, **all_of_it)
    assert "not seen" not in story.said()


@pytest.mark.parametrize(
    ("status", "name"), [(5, "CRITICAL"), (6, "EMERGENCY"), (8, "TERMINATION")]
)
def test_an_autopilot_that_cannot_fly_forbids_the_take_off(status, name):
    story = Story(shipped("multirotor")).ready()
    story.at(0.2, story.heartbeat(), story.told(**DOWN, height=0.0, system_status=status))
    assert story.state.stage is Stage.BLOCKED
    assert name in story.said()


@pytest.mark.parametrize(
    ("vehicle", "mav_type", "told"),
    [
        (Airframe.MULTIROTOR, 2, ""),
        (Airframe.MULTIROTOR, 1, "MAV_TYPE 1 (fixed_wing)"),
        (Airframe.FIXED_WING, 13, "MAV_TYPE 13 (multirotor)"),
        (Airframe.ROCKET, 2, "MAV_TYPE 2 (multirotor)"),
        # A VTOL is flown by either.
        (Airframe.MULTIROTOR, 22, ""),
        (Airframe.FIXED_WING, 22, ""),
        (Airframe.ROCKET, 22, "MAV_TYPE 22 (fixed_wing or multirotor)"),
        # Generic, a rover, not known: nobody can say.
        (Airframe.ROCKET, 0, ""),
        (Airframe.MULTIROTOR, 10, ""),
        (Airframe.ANY, 1, ""),
    ],
)
def test_a_profile_of_another_kind_of_vehicle_forbids_the_take_off(vehicle, mav_type, told):
    """The shipped default is multirotor: an aeroplane flown with it would be ended in a dive, and
    its spins not seen."""
    config = SupervisorConfig(profile=replace(SupervisorConfig().profile, vehicle=vehicle))
    story = Story(config).flying()
    story.at(20.0, story.heartbeat(), i.VehicleReport(replace(STANDING, vehicle_type=mav_type)))
    reasons = block_reasons(config, story.state, START + 20.0)
    expected = (
        f"the profile device requests only is for the vehicle {vehicle.value}, and the autopilot "
        f"reports {told}: set the parameter profile, or `vehicle` in a profile of your own"
    )
    assert [one for one in reasons if "MAV_TYPE" in one] == ([expected] if told else [])


def test_what_the_vehicle_says_against_flying_is_a_reason_and_in_flight_an_alarm():
    slow = ("ATTITUDE comes at 2.1 Hz (need 5 Hz)",)
    story = Story(shipped("multirotor")).ready()
    story.at(0.2, story.heartbeat(), story.told(**DOWN, height=0.0, faults=slow))
    assert f"vehicle: {slow[0]}" in story.said()
    aloft = Story(shipped("multirotor")).flying().fly(1.0).fly(2.0, faults=slow)
    assert [one for one in aloft.alarms() if slow[0] in one] == [f"vehicle: {slow[0]}"]


def test_after_the_flight_the_parachutes_that_were_armed_are_disarmed():
    story = Story(shipped("multirotor")).ready()
    story.at(0.0, i.ArmRequest(1, True, 0))
    story.at(0.1, i.ArmDone(1, True, True, "armed"))
    story.fly(2.0, height=30.0)
    story.fly(10.0, height=0.0, vertical_speed=0.0, **DOWN)
    orders = [one for _, one in story.outputs if isinstance(one, i.ArmDevices)]
    assert [(one.token, one.arm) for one in orders] == [(1, True), (0, False)]
    # Then the devices fail to: nobody waits for an answer, so that it is an alarm.
    story.at(10.1, i.ArmDone(0, False, False, "no answer"))
    assert any("not disarmed after the flight" in one for one in story.alarms())


@pytest.mark.parametrize("armed", [True, False])
def test_so_are_those_that_somebody_else_has_armed_on_the_ground(armed):
    """By ~/arm, from a ground station, or before a restart of the supervisor."""
    story = Story(shipped("multirotor")).ready()
    status = replace(GOOD, state=ParachuteState.ARMED, armed=True) if armed else GOOD
    for _ in range(30):
        told = story.told(**DOWN, height=0.0), i.ParachuteReport(LINK, status)
        story.at(story.t + 0.1, story.heartbeat(), *told)
    story.fly(story.t + 2.0, height=30.0)
    story.fly(story.t + 10.0, height=0.0, vertical_speed=0.0, **DOWN)
    orders = [one for _, one in story.outputs if isinstance(one, i.ArmDevices)]
    assert [(one.token, one.arm) for one in orders] == ([(0, False)] if armed else [])


def test_in_flight_a_fault_whose_figure_changes_is_one_alarm_and_another_fault_another():
    story = Story(shipped("multirotor")).flying().fly(1.0)
    for tenths in range(6, 30):
        late = f"answers after {tenths / 10:.1f} s (limit 0.5 s): it is late"
        slow = f"ATTITUDE comes at {tenths / 10:.1f} Hz (need 5 Hz)"
        story.fly(story.t + 0.1, faults=(late,) if tenths < 20 else (late, slow))
    assert len(story.alarms()) == 2
    assert "answers after 0.6 s" in story.alarms()[0]
    assert "ATTITUDE comes at 2.0 Hz" in story.alarms()[1]
    story.fly(story.t + 1.0)
    story.fly(story.t + 0.1, faults=("answers after 0.9 s (limit 0.5 s): it is late",))
    assert len(story.alarms()) == 3


NOW = 100.0
CONFIG = SupervisorConfig(required_links=("a",), kill_links=("a",), deploy_links=("a",))
READY = ParachuteStatus("1", LinkState.OK, ParachuteState.READY, packed_date="2026-06-01")


def day(text: str) -> int:
    """Days since 1970-01-01."""
    return (datetime.date.fromisoformat(text) - datetime.date(1970, 1, 1)).days


def link(
    *devices: ParachuteStatus, healthy: bool = True, state: LinkState = LinkState.OK
) -> LinkEvidence:
    told = MappingProxyType({one.device: one for one in devices})
    return LinkEvidence(NOW, state, healthy, devices=told)


def known(vehicle_received: float = NOW, **links: LinkEvidence) -> State:
    """Disarmed on the ground; these links are known."""
    vehicle = VehicleState(armed=Armed.DISARMED, armed_age=0.0)
    state = State(epoch=7, started_at=0.0, stage=Stage.READY)
    return changed(state, links=links, vehicle=vehicle, vehicle_received=vehicle_received)


@pytest.mark.parametrize(
    ("faults", "deployed", "more"),
    [
        ((), False, ""),
        (("hot",), False, " (1 hot)"),
        (("hot", "wet"), True, " (1 hot; 1 wet; 1 is released)"),
    ],
)
def test_an_unhealthy_device_is_told_with_its_faults_if_it_has_any(faults, deployed, more):
    device = replace(READY, faults=faults, deployed=deployed)
    state = known(a=link(device, healthy=False))
    assert block_reasons(CONFIG, state, NOW) == (f"a: its device is not healthy{more}",)


def test_what_its_node_repeats_of_a_release_is_told_once_and_all_else_of_it():
    device = replace(READY, faults=("hot",), deployed=True)
    more = ("1 is released", "supply 3.1 V", "supply 3.2 V")
    evidence = replace(link(device, healthy=False), reasons=more)
    assert block_reasons(CONFIG, known(a=evidence), NOW) == (
        "a: its device is not healthy (1 hot; 1 is released; supply 3.1 V; supply 3.2 V)",
    )


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (LinkState.NEVER_SEEN, "a: nothing received from its device"),
        (LinkState.LOST, "a: its device is LOST (1 hot)"),
    ],
)
def test_a_node_that_does_not_hear_its_device_is_told_of_by_the_device(told, words):
    state = known(a=link(replace(READY, faults=("hot",)), state=told))
    assert block_reasons(CONFIG, state, NOW) == (words,)


def test_each_link_is_told_by_its_own_limits():
    patient = MappingProxyType({"a": LinkLimits(stale_after=2.0, lost_after=4.0)})
    config = replace(CONFIG, link_limits=patient)
    silent = known(a=replace(link(), heard=NOW - 1.75))
    assert block_reasons(config, silent, NOW) == ()
    silent = known(a=replace(link(), heard=NOW - 2.0))
    assert block_reasons(config, silent, NOW) == (
        "a: STALE, heartbeat of its node 2.00 s old (limit 2 s)",
    )


@pytest.mark.parametrize("stage", [Stage.KILLING, Stage.DEPLOYED, Stage.FAULT])
def test_after_a_kill_or_a_deploy_only_a_reset_unblocks(stage):
    state = replace(known(a=link()), stage=stage)
    words = f"the vehicle is {stage.name}: needs a reset on the ground"
    assert block_reasons(CONFIG, state, NOW) == (words,)


def test_that_nobody_can_stop_the_motors_does_not_hide_a_required_link():
    config = SupervisorConfig(required_links=("a",), kill_links=("b",), deploy_links=("c",))
    assert block_reasons(config, known(c=link()), NOW) == (
        "a: nothing received from its node",
        "b: nothing received from its node",
    )
    assert block_reasons(config, known(a=link(), b=link(), c=link()), NOW) == ()


def test_a_vehicle_that_never_told_of_its_motors_blocks_flight():
    state = changed(known(a=link()), vehicle=VehicleState())
    assert block_reasons(CONFIG, state, NOW) == (
        "vehicle/state: armed or disarmed was never reported",
    )


@pytest.mark.parametrize(
    ("age", "told"),
    [(2.5, ()), (2.75, ("vehicle/state: armed or not is 2.8 s old (limit 2.5 s)",))],
)
def test_what_the_vehicle_says_of_its_motors_counts_up_to_its_age(age, told):
    assert block_reasons(CONFIG, known(NOW - age, a=link()), NOW) == told


@pytest.mark.parametrize(
    ("today", "told"),
    [
        ("2023-12-31", ("the wall clock shows 2023-12-31 (need 2024-01-01 or later)",)),
        ("2024-01-01", ()),
    ],
)
def test_a_wall_clock_may_say_the_first_day_and_none_before(today, told):
    assert arm_reasons(CONFIG, known(a=link()), day(today), NOW) == told


def test_a_wall_clock_that_was_never_set_makes_a_pack_look_like_one_from_the_future():
    assert arm_reasons(CONFIG, known(a=link(READY)), 0, NOW) == (
        "the wall clock shows 1970-01-01 (need 2024-01-01 or later)",
        "a 1: packed on 2026-06-01, 20605 days from now",
    )


def test_a_pack_may_be_allowed_a_single_day():
    config = replace(CONFIG, preflight=PreflightLimits(max_pack_age=1))
    state = known(a=link(READY))
    assert arm_reasons(config, state, day("2026-06-02"), NOW) == ()
    assert arm_reasons(config, state, day("2026-06-03"), NOW) == (
        "a 1: packed on 2026-06-01, 2 days ago (limit 1)",
    )


def test_a_fault_that_its_node_repeats_is_one_with_its_age_of_now():
    story = Story().ready()
    lost = ("heartbeat LOST: 7.6 s old",)
    beat = story.heartbeat(healthy=False, state=LinkState.LOST)
    late = ("1/161 heartbeat LOST: 8.1 s old", "heartbeat LOST: 8.2 s old", "no autopilot")
    story.at(0.1, parachute(faults=lost, alive=False), replace(beat, reasons=late))
    (reason,) = block_reasons(story.config, story.state, START + 0.1)
    assert reason == (
        f"{LINK}: its device is LOST (1/161 heartbeat LOST: 8.1 s old; no autopilot)"
    )
    story.at(0.2, replace(beat, reasons=("heartbeat LOST: 8.2 s old",)))
    (reason,) = block_reasons(story.config, story.state, START + 0.2)
    assert reason == f"{LINK}: its device is LOST (1/161 heartbeat LOST: 8.2 s old)"
