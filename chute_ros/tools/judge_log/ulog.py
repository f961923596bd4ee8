"""PX4's own logs (.ulg), as PX4 would have told them.

Source: PX4's uORB topics (vehicle_attitude, vehicle_attitude_setpoint, vehicle_local_position and
its setpoint, vehicle_global_position, home_position, vehicle_air_data, sensor_baro,
sensor_combined, sensor_accel, battery_status, vehicle_status, vehicle_land_detected) and their
MAVLink streams, read by pyulog.
"""

from __future__ import annotations

import bisect
import contextlib
import io
import itertools
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.rotation import angles_of, quaternion_of
from chute_ros.tools.judge_log import told
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError, MessageLog, reason
from chute_ros.tools.judge_log.stamps import steady

FORMAT = "PX4 ULog"
MAGIC = b"ULog\x01\x12\x35"

_US = 1e-6
#: What is lost in less is nothing, s.
_GAP = 0.05
#: vehicle_status.arming_state.
_ARMED = 2
#: Among so many stamps of a topic a damaged one is seen.
_OFTEN = 5
_TOPICS = [
    *("vehicle_attitude", "vehicle_attitude_setpoint", "vehicle_local_position"),
    *("vehicle_local_position_setpoint", "vehicle_global_position", "home_position"),
    *("vehicle_air_data", "sensor_baro", "sensor_combined", "sensor_accel", "battery_status"),
    *("vehicle_status", "vehicle_land_detected"),
]
Row = tuple[float, dict[str, float]]


def read(path: Path) -> FlightLog:
    """The log of this file; LogError if it is none."""
    try:
        from pyulog import ULog
    except ImportError:
        raise LogError(
            f"{path}: a log of PX4 needs the package pyulog: python3 -m pip install pyulog"
        ) from None
    noise = io.StringIO()
    try:
        # It prints what it makes of damage.
        with contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
            ulog = ULog(str(path), _TOPICS)
            log = _UlogTranslator(ulog).log(path)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001 - whatever a damaged file makes of its reader
        raise LogError(f"{path}: no log of PX4: {reason(error)}") from None
    if not log.messages:
        raise LogError(f"{path}: no log of PX4: nothing of a vehicle is in it")
    if ulog.file_corruption or noise.getvalue():
        log.remarks.append("it is damaged: what could be read is judged")
    lost = sum(one.duration for one in ulog.dropouts) / 1000.0
    if lost >= _GAP:
        log.remarks.append(f"the log has gaps of {lost:.1f} s in all")
    return log


class _UlogTranslator:
    """Makes of the topics what PX4 sends."""

    def __init__(self, ulog: Any) -> None:
        self._ulog, self._out = ulog, MessageLog()
        self._remarks: list[str] = []
        self._parameters = {name: _plain(v) for name, v in ulog.initial_parameters.items()}

    def log(self, path: Path) -> FlightLog:
        """All of it."""
        self._attitudes()
        self._positions()
        self._pressures()
        self._accelerations()
        self._batteries()
        vehicle_type = self._states()
        messages = list(steady(self._out.in_order(), self._remarks))
        return FlightLog(
            path,
            FORMAT,
            vehicle_type,
            dialect.MAV_AUTOPILOT_PX4,
            messages,
            self._parameters,
            remarks=self._remarks,
        )

    def _rows(self, topic: str, which: int = 0) -> Iterator[Row]:
        """(s, values by name) of an instance of a topic; none where it was not logged."""
        for data in self._ulog.data_list:
            if data.name == topic and data.multi_id == which:
                names = [name for name in data.data if name != "timestamp"]
                columns = [data.data[name].tolist() for name in names]
                times = self._times(data.data["timestamp"].tolist())
                for time, *values in zip(times, *columns, strict=True):
                    yield time, dict(zip(names, values, strict=True))

    def _times(self, stamps: list[int]) -> list[float]:
        """s. Nobody sets this clock, and a topic may rest for as long as nothing changes."""
        times = [(stamp * _US, None) for stamp in stamps]
        if len(times) >= _OFTEN:
            times = list(steady(times, self._remarks, math.inf))
        return [at for at, _ in times]

    def _attitudes(self) -> None:
        for at, row in self._rows("vehicle_attitude"):
            turned = [row[f"q[{k}]"] for k in range(4)]
            if all(map(math.isfinite, turned)):
                self._out.add(at, told.attitude(*angles_of(*turned)))
        for at, row in self._rows("vehicle_attitude_setpoint"):
            if "q_d[0]" in row and row.get("q_d_valid", 1):
                turned = [row[f"q_d[{k}]"] for k in range(4)]
            else:
                names = ("roll_body", "pitch_body", "yaw_body")
                angles = [row.get(name, math.nan) for name in names]
                if not all(map(math.isfinite, angles)):
                    continue
                turned = list(quaternion_of(*angles))
            thrust = row.get("thrust", -row.get("thrust_body[2]", math.nan))
            if all(map(math.isfinite, turned)):
                self._out.add(at, told.attitude_target(turned, thrust))

    def _positions(self) -> None:
        global_rows = list(self._rows("vehicle_global_position"))
        homes = list(self._rows("home_position"))
        home = homes[0][1] if homes else {}
        for at, row in homes:
            if not row.get("valid_alt", True):
                continue
            self._out.add_change(
                at, told.home(row["alt"], row["lat"], row["lon"], row.get("z", 0.0))
            )
        times = [at for at, _ in global_rows]
        home_times = [at for at, _ in homes]
        for at, row in self._rows("vehicle_local_position"):
            speed = -row["vz"]
            self._out.add(at, told.local_position(-row["z"], speed))
            number = bisect.bisect_right(times, at) - 1
            # Without a global position PX4 sends what it has.
            where = global_rows[number][1] if number >= 0 else {}
            altitude = where.get("alt", math.nan)
            newest = bisect.bisect_right(home_times, at) - 1
            height = _height(row, altitude, homes[newest][1] if newest >= 0 else home)
            known = (where.get("lat", math.nan), where.get("lon", math.nan))
            self._out.add(at, told.position(height, speed, altitude, *known))
        for at, row in self._rows("vehicle_local_position_setpoint"):
            names = ("z", "vz")
            z, vz = (row.get(name, math.nan) for name in names)
            self._out.add(at, told.position_target(-z, -vz))

    def _pressures(self) -> None:
        told_already = False
        for at, row in self._rows("vehicle_air_data"):
            if "baro_pressure_pa" in row:
                told_already = True
                self._out.add(at, told.pressure(row["baro_pressure_pa"]))
        if told_already:
            return
        for at, row in self._rows("sensor_baro"):
            # Hectopascal until 1.13.
            value = row.get("pressure", math.nan)
            self._out.add(at, told.pressure(value * 100.0 if value < 2000.0 else value))

    def _accelerations(self) -> None:
        for at, row in self._rows("sensor_combined"):
            parts = (row[f"accelerometer_m_s2[{k}]"] for k in range(3))
            self._out.add(at, told.acceleration(0, *parts), 0)
        for which in (1, 2):
            for at, row in self._rows("sensor_accel", which):
                self._out.add(at, told.acceleration(which, row["x"], row["y"], row["z"]), which)

    def _batteries(self) -> None:
        for at, row in self._rows("battery_status"):
            voltage = row.get("voltage_v", row.get("voltage_filtered_v", math.nan))
            self._out.add(at, told.battery(voltage, row.get("remaining", math.nan)))

    def _states(self) -> int:
        told_type = self._parameters.get("MAV_TYPE", math.nan)
        vehicle_type = int(told_type) if 0 <= told_type <= 255 else dialect.MAV_TYPE_QUADROTOR
        arming, flying = [], []
        for at, row in self._rows("vehicle_status"):
            vehicle_type = int(row.get("system_type", vehicle_type)) or vehicle_type
            arming.append((at, row["arming_state"] == _ARMED))
        for at, row in self._rows("vehicle_land_detected"):
            flying.append((at, not row["landed"]))
        for at, armed in _changes(arming, self._out.seconds()):
            beat = told.heartbeat(vehicle_type, dialect.MAV_AUTOPILOT_PX4, armed)
            self._out.add_change(at, beat)
        for at, in_air in _changes(flying, self._out.seconds()):
            self._out.add_change(at, told.landed(in_air))
        return vehicle_type


def _height(row: Mapping[str, float], altitude: float, home: Mapping[str, float]) -> float:
    """Above home, if it is valid; otherwise above the origin. row: of the local position."""
    if "valid_alt" in home:
        return home["z"] - row["z"] if home["valid_alt"] else -row["z"]
    # Older logs do not tell whether it is valid.
    return altitude - home["alt"] if home and math.isfinite(altitude) else -row["z"]


def _changes(told_of: list[tuple[float, bool]], moments: list[float]) -> list[tuple[float, bool]]:
    """A truth as it changed, and at each of these moments."""
    if not told_of:
        return []
    changed = [told_of[0]]
    changed += [new for old, new in itertools.pairwise(told_of) if old[1] != new[1]]
    times = [at for at, _ in changed]
    found = list(changed)
    for at in moments:
        # What is told no more is not known any more.
        if at <= told_of[-1][0]:
            found.append((at, changed[max(0, bisect.bisect_right(times, at) - 1)][1]))
    return sorted(found, key=lambda one: one[0])


def _plain(value: Any) -> float:
    return value if isinstance(value, (int, float)) else float(value)
