"""Wait set of an executor, made once for its entities and used again."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any, Literal

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.waitable import NumberOfEntities

Kind = Literal["guard_condition", "subscription", "service", "client", "timer"]
#: In the order in which they are served: what came over a wire (guard conditions) first, then
#: messages; a timer can wait for them.
KINDS: tuple[Kind, ...] = ("guard_condition", "subscription", "service", "client", "timer")
#: Events of the middleware (a quality of service that does not match) decide nothing, stay until
#: they are taken, and are many: they are waited for in one turn of so many. A node's timers make
#: more turns than that in a second.
_TURNS_FOR_EVENTS = 10


class CachedWaitSet:
    """entities: of each kind; events: waitables that are nothing but events; guards: guard
    conditions of nobody, that only wake. Nothing of it is destroyed before `close`."""

    def __init__(
        self,
        context: Any,
        entities: dict[str, list[Any]],
        events: Iterable[Any],
        guards: Iterable[Any],
    ) -> None:
        self._held = ExitStack()
        self._held.enter_context(context.handle)
        self._by_pointer: dict[int, Any] = {}
        held = {kind: [one for one in entities[kind] if self._hold(one.handle)] for kind in KINDS}
        waking = [guard.handle for guard in guards if self._hold(guard.handle)]
        self._events = [event for event in events if self._hold(event)]
        count = sum((event.get_num_entities() for event in self._events), NumberOfEntities())
        self._wait_set = _rclpy.WaitSet(
            len(held["subscription"]) + count.num_subscriptions,
            len(held["guard_condition"]) + len(waking) + count.num_guard_conditions,
            len(held["timer"]) + count.num_timers,
            len(held["client"]) + count.num_clients,
            len(held["service"]) + count.num_services,
            count.num_events,
            context.handle,
        )
        #: (entity or None, what puts it into the wait set)
        self._waited_for: list[tuple[Any, Callable[[], Any]]] = [
            (None, partial(self._wait_set.add_guard_condition, handle)) for handle in waking
        ]
        for kind in KINDS:
            add = getattr(self._wait_set, f"add_{kind}")
            for one in held[kind]:
                self._by_pointer[one.handle.pointer] = one
                self._waited_for.append((one, partial(add, one.handle)))
        self._turns = 0

    def wait(self, timeout_ns: int, busy: bool) -> list[tuple[str, Any]]:
        """What is ready, with its kind (an event's is ""). timeout_ns below zero: for ever. busy:
        some group may let in nobody just now."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for entity, add in self._waited_for:
            if not busy or entity is None or entity.callback_group.can_execute(entity):
                add()
        self._turns = (self._turns + 1) % _TURNS_FOR_EVENTS
        events = [] if self._turns else self._events
        for event in events:
            event.add_to_wait_set(wait_set)
        wait_set.wait(timeout_ns)
        ready = [
            (kind, self._by_pointer[pointer])
            for kind in KINDS
            for pointer in wait_set.get_ready_entities(kind)
            if pointer in self._by_pointer
        ]
        return ready + [("", event) for event in events if event.is_ready(wait_set)]

    def close(self) -> None:
        """What was to be destroyed meanwhile is destroyed now."""
        self._held.close()

    def _hold(self, handle: Any) -> bool:
        # One that was destroyed just now has woken the executor, which makes another wait set.
        with suppress(_rclpy.InvalidHandle):
            self._held.enter_context(handle)
            return True
        return False
