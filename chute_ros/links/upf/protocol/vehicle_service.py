"""flyfire.VehicleService, served by the vehicle: kill switch, flight block and its release.

The answer follows what really happened. A request goes to the supervisor; success is sent once
what was asked for has happened, a failure when it has not within the limit. A controller that says
by its state what it should have asked for is treated as if it had. Source: Flyfire UPF UAVCAN
protocol V1.0, "global working state" (states 1, 2, 5 and 7).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass

from chute_ros.links.upf.protocol.config import Policy, UpfConfig
from chute_ros.links.upf.protocol.definitions import VEHICLE_SERVICE, Definitions
from chute_ros.links.upf.protocol.machine import BLOCKING
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.endpoint import ReceivedTransfer
from chute_ros.protocol.events import AskSupervisor, SafetyAsk

#: A kill that was confirmed, or waited for, so lately (s) answers a request that comes after it.
KILL_MEMORY = 5.0
#: What the supervisor should know by now is said again, s.
_SAY_AGAIN = 0.5
#: The word that a kill is confirmed may be so long behind the decision that rests on it, s.
_WORD_ON_ITS_WAY = 0.05
#: A kill that is not confirmed yet is asked for again, s.
_ASK_AGAIN = 0.2
#: A device that is silent for longer does not hold its block against a reset of the supervisor, s.
_GONE_AFTER = 5.0
#: A controller that asked for a block and goes on saying that it is READY does not want it, s.
_BELIEVE_STATE_AFTER = 1.0
#: States in which a controller lets fly (document: state 2 and those that follow it); one that has
#: launched does not.
_RELEASES = (ParachuteState.READY, ParachuteState.TAKEOFF, ParachuteState.ARMED)
#: Requests that wait for their answer at the same time; a flood must not grow us.
MOST_PENDING = 32


_ASKS = {
    "TYPE_KILLSWITCH": SafetyAsk.KILL,
    "TYPE_FLIGHT_BLOCK": SafetyAsk.FLIGHT_BLOCK,
    "TYPE_FLIGHT_BLOCK_RELEASE": SafetyAsk.FLIGHT_BLOCK_RELEASE,
}


@dataclass(frozen=True)
class Response:
    """Answer this request so; result: name of a RESULT_* constant without the prefix."""

    request: ReceivedTransfer
    result: str


@dataclass
class _Pending:
    request: ReceivedTransfer
    ask: SafetyAsk
    until: float
    ask_again: float


def _kill_asked(device: str) -> AskSupervisor:
    return AskSupervisor(SafetyAsk.KILL, device, "it is about to launch (TYPE_KILLSWITCH)")


class VehicleService:
    """Takes requests in; the owner sends the responses and passes on what is asked."""

    def __init__(self, config: UpfConfig, definitions: Definitions) -> None:
        self._config = config
        self._definitions = definitions
        self.counts: Counter[str] = Counter()
        self.newest_answer = ""
        self._pending: list[_Pending] = []
        #: When the motors were last seen to stop by our kill, and not armed since; minus infinity:
        #: they were not.
        self.kill_confirmed_at = -math.inf
        self._kill_waited_for = -math.inf
        #: Device -> why it wants flight blocked.
        self._blocks: dict[str, str] = {}
        self._standing: frozenset[str] = frozenset()
        self._blocked = False
        self._said_at: dict[str, float] = {}
        #: Device -> when it last said anything of this.
        self._heard_at: dict[str, float] = {}
        #: Controllers -> the newest state that has a name.
        self._states: dict[str, ParachuteState] = {}
        #: Devices that have asked for a release since we started.
        self._released: set[str] = set()
        self._asks: list[AskSupervisor] = []
        self._responses: list[Response] = []

    # -- what devices say -----------------------------------------------------------------------

    def request(self, request: ReceivedTransfer, now: float) -> None:
        """A VehicleService request came."""
        name = self._definitions.type_name(VEHICLE_SERVICE, request.values)
        device = str(request.source)
        if not self._definitions.magic_is_good(VEHICLE_SERVICE, request.values):
            self.counts["requests with a bad magic number"] += 1
            self._respond(request, "BAD_MAGIC_NUMBER")
            return
        if name not in _ASKS:
            self.counts["requests of an unknown type"] += 1
            self._respond(request, "REJECTED")
            return
        ask, config = _ASKS[name], self._config
        if config.controller_node_id not in (0, request.source):
            self.counts["requests of nodes that are not our controller"] += 1
            self._respond(request, "REJECTED")
            return
        self.counts[f"{name} received"] += 1
        self._heard_at[device] = now
        policy = config.kill_policy if ask is SafetyAsk.KILL else config.flight_block_policy
        if policy is Policy.REJECT:
            self._respond(request, "REJECTED")
            return
        if ask is SafetyAsk.KILL:
            self._asks.append(_kill_asked(device))
        else:
            self._want(
                device, f"requested by {name}" if ask is SafetyAsk.FLIGHT_BLOCK else "", now
            )
        if policy is Policy.ACCEPT:
            self._respond(request, "SUCCESS")
            return
        if len(self._pending) >= MOST_PENDING:
            self.counts["requests refused: too many at once"] += 1
            self._respond(request, "FAILED")
            return
        until = now + config.vehicle_service_timeout
        self._pending.append(_Pending(request, ask, until, now + _ASK_AGAIN))
        self._answer_what_is_so(now)

    def state(self, device: str, state: ParachuteState, now: float) -> None:
        """A controller's state: what it should have asked for when it entered it."""
        if self._config.flight_block_policy is Policy.REJECT:
            return
        if state is ParachuteState.UNKNOWN:
            return
        before, self._states[device] = self._states.get(device), state
        self._heard_at[device] = now
        if state in BLOCKING:
            if device not in self._blocks:
                self._want(device, f"it is {state.name}", now)
        elif device in self._blocks and state in _RELEASES:
            # A request that was sent again may come after the release that followed it.
            entered = before is not state
            if entered or now - self._said_at[device] >= _BELIEVE_STATE_AFTER:
                self._want(device, "", now)

    # -- what the vehicle says ------------------------------------------------------------------

    def kill_confirmed(self, now: float) -> None:
        """The motors were seen to stop by our kill."""
        self.kill_confirmed_at = now
        self._answer_what_is_so(now)

    def kill_waited_for(self, now: float) -> None:
        """A deploy was decided, whose kill nobody has confirmed in the time that it is given: no
        device waits for it a second time."""
        self._kill_waited_for = now
        self._answer_what_is_so(now)

    def motors_may_turn(self, said_at: float) -> None:
        """The vehicle said that it is armed: a kill from before says nothing any more."""
        if said_at > self.kill_confirmed_at:
            self.kill_confirmed_at = -math.inf

    def supervisor_said(self, blocked: bool, standing: Collection[str], now: float) -> None:
        """Flight is blocked or not, and the devices whose wish for it the supervisor knows."""
        self._blocked, self._standing = blocked, frozenset(standing)
        for device in sorted(set(self._blocks) ^ self._standing):
            # Of a device that has not said anything yet, a block from before we started stands.
            heard = device in self._blocks or device in self._released or device in self._states
            gone = now - self._heard_at.get(device, now) > _GONE_AFTER
            if gone and device in self._blocks:
                # It was exchanged, and somebody has reset the supervisor.
                del self._blocks[device]
            elif heard and now - self._said_at.get(device, -math.inf) >= _SAY_AGAIN:
                # It has not heard, or has started anew since.
                self._want(device, self._blocks.get(device, ""), now)
        self._answer_what_is_so(now)

    def update(self, now: float) -> None:
        """Look at the clock: what did not happen in time has failed."""
        for one in [one for one in self._pending if now >= one.until]:
            self._pending.remove(one)
            self.counts[f"{one.ask.name} not done in time"] += 1
            self._respond(one.request, "FAILED")
        for one in self._pending:
            if one.ask is SafetyAsk.KILL and now >= one.ask_again:
                # A supervisor that has just started has not heard it.
                one.ask_again = now + _ASK_AGAIN
                self._asks.append(_kill_asked(str(one.request.source)))

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        kills = (one.ask_again for one in self._pending if one.ask is SafetyAsk.KILL)
        return min((*kills, *(one.until for one in self._pending)), default=math.inf)

    def take_asks(self) -> list[AskSupervisor]:
        """What to pass on; each is handed out once."""
        asks, self._asks = self._asks, []
        return asks

    def take_responses(self) -> list[Response]:
        """What to answer; each is handed out once."""
        responses, self._responses = self._responses, []
        return responses

    # -- inside ----------------------------------------------------------------------------------

    def _want(self, device: str, reason: str, now: float) -> None:
        """The device wants flight blocked for reason, or (empty) released."""
        known = (device in self._blocks) is bool(reason)
        if known and now - self._said_at.get(device, -math.inf) < _SAY_AGAIN:
            return
        self._said_at[device] = now
        if reason:
            self._blocks[device] = reason
            self._asks.append(AskSupervisor(SafetyAsk.FLIGHT_BLOCK, device, reason))
        else:
            self._blocks.pop(device, None)
            self._released.add(device)
            text = "the device no longer requests it"
            self._asks.append(AskSupervisor(SafetyAsk.FLIGHT_BLOCK_RELEASE, device, text))

    def _happened(self, one: _Pending, now: float) -> bool:
        device = str(one.request.source)
        if one.ask is SafetyAsk.KILL:
            return now - self.kill_confirmed_at <= KILL_MEMORY
        if one.ask is SafetyAsk.FLIGHT_BLOCK:
            return self._blocked and device in self._standing
        return device not in self._standing

    def _answer_what_is_so(self, now: float) -> None:
        for one in [one for one in self._pending if self._happened(one, now)]:
            self._pending.remove(one)
            self._respond(one.request, "SUCCESS")
        if now - self._kill_waited_for <= KILL_MEMORY:
            for one in self._pending:
                if one.ask is SafetyAsk.KILL:
                    one.until = min(one.until, now + _WORD_ON_ITS_WAY)

    def _respond(self, request: ReceivedTransfer, result: str) -> None:
        name = self._definitions.type_name(VEHICLE_SERVICE, request.values) or "bad request"
        self.newest_answer = f"{name} of {request.source}: {result}"
        self.counts[f"answered {result}"] += 1
        self._responses.append(Response(request, result))
