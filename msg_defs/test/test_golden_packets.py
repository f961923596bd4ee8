"""Whole packets, byte by byte.

The bytes were worked out from the MAVLink serialization guide without pymavlink, and so can be
checked by hand:

MAVLink 2   fd  length  incompatible  compatible  sequence  system  component  message (3 bytes)
MAVLink 1   fe  length                            sequence  system  component  message (1 byte)
then        the payload, then two bytes of checksum, low byte first.

All numbers are little-endian. The payload holds the larger types first and fields of equal size
in the order of their declaration, then the extension fields. MAVLink 2 leaves out zero bytes at
the end of the payload, except the very first byte. The checksum is CRC-16/MCRF4XX (X.25 without
the last inversion) of everything after the first byte and up to the end of the payload, followed
by the CRC_EXTRA of the message; checksum() below is that, spelled out.
"""

import pytest

PARACHUTE = (1, 161)
COMPUTER = (1, 191)

HEARTBEAT = {
    "type": 37,
    "autopilot": 8,
    "base_mode": 0,
    "custom_mode": 0,
    "system_status": 4,
    "mavlink_version": 3,
}
NO_PARAMETERS = {f"param{index}": 0 for index in range(1, 8)}

# name: CRC_EXTRA, sender, message, fields, packet. The sequence number is the fifth byte.
PACKETS = {
    # MAV_TYPE_PARACHUTE 37, MAV_AUTOPILOT_INVALID 8, MAV_STATE_ACTIVE 4.
    "HEARTBEAT": (
        50,
        PARACHUTE,
        "heartbeat",
        HEARTBEAT,
        """
        fd 09 00 00 07 01 a1 00 00 00
        00000000 25 08 00 04 03
        35 98""",
    ),
    # Every field in use. The text ends with a zero byte, which is never sent: 22 of 23 bytes.
    "PARACHUTE_STATUS-full": (
        85,
        PARACHUTE,
        "parachute_status",
        {
            "time_boot_ms": 123456,
            "error_status": 0x18D123,
            "arm_status": 0b01010110,
            "deployment_status": 4,
            "safety_status": 0b101,
            "ats_arm_altitude": 30,
            "parachute_packed_date": b"2024-09-12",
        },
        """
        fd 16 00 00 08 01 a1 ae 01 00
        40e20100 23d11800 56 04 05 1e 323032342d30392d3132
        2c 4d""",
    ),
    # Zero from the deployment status on: cut after the arm status.
    "PARACHUTE_STATUS-truncated": (
        85,
        PARACHUTE,
        "parachute_status",
        {
            "time_boot_ms": 5000,
            "error_status": 0,
            "arm_status": 0b10,
            "deployment_status": 0,
            "safety_status": 0,
            "ats_arm_altitude": 0,
            "parachute_packed_date": b"",
        },
        """
        fd 09 00 00 09 01 a1 ae 01 00
        88130000 00000000 02
        f8 76""",
    ),
    # Nothing but zero: one byte stays.
    "PARACHUTE_STATUS-zero": (
        85,
        PARACHUTE,
        "parachute_status",
        {
            "time_boot_ms": 0,
            "error_status": 0,
            "arm_status": 0,
            "deployment_status": 0,
            "safety_status": 0,
            "ats_arm_altitude": 0,
            "parachute_packed_date": b"",
        },
        """
        fd 01 00 00 0a 01 a1 ae 01 00
        00
        ba 0a""",
    ),
    # MAV_CMD_DO_PARACHUTE 208, PARACHUTE_RELEASE 2.0. The confirmation, 0, is cut off.
    "COMMAND_LONG-release": (
        152,
        COMPUTER,
        "command_long",
        {
            **NO_PARAMETERS,
            "param1": 2,
            "command": 208,
            "target_system": 1,
            "target_component": 161,
            "confirmation": 0,
        },
        """
        fd 20 00 00 0b 01 bf 4c 00 00
        00000040 00000000 00000000 00000000 00000000 00000000 00000000 d000 01 a1
        dd 9f""",
    ),
    # The worked example of both documents: arm ATS and FC, disarm MANUAL and GEOFENCE. 6.0, 23.0.
    "COMMAND_LONG-set-arm": (
        152,
        COMPUTER,
        "command_long",
        {
            **NO_PARAMETERS,
            "param1": 0b00000110,
            "param2": 0b00010111,
            "command": 225,
            "target_system": 1,
            "target_component": 161,
            "confirmation": 1,
        },
        """
        fd 21 00 00 0c 01 bf 4c 00 00
        0000c040 0000b841 00000000 00000000 00000000 00000000 00000000 e100 01 a1 01
        f6 8d""",
    ),
    "COMMAND_ACK-accepted": (
        143,
        PARACHUTE,
        "command_ack",
        {
            "command": 208,
            "result": 0,
            "progress": 0,
            "result_param2": 0,
            "target_system": 1,
            "target_component": 191,
        },
        """
        fd 0a 00 00 0d 01 a1 4d 00 00
        d000 00 00 00000000 01 bf
        58 95""",
    ),
    "COMMAND_ACK-in-progress": (
        143,
        PARACHUTE,
        "command_ack",
        {
            "command": 225,
            "result": 5,
            "progress": 40,
            "result_param2": 0,
            "target_system": 1,
            "target_component": 191,
        },
        """
        fd 0a 00 00 0e 01 a1 4d 00 00
        e100 05 28 00000000 01 bf
        43 8a""",
    ),
    # From a sender that fills in no extension field: even the high byte of the command is cut off.
    "COMMAND_ACK-shortest": (
        143,
        PARACHUTE,
        "command_ack",
        {
            "command": 208,
            "result": 0,
            "progress": 0,
            "result_param2": 0,
            "target_system": 0,
            "target_component": 0,
        },
        """
        fd 01 00 00 0f 01 a1 4d 00 00
        d0
        a6 91""",
    ),
    "COMPONENT_INFORMATION_BASIC": (
        50,
        PARACHUTE,
        "component_information_basic",
        {
            "time_boot_ms": 5000,
            "capabilities": 0x2000,
            "time_manufacture_s": 1726100575,
            "vendor_name": b"Example Chutes",
            "model_name": b"PC-7",
            "software_version": b"1.4.2",
            "hardware_version": b"2.0.0",
            "serial_number": b"SN-0042",
        },
        f"""
        fd 87 00 00 10 01 a1 8c 01 00
        0020000000000000 88130000 5f34e266
        4578616d706c6520436875746573 {"00" * 18}
        50432d37 {"00" * 28}
        312e342e32 {"00" * 19}
        322e302e30 {"00" * 19}
        534e2d30303432
        46 6e""",
    ),
    "COMMAND_CANCEL": (
        14,
        COMPUTER,
        "command_cancel",
        {"command": 208, "target_system": 1, "target_component": 161},
        """
        fd 04 00 00 11 01 bf 50 00 00
        d000 01 a1
        b6 33""",
    ),
    # PARACHUTE_STATUS 430 once a second.
    "MESSAGE_INTERVAL": (
        95,
        PARACHUTE,
        "message_interval",
        {"message_id": 430, "interval_us": 1000000},
        """
        fd 06 00 00 12 01 a1 f4 00 00
        40420f00 ae01
        37 ab""",
    ),
    "HEARTBEAT-mavlink1": (
        50,
        PARACHUTE,
        "heartbeat",
        HEARTBEAT,
        """
        fe 09 07 01 a1 00
        00000000 25 08 00 04 03
        7a 3f""",
    ),
}
ALL = pytest.mark.parametrize("case", PACKETS.values(), ids=PACKETS.keys())


def checksum(data):
    """CRC-16/MCRF4XX, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc


def test_checksum_by_its_published_check_value():
    """The catalogue of CRC algorithms gives 0x6F91 for the digits 1 to 9."""
    assert checksum(b"123456789") == 0x6F91


@ALL
def test_packet_agrees_with_itself(case):
    """Length and checksum of the written bytes, without the dialect."""
    crc_extra, _, _, _, text = case
    packet = bytes.fromhex(text)
    assert packet[1] == len(packet) - {0xFD: 12, 0xFE: 8}[packet[0]]
    assert checksum(packet[1:-2] + bytes([crc_extra])) == int.from_bytes(packet[-2:], "little")


@ALL
def test_encode(dialect, case):
    """The dialect writes exactly these bytes."""
    _, sender, name, fields, text = case
    packet = bytes.fromhex(text)
    version1 = packet[0] == 0xFE
    link = dialect.MAVLink(None, *sender)
    link.seq = packet[2 if version1 else 4]
    arguments = {key: value for key, value in fields.items() if key != "mavlink_version"}
    message = getattr(link, f"{name}_encode")(**arguments)
    assert bytes(message.pack(link, force_mavlink1=version1)) == packet


@ALL
def test_decode(dialect, case):
    """The dialect reads these bytes as these fields."""
    _, sender, name, fields, text = case
    packet = bytes.fromhex(text)
    (message,) = dialect.MAVLink(None).parse_buffer(packet)
    assert (message.get_srcSystem(), message.get_srcComponent()) == sender
    assert message.get_type() == name.upper()
    decoded = message.to_dict()
    del decoded["mavpackettype"]
    as_text = {
        key: value.decode() if isinstance(value, bytes) else value for key, value in fields.items()
    }
    assert decoded == as_text


@ALL
def test_one_wrong_bit_is_refused(dialect, case):
    """No message comes out of these bytes if any one bit after the first byte is wrong.

    Unless it is the number of a message that nobody knows: its CRC_EXTRA is not known either.
    """
    packet = bytes.fromhex(case[-1])
    for place in range(8, 8 * len(packet)):
        wrong = bytearray(packet)
        wrong[place // 8] ^= 1 << place % 8
        link = dialect.MAVLink(None)
        link.robust_parsing = True
        types = [message.get_type() for message in link.parse_buffer(wrong) or []]
        assert all(name.startswith(("BAD_DATA", "UNKNOWN_")) for name in types), (place, types)


def test_untruncated_status_is_read(dialect):
    """A sender that does not leave out the last zero byte is understood as well."""
    body = bytes.fromhex("""
        17 00 00 08 01 a1 ae 01 00
        40e20100 23d11800 56 04 05 1e 323032342d30392d3132 00""")
    packet = b"\xfd" + body + checksum(body + bytes([85])).to_bytes(2, "little")
    (message,) = dialect.MAVLink(None).parse_buffer(packet)
    assert message.parachute_packed_date == "2024-09-12"
    assert message.error_status == 0x18D123
