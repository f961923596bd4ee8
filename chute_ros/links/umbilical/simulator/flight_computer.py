"""A simulated rocket's flight computer on a serial umbilical: telemetry out, tokens in.

Pure like the protocols: it is run by the same loop and knows neither a pty nor the clock.
Source: Umbilical Reference; timing and lines beside the telemetry are as measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.simulator.commands import NAMES, CommandReceiver
from chute_ros.links.umbilical.simulator.flight import FlightProgram
from chute_ros.links.umbilical.simulator.memory import Memory
from chute_ros.links.umbilical.simulator.output import OutboundQueue
from chute_ros.links.umbilical.simulator.settings import ComputerMode, FlightComputerSettings
from chute_ros.links.umbilical.simulator.telemetry import (
    sensor_values,
    target_values,
    telem_body,
    telem_line,
)
from chute_ros.sim.acting import Actor, Script, one_of

#: The flight loop takes the queued commands this often, s.
LOOP = 0.05
#: A snapshot goes to the FRAM this often, in turns of the loop.
_SNAPSHOT = 20
_RECORDED = (
    ComputerMode.Ascent,
    ComputerMode.Coast,
    ComputerMode.DrogueDeployed,
    ComputerMode.MainDeployed,
)


class FlightComputer(Actor):
    """One device. script: (s after the start, action). now: s, as the loop tells it."""

    def __init__(
        self,
        settings: FlightComputerSettings,
        layout: Layout,
        script: list[tuple[float, str]] | None = None,
    ) -> None:
        super().__init__()
        self.settings, self.layout = settings, layout
        self.now = 0.0
        self.booted_at = math.nan
        #: It hears nothing, but goes on with telemetry.
        self.deaf = False
        #: It sends nothing at all.
        self.silent = False
        #: Heartbeats come.
        self.connected = False
        #: Fields that show this in place of what they should, by name.
        self.overrides: dict[str, float] = {}
        self.receiver = CommandReceiver(layout.target_floats, self.say)
        self.queue = OutboundQueue(
            settings.packet_rate, settings.cut, settings.garbage, settings.seed
        )
        header = ",".join(field.name for field in layout.fields)
        self.memory = Memory(settings, header, self.queue)
        self.flight = FlightProgram(settings, layout.target_floats, self._log, self._print_line)
        self.memory.on_wiped = lambda: setattr(self.flight, "may_arm", True)
        self.actions = {
            "mute": lambda _: setattr(self, "deaf", True),
            "unmute": lambda _: setattr(self, "deaf", False),
            "silent": lambda _: setattr(self, "silent", True),
            "speak": lambda _: setattr(self, "silent", False),
            "stuck": lambda _: setattr(self.flight, "is_stuck", True),
            "free": lambda _: setattr(self.flight, "is_stuck", False),
            "launch": lambda _: self.flight.arm_and_launch(),
            "drogue-fails": lambda _: setattr(self.flight, "drogue_fails", True),
            "mend": lambda _: self._mend(),
            "fault": lambda _: self.flight.fail(),
            "reboot": lambda _: self.reboot(),
            "jump": lambda name: self.flight.jump(ComputerMode[name]),
            "land": lambda _: self.flight.rocket.land(),
            "wipe-fails": lambda _: setattr(self.memory, "wipe_outcome", "fails"),
            "wipe-hangs": lambda _: setattr(self.memory, "wipe_outcome", "hangs"),
            "lose-dump-end": lambda _: self.memory.disturb_dump("loses-end"),
            "dump-stalls": lambda _: self.memory.disturb_dump("stalls"),
        }
        self.arguments = {"jump": one_of(ComputerMode.__members__)}
        #: Those that are not for the flight program.
        self.commands_apart: dict[str, Callable[[], None]] = {
            "<R>": self.reboot,
            "<X>": self._wipe_fram_and_reboot,
            "<F>": self.memory.reset_snapshots,
            "<f>": lambda: self._print_line(self.memory.show_snapshot()),
            "<I>": lambda: self._print_line(self.memory.info()),
            "<G>": lambda: self.memory.begin_dump(self.now),
            "<W>": lambda: self.memory.begin_wipe(self.now),
        }
        self._script = Script(script or [])
        self._started_at = math.nan
        self._running_from = math.nan
        self._loop_at = math.nan
        self._telem_at = math.nan
        self._cycles = self._heartbeats_seen = 0
        self._output: list[bytes] = []

    # -- as the loop wants it -------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """One USB packet came."""
        self.update(now)
        if self.deaf:
            self.receiver.lose(data, "deaf")
        elif self.is_booting:
            self.receiver.lose(data, "booting")
        else:
            self.receiver.packet(data, now)

    def stream_ended(self, stream: Hashable) -> None:
        """A host that goes away is no event for the device: it has no such line."""

    def update(self, now: float) -> None:
        if math.isnan(self._started_at):
            self._start(now)
        for action in self._script.take_due(now):
            self.act(action)
        while self._loop_at <= now:
            self._advance(self._loop_at)
            self._loop()
            self._loop_at += LOOP
        self._advance(now)
        if now >= self._telem_at:
            self._telem_at = max(self._telem_at + 1.0 / self.settings.rate, now)
            self._telemetry()
        gone = self.queue.take(now)
        self._output += [] if self.silent else gone

    def next_deadline(self) -> float:
        if math.isnan(self._started_at):
            return 0.0
        return min(
            self._script.next_deadline(),
            self._loop_at,
            self._telem_at,
            self.receiver.next_deadline(),
            self.memory.next_deadline(),
            self.queue.next_deadline(),
        )

    def take_output(self) -> list[bytes]:
        """Chunks of up to 64 bytes."""
        output, self._output = self._output, []
        return output

    # -- for tests and for whoever watches ------------------------------------------------------

    @property
    def came(self) -> list[tuple[float, str]]:
        """Every command that was accepted: (time, token). Heartbeats are apart."""
        return self.receiver.came

    @property
    def heartbeats(self) -> list[float]:
        """When heartbeats came."""
        return self.receiver.heartbeats

    @property
    def mode(self) -> ComputerMode:
        """Of the flight."""
        return self.flight.mode

    @property
    def is_booting(self) -> bool:
        """It neither hears nor sends."""
        return self.now < self._running_from

    def reboot(self) -> None:
        """Start anew. What is out of the rocket, and what is in flash and FRAM, stays."""
        self.booted_at = self.now
        self._running_from = self.now + self.settings.boot_time
        self.deaf = self.silent = self.connected = False
        self._cycles = 0
        self.memory.stop()
        self.queue.clear()
        self.receiver.reset()
        self.flight.restart()
        self._telem_at = self._running_from
        self.say("started")

    def boot_ms(self) -> int:
        """Time since start, ms, as uint32."""
        return int((self.now - self.booted_at) * 1000.0) % 2**32

    # -- turns ----------------------------------------------------------------------------------

    def _start(self, now: float) -> None:
        """It was switched on before, so that it needs no time to boot."""
        self.now = self._started_at = self._loop_at = now
        self.reboot()
        self._running_from = self._telem_at = now

    def _advance(self, now: float) -> None:
        self.now = now
        self.receiver.update(now)
        self.memory.update(now)

    def _loop(self) -> None:
        """One turn of the flight loop."""
        before = self.mode
        if not self.is_booting:
            self.flight.turn_key()
            for token in self.receiver.take():
                self._command(token)
        if self._loop_at > self._started_at:
            self.flight.fly(LOOP * self.settings.speed, not self.is_booting)
        self._watch_heartbeats()
        self._cycles += 1
        if self.mode is not before:
            self.say(f"{before.name} -> {self.mode.name}")
        if self.mode is not ComputerMode.Startup and self._cycles % _SNAPSHOT == 0:
            self._snapshot()

    def _command(self, token: str) -> None:
        self.say(f"command {token}")
        self._log("WARN", f"UMBILICAL CMD: {NAMES.get(token, 'Set target')}")
        if token in self.commands_apart:
            self.commands_apart[token]()
        else:
            self.flight.command(token)

    def _mend(self) -> None:
        self.flight.mend()
        self.reboot()

    def _wipe_fram_and_reboot(self) -> None:
        self.memory.reset_snapshots()
        self.reboot()

    def _watch_heartbeats(self) -> None:
        last = self.heartbeats[-1] if self.heartbeats else -math.inf
        connected = last >= self.booted_at and self.now - last <= self.settings.heartbeat_timeout
        if connected is not self.connected:
            self.connected = connected
            text = f"umbilical {'connected' if connected else 'disconnected'}"
            self.say(text)
            self._log("INFO" if connected else "WARN", text.capitalize())
        seen, self._heartbeats_seen = self._heartbeats_seen, len(self.heartbeats)
        rises = self.mode in (ComputerMode.Ascent, ComputerMode.Coast)
        if self.settings.faults_on_heartbeat and rises and len(self.heartbeats) > seen:
            self.say("umbilical still connected in flight")
            self.flight.fail()

    def _snapshot(self) -> None:
        rocket, flags = self.flight.rocket, self.flight.flags
        self.memory.snapshot(
            f"mode={int(self.mode)} cyc={self._cycles} p={rocket.air.pressure:.1f} "
            f"arm={self.flight.armed_altitude:.2f} alt={rocket.altitude:.2f} "
            f"mav={flags['mav_open']} sv={flags['sv_open']}"
        )

    def _telemetry(self) -> None:
        if self.is_booting or self.memory.is_busy:
            return
        rocket = self.flight.rocket
        values = {
            **sensor_values(rocket, self.mode),
            **target_values(self.layout, self.flight.target, rocket.latitude, rocket.longitude),
            **self.flight.flags,
            "flight_mode": int(self.mode),
            "timestamp": (self.settings.time_of_day + self.now - self._started_at) % 86_400.0,
            "ms_since_boot_cfc": self.boot_ms(),
            **self.overrides,
        }
        body = telem_body(self.layout, values)
        if self.mode in _RECORDED and not rocket.on_ground:
            self.memory.record(body)
        self._print_line(telem_line(body))

    def _log(self, level: str, text: str) -> None:
        if self.settings.debug:
            self._print_line(f"[{level}] {text}")

    def _print_line(self, text: str) -> None:
        # In a dump no other line may stand.
        if not (self.is_booting or self.memory.is_dumping):
            self.queue.put_line(text, self.now)
