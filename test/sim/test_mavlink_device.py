"""What every simulated MAVLink device does: streams, requests, silence, restarts, packets."""

import pytest
from device_bench import Station, crc

from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.sim.autopilot_device import AutopilotDevice

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
SET, GET = dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAV_CMD_GET_MESSAGE_INTERVAL
REQUEST = dialect.MAV_CMD_REQUEST_MESSAGE
STATUS = dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS
HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT
INFORMATION = dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC
INTERVAL = dialect.MAVLINK_MSG_ID_MESSAGE_INTERVAL


def module(script=(), **settings):
    return Station(ParachuteDevice(ParachuteSettings(**settings), list(script)))


def count(station, name, seconds):
    """How many of them come in this time."""
    station.forget()
    station.run(seconds)
    return len(station.messages(name))


# Streams and requests


def test_an_interval_is_set_read_back_switched_off_and_set_to_its_default():
    station = module()
    assert station.command(SET, STATUS, 200_000) == [ACCEPTED]
    assert count(station, "PARACHUTE_STATUS", 4.0) == pytest.approx(20, abs=1)
    for ask in ((GET, STATUS), (REQUEST, INTERVAL, STATUS)):
        assert station.command(*ask) == [ACCEPTED]
        read_back = station.newest("MESSAGE_INTERVAL")
        assert (read_back.message_id, read_back.interval_us) == (STATUS, 200_000)
    assert station.command(SET, STATUS, -1) == [ACCEPTED]
    assert count(station, "PARACHUTE_STATUS", 4.0) == 0
    station.command(GET, STATUS)
    assert station.newest("MESSAGE_INTERVAL").interval_us == -1
    assert station.command(SET, STATUS, 0) == [ACCEPTED]
    assert count(station, "PARACHUTE_STATUS", 4.0) == pytest.approx(4, abs=1)
    station.command(GET, STATUS)
    assert station.newest("MESSAGE_INTERVAL").interval_us == 1_000_000


@pytest.mark.parametrize(
    "command",
    [(SET, 30, 100_000), (SET, STATUS, -2), (GET, 30), (REQUEST, 30), (SET, HEARTBEAT, -1)],
)
def test_what_it_does_not_have_and_an_interval_that_cannot_be_are_denied(command):
    station = module()
    assert station.command(*command) == [DENIED]
    assert count(station, "HEARTBEAT", 3.0) == 3, "which cannot be switched off"


def test_a_flood_cannot_be_asked_for():
    station = module()
    station.command(SET, STATUS, 1)
    assert count(station, "PARACHUTE_STATUS", 1.0) <= 201


@pytest.mark.parametrize(
    ("message_id", "name"),
    [
        (HEARTBEAT, "HEARTBEAT"),
        (STATUS, "PARACHUTE_STATUS"),
        (INFORMATION, "COMPONENT_INFORMATION_BASIC"),
    ],
)
def test_a_message_is_sent_on_request_after_its_acknowledgement(message_id, name):
    station = module()
    station.forget()
    assert station.command(REQUEST, message_id) == [ACCEPTED]
    assert [f.message.get_type() for f in station.frames] == ["COMMAND_ACK", name]


def test_the_component_information_names_it():
    station = module()
    station.command(REQUEST, INFORMATION)
    told = station.newest("COMPONENT_INFORMATION_BASIC")
    assert told.vendor_name == "chute_ros"
    assert told.serial_number == "SIM-0001"


# Who is meant, and who is answered


@pytest.mark.parametrize("to", [(1, 161), (0, 161), (1, 0), (0, 0)])
def test_it_answers_what_is_addressed_to_it_or_to_all(to):
    assert module().command(REQUEST, 0, to=to) == [ACCEPTED]


@pytest.mark.parametrize("to", [(2, 161), (1, 162), (2, 0)])
def test_it_leaves_to_others_what_is_addressed_to_them(to):
    station = module()
    assert station.command(dialect.MAV_CMD_SET_PARACHUTE_ARM, 4, 4, to=to) == []
    assert station.device.armed == 0
    other = dialect.MAVLink_command_int_message(*to, 0, REQUEST, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    station.forget()
    station.send(other)
    assert station.messages("COMMAND_ACK") == []


def test_the_acknowledgement_names_who_asked():
    station = module()
    message = dialect.MAVLink_command_long_message(1, 161, REQUEST, 0, 0, 0, 0, 0, 0, 0, 0)
    station.send(message, sender=(255, 190))
    ack = station.newest("COMMAND_ACK")
    assert (ack.target_system, ack.target_component) == (255, 190)


@pytest.mark.parametrize(
    ("command", "result"),
    [(REQUEST, dialect.MAV_RESULT_COMMAND_LONG_ONLY), (30001, dialect.MAV_RESULT_UNSUPPORTED)],
)
def test_the_other_form_of_a_command_that_it_knows_is_refused_as_such(command, result):
    station = module()
    station.send(dialect.MAVLink_command_int_message(1, 161, 0, command, *[0] * 9))
    assert station.newest("COMMAND_ACK").result == result


def asking():
    """A frame that asks for its status."""
    ask = dialect.MAVLink_command_long_message(1, 161, REQUEST, 0, STATUS, 0, 0, 0, 0, 0, 0)
    return FrameEncoder(1, 191).encode(ask, 0.0)


@pytest.mark.parametrize("stream", [None, "a stream"])
def test_garbage_between_frames_does_not_confuse_it(stream):
    station = module()
    station.forget()
    station.device.receive(b"garbage" + asking() + b"more", station.now, stream)
    station.run(0.0)
    assert len(station.messages("COMMAND_ACK")) == 1


def test_what_a_closed_connection_left_unfinished_is_forgotten():
    station, frame = module(), asking()
    for ended in ("a stream", None):
        station.forget()
        station.device.receive(frame[:20], station.now, "a stream")
        station.device.stream_ended(ended)
        station.device.receive(frame[20:], station.now, "a stream")
        station.run(0.0)
        assert station.messages("COMMAND_ACK") == []


# Actions of the command line


def test_mute_it_speaks_but_answers_nothing_and_does_nothing():
    station = module()
    station.device.act("mute")
    assert station.command(dialect.MAV_CMD_SET_PARACHUTE_ARM, 4, 4) == []
    assert station.device.armed == 0
    assert count(station, "HEARTBEAT", 3.0) == 3
    station.device.act("unmute")
    assert station.command(dialect.MAV_CMD_SET_PARACHUTE_ARM, 4, 4) == [ACCEPTED]


def test_silent_it_sends_nothing_until_it_speaks_again():
    station = module()
    station.device.act("silent")
    station.forget()
    station.run(3.0)
    assert station.raw == []
    station.device.act("speak")
    assert count(station, "HEARTBEAT", 3.0) == 3


def test_a_reboot_forgets_all_but_what_was_released():
    station = module(armed_triggers=1)
    station.run(5.0)
    station.command(dialect.MAV_CMD_SET_PARACHUTE_ARM, 12, 12)
    station.command(SET, STATUS, 100_000)
    station.device.act("error=LOW_POWER")
    station.device.act("deploy=MANUAL")
    station.device.act("mute")
    station.device.act("reboot")
    station.run(0.0)
    status = station.newest("PARACHUTE_STATUS")
    assert (status.time_boot_ms, status.arm_status, status.error_status) == (0, 1, 0)
    assert status.deployment_status == 1
    assert station.command(REQUEST, STATUS) == [ACCEPTED], "no longer mute"
    assert count(station, "PARACHUTE_STATUS", 4.0) == 4, "its interval as delivered"


def test_a_script_is_done_in_its_time():
    station = module(script=[(2.0, "speak"), (1.0, "silent"), (3.0, "error=GPS_ERROR")])
    station.run(4.0)
    actions = [line for line in station.log if line.startswith("action")]
    assert actions == ["action silent", "action speak", "action error=GPS_ERROR"]
    times = [message.time_boot_ms for message in station.messages("PARACHUTE_STATUS")]
    assert not [t for t in times if 1000 <= t < 2000]
    assert [t for t in times if t < 1000]
    assert [t for t in times if t >= 2000]


def test_it_knows_when_it_has_something_to_do():
    station = module(script=[(2.5, "silent")])
    assert station.device.next_deadline() == pytest.approx(station.now + 1.0)
    station.run(2.0)
    assert station.device.next_deadline() == pytest.approx(1002.5)


# Whole packets, checked by hand against the MAVLink guide (see msg_defs/test)

GOLDEN_HEARTBEAT = "fd 09 00 00 00 01 a1 00 00 00 00000000 25 08 00 03 03"
GOLDEN_STATUS = "fd 16 00 00 01 01 a1 ae 01 00 00000000 04000000 0c 00 01 32 323032362d30362d3139"


def test_its_packets_are_these_bytes():
    station = module(armed_triggers=12, errors=4)
    for raw, golden in zip(station.raw, (GOLDEN_HEARTBEAT, GOLDEN_STATUS), strict=True):
        expected = bytes.fromhex(golden)
        extra = 50 if raw[7] == 0 else 85
        assert raw[:-2].hex(" ") == expected.hex(" ")
        assert int.from_bytes(raw[-2:], "little") == crc(raw[1:-2] + bytes([extra]))


def test_frames_are_numbered_without_a_gap():
    station = Station(AutopilotDevice(1, []))
    station.run(60.0)
    numbers = [frame.sequence for frame in station.frames]
    assert len(numbers) > 300
    assert numbers == [number % 256 for number in range(len(numbers))]
