"""The simulated parachute module, from the other side of the protocol.

The rows are those of the Parachute Protocol's tables; what is refused, and how, follows its public
emulator.
"""

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


def test_deployment_status_shows_each_trigger():
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


def test_a_second_release_is_accepted_and_changes_nothing():
    station = module(armed_triggers=int(FC), ground_cleared="yes")
    station.command(DO_PARACHUTE, RELEASE)
    station.command(SET_ARM, 0, FC)
    assert station.command(DO_PARACHUTE, RELEASE) == [ACCEPTED]
    assert status(station).deployment_status == DeploymentTrigger.DRONE
    assert sum("RELEASED" in line for line in station.log) == 1


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
