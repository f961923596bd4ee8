"""Orders of a person or the supervisor to the flight computer: through the gate, to the wire.

Every command goes through gate.rule here and nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol import commands, gate
from chute_ros.links.umbilical.protocol.canopies import CANOPIES
from chute_ros.links.umbilical.protocol.commands import CommandKind, Effect
from chute_ros.links.umbilical.protocol.config import DeployStage, UmbilicalConfig
from chute_ros.links.umbilical.protocol.decoder import TelemetryDecoder
from chute_ros.links.umbilical.protocol.flight_computer import FlightComputerTracker
from chute_ros.links.umbilical.protocol.gate import Situation
from chute_ros.links.umbilical.protocol.line_parser import FlashUsage
from chute_ros.links.umbilical.protocol.memory import MemoryWorks
from chute_ros.links.umbilical.protocol.scheduler import CommandScheduler
from chute_ros.protocol.events import EventLog, Severity
from chute_ros.protocol.goal import ConfirmedCommand
from chute_ros.protocol.requests import Requests

#: Not while the vehicle is being made safe.
_UNSAFE = ("launch", "open_mav", "open_sv")
#: Not while a launch is under way.
_DISTURBING = (
    "launch",
    "reboot",
    "reset_fram",
    "dump_fram",
    "dump_flash",
    "wipe_flash",
    "wipe_fram_and_reboot",
)
#: The receiver sleeps 0.1 s and the flight loop takes its turn, s.
_SETTLES = 0.3
_NOTHING_SHOWS = "telemetry cannot show its effect"


class Orders(EventLog):
    """Begins requests; each ends in one RequestFinished with its token."""

    def __init__(
        self,
        config: UmbilicalConfig,
        requests: Requests[CommandScheduler],
        computer: FlightComputerTracker,
        decoder: TelemetryDecoder,
        memory: MemoryWorks,
    ) -> None:
        super().__init__()
        self._config, self._requests, self._computer = config, requests, computer
        self._decoder, self._memory = decoder, memory
        self._block = ""
        self._key_disarmed = False
        self._flash_usage_at = -math.inf
        #: When a command was sent last, by its name.
        self._sent_at: dict[str, float] = {}
        #: What may still leave, for the first time or again: request -> (command, force).
        self._to_leave: dict[int, tuple[CommandKind, bool]] = {}

    # -- orders ----------------------------------------------------------------------------------

    def command(self, token: int, name: str, force: bool, now: float) -> None:
        """A command by its name in the reference. force: a person confirms, or insists."""
        if name == "set_target":
            self._requests.refuse(token, "set_target needs its values: call ~/set_target")
            return
        kind = commands.KINDS.get(name)
        if kind is None:
            known = ", ".join(commands.KINDS)
            self._requests.refuse(token, f"there is no command {name!r}: need one of {known}")
            return
        # What fires is not fired twice by mistake; a valve's telemetry may be old.
        even_if_shown = force or name not in ("drogue", "main")
        self._order(token, kind, force, even_if_shown, now)

    def deploy(self, token: int, force: bool, again: bool, repeated: bool, now: float) -> None:
        """Fire the stage of the configuration. again: though telemetry reports that it is out;
        repeated: the same deploy as the one before, which no telemetry has confirmed."""
        stage = self._config.deploy
        if stage is DeployStage.NEXT:
            # The same deploy may be ordered once more, as by a supervisor that took over, or one
            # that tries again what some firmware never shows: the main has its time.
            hidden = repeated and not self._computer.surely_out("drogue")
            same = hidden or self._requests.under_way("drogue")
            over = self._computer.was_fired("drogue", now) and not same
            stage = DeployStage.MAIN if over else DeployStage.DROGUE
        self._order(token, commands.KINDS[stage.value], force, again, now)

    def set_target(self, token: int, values: tuple[float, ...], now: float) -> None:
        """Set the landing target."""
        layout = self._decoder.layout
        if layout is None:
            why = "the number of floats is not known before the first telemetry: set layout"
            self._requests.refuse(token, f"set_target refused: {why}; nothing was sent")
            return
        try:
            kind = commands.set_target(layout, values)
        except ParameterError as error:
            self._requests.refuse(token, f"set_target refused: {error}; nothing was sent")
            return
        self._order(token, kind, False, True, now)

    def refuse(self, token: int, why: str) -> None:
        """End a request before anything was sent."""
        self._requests.refuse(token, f"{why}; nothing was sent")

    def flight_block(self, reason: str, now: float) -> None:
        """Refuse to launch for reason, or no longer (empty)."""
        if reason != self._block:
            text = f"flight blocked: {reason}" if reason else "flight block released"
            self.notice(Severity.WARNING if reason else Severity.INFO, text)
        self._block = reason
        if reason:
            self._end(("launch",), f"flight is blocked: {reason}", now)

    def wire_closed(self, now: float) -> None:
        """The port is closed: what is not urgent does not wait for it to come back."""
        self._requests.commands.wire_closed()
        self._requests.abandon_where(
            lambda goal: goal.name not in commands.URGENT, "the cable was pulled", now
        )

    def token_sent(self, name: str, now: float) -> None:
        """A command has left: only what comes after that shows its effect."""
        self._sent_at[name] = now
        if name in CANOPIES:
            self._computer.fired(name, now)

    def token_not_written(self, name: str) -> None:
        """What seemed to have left has not: the port took no more. An order goes on trying."""
        self._sent_at.pop(name, None)
        if name in CANOPIES:
            self._computer.not_fired(name)
        text = f"{name} was not written: the port takes no more data; is anything at its end?"
        self.notice(Severity.ERROR, text)
        self._requests.fail_untold(
            [token for token, (kind, _) in self._to_leave.items() if kind.command.name == name],
            text,
        )

    # -- what the flight computer says -----------------------------------------------------------

    def flash_usage(self, said: FlashUsage, now: float) -> None:
        """The answer to flash_info."""
        self._flash_usage_at = now
        self._requests.effects_may_show(now)

    def arming_blocked(self, text: str, now: float) -> None:
        """It does not arm."""
        self._end(("key_arm",), f"the flight computer reports: {text}", now)

    def judge_again(self, now: float) -> None:
        """Telemetry or the clock moved on: what has yet to leave, or would leave again, must still
        be allowed."""
        situation = self._computer.situation(now)
        for token, (kind, force) in list(self._to_leave.items()):
            waits = self._waits(token, kind)
            if not waits and (kind.once or token not in self._requests):
                del self._to_leave[token]
                continue
            name = kind.command.name
            if situation is Situation.UNKNOWN and name in commands.URGENT:
                continue  # it was wanted when it was allowed, and may have to wait for the cable
            refusal = gate.rule(name, situation, force).refusal
            if refusal and not waits:
                refusal = f"not to be sent again (flight mode {situation.value})"
            if refusal and kind.lasting:
                self._memory.give_up(refusal)
            elif refusal:
                self._requests.abandon(token, refusal, now)

    # -- inside ----------------------------------------------------------------------------------

    def _order(
        self, token: int, kind: CommandKind, force: bool, even_if_shown: bool, now: float
    ) -> None:
        name = kind.command.name
        refusal = ""
        if not self._requests.commands.is_open and name not in commands.URGENT:
            refusal = f"{name} refused: the port is not open; nothing was sent"
        refusal = refusal or gate.rule(name, self._computer.situation(now), force).refusal
        refusal = refusal or self._standing_refusal(name, force)
        if refusal:
            self._requests.refuse(token, refusal + self._never_heard())
            return
        self._end(commands.SUPERSEDES.get(name, ()), f"{name} was ordered", now)
        if name in ("key_arm", "key_disarm"):
            self._key_disarmed = name == "key_disarm"
        if kind.lasting:
            refusal = self._memory.begin(token, name, now)
            if refusal:
                self._requests.refuse(token, refusal)
            else:
                self._requests.commands.send_once(kind.command, now)
                self._to_leave[token] = (kind, force)
            return
        shown, text = self._shown(kind, even_if_shown, now)
        # One damaged line must not make up for a command that never left.
        lately = now - self._config.effect.give_up_after
        goal = ConfirmedCommand(
            name,
            (kind.command,),
            text,
            shown,
            urgent=name in commands.URGENT,
            unacknowledged=True,
            once=kind.once,
            even_if_shown=even_if_shown,
            sent_by_another=lambda: self._sent_at.get(name, -math.inf) > lately,
        )
        self._requests.begin(token, goal, now)
        self._to_leave[token] = (kind, force)

    def _waits(self, token: int, kind: CommandKind) -> bool:
        """Nothing of this request has left yet."""
        if not kind.lasting:
            return self._requests.not_sent_yet(token)
        work = self._memory.work
        return work is not None and work.token == token and not work.sent

    def _standing_refusal(self, name: str, force: bool) -> str:
        """Why this command is refused whatever the flight mode; empty: it is not."""
        if name in _UNSAFE and self._requests.under_way("safe"):
            return f"{name} refused: the vehicle is being made safe; nothing was sent"
        if name == "open_mav" and self._block and not force:
            return f"open_mav refused: flight is blocked ({self._block}); force sends it"
        if name in _DISTURBING and self._requests.under_way("launch"):
            return f"{name} refused: a launch is under way; nothing was sent"
        if name != "launch":
            return ""
        if self._memory.work is not None:
            return f"launch refused: a {self._memory.work.text} is under way; nothing was sent"
        if self._block:
            return f"launch refused: flight is blocked ({self._block}); nothing was sent"
        if self._key_disarmed:
            return "launch refused: the key was disarmed by this node; nothing was sent"
        return ""

    def _never_heard(self) -> str:
        return "" if self._computer.record is not None else " (no telemetry was received yet)"

    def _shown(
        self, kind: CommandKind, even_if_shown: bool, now: float
    ) -> tuple[Callable[[], bool] | None, str]:
        """What shows the effect, and the same in words. Only what came after the order counts,
        or what is fresh where that keeps a command from being sent again."""
        name, computer = kind.command.name, self._computer

        first_sent = math.inf

        def since() -> float:
            # From the first time on: what is said again all the time would never settle.
            nonlocal first_sent
            if self._sent_at.get(name, -math.inf) >= now:
                first_sent = min(first_sent, self._sent_at[name])
            return now if math.isinf(first_sent) else first_sent

        if name == "reboot":
            before = computer.restarts
            return lambda: computer.restarts > before, "its clock restarts"
        if name == "flash_info":
            return lambda: self._flash_usage_at > since(), "it reports how full the flash is"
        effect = self._effect(kind)
        if effect is None:
            return None, _NOTHING_SHOWS
        known = name not in CANOPIES or computer.seen_out(name)
        believed = not even_if_shown and computer.fresh(now) and known
        # Where it shows already, only what is said once the command has been taken counts.
        settles = _SETTLES if computer.record and effect.shown(computer.record) else 0.0

        def forgot() -> bool:
            return not even_if_shown and computer.forgot(name)

        def shown() -> bool:
            record = computer.record
            if record is None or not (believed or record.received > since() + settles):
                return False
            return effect.shown(record) or forgot()

        text = "it was out before the flight computer restarted" if forgot() else effect.text
        return shown, text

    def _effect(self, kind: CommandKind) -> Effect | None:
        if kind.command.name == "safe" and self._config.safe_opens_sv:
            return commands.SAFE_THAT_VENTS
        name, record = kind.command.name, self._computer.record
        if name in CANOPIES and record and not self._computer.came_out(name):
            flag, mode = CANOPIES[name]
            if record[flag]:
                # A flag that was set before shows nothing: as by a test on the ground.
                return commands.mode_shown(mode)
        return kind.effect

    def _end(self, names: tuple[str, ...], why: str, now: float) -> None:
        if names:
            self._requests.abandon_where(lambda goal: goal.name in names, why, now)
