"""The callbacks of a node, one after the other, with little between a message and its callback.

rclpy's SingleThreadedExecutor makes its wait set anew for each callback, twice, and asks every
event of the middleware each time: most of what a message costs a node. Here the wait set is kept
while the entities stay the same. docs/evidence/speed.md has what that brings.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.utilities import timeout_sec_to_nsec

from chute_ros.ros.cached_wait_set import KINDS, CachedWaitSet

_Coroutine = Coroutine[Any, Any, None]


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
        #: rclpy's ways to take what has come; each gives what is to be done with it, or None.
        self._takes: dict[str, Callable[[Any], Callable[[], _Coroutine] | None]] = {
            "guard_condition": self._take_guard_condition,
            "subscription": self._take_subscription,
            "service": self._take_service,
            "client": self._take_client,
            "timer": self._take_due_timer,
            "": self._take_waitable,
        }

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
            execute = self._takes[kind](entity)
            if execute is not None:
                await execute()
        finally:
            entity.callback_group.ending_execution(entity)

    def _take_due_timer(self, timer: Any) -> Callable[[], _Coroutine] | None:
        # One that was cancelled meanwhile seems ready to rcl_wait.
        return self._take_timer(timer) if timer.handle.is_timer_ready() else None

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
