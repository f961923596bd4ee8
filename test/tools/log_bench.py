"""Flights of the simulated autopilot as logs of every format that judge_log reads."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from chute_msgs.msg import VehicleState
from mcap.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.ros.message_definitions import definition
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.tools.judge_log import command, formats
from chute_ros.tools.judge_log.flight_log import FlightLog
from chute_ros.tools.judge_log.log_flight import JudgedLog

ROOT = Path(__file__).parents[2]
#: Messages that are recorded, and every how many us.
STREAMS = {
    dialect.MAVLINK_MSG_ID_HEARTBEAT: 1_000_000,
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 100_000,
    dialect.MAVLINK_MSG_ID_ATTITUDE: 50_000,
    dialect.MAVLINK_MSG_ID_SCALED_IMU: 50_000,
    dialect.MAVLINK_MSG_ID_SCALED_PRESSURE: 100_000,
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 500_000,
    dialect.MAVLINK_MSG_ID_ATTITUDE_TARGET: 100_000,
    dialect.MAVLINK_MSG_ID_SYS_STATUS: 1_000_000,
}
#: It takes off to HEIGHT, m, and has landed at LANDED_AT, s; or a motor fails at another height.
HEIGHT, LANDED_AT = 12.0, 16.0
FALLS_FROM, FAILS_AT = 20.0, 13.0
_ARMS = (2.0, "arm")
LANDS = [_ARMS, (4.0, f"takeoff={HEIGHT:g}"), (8.0, "land")]
FAILS = [_ARMS, (4.0, f"takeoff={FALLS_FROM:g}"), (FAILS_AT, "fail-motor")]
EPOCH_US = 1_700_000_000_000_000


@dataclass(frozen=True)
class Told:
    """A message, when it was sent (s), and its bytes."""

    at: float
    message: Any
    frame: bytes


def flown(script: list[tuple[float, str]], until: float) -> list[Told]:
    """What the autopilot said on this flight."""
    device = AutopilotDevice(1, script)
    device.update(0.0)
    asking = FrameEncoder(1, 191)
    for message_id, interval in STREAMS.items():
        number = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
        wish = dialect.MAVLink_command_long_message(
            *(1, 1, number, 0, float(message_id), float(interval), 0.0, 0.0, 0.0, 0.0, 0.0)
        )
        device.receive(asking.encode(wish, 0.0), 0.0)
    now, told, decoder = 0.0, [], FrameDecoder()
    while now < until:
        now = max(now + 1e-3, device.next_deadline())
        device.update(now)
        for frame in device.take_output():
            for one in decoder.feed_datagram(frame, now):
                told.append(Told(now, one.message, frame))
    return told


def judged(path: Path, profile: str | None = None) -> JudgedLog:
    """As the command judges this log."""
    log = formats.read(path, {})
    return command.flown(log, command.config_of(log, profile))


def times_of(log: FlightLog) -> dict[str, list[float]]:
    """Kind of a message -> when each of them was told, s."""
    times: dict[str, list[float]] = {}
    for at, message in log.messages:
        times.setdefault(message.get_type(), []).append(at)
    return times


# -- telemetry --------------------------------------------------------------------------------


def tlog(told: Iterable[Told], path: Path) -> Path:
    """As a ground station writes it."""
    data = b"".join(struct.pack(">Q", EPOCH_US + round(one.at * 1e6)) + one.frame for one in told)
    path.write_bytes(data)
    return path


# -- ArduPilot --------------------------------------------------------------------------------

#: Name -> (number, format, fields).
ENTRIES = {
    "ATT": (129, "Qccccff", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "POS": (130, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "XKF1": (131, "QBf", "TimeUS,C,VD"),
    "BARO": (132, "QBff", "TimeUS,I,Alt,Press"),
    "IMU": (133, "QBfff", "TimeUS,I,AccX,AccY,AccZ"),
    "EV": (134, "QB", "TimeUS,Id"),
    "MSG": (135, "QZ", "TimeUS,Message"),
    "PARM": (136, "QNf", "TimeUS,Name,Value"),
    "BAT": (137, "QBff", "TimeUS,I,Volt,RemPct"),
    "CTUN": (138, "Qf", "TimeUS,ThO"),
}
_PACKED = {"Q": "Q", "B": "B", "f": "f", "c": "h", "L": "i", "Z": "64s", "N": "16s", "n": "4s"}
_FMT = ("BBnNZ", "Type,Length,Name,Format,Columns")


def dataflash(told: Iterable[Told], path: Path, **parameters: float) -> Path:
    """As ArduCopter writes it: binary, or text by its suffix."""
    write = _text if path.suffix == ".log" else _binary
    entries = _entries(told, {"CHUTE_ENABLED": 0.0, **parameters})
    path.write_bytes(b"".join(write(name, values) for name, values in entries))
    return path


def _entries(
    told: Iterable[Told], parameters: Mapping[str, float]
) -> Iterable[tuple[str, tuple[Any, ...]]]:
    yield "FMT", (128, 89, "FMT", *_FMT)
    for name, (number, form, fields) in ENTRIES.items():
        yield "FMT", (number, 3 + _size(form), name, form, fields)
    yield "MSG", (0, "ArduCopter V4.5.7 (00000000)")
    for name, value in parameters.items():
        yield "PARM", (0, name, value)
    armed, landed = False, True
    for one in told:
        us, message, kind = round(one.at * 1e6), one.message, one.message.get_type()
        if kind == "HEARTBEAT":
            now = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            if now != armed:
                yield "EV", (us, 10 if now else 11)
            armed = now
        elif kind == "EXTENDED_SYS_STATE":
            now = message.landed_state == dialect.MAV_LANDED_STATE_ON_GROUND
            if now != landed:
                yield "EV", (us, 18 if now else 28)
            landed = now
        elif kind == "ATTITUDE":
            roll, pitch, yaw = map(math.degrees, (message.roll, message.pitch, message.yaw))
            yield "ATT", (us, 0.0, roll, 0.0, pitch, yaw, yaw)
        elif kind == "GLOBAL_POSITION_INT":
            height = message.relative_alt / 1e3
            yield "XKF1", (us, 0, message.vz / 100.0)
            yield "POS", (us, message.lat / 1e7, message.lon / 1e7, message.alt / 1e3, *(height,) * 2)
        elif kind == "SCALED_PRESSURE":
            yield "BARO", (us, 0, 0.0, message.press_abs * 100.0)
        elif kind == "SCALED_IMU":
            parts = (getattr(message, name) * 9.80665e-3 for name in ("xacc", "yacc", "zacc"))
            yield "IMU", (us, 0, *parts)
        elif kind == "ATTITUDE_TARGET":
            yield "CTUN", (us, message.thrust)
        elif kind == "SYS_STATUS":
            yield "BAT", (us, 0, message.voltage_battery / 1e3, message.battery_remaining)


def _size(form: str) -> int:
    return struct.calcsize("<" + "".join(_PACKED[one] for one in form))


def _binary(name: str, values: tuple[Any, ...]) -> bytes:
    number, form = (128, _FMT[0]) if name == "FMT" else ENTRIES[name][:2]
    scaled = {"c": 100.0, "L": 1e7}
    packed = [
        value.encode() if isinstance(value, str) else round(value * scaled[one]) if one in scaled else value
        for one, value in zip(form, values, strict=True)
    ]
    head = bytes([0xA3, 0x95, number])
    return head + struct.pack("<" + "".join(_PACKED[one] for one in form), *packed)


def _text(name: str, values: tuple[Any, ...]) -> bytes:
    return (", ".join(map(str, (name, *values))) + "\n").encode()


# -- PX4 --------------------------------------------------------------------------------------

TOPICS = {
    "vehicle_attitude": ["float[4] q"],
    "vehicle_attitude_setpoint": ["float[4] q_d", "float[3] thrust_body"],
    "vehicle_local_position": ["float z", "float vz"],
    "vehicle_global_position": ["double lat", "double lon", "float alt"],
    "home_position": ["double lat", "double lon", "float alt", "float z"],
    "vehicle_air_data": ["float baro_pressure_pa"],
    "sensor_combined": ["float[3] accelerometer_m_s2"],
    "battery_status": ["float voltage_v", "float remaining"],
    "vehicle_status": ["uint8_t arming_state"],
    "vehicle_land_detected": ["bool landed"],
}
_ULOG_TYPES = {"float": "f", "double": "d", "uint8_t": "B", "bool": "?"}


def ulog(told: Iterable[Told], path: Path, home_z: float | None = None, valid_alt: bool = True) -> Path:
    """As PX4 writes it: without valid_alt as old ones do; with home_z as new ones do, for which
    heights begin there; a home that is not valid is full of zeros."""
    topics = dict(TOPICS)
    if home_z is not None:
        topics["home_position"] = [*TOPICS["home_position"], "bool valid_alt"]
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]

    def message(kind: str, payload: bytes) -> None:
        parts.append(struct.pack("<HB", len(payload), ord(kind)) + payload)

    message("B", bytes(40))
    for name, fields in topics.items():
        message("F", f"{name}:uint64_t timestamp;{';'.join(fields)};".encode())
    key = b"int32_t MAV_TYPE"
    message("P", bytes([len(key)]) + key + struct.pack("<i", 2))
    numbers = {name: number for number, name in enumerate(TOPICS)}
    for name, number in numbers.items():
        message("A", struct.pack("<BH", 0, number) + name.encode())
    for at, name, values in _topics(told):
        form = "<HQ"
        if name == "home_position" and home_z is not None:
            values = (*values[:3], home_z, True) if valid_alt else (0.0, 0.0, 0.0, 0.0, False)
        for field in topics[name]:
            kind, _, length = field.split()[0].partition("[")
            form += f"{length.rstrip(']')}{_ULOG_TYPES[kind]}"
        message("D", struct.pack(form, numbers[name], round(at * 1e6), *values))
    path.write_bytes(b"".join(parts))
    return path


def _topics(told: Iterable[Told]) -> Iterable[tuple[float, str, tuple[Any, ...]]]:
    at_home = False
    for one in told:
        at, message, kind = one.at, one.message, one.message.get_type()
        if kind == "HEARTBEAT":
            armed = message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
            yield at, "vehicle_status", (2 if armed else 1,)
        elif kind == "EXTENDED_SYS_STATE":
            on_ground = message.landed_state == dialect.MAV_LANDED_STATE_ON_GROUND
            yield at, "vehicle_land_detected", (on_ground,)
        elif kind == "ATTITUDE":
            roll = message.roll
            yield at, "vehicle_attitude", (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0)
        elif kind == "ATTITUDE_TARGET":
            yield at, "vehicle_attitude_setpoint", (*message.q, 0.0, 0.0, -message.thrust)
        elif kind == "GLOBAL_POSITION_INT":
            where = (message.lat / 1e7, message.lon / 1e7, message.alt / 1e3)
            if not at_home:
                at_home = True
                yield at, "home_position", (*where, 0.0)
            yield at, "vehicle_global_position", where
            yield at, "vehicle_local_position", (-message.relative_alt / 1e3, message.vz / 100.0)
        elif kind == "SCALED_PRESSURE":
            yield at, "vehicle_air_data", (message.press_abs * 100.0,)
        elif kind == "SCALED_IMU":
            parts = (getattr(message, name) * 9.80665e-3 for name in ("xacc", "yacc", "zacc"))
            yield at, "sensor_combined", tuple(parts)
        elif kind == "SYS_STATUS":
            battery = (message.voltage_battery / 1e3, message.battery_remaining / 100.0)
            yield at, "battery_status", battery


# -- ROS --------------------------------------------------------------------------------------


def mavros(
    told: Iterable[Told],
    path: Path,
    others: Iterable[tuple[str, str, tuple[Any, ...]]] = (),
    storage: StoragePlugin = StoragePlugin.SQLITE3,
) -> Path:
    """A rosbag2 folder with what MAVROS publishes in types of ROS itself. others: what is published
    besides, before each position: topic, type, values."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {
        "/mavros/global_position/rel_alt": "std_msgs/msg/Float64",
        "/mavros/local_position/velocity_local": "geometry_msgs/msg/TwistStamped",
        "/mavros/imu/data": "sensor_msgs/msg/Imu",
        "/mavros/imu/static_pressure": "sensor_msgs/msg/FluidPressure",
        **{topic: kind for topic, kind, _ in others},
    }
    made = {name: store.types[name] for name in {*types.values(), *_PARTS}}
    header = made["std_msgs/msg/Header"](made["builtin_interfaces/msg/Time"](0, 0), "")
    vector, quaternion = made["geometry_msgs/msg/Vector3"], made["geometry_msgs/msg/Quaternion"]
    still, none = vector(0.0, 0.0, 0.0), np.zeros(9)
    turned = quaternion(0.0, 0.0, 0.0, 1.0)
    with Writer(path, version=9, storage_plugin=storage) as writer:
        ways = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in types.items()}

        def say(topic: str, at: float, *values: Any) -> None:
            kind = types[topic]
            raw = store.serialize_cdr(made[kind](*values), kind)
            writer.write(ways[topic], round(at * 1e9), raw)

        for one in told:
            message, kind = one.message, one.message.get_type()
            if kind == "GLOBAL_POSITION_INT":
                up = vector(0.0, 0.0, message.vz / -100.0)
                for topic, _, values in others:
                    say(topic, one.at, *values)
                twist = made["geometry_msgs/msg/Twist"](up, still)
                say("/mavros/local_position/velocity_local", one.at, header, twist)
                say("/mavros/global_position/rel_alt", one.at, message.relative_alt / 1e3)
            elif kind == "ATTITUDE":
                turned = quaternion(math.sin(message.roll / 2), 0.0, 0.0, math.cos(message.roll / 2))
            elif kind == "SCALED_IMU":
                force = vector(0.0, 0.0, -message.zacc * 9.80665e-3)
                say("/mavros/imu/data", one.at, header, turned, none, still, none, force, none)
            elif kind == "SCALED_PRESSURE":
                pressure = (header, message.press_abs * 100.0, 0.0)
                say("/mavros/imu/static_pressure", one.at, *pressure)
    return path


_PARTS = (
    "std_msgs/msg/Header",
    "builtin_interfaces/msg/Time",
    "geometry_msgs/msg/Vector3",
    "geometry_msgs/msg/Quaternion",
    "geometry_msgs/msg/Twist",
)


def vehicle_state(told: Iterable[Told], path: Path) -> Path:
    """A rosbag2 folder with vehicle/state, as a node of this suite publishes it."""
    store = get_typestore(Stores.ROS2_JAZZY)
    name = "chute_msgs/msg/VehicleState"
    store.register(get_types_from_msg((ROOT / "msg_defs/msg/VehicleState.msg").read_text(), name))
    kind = store.types[name]
    stamp = store.types["builtin_interfaces/msg/Time"](0, 0)
    values: dict[str, Any] = {
        field: "" if where.endswith("str") else 0 for field, where in kind.__annotations__.items()
    }
    values |= {one: math.nan for one in values if one.endswith("_age")}
    values |= {"faults": [], "rebooted_in_flight": False, "source": "mavlink_parachute"}
    values["header"] = store.types["std_msgs/msg/Header"](stamp, "")
    measured: dict[str, float] = {}
    with Writer(path, version=9) as writer:
        way = writer.add_connection("/drone/vehicle/state", name, typestore=store)
        for one in told:
            new = _parts_of_state(one.message)
            if not new:
                continue
            for group, parts in new.items():
                measured[group] = one.at
                values |= parts
            ages = {f"{group}_age": one.at - at for group, at in measured.items()}
            never = {age: -1.0 for age in values if age.endswith("_age") and age not in ages}
            fields = {k: v for k, v in {**values, **never, **ages}.items() if k in kind.__annotations__}
            fields = {k: v for k, v in fields.items() if not k.isupper()}
            raw = store.serialize_cdr(kind(**fields), name)
            writer.write(way, round(one.at * 1e9), raw)
    return path


def black_box(told: Iterable[Told], path: Path) -> Path:
    """A file of a black box with vehicle/state, in chunks as it writes them."""
    folder = vehicle_state(told, path.with_name(f"{path.name}.folder"))
    text = definition(VehicleState)
    with AnyReader([folder]) as reader, path.open("wb") as file:
        writer = McapWriter(file, chunk_size=20_000)
        writer.start("ros2", "test")
        schema = writer.register_schema("chute_msgs/msg/VehicleState", "ros2msg", text.encode())
        channel = writer.register_channel("/drone1/vehicle/state", "cdr", schema)
        for _, time, raw in reader.messages():
            writer.add_message(channel, time, bytes(raw), time)
        writer.finish()
    return path


def _parts_of_state(message: Any) -> dict[str, dict[str, Any]]:
    kind = message.get_type()
    if kind == "HEARTBEAT":
        armed = message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
        return {"armed": {"armed": 2 if armed else 1}}
    if kind == "EXTENDED_SYS_STATE":
        return {"landed_state": {"landed_state": message.landed_state}}
    if kind == "GLOBAL_POSITION_INT":
        return {
            "height": {"height": message.relative_alt / 1e3},
            "vertical_speed": {"vertical_speed": message.vz / -100.0},
        }
    if kind == "ATTITUDE":
        tilt = math.acos(max(-1.0, min(1.0, math.cos(message.roll) * math.cos(message.pitch))))
        angles = {"roll": message.roll, "pitch": message.pitch, "yaw": message.yaw}
        return {"attitude": {**angles, "tilt": tilt}}
    if kind == "SCALED_IMU":
        return {"acceleration": {"acceleration": abs(message.zacc) * 9.80665e-3}}
    if kind == "SCALED_PRESSURE":
        return {"pressure": {"pressure": message.press_abs * 100.0}}
    return {}


Write = Callable[[Iterable[Told], Path], Path]
#: Name of the file -> who writes it.
FORMATS: dict[str, Write] = {
    "flight.tlog": tlog,
    "flight.bin": dataflash,
    "flight.log": dataflash,
    "flight.ulg": ulog,
    "mavros": mavros,
    "suite": vehicle_state,
    "box.mcap": black_box,
}
