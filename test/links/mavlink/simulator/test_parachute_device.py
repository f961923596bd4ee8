"""The simulated parachute module, from the other side of the protocol.

The rows are those of the Parachute Protocol's tables; what is refused, and how, follows its public
emulator.
"""

import pytest
from device_bench import Station, position

from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.model import DeploymentTrigger, ErrorFlags, SafetyFlags, TriggerFlags
from chute_ros.protocol.mavlink.dialect import dialect

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
DENIED = dialect.MAV_RESULT_DENIED
FAILED = dialect.MAV_RESULT_FAILED
NOT_NOW = dialect.MAV_RESULT_TEMPORARILY_REJECTED
UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED
DO_PARACHUTE = dialect.MAV_CMD_DO_PARACHUTE
SET_ARM = dialect.MAV_CMD_SET_PARACHUTE_ARM
RELEASE, ENABLE, DISABLE = 2, 1, 0
FC, OFFBOARD, ATS = TriggerFlags.FC, TriggerFlags.OFFBOARD, TriggerFlags.ATS
AUTO_ARM, AUTO_DISARM = TriggerFlags.ATS_AUTO_ARM, TriggerFlags.ATS_AUTO_DISARM


def module(**settings):
    """A module that was just switched on."""
    return Station(ParachuteDevice(ParachuteSettings(**settings), []))


def status(station):
    """A fresh PARACHUTE_STATUS."""
    station.run(1.0)
    return station.newest("PARACHUTE_STATUS")


# HEARTBEAT and PARACHUTE_STATUS


def test_it_is_told_by_its_heartbeat_once_a_second():
    station = module(system_id=7, component_id=162, system_status=5)
    station.run(10.0)
    beats = [f for f in station.frames if f.message.get_type() == "HEARTBEAT"]
    assert len(beats) == 11
    assert {(f.system_id, f.component_id) for f in beats} == {(7, 162)}
    beat = beats[-1].message
    assert (beat.type, beat.autopilot) == (37, dialect.MAV_AUTOPILOT_INVALID)
    assert beat.system_status == 5


def test_time_boot_ms_counts_from_its_start_and_the_rest_is_as_set():
    # Time boot ms counts from its start.
    station = module()
    assert station.newest("PARACHUTE_STATUS").time_boot_ms == 0
    station.run(5.0)
    assert station.newest("PARACHUTE_STATUS").time_boot_ms == pytest.approx(5000, abs=20)
    # The rest of the status is as set.
    got = status(module(ats_arm_altitude=30, packed_date="2024-09-12"))
    assert got.ats_arm_altitude == 30
    assert got.parachute_packed_date == "2024-09-12"


def test_error_status_shows_each_error():
    for error in ErrorFlags:
        station = module()
        station.device.act(f"error={error.name}")
        assert status(station).error_status == error
        station.device.act("clear-errors")
        assert status(station).error_status == 0
    station = module(errors=ErrorFlags.LOW_POWER)
    station.device.act("error=IMU_ERROR")
    assert status(station).error_status == ErrorFlags.LOW_POWER | ErrorFlags.IMU_ERROR


def test_arm_and_deployment_status_show_each_trigger():
    for trigger in TriggerFlags:
        station = module()
        assert station.command(SET_ARM, trigger, trigger) == [ACCEPTED]
        assert status(station).arm_status == trigger
    for trigger in DeploymentTrigger:
        station = module()
        if trigger:
            station.device.act(f"deploy={trigger.name}")
        assert status(station).deployment_status == trigger


def test_safety_status_follows_the_settings_and_the_height():
    cleared, ground = SafetyFlags.GROUND_CLEARED, SafetyFlags.ON_GROUND
    for setting, height, flags in (
        ("yes", None, cleared),
        ("no", None, SafetyFlags(0)),
        ("auto", None, cleared),
        ("auto", 0.0, ground),
        ("auto", 7.9, SafetyFlags(0)),
        ("auto", 8.0, cleared),
        ("yes", 0.0, cleared | ground),
        ("no", 100.0, SafetyFlags(0)),
    ):
        station = module(ground_cleared=setting)
        if height is not None:
            station.send(position(height), sender=(1, 1))
        assert status(station).safety_status == flags, (setting, height)
    station = module()
    station.send(position(0.0), sender=(1, 50))
    assert status(station).safety_status == cleared, "another component's is not its vehicle's"


# MAV_CMD_SET_PARACHUTE_ARM and MAV_CMD_DO_PARACHUTE


def test_only_the_selected_triggers_change():
    station = module(armed_triggers=int(ATS | FC))
    assert station.command(SET_ARM, OFFBOARD, OFFBOARD | FC) == [ACCEPTED]
    assert status(station).arm_status == ATS | OFFBOARD


def test_a_mask_beyond_the_eighth_bit_or_that_is_no_number_is_denied_and_changes_nothing():
    nan, inf = float("nan"), float("inf")
    for masks in ((256, 256), (256, 4), (4, 256), (-1, 4), (4, -1), (nan, 4), (inf, 4)):
        station = module(armed_triggers=int(FC))
        assert station.command(SET_ARM, *masks) == [DENIED], masks
        assert status(station).arm_status == FC, masks


def test_a_release_without_an_armed_command_trigger_fails():
    for armed in (TriggerFlags(0), ATS, TriggerFlags.MANUAL, ATS | AUTO_ARM):
        station = module(armed_triggers=int(armed), ground_cleared="yes")
        assert station.command(DO_PARACHUTE, RELEASE) == [FAILED], armed
        assert status(station).deployment_status == DeploymentTrigger.NONE


def test_a_release_too_near_the_ground_is_rejected_for_now():
    station = module(armed_triggers=int(FC))
    station.send(position(5.0), sender=(1, 1))
    assert station.command(DO_PARACHUTE, RELEASE) == [NOT_NOW]
    assert status(station).deployment_status == DeploymentTrigger.NONE
    station.send(position(20.0), sender=(1, 1))
    assert station.command(DO_PARACHUTE, RELEASE) == [ACCEPTED]
    assert status(station).deployment_status == DeploymentTrigger.DRONE


def test_a_release_is_acknowledged_and_then_told_at_once():
    drone, mavlink = DeploymentTrigger.DRONE, DeploymentTrigger.MAVLINK
    for armed, by in ((FC, drone), (OFFBOARD, mavlink), (FC | OFFBOARD, drone)):
        station = module(armed_triggers=int(armed), ground_cleared="yes")
        station.run(0.5)
        station.forget()
        assert station.command(DO_PARACHUTE, RELEASE) == [ACCEPTED]
        station.run(0.0)
        kinds = [f.message.get_type() for f in station.frames]
        assert kinds == ["COMMAND_ACK", "PARACHUTE_STATUS"]
        assert station.newest("PARACHUTE_STATUS").deployment_status == by
        assert f"RELEASED by {by.name}" in station.log


def test_a_second_release_changes_nothing_and_enable_switches_the_automatic_trigger():
    # A second release is accepted and changes nothing.
    station = module(armed_triggers=int(FC), ground_cleared="yes")
    station.command(DO_PARACHUTE, RELEASE)
    station.command(SET_ARM, 0, FC)
    assert station.command(DO_PARACHUTE, RELEASE) == [ACCEPTED]
    assert status(station).deployment_status == DeploymentTrigger.DRONE
    assert sum("RELEASED" in line for line in station.log) == 1
    # Enable and disable switch the automatic trigger.
    station = module(armed_triggers=int(FC))
    assert station.command(DO_PARACHUTE, ENABLE) == [ACCEPTED]
    assert status(station).arm_status == FC | ATS
    assert station.command(DO_PARACHUTE, DISABLE) == [ACCEPTED]
    assert status(station).arm_status == FC


def test_an_action_that_the_enumeration_does_not_hold_is_denied():
    for action in (3, -1, 255):
        assert module(armed_triggers=int(FC)).command(DO_PARACHUTE, action) == [DENIED], action
    assert module().command(dialect.MAV_CMD_NAV_TAKEOFF) == [UNSUPPORTED]


# ATS: the module's own automatic trigger


def fall(station, height, seconds, sink=15.0):
    for _ in range(round(seconds / 0.1)):
        station.send(position(height, sink), sender=(1, 1))
        station.run(0.1)


def test_a_fall_with_the_automatic_trigger_armed_releases_and_tells_it_at_once():
    # A fall with the automatic trigger armed releases.
    station = module(armed_triggers=int(ATS))
    fall(station, 60.0, 1.0)
    assert station.newest("PARACHUTE_STATUS").deployment_status == DeploymentTrigger.ATS
    # A release by itself is told at once with the right time.
    station = module(armed_triggers=int(ATS))
    station.run(0.4)
    fall(station, 60.0, 0.5)
    told = station.newest("PARACHUTE_STATUS")
    assert told.deployment_status == DeploymentTrigger.ATS
    station.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS)
    times = [message.time_boot_ms for message in station.messages("PARACHUTE_STATUS")]
    assert times == sorted(times), "no status from the past is sent later"


def test_it_does_not_release_by_itself_otherwise():
    # Not armed, too near the ground, too short, too slow.
    for armed, *story in (
        *((FC, 60.0, 2.0, 15.0), (ATS, 5.0, 2.0, 15.0)),
        *((ATS, 60.0, 0.2, 15.0), (ATS, 60.0, 2.0, 9.0)),
    ):
        station = module(armed_triggers=int(armed))
        fall(station, *story)
        assert status(station).deployment_status == DeploymentTrigger.NONE, story
    station = module(armed_triggers=int(ATS))
    for _ in range(5):
        fall(station, 60.0, 0.2)
        station.send(position(60.0, 0.0), sender=(1, 1))
    untold = status(station).deployment_status
    assert untold == DeploymentTrigger.NONE, "one good moment begins the count anew"


def test_it_arms_and_disarms_itself_by_height():
    both = AUTO_ARM | AUTO_DISARM
    station = module(armed_triggers=int(both), ats_arm_altitude=30)
    for height, armed in ((29.9, both), (30.0, both | ATS), (29.9, both)):
        station.send(position(height), sender=(1, 1))
        assert status(station).arm_status == armed
    station = module(armed_triggers=int(AUTO_ARM), ats_arm_altitude=30)
    for height in (40.0, 10.0):
        station.send(position(height), sender=(1, 1))
    assert status(station).arm_status == AUTO_ARM | ATS, "without auto disarm it stays armed"


def test_what_was_disabled_stays_so_until_it_passes_the_altitude_again():
    station = module(armed_triggers=int(AUTO_ARM | ATS), ats_arm_altitude=30)
    station.send(position(60.0), sender=(1, 1))
    assert station.command(DO_PARACHUTE, DISABLE) == [ACCEPTED]
    fall(station, 60.0, 1.0)
    assert status(station).arm_status == AUTO_ARM
    assert status(station).deployment_status == DeploymentTrigger.NONE
    for height in (20.0, 31.0):
        station.send(position(height), sender=(1, 1))
    assert status(station).arm_status == AUTO_ARM | ATS


def test_the_height_of_another_vehicle_or_of_long_ago_is_not_known():
    station = module(armed_triggers=int(ATS | FC))
    station.send(position(0.0), sender=(2, 1))
    assert station.command(DO_PARACHUTE, RELEASE) == [ACCEPTED]
    station = module(armed_triggers=int(FC))
    station.send(position(5.0), sender=(1, 1))
    station.run(2.9)
    assert station.command(DO_PARACHUTE, RELEASE) == [NOT_NOW]
    station.run(0.2)
    assert station.command(DO_PARACHUTE, RELEASE) == [ACCEPTED]
