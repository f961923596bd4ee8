"""How a simulated flight computer hears: USB packets, of which each must be one whole token.

Source: Umbilical Reference, section 2 (tokens). The packets, the pause after each and the short
queue are as measured: there is no acknowledgement, and what comes too fast is lost.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable

PACKET = 64  # bytes
#: The receiver sleeps this long after a packet that is not a lone heartbeat, s.
PAUSE = 0.1
QUEUE = 4
HEARTBEAT = "<H>"
#: The host's driver holds no more than this for a device that does not read, bytes.
_HOST_BUFFER = 4096

#: Token -> name, for the log. The target command has its own form.
NAMES: dict[str, str] = {
    "<L>": "Launch",
    "<V>": "Safe vehicle",
    "<KA>": "Key arm",
    "<KD>": "Key disarm",
    "<M>": "Open MAV",
    "<m>": "Close MAV",
    "<S>": "Open SV",
    "<s>": "Close SV",
    "<D>": "Trigger drogue",
    "<d>": "Trigger main",
    **{f"<{n}>": f"Payload event N{n}" for n in range(1, 5)},
    **{f"<A{n}>": f"Payload event A{n}" for n in range(1, 4)},
    "<R>": "Reboot",
    "<F>": "Reset FRAM",
    "<f>": "Dump FRAM",
    "<G>": "Dump flash",
    "<W>": "Wipe flash",
    "<I>": "Flash info",
    "<X>": "Wipe FRAM and reboot",
}

_TOKEN = re.compile(r"<[^<>]*>")
_NUMBER = re.compile(r"-?[0-9]+(?:\.[0-9]+)?")


def target_of(token: str, floats: int) -> tuple[float, ...] | None:
    """The numbers of <T,...>: latitude and longitude, once or twice; None: it is none."""
    if not token.startswith("<T,") or not token.endswith(">"):
        return None
    texts = token[3:-1].split(",")
    if len(texts) != floats or not all(_NUMBER.fullmatch(text) for text in texts):
        return None
    numbers = tuple(float(text) for text in texts)
    limits = (90.0, 180.0)
    if any(abs(number) > limits[i % 2] for i, number in enumerate(numbers)):
        return None
    return numbers


class CommandReceiver:
    """Packets to queued tokens. say: one line for whoever watches."""

    def __init__(self, target_floats: int, say: Callable[[str], None]) -> None:
        #: Every command that was accepted: (time, token).
        self.came: list[tuple[float, str]] = []
        self.heartbeats: list[float] = []
        #: Tokens lost, by why: glued, unknown, busy (the queue was full), deaf, booting.
        self.lost: Counter[str] = Counter()
        self._target_floats = target_floats
        self._say = say
        self._queue: list[str] = []
        self._waiting = b""
        self._asleep_until = -math.inf

    def packet(self, data: bytes, now: float) -> None:
        """Bytes came over USB; they wait while the receiver sleeps."""
        for start in range(0, len(data), PACKET):
            part = data[start : start + PACKET]
            if now < self._asleep_until or self._waiting:
                self._waiting = (self._waiting + part)[:_HOST_BUFFER]
            else:
                self._read(part, now)

    def update(self, now: float) -> None:
        """Read what has waited, glued together as it is."""
        while self._waiting and self._asleep_until <= now:
            part, self._waiting = self._waiting[:PACKET], self._waiting[PACKET:]
            self._read(part, self._asleep_until)

    def next_deadline(self) -> float:
        """When it reads what waits."""
        return self._asleep_until if self._waiting else math.inf

    def take(self) -> list[str]:
        """The tokens in the queue, which is empty from now on."""
        tokens, self._queue = self._queue, []
        return tokens

    def lose(self, data: bytes, why: str) -> None:
        """Nobody hears data."""
        count = len(_tokens_in(data)) or 1
        self.lost[why] += count
        self._say(f"lost {data!r}: {why}")

    def reset(self) -> None:
        """Forget what has not been taken; what came stays known."""
        self._queue.clear()
        self._waiting = b""
        self._asleep_until = -math.inf

    def _read(self, data: bytes, now: float) -> None:
        text = data.decode("latin-1")
        if HEARTBEAT in text:
            self.heartbeats.append(now)
        if text == HEARTBEAT:
            return
        self._asleep_until = now + PAUSE
        commands = [token for token in _tokens_in(data) if token != HEARTBEAT]
        if text in NAMES or target_of(text, self._target_floats) is not None:
            self._accept(text, now)
        elif commands and text != commands[0]:
            self.lost["glued"] += len(commands)
            self._say(f"lost {data!r}: glued")
        elif text.replace(HEARTBEAT, ""):
            self.lost["unknown"] += 1
            self._say(f"lost {data!r}: unknown")

    def _accept(self, token: str, now: float) -> None:
        if len(self._queue) >= QUEUE:
            self.lost["busy"] += 1
            self._say(f"lost {token}: busy")
            return
        self.came.append((now, token))
        self._queue.append(token)


def _tokens_in(data: bytes) -> list[str]:
    return _TOKEN.findall(data.decode("latin-1"))
