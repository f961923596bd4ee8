"""What was received of one vehicle, and when it was sent, by the listener's own clock.

A message tells its age badly: the clocks of two computers differ, a latched message may be hours
old when it is received, and a node repeats the status of a device that is long silent. Heartbeats
are stamped as they leave, ten times a second: they show how the sender's wall clock lies to the
listener's monotonic one.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

from chute_ros.model import FIRES
from chute_ros.tools.chute.words import is_old

#: Heartbeats of each sender whose delays are compared: the fastest shows its clock best.
_COMPARED = 20
#: Links, devices and supervisors that are remembered: a stranger on the network may invent many.
MOST_NAMES = 32
MOST_DECISIONS = 8


def stamp_seconds(message: Any) -> float:
    """The stamp of its header, Unix s."""
    stamp = message.header.stamp
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


@dataclass(frozen=True)
class ReceivedMessage:
    """A message; when it was received, monotonic s and Unix s; the how-manieth it is of its kind
    and sender, from 1 on; and when the first of those was received, monotonic s, NaN: not kept."""

    message: Any
    received: float
    wall: float
    number: int = 1
    first: float = math.nan


@dataclass
class ReceivedMessages:
    """All that was received of one vehicle. began: when its first state was, monotonic s."""

    began: float = math.nan
    #: By the supervisor's name; by link; by link and device.
    states: dict[str, ReceivedMessage] = field(default_factory=dict)
    heartbeats: dict[str, ReceivedMessage] = field(default_factory=dict)
    parachutes: dict[tuple[str, str], ReceivedMessage] = field(default_factory=dict)
    vehicle: ReceivedMessage | None = None
    #: (epoch, id) -> each decision once, though it is resent; of kills and deploys, and of flight
    #: blocks, the newest: apart, so that no blocks push a kill out.
    fired: dict[tuple[int, int], ReceivedMessage] = field(default_factory=dict)
    blocks: dict[tuple[int, int], ReceivedMessage] = field(default_factory=dict)
    #: (epoch, id, link) -> the newest report of that link on that decision.
    reports: dict[tuple[int, int, str], ReceivedMessage] = field(default_factory=dict)
    _ahead: dict[str, deque[float]] = field(default_factory=dict)

    def hear_state(self, message: Any, now: float, wall: float) -> None:
        """safety/state. now: monotonic s; wall: Unix s; as in all below."""
        if math.isnan(self.began):
            self.began = now
        _remember(self.states, message.supervisor, message, now, wall)

    def hear_heartbeat(self, message: Any, now: float, wall: float) -> None:
        """safety/heartbeat."""
        link = message.link
        _remember(self.heartbeats, link, message, now, wall)
        if link in self.heartbeats:
            ahead = self._ahead.setdefault(link, deque(maxlen=_COMPARED))
            ahead.append(now - stamp_seconds(message))
            for gone in self._ahead.keys() - self.heartbeats.keys():
                del self._ahead[gone]

    def hear_parachute(self, message: Any, now: float, wall: float) -> None:
        """parachute/status."""
        _remember(self.parachutes, (message.link, message.device), message, now, wall)

    def hear_vehicle(self, message: Any, now: float, wall: float) -> None:
        """vehicle/state."""
        self.vehicle = ReceivedMessage(message, now, wall)

    def hear_decision(self, message: Any, now: float, wall: float) -> None:
        """safety/decision."""
        into = self.fired if message.action in FIRES else self.blocks
        into.setdefault((message.epoch, message.id), ReceivedMessage(message, now, wall))
        while len(into) > MOST_DECISIONS:
            del into[min(into)]

    def hear_history(self, message: Any, now: float, wall: float) -> None:
        """safety/history: what was decided before this listener came is as old as its stamp
        says."""
        stamp = stamp_seconds(message)
        newest = self.state(now)
        sent = self._sent(newest.message.supervisor, stamp) if newest else math.nan
        decided = now - max(0.0, wall - stamp) if math.isnan(sent) else min(sent, now)
        self.hear_decision(message, decided, wall)

    @property
    def decisions(self) -> list[ReceivedMessage]:
        """The newest last."""
        return [one for _, one in sorted({**self.blocks, **self.fired}.items())]

    def hear_report(self, message: Any, now: float, wall: float) -> None:
        """safety/action."""
        _remember(self.reports, (message.epoch, message.id, message.link), message, now, wall)

    def state(self, now: float) -> ReceivedMessage | None:
        """The state to believe: of those that are not old that of the highest epoch, as one that
        led before may have left its last one behind; else the youngest."""
        fresh = [one for one in self.states.values() if not is_old(self.state_age(one, now))]
        if fresh:
            return max(fresh, key=lambda one: (one.message.epoch, one.received))
        return min(self.states.values(), key=lambda one: self.state_age(one, now), default=None)

    def state_age(self, heard: ReceivedMessage, now: float) -> float:
        """Since it was sent, s. The first one is latched: where no heartbeat tells its sender's
        clock, its stamp is believed."""
        sent = self._sent(heard.message.supervisor, stamp_seconds(heard.message))
        if math.isnan(sent):
            latched = max(0.0, heard.wall - stamp_seconds(heard.message))
            sent = heard.received - (latched if heard.number == 1 else 0.0)
        return max(0.0, now - min(sent, heard.received))

    def parachute_age(self, heard: ReceivedMessage, now: float) -> float:
        """Since its device was received by its node, s; NaN: it never was."""
        if stamp_seconds(heard.message) == 0.0:
            return math.nan
        sent = self._sent(heard.message.link, stamp_seconds(heard.message))
        return now - (heard.received if math.isnan(sent) else min(sent, heard.received))

    def clock_difference(self, sender: str) -> float:
        """This computer's wall clock less that of a sender of heartbeats, s, with the time that
        its fastest heartbeat took; NaN: none received."""
        heard = self.heartbeats.get(sender)
        if heard is None:
            return math.nan
        return min(self._ahead[sender]) + (heard.wall - heard.received)

    def _sent(self, sender: str, stamp: float) -> float:
        """When something with this stamp was sent, monotonic s; NaN: its clock is not known."""
        ahead = self._ahead.get(sender)
        return stamp + min(ahead) if ahead else math.nan


def _remember(
    into: dict[Any, ReceivedMessage], key: Any, message: Any, now: float, wall: float
) -> None:
    before = into.pop(key, None)
    number, first = (before.number + 1, before.first) if before else (1, now)
    into[key] = ReceivedMessage(message, now, wall, number, first)
    while len(into) > MOST_NAMES:
        del into[min(into, key=lambda one: into[one].received)]
