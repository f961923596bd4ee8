"""The callbacks of a node, one after the other, with little between a message and its callback.

rclpy's SingleThreadedExecutor makes its wait set anew for each callback, twice, and asks every
event of the middleware each time: most of what a message costs a node. Here the wait set is kept
while the entities stay the same. docs/evidence/speed.md has what that brings. It rests on private
members of rclpy; where one of them is missing, `new_executor` gives rclpy's own.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterable
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any, Literal

from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.logging import get_logger
from rclpy.utilities import timeout_sec_to_nsec
from rclpy.waitable import NumberOfEntities

_Coroutine = Coroutine[Any, Any, None]
Kind = Literal["guard_condition", "subscription", "service", "client", "timer"]
#: In the order in which they are served: what came over a wire (guard conditions) first, then
#: messages; a timer can wait for them.
KINDS: tuple[Kind, ...] = ("guard_condition", "subscription", "service", "client", "timer")
#: Events of the middleware (a quality of service that does not match) decide nothing, stay until
#: they are taken, and are many: they are waited for in one turn of so many. A node's timers make
#: more turns than that in a second.
_TURNS_FOR_EVENTS = 10
#: rclpy's private ways to take what has come, by the kind of entity; each gives what is to be done
#: with it, or None. ("": an event.)
_TAKES: dict[str, str] = {
    "guard_condition": "_take_guard_condition",
    "subscription": "_take_subscription",
    "service": "_take_service",
    "client": "_take_client",
    "timer": "_take_timer",
    "": "_take_waitable",
}
#: What else of an executor, and of the compiled part of rclpy, is private and used here.
_OF_EXECUTOR = (
    "_spin_once_impl", "_is_shutdown", "_context", "_guard", "_sigint_gc", "_tasks", "_tasks_lock",
)  # fmt: skip
_OF_RCLPY = ("WaitSet", "InvalidHandle")


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


class NodeExecutor(SingleThreadedExecutor):
    """Each turn serves every entity that is ready once; all else is as with rclpy's.

    Callbacks may be coroutines, in any callback group.
    """

    #: Entities came or went. On the class: rclpy's own __init__ may wake it already.
    _changed = True
    _wait_set: CachedWaitSet | None = None
    #: rclpy's own.
    _tasks: list[tuple[Any, Any, Any]]

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        #: Callbacks that wait for something.
        self._suspended: list[_Coroutine] = []

    def wake(self) -> None:
        """Entities came or went, or ROS shuts down."""
        self._changed = True
        super().wake()

    def add_node(self, node: Any) -> bool:
        """As rclpy's."""
        self._changed = True
        return bool(super().add_node(node))

    def remove_node(self, node: Any) -> None:
        """As rclpy's."""
        self._changed = True
        super().remove_node(node)

    def spin(self) -> None:
        """As rclpy's; afterwards nothing keeps a node from being destroyed."""
        try:
            super().spin()
        finally:
            self._let_go()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """As rclpy's; not while another thread spins."""
        ended = bool(super().shutdown(timeout_sec))
        self._let_go()
        return ended

    def _let_go(self) -> None:
        if self._wait_set is not None:
            self._wait_set.close()
            self._wait_set = None

    def _spin_once_impl(
        self, timeout_sec: Any = None, wait_condition: Callable[[], bool] = lambda: False
    ) -> None:
        """One turn. All of rclpy's ways to spin end here."""
        if self._is_shutdown or wait_condition():
            return
        wait_set = self._gathered()
        again = self._go_on()
        # rclpy may hand over an object that knows what is left of a time.
        timeout_ns = timeout_sec_to_nsec(getattr(timeout_sec, "timeout", timeout_sec))
        ready = wait_set.wait(0 if again else timeout_ns, bool(self._suspended))
        if not self._context.ok():
            raise ExternalShutdownException
        for kind, entity in ready:
            if not self._is_shutdown and entity.callback_group.beginning_execution(entity):
                self._step(self._served(kind, entity))

    def _gathered(self) -> CachedWaitSet:
        """The wait set for what there is to wait for now."""
        if self._changed or self._wait_set is None:
            self._changed = False  # before it looks: it may be woken meanwhile
            self._let_go()
            nodes = self.get_nodes()
            names = {kind: f"{kind.removesuffix('_condition')}s" for kind in KINDS}
            self._wait_set = CachedWaitSet(
                self._context,
                {kind: [e for n in nodes for e in getattr(n, names[kind])] for kind in KINDS},
                [waitable for node in nodes for waitable in node.waitables],
                [guard for guard in (self._guard, self._sigint_gc) if guard is not None],
            )
        return self._wait_set

    async def _served(self, kind: str, entity: Any) -> None:
        try:
            # A timer that was cancelled meanwhile seems ready to rcl_wait.
            due = kind != "timer" or entity.handle.is_timer_ready()
            execute = getattr(self, _TAKES[kind])(entity) if due else None
            if execute is not None:
                await execute()
        finally:
            entity.callback_group.ending_execution(entity)

    def _step(self, coroutine: _Coroutine) -> bool:
        """Run it until its end, or until it has to wait; whether it has ended."""
        try:
            coroutine.send(None)
        except StopIteration:
            return True
        self._suspended.append(coroutine)
        return False

    def _go_on(self) -> bool:
        """Let those that wait look again; whether another look may help, as one has ended."""
        ended = False
        for coroutine in list(self._suspended):
            self._suspended.remove(coroutine)
            ended |= self._step(coroutine)
        with self._tasks_lock:
            tasks = [task for task, _, _ in self._tasks]
        if not tasks:
            return ended
        for task in tasks:
            task()
            task.result()  # or raise what it raised
        with self._tasks_lock:
            self._tasks = [
                one for one in self._tasks if not one[0].done() and not one[0].cancelled()
            ]
        return ended or any(task.done() for task in tasks)


def missing(executor: SingleThreadedExecutor) -> list[str]:
    """What of rclpy's private members this file needs and the distribution does not have."""
    of_executor = [one for one in (*_OF_EXECUTOR, *_TAKES.values()) if not hasattr(executor, one)]
    return of_executor + [one for one in _OF_RCLPY if not hasattr(_rclpy, one)]


def new_executor(context: Context | None = None) -> SingleThreadedExecutor:
    """Ours; rclpy's own, which serves the same later, where ours cannot run."""
    executor = NodeExecutor(context=context)
    gone = missing(executor)
    if not gone:
        return executor
    executor.shutdown()
    text = f"rclpy no longer has {', '.join(gone)}: its own executor is used, which is slower"
    get_logger("chute_ros").warning(text)
    return SingleThreadedExecutor(context=context)
