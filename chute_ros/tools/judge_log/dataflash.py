"""ArduPilot's own logs, binary (.bin) and text (.log), as ArduPilot would have told them.

Source: ArduPilot's log messages (ATT, POS, XKF1, BARO, IMU, CTUN, TECS, BAT, MODE, EV, ARM, STAT,
ORGN, PARM), read by pymavlink's DFReader.
"""

from __future__ import annotations

import bisect
import contextlib
import math
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from chute_ros.model import VTOL
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.rotation import quaternion_of
from chute_ros.tools.judge_log import told
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError, MessageLog, reason
from chute_ros.tools.judge_log.stamps import steady
from chute_ros.transport.regular_file import open_regular

FORMAT = "ArduPilot DataFlash"
#: The first bytes of a binary log.
MAGIC = b"\xa3\x95"

#: EV.Id: armed, disarmed; landed, and not.
_ARMED, _DISARMED, _LANDED, _NOT_LANDED = 10, 11, 18, 28
#: What tells the vertical speed, the best first: what the height controller flew by is what was
#: sent; of the estimators one may have run beside it. Message, field, factor to m/s up (of a
#: CTUN as a whole number: cm/s).
_SPEEDS = (
    ("CTUN", "CRt", 0.01),
    ("CTUN", "CRate", 0.01),
    ("XKF1", "VD", -1.0),
    ("NKF1", "VD", -1.0),
    ("EKF1", "VD", -1.0),
    ("GPS", "VZ", -1.0),
)
_IMUS = {"IMU": 0, "IMU2": 1, "IMU3": 2}
_READ = frozenset(
    {
        *("ATT", "POS", "AHR2", "GPS", "BARO", "CTUN", "TECS", "BAT", "CURR", "MODE", "EV", "ARM"),
        *("STAT", "ORGN", "PARM", "MSG", "VER", "XKF1", "NKF1", "EKF1", *_IMUS),
    }
)
#: A text begins to tell what is in it within so many bytes.
_HEAD = 4096
#: Logs in flash memory end with so many bytes of filling at most.
_PAGE = 528
_STDERR = 2
#: What pymavlink makes of a log without any clock.
_TIMELESS = "unsupported operand type(s) for *: 'int' and 'NoneType'"
#: How the firmwares name themselves.
_NAMES = {
    "Copter": dialect.MAV_TYPE_QUADROTOR,
    "Plane": dialect.MAV_TYPE_FIXED_WING,
    "Rover": dialect.MAV_TYPE_GROUND_ROVER,
    "Sub V": dialect.MAV_TYPE_SUBMARINE,
}


def read(path: Path) -> FlightLog:
    """The log of this file; LogError if it is none."""
    try:
        with _silence():
            log = _read(path)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001 - whatever a damaged file makes of its reader
        why = (
            "its entries have no time, as before 3.1" if _TIMELESS in str(error) else reason(error)
        )
        raise LogError(f"{path}: no log of ArduPilot that can be read: {why}") from None
    if not log.messages:
        raise LogError(f"{path}: no log of ArduPilot: nothing of a vehicle is in it")
    return log


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """pymavlink writes of each damaged byte, its compiled part past sys.stderr."""
    sys.stderr.flush()
    stderr = os.dup(_STDERR)
    try:
        with (
            open(os.devnull, "w") as nothing,
            contextlib.redirect_stdout(nothing),
            contextlib.redirect_stderr(nothing),
        ):
            os.dup2(nothing.fileno(), _STDERR)
            yield
    finally:
        os.dup2(stderr, _STDERR)
        os.close(stderr)


def _read(path: Path) -> FlightLog:
    # Here: it brings another dialect along, for which no other log has to wait.
    from pymavlink import DFReader

    with open_regular(path) as file:
        head = file.read(_HEAD)
    # The first bytes may be damaged, and a text has lines of the console before its first entry.
    if head.startswith(MAGIC) or b"FMT," not in head:
        return _told(path, DFReader.DFReader_binary(str(path)), "")
    # Text logs until 3.1 have lines of the console before the first entry.
    with open_regular(path) as file:
        text = file.read().decode("ascii", errors="replace")
    begin = max(0, text.find("FMT,"))
    if not begin:
        return _told(path, DFReader.DFReader_text(str(path)), "")
    with tempfile.NamedTemporaryFile("w", suffix=".log") as cleaned:
        cleaned.write(text[begin:])
        cleaned.flush()
        return _told(path, DFReader.DFReader_text(cleaned.name), text[:begin])


def _told(path: Path, reader: Any, console: str) -> FlightLog:
    translator = _DataflashTranslator()
    translator.said(console)
    # It closes nothing itself.
    with reader.filehandle, reader.data_map:
        remarks: list[str] = []
        entries = _Entries(reader)
        for at, entry in steady(entries.stamped(translator), remarks):
            translator.take(entry, at)
        if damaged := entries.damaged:
            remarks.append(f"{damaged} damaged bytes were passed over")
    return translator.log(path, remarks)


class _Entries:
    """What pymavlink makes of a file."""

    def __init__(self, reader: Any) -> None:
        self._reader = reader
        self._read = self._end = 0
        # Logs before 3.1 have no times: it counts the entries of each kind, which part by seconds.
        self._counts = "interpolated" in type(reader.clock).__name__

    def stamped(self, translator: _DataflashTranslator) -> Iterator[tuple[float, Any]]:
        """Each entry of a moment with its own time (s); parameters, which have none, are told."""
        newest = -math.inf
        while (entry := self._reader.recv_msg()) is not None:
            self._read += entry.fmt.len
            self._end = self._reader.offset
            if entry.get_type() == "PARM":
                translator.parameter(entry)
            elif entry.get_type() in _READ:
                newest = max(newest, entry._timestamp) if self._counts else entry._timestamp
                yield newest, entry

    @property
    def damaged(self) -> int:
        """Bytes of a binary log that were no entry; what fills the last page is no damage."""
        if not hasattr(self._reader, "HEAD1"):
            return 0
        size: int = self._reader.data_len
        behind = size - self._end
        return size - self._read - (behind if behind < _PAGE else 0)


class _DataflashTranslator:
    """Makes of each entry what ArduPilot sends."""

    def __init__(self) -> None:
        self._out = MessageLog()
        self._parameters: dict[str, float] = {}
        self._at = -math.inf
        self._newest: dict[str, Any] = {}
        #: (s, armed), (s, in the air), (s, mode), as far as they were told.
        self._arming: list[tuple[float, bool]] = []
        self._flying: list[tuple[float, bool]] = []
        self._modes: list[tuple[float, int]] = []
        self._vehicle_type = dialect.MAV_TYPE_QUADROTOR
        self._speed_of = len(_SPEEDS)
        self._speed = math.nan
        self._home_altitude = math.nan
        #: Positions by the height controller, and by the second estimator.
        self._by_controller: list[tuple[float, Any]] = []
        self._by_ahr2: list[tuple[float, Any]] = []
        self._makers = {
            "ATT": self._att,
            "POS": self._pos,
            "AHR2": self._ahr2,
            "CTUN": self._ctun,
            "BARO": self._baro,
            "BAT": self._bat,
            "CURR": self._bat,
            "MODE": self._mode,
            "EV": self._event,
            "ARM": self._arm,
            "STAT": self._stat,
            "ORGN": self._origin,
            "MSG": self._msg,
        } | dict.fromkeys(_IMUS, self._imu)

    def take(self, entry: Any, at: float) -> None:
        """One entry of the log (s), none sooner than those before."""
        kind = entry.get_type()
        self._at = at
        self._newest[kind] = entry
        for number, (message, name, factor) in enumerate(_SPEEDS[: self._speed_of + 1]):
            if kind == message and hasattr(entry, name) and _instance(entry) == 0:
                value = getattr(entry, name)
                whole = 1.0 if kind == "CTUN" and isinstance(value, float) else factor
                self._speed_of, self._speed = number, whole * value
        maker = self._makers.get(kind)
        if maker is not None:
            maker(entry)

    def said(self, text: str) -> None:
        """What it told on its console, or to the ground: its own name among it."""
        for name, vehicle_type in _NAMES.items():
            if name in text:
                self._vehicle_type = vehicle_type

    def log(self, path: Path, remarks: list[str]) -> FlightLog:
        """All of it. remarks: on how it was read."""
        vehicle_type = self._vehicle_type
        if self._parameters.get("Q_ENABLE", 0) > 0:
            vehicle_type = VTOL
        if "POS" not in self._newest:
            for at, message in self._by_controller or self._by_ahr2:
                self._out.add(at, message)
        if not self._arming:
            remarks.append("nothing reports when it was armed: taken to be armed throughout")
        self._heartbeats(vehicle_type)
        self._landed_states()
        return FlightLog(
            path,
            FORMAT,
            vehicle_type,
            dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
            self._out.in_order(),
            self._parameters,
            remarks=remarks,
        )

    # -- one entry -------------------------------------------------------------------------------

    def _att(self, entry: Any) -> None:
        angles = [math.radians(getattr(entry, name)) for name in ("Roll", "Pitch", "Yaw")]
        self._out.add(self._at, told.attitude(*angles))
        roll, pitch = (math.radians(getattr(entry, n, math.nan)) for n in ("DesRoll", "DesPitch"))
        if not (math.isfinite(roll) and math.isfinite(pitch)):
            return
        tecs = self._newest.get("TECS")
        if tecs is not None:
            # An aeroplane: its height controller's energy tells of the height as well.
            wish, height = (getattr(tecs, name, math.nan) for name in ("hdem", "h"))
            self._out.add(self._at, told.wing_target(roll, pitch, _known(wish - height)))
            return
        thrust = self._thrust()
        yaw = math.radians(getattr(entry, "DesYaw", math.degrees(angles[2])))
        if not math.isfinite(yaw):
            return
        turned = quaternion_of(roll, pitch, yaw)
        self._out.add(self._at, told.attitude_target(turned, thrust))

    def _thrust(self) -> float:
        entry = self._newest.get("CTUN")
        for name in ("ThO", "ThrOut"):
            if entry is not None and hasattr(entry, name):
                value = float(getattr(entry, name))
                # Thousandths until 3.3.
                return value / 1000.0 if value > 1.5 else value
        return math.nan

    def _pos(self, entry: Any) -> None:
        height = getattr(entry, "RelHomeAlt", math.nan)
        if not math.isfinite(height):
            height = entry.Alt - self._home(entry.Alt)
        self._out.add(
            self._at,
            told.position(height, _known(self._speed), entry.Alt, entry.Lat, entry.Lng),
        )

    def _ahr2(self, entry: Any) -> None:
        # The second estimator's: where the first one's is not in the log.
        if hasattr(entry, "Alt") and math.isfinite(self._speed):
            height = entry.Alt - self._home(entry.Alt)
            where = (entry.Alt, entry.Lat, entry.Lng)
            self._by_ahr2.append((self._at, told.position(height, self._speed, *where)))

    def _ctun(self, entry: Any) -> None:
        # Logs older than POS: the height of the controller, which a barometer led.
        names = ("Alt", "BAlt", "BarAlt")
        height = next((getattr(entry, n) for n in names if hasattr(entry, n)), math.nan)
        if math.isfinite(height) and math.isfinite(self._speed):
            where = self._newest.get("GPS")
            place = (where.Alt, where.Lat, where.Lng) if where else (math.nan,) * 3
            self._by_controller.append((self._at, told.position(height, self._speed, *place)))

    def _home(self, altitude: float) -> float:
        if math.isnan(self._home_altitude):
            self._home_altitude = altitude
        return self._home_altitude

    def _baro(self, entry: Any) -> None:
        if _instance(entry) == 0:
            self._out.add(self._at, told.pressure(entry.Press))

    def _imu(self, entry: Any) -> None:
        which = _IMUS[entry.get_type()] or _instance(entry)
        if which < len(_IMUS):
            self._out.add(
                self._at, told.acceleration(which, entry.AccX, entry.AccY, entry.AccZ), which
            )

    def _bat(self, entry: Any) -> None:
        if _instance(entry):
            return
        # Hundredths of a volt until 3.3.
        voltage = entry.Volt / 100.0 if entry.Volt > 100.0 else entry.Volt
        share = getattr(entry, "RemPct", math.nan)
        self._out.add(self._at, told.battery(voltage, share / 100.0))

    def _mode(self, entry: Any) -> None:
        number = getattr(entry, "ModeNum", getattr(entry, "Mode", 0))
        if isinstance(number, int):
            self._modes.append((self._at, number))

    def _event(self, entry: Any) -> None:
        if entry.Id in (_ARMED, _DISARMED):
            self._arming.append((self._at, entry.Id == _ARMED))
        elif entry.Id in (_LANDED, _NOT_LANDED):
            self._flying.append((self._at, entry.Id == _NOT_LANDED))

    def _arm(self, entry: Any) -> None:
        self._arming.append((self._at, bool(entry.ArmState)))

    def _stat(self, entry: Any) -> None:
        for name, changes in (("Armed", self._arming), ("isFlying", self._flying)):
            value = getattr(entry, name, None)
            if value is not None and (not changes or changes[-1][1] != bool(value)):
                changes.append((self._at, bool(value)))

    def _origin(self, entry: Any) -> None:
        if entry.Type == 1:  # home
            self._home_altitude = entry.Alt
            self._out.add_change(self._at, told.home(entry.Alt, entry.Lat, entry.Lng, 0.0))

    def _msg(self, entry: Any) -> None:
        self.said(str(entry.Message))

    def parameter(self, entry: Any) -> None:
        """One of the autopilot's."""
        value = float(entry.Value)
        if not told.can_be_single(value):
            return
        self._parameters[entry.Name] = int(value) if value.is_integer() else value

    # -- what was told as it changed -------------------------------------------------------------

    def _heartbeats(self, vehicle_type: int) -> None:
        changes = {at for at, _ in (*self._arming, *self._modes)}
        for at in sorted({*self._out.seconds(), *changes}):
            armed = _value(self._arming, at, True)
            mode = _value(self._modes, at, 0, before_is_first=True)
            beat = told.heartbeat(
                vehicle_type, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, bool(armed), int(mode)
            )
            self._out.add_change(at, beat)

    def _landed_states(self) -> None:
        if self._flying:
            for at in sorted({*self._out.seconds(), *(at for at, _ in self._flying)}):
                self._out.add_change(at, told.landed(bool(_value(self._flying, at, False))))


def _value(
    changes: list[tuple[float, Any]], at: float, alone: Any, before_is_first: bool = False
) -> Any:
    """What it was then; before the first change to a truth it was the opposite."""
    if not changes:
        return alone
    known = bisect.bisect_right(changes, at, key=lambda one: one[0])
    if known:
        return changes[known - 1][1]
    return changes[0][1] if before_is_first else not changes[0][1]


def _instance(entry: Any) -> int:
    for name in ("I", "Instance", "Inst", "C"):
        if hasattr(entry, name):
            return int(getattr(entry, name))
    return 0


def _known(value: float) -> float:
    return value if math.isfinite(value) else 0.0
