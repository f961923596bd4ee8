"""Recordings of ROS 1 and 2 (.bag, .mcap, .db3, a rosbag2 folder): MAVROS, or a vehicle/state of
this suite, as the autopilot behind them would have told it.

Source: the MAVROS plugins imu, local_position, global_position, altitude, sys_status and
setpoint_raw (REP 103: x forward, y left, z up), chute_msgs/VehicleState; read by rosbags. What the
nodes listen to is read as they read it (protocol/vehicle_readings.py).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from mcap.records import Schema

from chute_ros.errors import RecordError
from chute_ros.model import Armed, LandedState
from chute_ros.protocol import vehicle_readings as readings
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.rotation import quaternion_of
from chute_ros.tools.judge_log import told
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError, MessageLog, reason
from chute_ros.tools.judge_log.stamps import steady
from chute_ros.tools.mcap_entries import McapEntries

FORMAT = "ROS recording"

_NANO = 1e-9
#: Its times are of a clock that can be set: a longer silence is one that was, s.
_SILENCE = 10.0
#: Of times by their ages, s.
_ROUNDING = 0.005
_SUITE, _TARGET = "vehicle/state", "setpoint_raw/target_attitude"
#: How a topic of MAVROS ends, and its type -> what a message of it tells.
_READERS: dict[tuple[str, str], Callable[[Any], readings.Parts]] = {
    ("global_position/rel_alt", "std_msgs/msg/Float64"): readings.relative_altitude,
    ("altitude", "mavros_msgs/msg/Altitude"): lambda message: {"height": (message.relative,)},
    ("local_position/odom", "nav_msgs/msg/Odometry"): readings.odometry,
    ("local_position/pose", "geometry_msgs/msg/PoseStamped"): lambda message: {
        "height": (message.pose.position.z,)
    },
    ("local_position/velocity_local", "geometry_msgs/msg/TwistStamped"): lambda message: {
        "vertical_speed": (message.twist.linear.z,)
    },
    ("global_position/global", "sensor_msgs/msg/NavSatFix"): readings.position,
    ("imu/data", "sensor_msgs/msg/Imu"): readings.imu,
    ("imu/static_pressure", "sensor_msgs/msg/FluidPressure"): lambda message: {
        "pressure": (message.fluid_pressure,)
    },
    ("battery", "sensor_msgs/msg/BatteryState"): readings.battery,
    ("extended_state", "mavros_msgs/msg/ExtendedState"): readings.mavros_extended_state,
    ("state", "mavros_msgs/msg/State"): readings.mavros_state,
}
_KINDS = (
    (_SUITE, "chute_msgs/msg/VehicleState"),
    (_TARGET, "mavros_msgs/msg/AttitudeTarget"),
    *_READERS,
)
_Kind = tuple[str, str]


def read(path: Path) -> FlightLog:
    """The log of this recording; LogError if it is none."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
        from rosbags.typesys.base import TypesysError
    except ImportError:
        raise LogError(
            f"{path}: a recording of ROS needs the package rosbags: python3 -m pip install rosbags"
        ) from None
    if path.is_dir() and (files := sorted(path.glob("*.mcap"), key=_number)):
        return _of_mcaps(path, files)
    folder = path if path.suffix == ".bag" or path.is_dir() else path.parent
    translator = _BagTranslator()
    try:
        with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            chosen = [one for one in reader.connections if _kind_of(one.topic, one.msgtype)]
            # Of none of them it would give all.
            every = _as_written(reader, chosen) if chosen else ()
            stamped = ((time * _NANO, (connection, raw)) for connection, time, raw in every)
            for at, (connection, raw) in steady(stamped, translator.remarks, _SILENCE):
                try:
                    message = reader.deserialize(raw, connection.msgtype)
                    translator.take(connection.topic, connection.msgtype, message, at)
                except (KeyError, AttributeError, TypesysError):
                    translator.unknown.add(connection.msgtype)
    except Exception as error:  # noqa: BLE001 - whatever a damaged file makes of its reader
        raise LogError(f"{path}: no recording of ROS that can be read: {reason(error)}") from None
    return translator.log(path)


def _as_written(reader: Any, chosen: Sequence[Any]) -> Iterable[tuple[Any, int, Any]]:
    """(connection, ns, message) in the order of the file, if it is a database: its times are of a
    clock that may have been set."""
    folders = [getattr(part, "storage", None) for part in reader.readers]
    storages = [one for folder in folders for one in getattr(folder, "storages", [folder])]
    databases = [one for one in storages if hasattr(one, "dbconn")]
    if not databases or any(part.compression_mode == "message" for part in reader.readers):
        yield from reader.messages(connections=chosen)
        return
    topics = {one.topic for one in chosen}
    for database in databases:
        connections = {one.id: one for one in database.connections if one.topic in topics}
        rows = database.dbconn.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY rowid"
        )
        for topic, time, raw in rows:
            if topic in connections:
                yield connections[topic], time, raw


def read_mcap(path: Path) -> FlightLog:
    """The log of one file."""
    return _of_mcaps(path, [path])


def _of_mcaps(path: Path, files: Sequence[Path]) -> FlightLog:
    """By our own reader, which takes what a power cut has left, as of a black box. files: the
    parts of this recording, the oldest first."""
    translator = _BagTranslator()
    parts = [McapEntries(file) for file in files]
    try:
        chosen = [
            one
            for one in itertools.chain.from_iterable(parts)
            if _kind_of(one.channel.topic, one.schema.name)
        ]
    except RecordError as error:
        raise LogError(f"no recording of ROS that can be read: {error}") from None
    definitions: dict[tuple[str, bytes], Any] = {}
    stamped = ((one.time * _NANO, one) for one in chosen)
    for at, entry in steady(stamped, translator.remarks, _SILENCE):
        schema = entry.schema
        key = (schema.name, schema.data)
        if key not in definitions:
            definitions[key] = _definition(schema)
        try:
            message = definitions[key].deserialize_cdr(entry.data, schema.name)
            translator.take(entry.channel.topic, schema.name, message, at)
        except Exception:  # noqa: BLE001 - whatever damage makes of its reader
            translator.unknown.add(schema.name)
    translator.remarks.extend(remark for part in parts for remark in part.remarks)
    return translator.log(path)


def _number(part: Path) -> tuple[int, str]:
    """rosbag2 numbers the parts of a recording: name_0, name_1, ..."""
    number = part.stem.rpartition("_")[2]
    return (int(number) if number.isdecimal() else 0), part.name


def _definition(schema: Schema) -> Any:
    """What reads a message of it: by its own definition, or that of ROS where it has none."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    text = schema.data.decode("utf-8", errors="replace")
    store = get_typestore(Stores.EMPTY)
    try:
        if schema.encoding == "ros2msg":
            store.register(get_types_from_msg(text, schema.name))
        elif schema.encoding == "ros2idl":
            parts = text.split("=" * 80 + "\n")
            for part in parts[1:] or parts:
                store.register(get_types_from_idl(part.partition("\n")[2] if parts[1:] else part))
    except Exception:  # noqa: BLE001 - whatever damage makes of its reader
        pass  # as one without
    return store if schema.name in store.fielddefs else get_typestore(Stores.ROS2_JAZZY)


def _kind_of(topic: str, message_type: str) -> _Kind | None:
    """What a topic says of the vehicle; None: nothing, or it is another program's."""
    kinds = (one for one in _KINDS if one[1] == message_type)
    return next((one for one in kinds if f"/{topic}".endswith(f"/{one[0]}")), None)


class _BagTranslator:
    """Makes of each message what an autopilot sends."""

    def __init__(self) -> None:
        self._out = MessageLog()
        self.unknown: set[str] = set()
        #: What a reader must be told of the recording.
        self.remarks: list[str] = []
        self._vehicle_type = dialect.MAV_TYPE_QUADROTOR
        self._autopilot = dialect.MAV_AUTOPILOT_GENERIC
        #: Part -> its newest values, and from which topic: of several the first that told it.
        self._newest: dict[str, readings.Values] = {}
        self._from: dict[str, str] = {}
        #: Of VehicleState: part -> when the newest value was measured.
        self._measured: dict[str, float] = {}

    def take(self, topic: str, message_type: str, message: Any, at: float) -> None:
        """One message of a topic, received at (s)."""
        kind = _kind_of(topic, message_type)
        if kind is None:
            return
        if kind[0] == _TARGET:
            self._target(message, at)
            return
        parts = self._of_suite(message, at) if kind[0] == _SUITE else _READERS[kind](message)
        new = {
            part: values
            for part, values in parts.items()
            if values is not None and self._is_of(topic, part, values)
        }
        self._newest |= new
        for part in new:
            self._tell(part, at)

    def _is_of(self, topic: str, part: str, values: readings.Values) -> bool:
        """This topic tells this part: it was the first with a number."""
        if part not in self._from and any(map(math.isfinite, values)):
            self._from[part] = topic
        return self._from.get(part) == topic

    def log(self, path: Path) -> FlightLog:
        """All of it; LogError: nothing of a vehicle."""
        damage = "".join(f"; {one}" for one in self.remarks)
        remarks = self.remarks
        if "armed" not in self._newest:
            remarks.append("nothing reports when it was armed: taken to be armed throughout")
            beat = told.heartbeat(self._vehicle_type, self._autopilot, True)
            for at in self._out.seconds():
                self._out.add_change(at, beat)
        messages = self._out.in_order()
        if not any(one.get_type() == "GLOBAL_POSITION_INT" for _, one in messages):
            wants = "vehicle/state, or mavros/global_position/rel_alt, altitude or local_position"
            types = ", ".join(sorted(self.unknown))
            lacking = f"; of these types it has no definition: {types}" if types else ""
            raise LogError(f"{path}: no topic reports a height (need {wants}){lacking}{damage}")
        if self.unknown:
            remarks.append(f"without a definition: {', '.join(sorted(self.unknown))}")
        return FlightLog(
            path, FORMAT, self._vehicle_type, self._autopilot, messages, remarks=remarks
        )

    def _tell(self, part: str, at: float) -> None:
        """What is told with another part waits for that."""
        values = self._newest[part]
        if part == "armed" and values[0] != Armed.UNKNOWN:
            armed = values[0] == Armed.ARMED
            self._out.add(at, told.heartbeat(self._vehicle_type, self._autopilot, armed))
        elif part == "landed_state" and values[0] != LandedState.UNKNOWN:
            self._out.add(at, told.landed(values[0] == LandedState.IN_AIR))
        elif part == "height" and math.isfinite(values[0]):
            (speed,) = self._newest.get("vertical_speed", (0.0,))
            (altitude,) = self._newest.get("altitude", (math.nan,))
            where = self._newest.get("position", (math.nan, math.nan))
            self._out.add(at, told.position(values[0], speed, altitude, *where))
        elif part == "attitude":
            *angles, tilt = values
            # A source may tell its tilt alone.
            known = angles if all(map(math.isfinite, angles)) else (tilt, 0.0, 0.0)
            self._out.add(at, told.attitude(*known))
        elif part == "pressure":
            self._out.add(at, told.pressure(values[0]))
        elif part == "acceleration":
            self._out.add(at, told.acceleration(0, 0.0, 0.0, -values[0]))
        elif part == "battery":
            self._out.add(at, told.battery(*values))

    def _target(self, message: Any, at: float) -> None:
        commanded = readings.attitude(message.orientation)
        if commanded is not None:
            turned = quaternion_of(*commanded[:3])
            self._out.add(at, told.attitude_target(turned, message.thrust))

    def _of_suite(self, message: Any, at: float) -> readings.Parts:
        """Of a VehicleState: what was measured since the message before."""
        return {
            part: tuple(getattr(message, name) for name in names)
            for part, names in readings.PARTS.items()
            if self._is_new(part, getattr(message, f"{part}_age"), at)
        }

    def _is_new(self, part: str, age: float, at: float) -> bool:
        """age: s; below 0: never measured."""
        measured = at - age
        # Ages are rounded to 32 bits.
        if age < 0.0 or not measured > self._measured.get(part, -math.inf) + _ROUNDING:
            return False
        self._measured[part] = measured
        return True
