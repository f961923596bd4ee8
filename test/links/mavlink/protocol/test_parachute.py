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

#: By bit.
ERROR_FLAGS = [
    "BAROMETER_ERROR",
    "IMU_ERROR",
    "RF_CONNECTION_ERROR",
    "LOW_POWER",
    "FC_CONNECTION_ERROR",
    "EFTS_CONNECTION_ERROR",
    "POD_CONNECTION_ERROR",
    "EFTS_DIAGNOSE",
    "CHARGING_FAILED",
    "EXTERNAL_POWER_ERROR",
    "GS_CONNECTION_ERROR",
    "GPS_ERROR",
    "SUBSYSTEM_CONNECTION_ERROR",
    "SUBSYSTEM_FW_ERROR",
    "RESERVED_1",
    "RESERVED_2",
    "LOGGING_ERROR",
    "MODULE_RETIRED",
    "GLOW_WIRE_ERROR",
    "OFFBOARD_CONNECTION_ERROR",
    "IMU_CALIBRATION_ERROR",
]
TRIGGER_FLAGS = [
    "MANUAL",
    "ATS",
    "FC",
    "OFFBOARD",
    "GEOFENCE",
    "FTS_PRECHECKING",
    "ATS_AUTO_ARM",
    "ATS_AUTO_DISARM",
]
#: By value.
DEPLOYMENT_TRIGGERS = ["NONE", "MANUAL", "ATS", "DRONE", "MAVLINK", "GEOFENCE", "FTS_PRECHECKING"]
SAFETY_FLAGS = {1: "GROUND_CLEARED", 2: "ON_GROUND", 4: "GEOFENCE_MISSION_SET"}


def test_error_flag():
    assert list(ErrorFlags.__members__) == ERROR_FLAGS
    for bit, name in enumerate(ERROR_FLAGS):
        told = picture(errors=1 << bit)
        assert told.error_flags is ErrorFlags[name], name
        assert getattr(d, f"PARACHUTE_ERROR_FLAGS_{name}") == 1 << bit == int(ErrorFlags[name])
        assert (told.faults, told.state) == ((name,), ParachuteState.ABNORMAL)
        assert not told.healthy, name
        # One to take no notice of is shown, and no fault.
        told = Told(ErrorFlags[name]).heartbeat().status(errors=1 << bit).at(0.0)
        assert told.error_flags is ErrorFlags[name]
        assert (told.faults, told.state) == ((), ParachuteState.READY), name


def test_deployment_trigger():
    for value, name in enumerate(DEPLOYMENT_TRIGGERS):
        told = picture(deployed=value)
        assert told.deployment_trigger == value == DeploymentTrigger[name]
        assert getattr(d, f"PARACHUTE_DEPLOYMENT_TRIGGER_{name}") == value
        assert told.deployed == (name != "NONE")
        state = ParachuteState.READY if name == "NONE" else ParachuteState.LAUNCHED
        assert (told.state, told.faults) == (state, ()), name


def test_safety_flag():
    for value, name in SAFETY_FLAGS.items():
        told = picture(safety=value)
        assert told.safety_flags is SafetyFlags[name]
        assert getattr(d, f"PARACHUTE_SAFETY_FLAGS_{name}") == value
        assert told.faults == (), name


def test_trigger_flag():
    for bit, name in enumerate(TRIGGER_FLAGS):
        told = picture(armed=1 << bit)
        assert told.armed_triggers is TriggerFlags[name]
        assert getattr(d, f"PARACHUTE_TRIGGER_FLAGS_{name}") == 1 << bit
        # Automatic arming and disarming by height is no trigger that fires.
        assert told.armed == (not name.startswith("ATS_AUTO")), name
        assert told.state is (ParachuteState.ARMED if told.armed else ParachuteState.READY)


@pytest.mark.parametrize(
    ("sent", "field", "value"),
    [
        ({"boot_ms": 123456}, "uptime", 123.456),
        ({"errors": 9}, "error_flags", 9),
        ({"armed": 0xC3}, "armed_triggers", 0xC3),
        ({"deployed": 4}, "deployment_trigger", 4),
        ({"safety": 5}, "safety_flags", 5),
        ({"ats": 255}, "ats_arm_altitude", 255.0),
        ({"packed": b"2025-12-24"}, "packed_date", "2025-12-24"),
        ({"packed": bytes(11)}, "packed_date", ""),  # all 0: not provided
    ],
)
def test_status_field(sent, field, value):
    assert getattr(picture(**sent), field) == value


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


def test_packed_date():
    # A leap day; all zero: not given.
    for packed, date in ((b"2024-02-29", "2024-02-29"), (bytes(11), "")):
        told = picture(packed=packed)
        assert (told.packed_date, told.faults) == (date, ()), packed
        assert told.state is ParachuteState.READY
    for packed in (
        *(b"2023-02-29", b"2023-13-01", b"2023-00-10", b"0000-01-01", b"2023-1-1", b"20230101"),
        *(b"01-02-2023", b"2023-01-011", b"\xff\xfe\x80", b"2023-01-0\n"),
    ):
        told = picture(packed=packed)
        assert told.packed_date == "", packed
        assert any("is no date YYYY-MM-DD" in text for text in told.faults), packed
        assert told.state is ParachuteState.READY
    assert packed_date("1st May") == ("", "packed date '1st May' is no date YYYY-MM-DD")
