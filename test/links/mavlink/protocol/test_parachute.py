"""PARACHUTE_STATUS and heartbeat of one parachute; each row of the full document's tables."""

import pytest
from parachute_bench import Told, picture

from chute_ros.links.mavlink.protocol.parachute import packed_date
from chute_ros.model import (
    DeploymentTrigger,
    ErrorFlags,
    ParachuteState,
    SafetyFlags,
    TriggerFlags,
)
from chute_ros.protocol.mavlink.dialect import dialect as d

ERROR_FLAGS = {
    0: "BAROMETER_ERROR",
    1: "IMU_ERROR",
    2: "RF_CONNECTION_ERROR",
    3: "LOW_POWER",
    4: "FC_CONNECTION_ERROR",
    5: "EFTS_CONNECTION_ERROR",
    6: "POD_CONNECTION_ERROR",
    7: "EFTS_DIAGNOSE",
    8: "CHARGING_FAILED",
    9: "EXTERNAL_POWER_ERROR",
    10: "GS_CONNECTION_ERROR",
    11: "GPS_ERROR",
    12: "SUBSYSTEM_CONNECTION_ERROR",
    13: "SUBSYSTEM_FW_ERROR",
    14: "RESERVED_1",
    15: "RESERVED_2",
    16: "LOGGING_ERROR",
    17: "MODULE_RETIRED",
    18: "GLOW_WIRE_ERROR",
    19: "OFFBOARD_CONNECTION_ERROR",
    20: "IMU_CALIBRATION_ERROR",
}
DEPLOYMENT_TRIGGERS = {
    0: "NONE",
    1: "MANUAL",
    2: "ATS",
    3: "DRONE",
    4: "MAVLINK",
    5: "GEOFENCE",
    6: "FTS_PRECHECKING",
}
SAFETY_FLAGS = {1: "GROUND_CLEARED", 2: "ON_GROUND", 4: "GEOFENCE_MISSION_SET"}
TRIGGER_FLAGS = {
    0: "MANUAL",
    1: "ATS",
    2: "FC",
    3: "OFFBOARD",
    4: "GEOFENCE",
    5: "FTS_PRECHECKING",
    6: "ATS_AUTO_ARM",
    7: "ATS_AUTO_DISARM",
}


def rows(table: dict[int, str], prefix: str) -> list:
    return [pytest.param(key, name, id=f"{prefix}_{name}") for key, name in table.items()]


# -- the tables -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("bit", "name"), rows(ERROR_FLAGS, "PARACHUTE_ERROR_FLAGS"))
def test_error_flag(bit, name):
    told = picture(errors=1 << bit)
    assert told.error_flags is ErrorFlags[name]
    assert getattr(d, f"PARACHUTE_ERROR_FLAGS_{name}") == 1 << bit == int(ErrorFlags[name])
    assert told.faults == (name,)
    assert told.state is ParachuteState.ABNORMAL
    assert not told.healthy


@pytest.mark.parametrize(("bit", "name"), rows(ERROR_FLAGS, "PARACHUTE_ERROR_FLAGS"))
def test_error_flag_to_take_no_notice_of_is_shown_and_is_no_fault(bit, name):
    told = Told(ErrorFlags[name]).heartbeat().status(errors=1 << bit).at(0.0)
    assert told.error_flags is ErrorFlags[name]
    assert (told.faults, told.state) == ((), ParachuteState.READY)


def test_every_error_flag_is_in_the_table():
    assert {name: 1 << bit for bit, name in ERROR_FLAGS.items()} == {
        name: int(flag) for name, flag in ErrorFlags.__members__.items()
    }


@pytest.mark.parametrize(
    ("value", "name"), rows(DEPLOYMENT_TRIGGERS, "PARACHUTE_DEPLOYMENT_TRIGGER")
)
def test_deployment_trigger(value, name):
    told = picture(deployed=value)
    assert told.deployment_trigger == value == DeploymentTrigger[name]
    assert getattr(d, f"PARACHUTE_DEPLOYMENT_TRIGGER_{name}") == value
    assert told.deployed == (name != "NONE")
    assert told.state is (ParachuteState.READY if name == "NONE" else ParachuteState.LAUNCHED)
    assert told.faults == ()


@pytest.mark.parametrize(("value", "name"), rows(SAFETY_FLAGS, "PARACHUTE_SAFETY_FLAGS"))
def test_safety_flag(value, name):
    told = picture(safety=value)
    assert told.safety_flags is SafetyFlags[name]
    assert getattr(d, f"PARACHUTE_SAFETY_FLAGS_{name}") == value
    assert told.faults == ()


@pytest.mark.parametrize(("bit", "name"), rows(TRIGGER_FLAGS, "PARACHUTE_TRIGGER_FLAGS"))
def test_trigger_flag(bit, name):
    told = picture(armed=1 << bit)
    assert told.armed_triggers is TriggerFlags[name]
    assert getattr(d, f"PARACHUTE_TRIGGER_FLAGS_{name}") == 1 << bit
    # Automatic arming and disarming by height is no trigger that fires.
    assert told.armed == (not name.startswith("ATS_AUTO"))
    assert told.state is (ParachuteState.ARMED if told.armed else ParachuteState.READY)


FIELDS = [
    pytest.param({"boot_ms": 123456}, "uptime", 123.456, id="time_boot_ms"),
    pytest.param({"errors": 9}, "error_flags", 9, id="error_status"),
    pytest.param({"armed": 0xC3}, "armed_triggers", 0xC3, id="arm_status"),
    pytest.param({"deployed": 4}, "deployment_trigger", 4, id="deployment_status"),
    pytest.param({"safety": 5}, "safety_flags", 5, id="safety_status"),
    pytest.param({"ats": 255}, "ats_arm_altitude", 255.0, id="ats_arm_altitude"),
    pytest.param({"packed": b"2025-12-24"}, "packed_date", "2025-12-24", id="packed_date"),
    pytest.param({"packed": bytes(11)}, "packed_date", "", id="packed_date_all_0_not_provided"),
]


@pytest.mark.parametrize(("sent", "field", "value"), FIELDS)
def test_status_field(sent, field, value):
    assert getattr(picture(**sent), field) == value


# -- what has no name ---------------------------------------------------------------------------


def test_unknown_bits_are_kept_and_named_as_such():
    told = picture(errors=1 << 31 | 1 << 21 | 1, safety=0x88, deployed=77)
    assert int(told.error_flags) == 1 << 31 | 1 << 21 | 1
    assert int(told.safety_flags) == 0x88
    assert told.deployment_trigger == 77
    assert told.deployed
    assert told.faults == (
        "BAROMETER_ERROR",
        "bit 21",
        "bit 31",
        "deployment trigger 77 has no name",
        "safety flag bit 3 has no name",
        "safety flag bit 7 has no name",
    )


def test_unknown_error_bit_alone_makes_it_unhealthy():
    assert picture(errors=1 << 25).state is ParachuteState.ABNORMAL


@pytest.mark.parametrize(
    ("packed", "date", "fault"),
    [
        pytest.param(b"2024-02-29", "2024-02-29", False, id="leap day"),
        pytest.param(bytes(11), "", False, id="all zero: not given"),
        pytest.param(b"2023-02-29", "", True, id="no leap year"),
        pytest.param(b"2023-13-01", "", True, id="month 13"),
        pytest.param(b"2023-00-10", "", True, id="month 0"),
        pytest.param(b"0000-01-01", "", True, id="year 0"),
        pytest.param(b"2023-1-1", "", True, id="short"),
        pytest.param(b"20230101", "", True, id="without dashes"),
        pytest.param(b"01-02-2023", "", True, id="wrong order"),
        pytest.param(b"2023-01-011", "", True, id="not terminated"),
        pytest.param(b"\xff\xfe\x80", "", True, id="not ASCII"),
        pytest.param(b"2023-01-0\n", "", True, id="line break"),
    ],
)
def test_packed_date(packed, date, fault):
    told = picture(packed=packed)
    assert told.packed_date == date
    assert any("is no date YYYY-MM-DD" in text for text in told.faults) == fault
    assert told.state is ParachuteState.READY


def test_packed_date_tells_what_came():
    assert packed_date("1st May") == ("", "packed date '1st May' is no date YYYY-MM-DD")
