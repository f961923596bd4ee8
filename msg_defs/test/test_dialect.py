"""The numbers of the dialect, each written out as the protocol's documents give it.

Test ids name the row of the table that they come from. The two documents are those that the head
of parachute.xml names [P]: "full" and "reduced".
"""

from pathlib import Path
from xml.etree import ElementTree

import pytest

DEFINITION = Path(__file__).resolve().parents[1] / "mavlink" / "parachute.xml"

# id, name, CRC_EXTRA, length of the payload (with extension fields), fields in the order of their
# declaration as (type, name, array length). Order on the wire: larger types first, else as here.
MESSAGES = [
    (
        0,
        "HEARTBEAT",
        50,
        9,
        [
            ("uint8_t", "type", 0),
            ("uint8_t", "autopilot", 0),
            ("uint8_t", "base_mode", 0),
            ("uint32_t", "custom_mode", 0),
            ("uint8_t", "system_status", 0),
            ("uint8_t", "mavlink_version", 0),
        ],
    ),
    (
        76,
        "COMMAND_LONG",
        152,
        33,
        [
            ("uint8_t", "target_system", 0),
            ("uint8_t", "target_component", 0),
            ("uint16_t", "command", 0),
            ("uint8_t", "confirmation", 0),
            ("float", "param1", 0),
            ("float", "param2", 0),
            ("float", "param3", 0),
            ("float", "param4", 0),
            ("float", "param5", 0),
            ("float", "param6", 0),
            ("float", "param7", 0),
        ],
    ),
    (
        77,
        "COMMAND_ACK",
        143,
        10,
        [
            ("uint16_t", "command", 0),
            ("uint8_t", "result", 0),
            ("uint8_t", "progress", 0),
            ("int32_t", "result_param2", 0),
            ("uint8_t", "target_system", 0),
            ("uint8_t", "target_component", 0),
        ],
    ),
    (
        80,
        "COMMAND_CANCEL",
        14,
        4,
        [
            ("uint8_t", "target_system", 0),
            ("uint8_t", "target_component", 0),
            ("uint16_t", "command", 0),
        ],
    ),
    (
        244,
        "MESSAGE_INTERVAL",
        95,
        6,
        [
            ("uint16_t", "message_id", 0),
            ("int32_t", "interval_us", 0),
        ],
    ),
    (
        396,
        "COMPONENT_INFORMATION_BASIC",
        50,
        160,
        [
            ("uint32_t", "time_boot_ms", 0),
            ("uint64_t", "capabilities", 0),
            ("uint32_t", "time_manufacture_s", 0),
            ("char", "vendor_name", 32),
            ("char", "model_name", 32),
            ("char", "software_version", 24),
            ("char", "hardware_version", 24),
            ("char", "serial_number", 32),
        ],
    ),
    (
        430,
        "PARACHUTE_STATUS",
        85,
        23,
        [
            ("uint32_t", "time_boot_ms", 0),
            ("uint32_t", "error_status", 0),
            ("uint8_t", "arm_status", 0),
            ("uint8_t", "deployment_status", 0),
            ("uint8_t", "safety_status", 0),
            ("uint8_t", "ats_arm_altitude", 0),
            ("char", "parachute_packed_date", 11),
        ],
    ),
]

# Full document, table of PARACHUTE_STATUS: field, enumeration, display, unit.
STATUS_FIELDS = [
    ("time_boot_ms", None, None, "ms"),
    ("error_status", "PARACHUTE_ERROR_FLAGS", "bitmask", None),
    ("arm_status", "PARACHUTE_TRIGGER_FLAGS", "bitmask", None),
    ("deployment_status", "PARACHUTE_DEPLOYMENT_TRIGGER", None, None),
    ("safety_status", "PARACHUTE_SAFETY_FLAGS", "bitmask", None),
    ("ats_arm_altitude", None, None, "m"),
    ("parachute_packed_date", None, None, None),
]

# Full document, table of PARACHUTE_ERROR_FLAGS: bit, value, name.
ERROR_FLAGS = [
    (0, 1, "PARACHUTE_ERROR_FLAGS_BAROMETER_ERROR"),
    (1, 2, "PARACHUTE_ERROR_FLAGS_IMU_ERROR"),
    (2, 4, "PARACHUTE_ERROR_FLAGS_RF_CONNECTION_ERROR"),
    (3, 8, "PARACHUTE_ERROR_FLAGS_LOW_POWER"),
    (4, 16, "PARACHUTE_ERROR_FLAGS_FC_CONNECTION_ERROR"),
    (5, 32, "PARACHUTE_ERROR_FLAGS_EFTS_CONNECTION_ERROR"),
    (6, 64, "PARACHUTE_ERROR_FLAGS_POD_CONNECTION_ERROR"),
    (7, 128, "PARACHUTE_ERROR_FLAGS_EFTS_DIAGNOSE"),
    (8, 256, "PARACHUTE_ERROR_FLAGS_CHARGING_FAILED"),
    (9, 512, "PARACHUTE_ERROR_FLAGS_EXTERNAL_POWER_ERROR"),
    (10, 1024, "PARACHUTE_ERROR_FLAGS_GS_CONNECTION_ERROR"),
    (11, 2048, "PARACHUTE_ERROR_FLAGS_GPS_ERROR"),
    (12, 4096, "PARACHUTE_ERROR_FLAGS_SUBSYSTEM_CONNECTION_ERROR"),
    (13, 8192, "PARACHUTE_ERROR_FLAGS_SUBSYSTEM_FW_ERROR"),
    (14, 16384, "PARACHUTE_ERROR_FLAGS_RESERVED_1"),
    (15, 32768, "PARACHUTE_ERROR_FLAGS_RESERVED_2"),
    (16, 65536, "PARACHUTE_ERROR_FLAGS_LOGGING_ERROR"),
    (17, 131072, "PARACHUTE_ERROR_FLAGS_MODULE_RETIRED"),
    (18, 262144, "PARACHUTE_ERROR_FLAGS_GLOW_WIRE_ERROR"),
    (19, 524288, "PARACHUTE_ERROR_FLAGS_OFFBOARD_CONNECTION_ERROR"),
    (20, 1048576, "PARACHUTE_ERROR_FLAGS_IMU_CALIBRATION_ERROR"),
]

# Full document, table of PARACHUTE_TRIGGER_FLAGS: bit, value, name.
TRIGGER_FLAGS = [
    (0, 1, "PARACHUTE_TRIGGER_FLAGS_MANUAL"),
    (1, 2, "PARACHUTE_TRIGGER_FLAGS_ATS"),
    (2, 4, "PARACHUTE_TRIGGER_FLAGS_FC"),
    (3, 8, "PARACHUTE_TRIGGER_FLAGS_OFFBOARD"),
    (4, 16, "PARACHUTE_TRIGGER_FLAGS_GEOFENCE"),
    (5, 32, "PARACHUTE_TRIGGER_FLAGS_FTS_PRECHECKING"),
    (6, 64, "PARACHUTE_TRIGGER_FLAGS_ATS_AUTO_ARM"),
    (7, 128, "PARACHUTE_TRIGGER_FLAGS_ATS_AUTO_DISARM"),
]

# Full document, table of PARACHUTE_SAFETY_FLAGS (it gives no bit numbers): bit, value, name.
SAFETY_FLAGS = [
    (0, 1, "PARACHUTE_SAFETY_FLAGS_GROUND_CLEARED"),
    (1, 2, "PARACHUTE_SAFETY_FLAGS_ON_GROUND"),
    (2, 4, "PARACHUTE_SAFETY_FLAGS_GEOFENCE_MISSION_SET"),
]

# Full document, table of PARACHUTE_DEPLOYMENT_TRIGGER: value, name.
DEPLOYMENT_TRIGGERS = [
    (0, "PARACHUTE_DEPLOYMENT_TRIGGER_NONE"),
    (1, "PARACHUTE_DEPLOYMENT_TRIGGER_MANUAL"),
    (2, "PARACHUTE_DEPLOYMENT_TRIGGER_ATS"),
    (3, "PARACHUTE_DEPLOYMENT_TRIGGER_DRONE"),
    (4, "PARACHUTE_DEPLOYMENT_TRIGGER_MAVLINK"),
    (5, "PARACHUTE_DEPLOYMENT_TRIGGER_GEOFENCE"),
    (6, "PARACHUTE_DEPLOYMENT_TRIGGER_FTS_PRECHECKING"),
]

# The enumerations, and the name that the generator gives to one above the highest value. The
# protocol's public emulator computes its mask of known triggers from the first of them.
ENUMERATIONS = [
    ("PARACHUTE_TRIGGER_FLAGS", [row[1:] for row in TRIGGER_FLAGS], 129),
    ("PARACHUTE_DEPLOYMENT_TRIGGER", DEPLOYMENT_TRIGGERS, 7),
    ("PARACHUTE_SAFETY_FLAGS", [row[1:] for row in SAFETY_FLAGS], 5),
    ("PARACHUTE_ERROR_FLAGS", [row[1:] for row in ERROR_FLAGS], 1048577),
    (
        "PARACHUTE_ACTION",
        [
            (0, "PARACHUTE_DISABLE"),
            (1, "PARACHUTE_ENABLE"),
            (2, "PARACHUTE_RELEASE"),
        ],
        3,
    ),
    (
        "MAV_RESULT",
        [
            (0, "MAV_RESULT_ACCEPTED"),
            (1, "MAV_RESULT_TEMPORARILY_REJECTED"),
            (2, "MAV_RESULT_DENIED"),
            (3, "MAV_RESULT_UNSUPPORTED"),
            (4, "MAV_RESULT_FAILED"),
            (5, "MAV_RESULT_IN_PROGRESS"),
            (6, "MAV_RESULT_CANCELLED"),
            (7, "MAV_RESULT_COMMAND_LONG_ONLY"),
            (8, "MAV_RESULT_COMMAND_INT_ONLY"),
        ],
        9,
    ),
]

# The summary tables of both documents (messages, commands, enumeration values, enumerations) with
# the numbers that MAVLink gives to the names, and the names that their text mentions.
SUMMARY = [
    ("full", "message", "PARACHUTE_STATUS", 430),
    ("full", "command", "MAV_CMD_SET_PARACHUTE_ARM", 225),
    ("full", "value", "MAV_TYPE_PARACHUTE", 37),
    ("full", "value", "MAV_COMP_ID_PARACHUTE", 161),
    ("full", "text", "MAV_CMD_REQUEST_MESSAGE", 512),
    ("reduced", "message", "PARACHUTE_STATUS", 430),
    ("reduced", "command", "MAV_CMD_DO_PARACHUTE", 208),
    ("reduced", "command", "MAV_CMD_SET_PARACHUTE_ARM", 225),
    ("reduced", "value", "MAV_TYPE_PARACHUTE", 37),
    ("reduced", "value", "MAV_COMP_ID_PARACHUTE", 161),
    ("reduced", "text", "MAV_CMD_DO_FLIGHTTERMINATION", 185),
    ("reduced", "text", "MAV_CMD_REQUEST_MESSAGE", 512),
    ("reduced", "text", "MAV_CMD_SET_MESSAGE_INTERVAL", 511),
    # Beside the documents: what the operation of a parachute needs from common.xml.
    ("common", "command", "MAV_CMD_GET_MESSAGE_INTERVAL", 510),
    ("common", "command", "MAV_CMD_COMPONENT_ARM_DISARM", 400),
]
SUMMARY_ENUMERATIONS = [
    ("full", "PARACHUTE_TRIGGER_FLAGS"),
    ("full", "PARACHUTE_DEPLOYMENT_TRIGGER"),
    ("full", "PARACHUTE_SAFETY_FLAGS"),
    ("full", "PARACHUTE_ERROR_FLAGS"),
    ("reduced", "PARACHUTE_TRIGGER_FLAGS"),
    ("reduced", "PARACHUTE_DEPLOYMENT_TRIGGER"),
    ("reduced", "PARACHUTE_SAFETY_FLAGS"),
    ("reduced", "PARACHUTE_ERROR_FLAGS"),
    ("reduced", "PARACHUTE_ACTION"),
]


def rows(table, name):
    """Parametrise with the rows of table; name(row) gives the test id."""
    return pytest.mark.parametrize("row", table, ids=name)


@rows(MESSAGES, lambda row: f"{row[1]}-{row[0]}")
def test_message(dialect, row):
    """Id, CRC_EXTRA, length, and the order and types of the fields."""
    number, name, crc_extra, length, fields = row
    message = dialect.mavlink_map[number]
    assert message.msgname == name
    assert getattr(dialect, f"MAVLINK_MSG_ID_{name}") == number
    assert message.crc_extra == crc_extra
    assert message.unpacker.size == length
    # array_lengths follows the order on the wire; "orders" leads there from the declaration.
    lengths = [message.array_lengths[place] for place in message.orders]
    assert list(zip(message.fieldtypes, message.fieldnames, lengths, strict=True)) == fields


@rows(STATUS_FIELDS, lambda row: f"PARACHUTE_STATUS-{row[0]}")
def test_status_field(dialect, row):
    """Meaning of a field of PARACHUTE_STATUS: enumeration, display, unit."""
    name, enumeration, display, unit = row
    message = dialect.mavlink_map[430]
    assert name in message.fieldnames
    assert message.fieldenums_by_name.get(name) == enumeration
    assert message.fielddisplays_by_name.get(name) == display
    assert message.fieldunits_by_name.get(name) == unit


@rows(ERROR_FLAGS + TRIGGER_FLAGS + SAFETY_FLAGS, lambda row: f"{row[2]}-bit{row[0]}-{row[1]}")
def test_flag(dialect, row):
    """Name, value and bit of a flag."""
    bit, value, name = row
    assert getattr(dialect, name) == value == 1 << bit


@rows(DEPLOYMENT_TRIGGERS, lambda row: f"{row[1]}-{row[0]}")
def test_deployment_trigger(dialect, row):
    """Name and value of a deployment trigger."""
    value, name = row
    assert getattr(dialect, name) == value


@rows(ENUMERATIONS, lambda row: row[0])
def test_enumeration_has_these_entries_and_no_others(dialect, row):
    """All entries of an enumeration, in both directions."""
    name, entries, end = row
    assert getattr(dialect, f"{name}_ENUM_END") == end
    found = {value: entry.name for value, entry in dialect.enums[name].items()}
    assert found == {**dict(entries), end: f"{name}_ENUM_END"}


@rows(SUMMARY, lambda row: "-".join(map(str, row)))
def test_summary(dialect, row):
    """Number of a message, command, type or component."""
    _, kind, name, number = row
    prefix = "MAVLINK_MSG_ID_" if kind == "message" else ""
    assert getattr(dialect, prefix + name) == number


@rows(SUMMARY_ENUMERATIONS, "-".join)
def test_summary_enumeration(dialect, row):
    """An enumeration that a document lists exists."""
    assert row[1] in dialect.enums


def test_set_parachute_arm_takes_two_masks():
    """MAV_CMD_SET_PARACHUTE_ARM: both documents give it two parameters, both masks of triggers."""
    command = ElementTree.parse(DEFINITION).find(".//entry[@value='225']")
    parameters = [
        (param.get("index"), param.get("enum"), param.get("reserved"))
        for param in command.findall("param")
    ]
    assert parameters == [
        ("1", "PARACHUTE_TRIGGER_FLAGS", None),
        ("2", "PARACHUTE_TRIGGER_FLAGS", None),
        *((str(index), None, "true") for index in range(3, 8)),
    ]
