"""A flight computer that is wrong in one thing: for each clause of the conformance kit one way."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import replace

from chute_ros.links.umbilical.protocol.commands import KINDS
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.simulator.commands import HEARTBEAT
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import ComputerMode, FlightComputerSettings

#: Confused by some bytes, it takes no command for so long, s.
_DEAF = 4.7
#: A field is wrong in each so-manieth line: all commands can still be seen to work.
_EACH = 5
#: So long after the first <H>, or after the last command where <H> comes, no telemetry comes, s.
_PAUSES, _TIRES = (1.0, 5.5), (12.0, 16.5)
#: Its telemetry goes on so long after a dump, s.
_RESTS = 6.0
#: Two <H> that come faster than this are too many for it, s.
_FAST = 0.3
#: Its own limit for heartbeats, s.
_IMPATIENT = 4.0


class BrokenFlightComputer(FlightComputer):
    """breaks: a name of BREAKS."""

    def __init__(
        self,
        settings: FlightComputerSettings,
        layout: Layout,
        script: list[tuple[float, str]],
        breaks: str,
    ) -> None:
        if breaks in ("heartbeat-timeout", "unconnected"):
            says = breaks == "heartbeat-timeout"
            settings = replace(settings, debug=says, heartbeat_timeout=_IMPATIENT)
        super().__init__(settings, layout, script)
        self._breaks = breaks
        self._deaf_until = self._dumped_at = self._spoken_to_at = -math.inf
        self._lines, self._last_line = 0, ""
        if breaks == "reset-fram":
            self.memory.snapshot("of a flight before")

    # -- what comes -------------------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        if now < self._deaf_until:
            return
        if self._breaks in _CONFUSES and _CONFUSES[self._breaks](data):
            self._deaf_until = now + _DEAF
        if self._breaks in _MISREADS:
            _MISREADS[self._breaks](self, data)
        before = self.heartbeats[-1] if self.heartbeats else -math.inf
        if data != HEARTBEAT.encode():
            self._spoken_to_at = now
        elif self._breaks == "heartbeat" and now - before < _FAST:
            self.reboot()
        super().receive(_TAKEN_FOR.get((self._breaks, data), data), now, stream)

    def _command(self, token: str) -> None:
        if _LEFT_OUT.get(self._breaks) == token:
            return
        mav, target = self.flight.flags["mav_open"], self.flight.target
        super()._command(token)
        if self._breaks == "safe" and token == "<V>":
            self.flight.flags["mav_open"] = mav
        elif self._breaks == "target" and self.flight.target is not target:
            self.flight.target = self.flight.target[::-1]
        elif (
            self._breaks == "launch-disarmed"
            and token == "<L>"
            and self.mode is ComputerMode.Startup
        ):
            self.flight.jump(ComputerMode.Ascent)

    def aim(self, *target: float) -> None:
        """It has this target, whatever it was told."""
        self.flight.target = target

    # -- what is sent -----------------------------------------------------------------------------

    def _telemetry(self) -> None:
        if self.memory.is_dumping:
            self._dumped_at = self.now
            if self._breaks == "dump-interrupts":
                self.queue.put_line(self._last_line, self.now)
        if not self._is_paused():
            super()._telemetry()

    def _is_paused(self) -> bool:
        if not self.heartbeats:
            return False
        first, last = self.heartbeats[0], self.heartbeats[-1]
        idle = self.now - max(first, self._spoken_to_at)
        return {
            "continuous": _PAUSES[0] <= self.now - first < _PAUSES[1],
            "soak": _TIRES[0] <= idle < _TIRES[1] and self.now - last < 2.0,
            "unconnected": not self.connected,
            "dump-resumes": self.now - self._dumped_at < _RESTS,
        }.get(self._breaks, False)

    def _print_line(self, text: str) -> None:
        if text.startswith("$TELEM,"):
            self._lines += 1
            if self._breaks in _LINES:
                text = _LINES[self._breaks](self, text)
            self._last_line = text
        super()._print_line(text)

    def changed(self, name: str, change: Callable[[str], str], each: int, text: str) -> str:
        """A line of telemetry with another text in this field, in each so-manieth line."""
        if self._lines % each:
            return text
        mark, *texts = text.split(",")
        place = self.layout.index[name]
        texts[place] = change(texts[place])
        return ",".join([mark, *texts])

    def longer(self, text: str) -> str:
        """A line of telemetry; each so-manieth has a field more."""
        return text if self._lines % _EACH else f"{text},0"

    def bytes_besides(self, text: str) -> str:
        """The line of telemetry; its binary packet comes before it at first."""
        if self.heartbeats and self.now - self.heartbeats[0] < _PAUSES[1]:
            super()._print_line("\x01\x02\xfe\xff")
        return text


def simulated_computer(
    settings: FlightComputerSettings,
    layout: Layout,
    script: list[tuple[float, str]],
    breaks: str,
) -> FlightComputer:
    """A simulated flight computer. breaks: a name of BREAKS; empty: it is sound."""
    if breaks:
        return BrokenFlightComputer(settings, layout, script, breaks)
    return FlightComputer(settings, layout, script)


Line = Callable[[BrokenFlightComputer, str], str]


def _says(name: str, wrong: str, each: int = _EACH) -> Line:
    return lambda device, text: device.changed(name, lambda _: wrong, each, text)


def _number(name: str, change: Callable[[float], float], each: int = 1) -> Line:
    def other(text: str) -> str:
        return f"{change(float(text)):.4f}".rstrip("0").rstrip(".")

    return lambda device, text: device.changed(name, other, each, text)


#: What becomes of a line of telemetry.
_LINES: dict[str, Line] = {
    "line-end": lambda device, text: f"{text}\r",
    "text": lambda device, text: device.bytes_besides(text),
    "field-count": lambda device, text: device.longer(text),
    "flight-mode": _says("flight_mode", "-1"),
    "pressure": _number("pressure", lambda pascal: pascal / 100.0),
    "temperature": _number("temp", lambda celsius: celsius + 273.15),
    "altitude": _says("altitude", "1e3"),
    "position": _says("latitude", "95.5"),
    "satellites": _says("num_satellites", "12.0"),
    "timestamp": _number("timestamp", lambda seconds: max(0.0, seconds - 10.0), _EACH),
    "magnetometer": _says("mag_y", ""),
    "accelerometer": _number("accel_z", lambda force: force / 9.80665),
    "gyroscope": _says("gyro_z", "nan"),
    "converters": _says("pt4", " 1790.5"),
    "valve-flags": _says("sv_open", "true"),
    "canopy-flags": _says("ssa_main_deployed", "-1"),
    "payload-flags": _says("cmd_a2", "300"),
    "airbrake": _says("airbrake_state", "3"),
    "apogee": _says("predicted_apogee", "--"),
    "gps-accuracy": _says("v_acc", "-5"),
    "velocity": _says("vel_d", "0x1"),
    "ground-speed": _says("s_acc", "0.3"),
    "fix": _says("fix_type", "9"),
    "blims-fields": _says("blims_phase_id", "200"),
    "wind": _says("blims_wind_from_deg", "south"),
    "boot-time": _number("ms_since_boot_cfc", lambda milliseconds: milliseconds // 1000),
}
#: Bytes that it takes for other bytes.
_TAKEN_FOR = {
    ("unknown", b"<Q>"): b"<R>",
    ("brackets", b"(T,-56.5000000,78.6500000)"): b"<T,-56.5000000,78.6500000>",
    ("nearly-arms", b"<ka>"): b"<KA>",
    ("nearly-fires", b"<v>"): b"<S>",
}
#: Bytes after which it is deaf.
_CONFUSES: dict[str, Callable[[bytes], bool]] = {
    "half": lambda data: data.startswith(b"<T,") and data.count(b",") == 2 and b">" not in data,
    "noise": lambda data: not data.isascii(),
    "long-token": lambda data: data.startswith(b"<QQQ"),
}


def _takes_half(device: BrokenFlightComputer, data: bytes) -> None:
    if data.startswith(b"<T,") and data.count(b",") == 1 and b">" not in data:
        device.aim(float(data[3:]), 0.0)


def _mixes(device: BrokenFlightComputer, data: bytes) -> None:
    if data.count(b"<T,") == 2:
        device.aim(12.5, 13.5)


def _takes_any(device: BrokenFlightComputer, data: bytes) -> None:
    if data.startswith(b"<T,95.5"):
        device.aim(95.5, 70.5)


def _takes_one(device: BrokenFlightComputer, data: bytes) -> None:
    if data == b"<T,50.5>":
        device.aim(50.5, 0.0)


#: What it reads into bytes that it does not take.
_MISREADS: dict[str, Callable[[BrokenFlightComputer, bytes], None]] = {
    "split": _takes_half,
    "joined": _mixes,
    "target-range": _takes_any,
    "target-form": _takes_one,
}


def _token(name: str) -> str:
    return KINDS[name].command.token.decode()


#: Commands of which nothing comes.
_LEFT_OUT = {
    **{
        name.replace("_", "-"): _token(name)
        for name in (
            *("flash_info", "dump_fram", "dump_flash", "reboot", "reset_fram", "wipe_flash"),
            *("key_arm", "key_disarm", "open_mav", "close_mav", "open_sv", "close_sv"),
            *(f"payload_{one}" for one in ("n1", "n2", "n3", "n4", "a1", "a2", "a3")),
            *("drogue", "main", "launch"),
        )
    },
    "wipe-reboot": _token("wipe_fram_and_reboot"),
}
#: Clauses that a device can break.
BREAKS = (
    *_LINES,
    *_CONFUSES,
    *_MISREADS,
    *(name for name, _ in _TAKEN_FOR),
    *_LEFT_OUT,
    *("continuous", "heartbeat", "heartbeat-timeout", "unconnected", "dump-interrupts"),
    *("dump-resumes", "soak", "target", "safe", "launch-disarmed"),
)
