"""DroneCAN service calls as transactions: sent, sent again, answered or given up.

A service call has a transfer id of five bits, one count for each server and service, and its
response carries the same. Each try is a new transfer; a late response to an earlier try of the
same call counts. Source: DroneCAN specification, "CAN bus transport layer", service transfers.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from chute_ros.protocol.dronecan.transfer import TRANSFER_IDS, TRANSFER_TIMEOUT
from chute_ros.protocol.goal import NO_ANSWER
from chute_ros.settings import Settings, parameter

#: Calls to one server and service that wait at the same time, urgent ones aside.
MOST_AT_ONCE = 4
#: A transfer id that was not answered is not used again for this long (s), so that a late response
#: never meets another call.
_UNANSWERED = TRANSFER_TIMEOUT


@dataclass(frozen=True)
class CallLimits(Settings):
    """How long a response may take, and how often a call is sent."""

    timeout: float = parameter(
        0.25, "wait for a response before the request is sent again", 0.02, 60.0, "s"
    )
    tries: int = parameter(
        3, "a request is sent at most this many times", 1, TRANSFER_IDS // MOST_AT_ONCE - 1
    )


@dataclass(frozen=True)
class Call:
    """A request to node server. service: full name of its type; values: fields of the request."""

    server: int
    service: str
    values: Mapping[str, Any]
    #: 0, the most urgent, to 31.
    priority: int = 16


@dataclass(frozen=True)
class SendCall:
    """Put this request on the bus now."""

    command: Call
    transfer_id: int
    #: Of the transaction that it belongs to; None: of none.
    token: int | None


@dataclass(frozen=True)
class CallFinished:
    """A call ended. values: of the response, None: there was none."""

    token: int
    command: Call
    values: Mapping[str, Any] | None
    sends: int
    seconds: float
    #: What the response means, as the reader of the calls says.
    accepted: bool = True
    not_now: bool = False
    result: int = 0
    words: str = ""

    #: A call never takes the place of another.
    superseded = False

    def text(self) -> str:
        """What came of it, in words."""
        if self.values is None and self.words:
            return self.words
        if self.values is None:
            return f"no acknowledgement after {self.sends} sends in {self.seconds:.2f} s"
        return f"{self.words or 'answered'} (after {self.seconds:.2f} s)"


_Key = tuple[int, str]


@dataclass
class _Open:
    token: int
    call: Call
    begun: float
    #: Of the tries so far.
    transfer_ids: set[int] = field(default_factory=set)
    sends: int = 0
    send_at: float = -math.inf


class ServiceCalls:
    """All calls of one node. The owner sends what take_output gives and feeds responses back."""

    def __init__(
        self, limits: CallLimits, read: Callable[[CallFinished], CallFinished] | None = None
    ) -> None:
        self.limits = limits
        #: Says of an answered call what its response means.
        self._read = read or (lambda finished: finished)
        #: Responses that no call waited for, and calls that nobody answered.
        self.counts: Counter[str] = Counter()
        self._next_id: dict[_Key, int] = {}
        #: Transfer ids whose response has not come yet -> when they were sent.
        self._unanswered: dict[_Key, dict[int, float]] = {}
        #: (server, service, transfer id) of calls that nobody answered in time -> call, when.
        self._given_up: dict[tuple[int, str, int], tuple[Call, float]] = {}
        self._open: dict[int, _Open] = {}
        self._waiting: deque[_Open] = deque()
        self._out: list[SendCall] = []
        self._finished: list[CallFinished] = []

    def start(
        self, token: int, command: Call, now: float, urgent: bool = False, family: int = 0
    ) -> None:
        """Begin a call. An urgent one does not wait for those before it."""
        opened = _Open(token, command, now)
        if urgent or self._free(_key(command)):
            self._open[token] = opened
            self._send(opened, now)
        else:
            self._waiting.append(opened)

    def send_once(self, command: Call, now: float) -> None:
        """Send a request whose response does not matter."""
        self._out.append(SendCall(command, self._take_id(_key(command), now), None))

    def cancel(self, token: int, now: float) -> None:
        """It is not needed any more; nothing is said of it."""
        self._waiting = deque(one for one in self._waiting if one.token != token)
        if self._open.pop(token, None) is not None:
            self._out = [send for send in self._out if send.token != token]
            self._begin_waiting(now)

    def response(
        self, server: int, service: str, transfer_id: int, values: Mapping[str, Any], now: float
    ) -> None:
        """A response came."""
        self._unanswered.get((server, service), {}).pop(transfer_id, None)
        for one in self._open.values():
            if _key(one.call) == (server, service) and transfer_id in one.transfer_ids:
                self._end(one, values, now)
                return
        late = self._given_up.pop((server, service, transfer_id), None)
        if late is None or now - late[1] >= _UNANSWERED:
            self.counts["unexpected responses"] += 1
        else:
            self.counts["late responses"] += 1
            # Nobody waits for it any more; whoever reads answers may still want to know.
            self._read(CallFinished(0, late[0], values, 0, 0.0))

    def unsendable(self, send: SendCall, why: str, now: float) -> None:
        """What take_output gave cannot be put on the bus: the call ends."""
        one = None if send.token is None else self._open.get(send.token)
        if one is not None:
            self._end(one, None, now, f"not sent: {why}")

    def update(self, now: float) -> None:
        """Look at the clock: send again, give up."""
        for one in list(self._open.values()):
            if now < one.send_at:
                continue
            if one.sends >= self.limits.tries:
                self.counts["calls without an answer"] += 1
                self._end(one, None, now)
            else:
                self._send(one, now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return min((one.send_at for one in self._open.values()), default=math.inf)

    def take_output(self) -> list[SendCall]:
        """Requests to send now; each is handed out once."""
        out, self._out = self._out, []
        return out

    def take_finished(self) -> list[CallFinished]:
        """Calls that ended; each is handed out once."""
        finished, self._finished = self._finished, []
        return finished

    def _free(self, key: _Key) -> bool:
        return sum(_key(one.call) == key for one in self._open.values()) < MOST_AT_ONCE

    def _take_id(self, key: _Key, now: float) -> int:
        """The next transfer id whose response is not awaited; of none the one sent first."""
        unanswered = self._unanswered.setdefault(key, {})
        begin = self._next_id.get(key, 0)
        in_order = [(begin + step) % TRANSFER_IDS for step in range(TRANSFER_IDS)]
        number = min(in_order, key=lambda one: _awaited_since(unanswered, one, now))
        self._next_id[key] = (number + 1) % TRANSFER_IDS
        unanswered[number] = now
        server, service = key
        self._given_up.pop((server, service, number), None)
        for one in self._open.values():
            if _key(one.call) == key:
                one.transfer_ids.discard(number)
        return number

    def _send(self, one: _Open, now: float) -> None:
        number = self._take_id(_key(one.call), now)
        one.transfer_ids.add(number)
        one.sends += 1
        one.send_at = now + self.limits.timeout
        self._out.append(SendCall(one.call, number, one.token))

    def _end(
        self, one: _Open, values: Mapping[str, Any] | None, now: float, why: str = ""
    ) -> None:
        del self._open[one.token]
        answered = values is not None
        if not answered:
            for number in one.transfer_ids:
                server, service = _key(one.call)
                self._given_up[server, service, number] = (one.call, now)
        finished = CallFinished(
            one.token,
            one.call,
            values,
            one.sends,
            now - one.begun,
            accepted=answered,
            not_now=not answered,
            result=0 if answered else NO_ANSWER,
            words=why,
        )
        self._finished.append(self._read(finished) if answered else finished)
        self._begin_waiting(now)

    def _begin_waiting(self, now: float) -> None:
        for one in list(self._waiting):
            if self._free(_key(one.call)):
                self._waiting.remove(one)
                self._open[one.token] = one
                self._send(one, now)


def _awaited_since(unanswered: Mapping[int, float], number: int, now: float) -> float:
    """When the transfer whose response may still come was sent; -infinity: there is none."""
    at = unanswered.get(number, -math.inf)
    return at if now - at < _UNANSWERED else -math.inf


def _key(call: Call) -> _Key:
    return (call.server, call.service)
