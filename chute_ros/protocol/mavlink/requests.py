"""Requests under way: goals with their loops, transactions and the messages they wait for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from chute_ros.model import Outcome
from chute_ros.protocol.mavlink import results
from chute_ros.protocol.mavlink.commands import CommandTransactions, SendCommand
from chute_ros.protocol.mavlink.config import MavlinkConfig
from chute_ros.protocol.mavlink.effect import EffectFinished, EffectLoop, Goal, Report
from chute_ros.protocol.mavlink.events import Event, RequestFinished, RequestReport
from chute_ros.protocol.mavlink.goals import Watch


@dataclass(frozen=True)
class _Running:
    loop: EffectLoop
    #: Marks the tries of this goal among the commands.
    family: int
    watch: Watch | None
    follow_up: tuple[Goal, Watch] | None
    #: How the goal before this follow-up ended.
    first_end: EffectFinished | None = None


class Requests:
    """Each request has a token of its owner's and ends in exactly one RequestFinished."""

    def __init__(self, config: MavlinkConfig) -> None:
        self.commands = CommandTransactions(config.commands)
        self._limits = config.effect
        self._running: dict[int, _Running] = {}
        #: Number of each command under way -> token of its request.
        self._owners: dict[int, int] = {}
        self._last_number = 0
        self._events: list[Event] = []

    def __contains__(self, token: int) -> bool:
        return token in self._running

    def under_way(self, name: str) -> bool:
        """A goal with this name has not ended yet."""
        return any(running.loop.goal.name == name for running in self._running.values())

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
        loop = EffectLoop(token, goal, self._limits, now)
        self._running[token] = _Running(loop, self._number(), watch, follow_up)

    def abandon(self, token: int, why: str, now: float) -> None:
        """End a request, if it is under way; nothing more is sent for it."""
        running = self._running.get(token)
        if running is not None:
            running.loop.abandon(why, now)

    def make_way_for_release(self, now: float) -> None:
        """End whatever would make a parachute less ready."""
        for token, running in self._running.items():
            if running.loop.goal.hinders_release:
                self.abandon(token, "a release was ordered", now)

    def refuse(self, token: int, why: str) -> None:
        """End a request before anything was sent."""
        self._events.append(RequestReport(Report(token, Outcome.FAILED, why)))
        finished = EffectFinished(token, False, False, results.NO_ACKNOWLEDGEMENT, why)
        self._events.append(RequestFinished(finished))

    def message(self, system_id: int, component_id: int, message: Any) -> None:
        """A message came: the one that a request waits for?"""
        for running in self._running.values():
            if running.watch is not None:
                running.watch.offer(system_id, component_id, message)

    def effects_may_show(self, now: float) -> None:
        """A device said something: look whether it shows an effect."""
        for running in self._running.values():
            running.loop.effect_may_show(now)

    def update(self, now: float) -> None:
        """Look at the clock."""
        self.commands.update(now)
        for running in self._running.values():
            running.loop.update(now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        loops = (running.loop.next_deadline() for running in self._running.values())
        return min((self.commands.next_deadline(), *loops))

    def drive(self, now: float) -> list[SendCommand]:
        """Move what is ready between loops and transactions; returns what is to be sent."""
        send: list[SendCommand] = []
        moved = True
        while moved:
            moved = False
            for finished in self.commands.take_finished():
                loop = self._loop_of(self._owners.pop(finished.token, None))
                if loop is not None and finished.command == loop.goal.commands[-1]:
                    loop.command_finished(finished, now)
            for token, running in list(self._running.items()):
                for command in running.loop.take_commands():
                    number = self._number()
                    self._owners[number] = token
                    urgent = running.loop.goal.urgent
                    self.commands.start(number, command, now, urgent, running.family)
                for command in running.loop.take_refreshes():
                    self.commands.send_once(command, now)
            for out in self.commands.take_output():
                loop = None if out.token is None else self._loop_of(self._owners.get(out.token))
                if loop is not None:
                    loop.command_sent(out.command)
                send.append(out)
                moved = True
            for token, running in list(self._running.items()):
                reports = running.loop.take_reports()
                self._events += [RequestReport(report) for report in reports]
                if running.loop.finished is not None:
                    self._close(token, running, running.loop.finished, now)
                    moved = True
        return send

    def take_events(self) -> list[Event]:
        """Reports and ends, oldest first; each is handed out once."""
        events, self._events = self._events, []
        return events

    def _number(self) -> int:
        self._last_number += 1
        return self._last_number

    def _loop_of(self, token: int | None) -> EffectLoop | None:
        running = None if token is None else self._running.get(token)
        return None if running is None else running.loop

    def _close(self, token: int, running: _Running, finished: EffectFinished, now: float) -> None:
        del self._running[token]
        for number in [n for n, owner in self._owners.items() if owner == token]:
            # What is not needed any more must not be sent again.
            del self._owners[number]
            self.commands.cancel(number, now)
        if running.follow_up is not None and finished.success:
            goal, watch = running.follow_up
            self.begin(token, goal, now, watch)
            self._running[token] = replace(self._running[token], first_end=finished)
            return
        first = running.first_end
        if first is not None:
            finished = replace(first, message=f"{first.message}; {finished.message}")
        data = None if running.watch is None else running.watch.message
        self._events.append(RequestFinished(finished, data))
