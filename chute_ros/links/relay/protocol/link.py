"""An output that fires a parachute and never answers.

At rest the output is written again each output_check_interval: no more can be tested of it. A
deploy is a pulse: the firing bytes, repeated each repeat_interval, for pulse_time; then rest.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.model import LinkState, Outcome, ParachuteStatus
from chute_ros.protocol.events import AskSupervisor, EventLog, ParachuteChanged, SafetyAsk, ended
from chute_ros.settings import Settings, parameter

#: The one device of an output.
DEVICE = "output"
#: Between two pictures of it, s.
_PICTURES = 1.0
_SENT = "sent; a relay output confirms nothing"
_FIRED = "its output was switched: repack or replace the parachute, then call safety/reset"


@dataclass(frozen=True)
class RelayConfig(Settings):
    """Settings of a RelayLink. The bytes are those of a serial relay board of one channel
    (LCUS-1)."""

    output_fire: str = parameter(
        "hex:a00101a2",
        "data written to fire: the text itself, or hex: and digits; the default closes channel 1 "
        "of a serial relay board LCUS-1",
    )
    output_rest: str = parameter(
        "hex:a00100a1", "data written at rest: the text itself, or hex: and digits"
    )
    pulse_time: float = parameter(2.0, "the output fires for this long", 0.05, 60.0, "s")
    repeat_interval: float = parameter(
        0.1, "interval at which output_fire is repeated", 0.02, 10.0, "s"
    )
    output_check_interval: float = parameter(
        1.0,
        "interval at which the output is checked at rest: output_rest is written again, and an "
        "output that cannot be written is LOST",
        0.05,
        60.0,
        "s",
    )
    give_up_after: float = parameter(
        5.0, "a deploy fails if it cannot be written within this time", 0.1, 60.0, "s"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.fire == self.rest:
            why = "the output would always fire; need two that differ"
            raise self.contradiction(why, "output_fire", "output_rest")

    @cached_property
    def fire(self) -> bytes:
        """The bytes of output_fire."""
        return _bytes(self.output_fire, "output_fire")

    @cached_property
    def rest(self) -> bytes:
        """The bytes of output_rest."""
        return _bytes(self.output_rest, "output_rest")


def _bytes(text: str, name: str) -> bytes:
    digits = text.removeprefix("hex:")
    try:
        data = text.encode() if digits == text else bytes.fromhex(digits)
    except ValueError:
        data = b""
    if not data:
        raise ParameterError(
            f"parameter {name} is {text!r}: need a text, or pairs of hexadecimal digits after "
            "hex:, as hex:a00101a2"
        )
    return data


class RelayLink(EventLog):
    """The output: UNMONITORED while it can be written; else LOST, or NEVER_SEEN at first."""

    def __init__(self, config: RelayConfig) -> None:
        super().__init__()
        self.config = config
        self.state = LinkState.NEVER_SEEN
        #: Bytes that came, which nobody expects; pulses; when the newest one began, monotonic s.
        self.received = self.fired = 0
        self.fired_at = math.nan
        #: When the output was last written, monotonic s: all that is ever known of it.
        self.written_at = math.nan
        self._is_open = False
        #: Token of each deploy that was not written yet -> when it fails.
        self._waiting: dict[int, float] = {}
        #: A pulse ends then, monotonic s, with the next write.
        self.fires_until = -math.inf
        #: No deploy is left to be written, and no pulse is left without the rest after it.
        self.at_rest = True
        self._write_at = math.inf
        self._picture_at = -math.inf
        self._now = -math.inf
        self._output: list[bytes] = []
        #: What the wire was given, and has not refused so far.
        self._given: list[bytes] = []

    # -- the wire --------------------------------------------------------------------------------

    def wire_opened(self, now: float) -> None:
        """The output can be written."""
        self._is_open = True
        self._write_at = now
        self.update(now)

    def stream_ended(self, stream: Hashable) -> None:
        """The output is gone."""
        self._is_open = False
        self._lost()

    def not_written(self, frame: bytes) -> None:
        """The output did not take it."""
        self._given.clear()
        self._lost()

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """Some boards echo; it says nothing of a parachute."""
        self.received += len(data)

    def update(self, now: float) -> None:
        self._now = now
        if self._is_open and now >= self._write_at:
            fires = bool(self._waiting) or now < self.fires_until
            self._output.append(self.config.fire if fires else self.config.rest)
            wait = self.config.repeat_interval if fires else self.config.output_check_interval
            self._write_at = now + wait
        for token in [one for one, until in self._waiting.items() if now >= until]:
            del self._waiting[token]
            text = f"the output could not be written within {self.config.give_up_after:g} s"
            self._end(token, Outcome.FAILED, text)
        if now >= self._picture_at:
            self._picture(now)

    def next_deadline(self) -> float:
        write_at = self._write_at if self._is_open else math.inf
        return min([write_at, self._picture_at, *self._waiting.values()])

    def take_output(self) -> list[bytes]:
        output, self._output = self._output, []
        self._given += output
        return output

    def take_events(self) -> list[Any]:
        self._check_written()
        return super().take_events()

    # -- the owner -------------------------------------------------------------------------------

    def owner_alive(self, until: float) -> None:
        """Nobody listens at the other end."""

    def has_parachute(self) -> bool:
        """It cannot be known; a deploy is tried all the same."""
        return True

    def arm(self, token: int, arm: bool, triggers: int, now: float) -> None:
        """There is nothing to arm, and nothing that could be disarmed."""
        if arm:
            self._end(token, Outcome.CONFIRMED, "a relay output has no arming: it can always fire")
        else:
            text = "a relay output cannot be disarmed: disconnect or secure the parachute"
            self._end(token, Outcome.FAILED, text)

    def deploy(self, token: int, force: bool, now: float) -> None:
        """Fire. Without force it is refused: an output knows neither height nor arming."""
        if not force:
            text = "a relay output cannot tell air from ground: nothing was sent (force fires it)"
            self._end(token, Outcome.FAILED, text)
            return
        self.at_rest = False
        self._waiting[token] = now + self.config.give_up_after
        self._write_at = now
        self.update(now)

    # -- inside ----------------------------------------------------------------------------------

    def _check_written(self) -> None:
        given, self._given = self._given, []
        if given:
            self.written_at = self._now
            self._to(LinkState.UNMONITORED)
            self.at_rest = not self._waiting and given[-1] == self.config.rest
        if self.config.fire not in given or not self._waiting:
            return
        self.fired += 1
        self.fired_at = self._now
        self.fires_until = self._now + self.config.pulse_time
        # Nothing ever reports that the parachute is out: a person has to look.
        self._events.append(AskSupervisor(SafetyAsk.FLIGHT_BLOCK, DEVICE, _FIRED))
        waiting, self._waiting = self._waiting, {}
        for token in waiting:
            self._end(token, Outcome.SENT, _SENT)

    def _lost(self) -> None:
        if self.state is LinkState.UNMONITORED:
            self._to(LinkState.LOST)

    def _to(self, state: LinkState) -> None:
        if state is not self.state:
            self.state = state
            self._picture(self._now)

    def _picture(self, now: float) -> None:
        self._picture_at = now + _PICTURES
        self._events.append(ParachuteChanged(ParachuteStatus(DEVICE, self.state), self.written_at))

    def _end(self, token: int, outcome: Outcome, text: str) -> None:
        self._events += ended(token, outcome, text)
