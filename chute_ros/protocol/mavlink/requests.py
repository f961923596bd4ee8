"""Requests under way: goals with their loops, transactions and the messages they wait for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from chute_ros.model import Outcome
from chute_ros.protocol.mavlink import results
from chute_ros.protocol.mavlink.commands import CommandTransactions, SendCommand
from chute_ros.protocol.mavlink.config import MavlinkConfig
from chute_ros.protocol.mavlink.effect import EffectFinished, EffectLoop, Goal, Report
from chute_ros.protocol.mavlink.events import Event, RequestFinished, RequestReport
from chute_ros.protocol.mavlink.goals import Watch


class Requests:
    """Each request has a token of its owner's and ends in exactly one RequestFinished."""

    def __init__(self, config: MavlinkConfig) -> None:
        self.commands = CommandTransactions(config.commands)
        self._limits = config.effect
        self._loops: dict[int, EffectLoop] = {}
        self._watches: dict[int, Watch] = {}
        self._follow_ups: dict[int, tuple[Goal, Watch]] = {}
        self._first_ends: dict[int, EffectFinished] = {}
        self._owners: dict[int, int] = {}
        self._next_command = 1
        self._events: list[Event] = []

    def __contains__(self, token: int) -> bool:
        return token in self._loops

    def under_way(self, name: str) -> bool:
        """A goal with this name has not ended yet."""
        return any(loop.goal.name == name for loop in self._loops.values())

    def begin(
        self,
        token: int,
        goal: Goal,
        now: float,
        watch: Watch | None = None,
        follow_up: tuple[Goal, Watch] | None = None,
    ) -> None:
        """Go for goal. watch: the message to hand over at the end. follow_up: what to ask after
        success; it adds its message to the answer, but cannot turn success into failure."""
        if watch is not None:
            self._watches[token] = watch
        if follow_up is not None:
            self._follow_ups[token] = follow_up
        self._loops[token] = EffectLoop(token, goal, self._limits, now)

    def refuse(self, token: int, why: str) -> None:
        """End a request before anything was sent."""
        self._events.append(RequestReport(Report(token, Outcome.FAILED, why)))
        finished = EffectFinished(token, False, False, results.NO_ACKNOWLEDGEMENT, why)
        self._events.append(RequestFinished(finished))

    def message(self, system_id: int, component_id: int, message: Any) -> None:
        """A message came: the one that a request waits for?"""
        for watch in self._watches.values():
            watch.offer(system_id, component_id, message)

    def effects_may_show(self, now: float) -> None:
        """A device said something: look whether it shows an effect."""
        for loop in self._loops.values():
            loop.effect_may_show(now)

    def update(self, now: float) -> None:
        """Look at the clock."""
        self.commands.update(now)
        for loop in self._loops.values():
            loop.update(now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        loops = (loop.next_deadline() for loop in self._loops.values())
        return min((self.commands.next_deadline(), *loops))

    def drive(self, now: float) -> list[SendCommand]:
        """Move what is ready between loops and transactions; returns what is to be sent."""
        send: list[SendCommand] = []
        moved = True
        while moved:
            moved = False
            for finished in self.commands.take_finished():
                loop = self._loops.get(self._owners.pop(finished.token, 0))
                if loop is not None and finished.command == loop.goal.commands[-1]:
                    loop.command_finished(finished, now)
            for token, loop in list(self._loops.items()):
                for command in loop.take_commands():
                    number, self._next_command = self._next_command, self._next_command + 1
                    self._owners[number] = token
                    self.commands.start(number, command, now, loop.goal.urgent)
                    moved = True
                for command in loop.take_refreshes():
                    self.commands.send_once(command, now)
                self._events += [RequestReport(report) for report in loop.take_reports()]
                if loop.finished is not None:
                    self._close(token, loop.finished, now)
                    moved = True
            send += self.commands.take_output()
        return send

    def take_events(self) -> list[Event]:
        """Reports and ends, oldest first; each is handed out once."""
        events, self._events = self._events, []
        return events

    def _close(self, token: int, finished: EffectFinished, now: float) -> None:
        del self._loops[token]
        for number in [n for n, owner in self._owners.items() if owner == token]:
            # What is not needed any more must not be sent again.
            del self._owners[number]
            self.commands.cancel(number, now)
        watch = self._watches.pop(token, None)
        follow_up = self._follow_ups.pop(token, None)
        if follow_up is not None and finished.success:
            self._first_ends[token] = finished
            self.begin(token, follow_up[0], now, follow_up[1])
            return
        first = self._first_ends.pop(token, None)
        if first is not None:
            finished = replace(first, message=f"{first.message}; {finished.message}")
        data = None if watch is None else watch.message
        self._events.append(RequestFinished(finished, data))
