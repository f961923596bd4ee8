"""The supervisor's core in its process: a loop that may be late, hang, or die and start again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from chute_ros.model import Decision
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import next_deadline, update
from chute_ros.supervisor.resume import Left, resumed, worth_leaving, written
from chute_ros.supervisor.state import State

#: What a queue of ROS keeps of what nobody reads.
_QUEUE = 10
_BOOT = _SETTINGS = "the same"
_RESUME_WITHIN = 30.0  # s


class SupervisorHost:
    """send: carries a decision to the device nodes, over ROS."""

    def __init__(self, config: SupervisorConfig, send: Callable[[Decision], None]) -> None:
        self.config, self._send = config, send
        self.state = State(epoch=8, started_at=0.0)
        self._waiting: dict[type, deque[i.Input]] = {}
        self._deadline = 0.0
        #: It hangs until then, virtual s.
        self.hangs_until = 0.0
        #: When each decision was first made, in their order.
        self.decided: list[tuple[float, Decision]] = []
        self.said: list[tuple[float, str]] = []
        self.vehicle_reports: list[float] = []

    def take(self, one: i.Input, now: float) -> None:
        """An input came."""
        if now < self.hangs_until:
            self._waiting.setdefault(type(one), deque(maxlen=_QUEUE)).append(one)
            return
        if isinstance(one, i.VehicleReport):
            self.vehicle_reports.append(now)
        self._turn((one,), now)

    def update(self, now: float) -> None:
        """Its deadline, or the end of its sleep."""
        if now < self.hangs_until:
            return
        waiting, self._waiting = self._waiting, {}
        for queue in waiting.values():
            for one in queue:
                self.take(one, now)
        self._turn((), now)

    def next_deadline(self) -> float:
        """Of the core, but not before it runs again."""
        return max(self._deadline, self.hangs_until)

    def start_again(self, now: float) -> None:
        """It was killed; what it left is what it goes on with."""
        left = written(Left(_BOOT, _SETTINGS, self.state))
        epoch = self.state.epoch + 4
        if worth_leaving(self.state):
            self.state = resumed(left, _BOOT, _SETTINGS, _RESUME_WITHIN, now)
            self._turn((i.TakeOver(epoch),), now)
        else:
            self.state = State(epoch=epoch, started_at=now)
            self._turn((), now)

    def _turn(self, inputs: tuple[i.Input, ...], now: float) -> None:
        self.state, outputs = update(self.config, self.state, inputs, now)
        self._deadline = next_deadline(self.config, self.state, now)
        for output in outputs:
            if isinstance(output, i.Decide):
                if not output.again:
                    self.decided.append((now, output.decision))
                self._send(output.decision)
            elif isinstance(output, i.Say):
                self.said.append((now, output.text))
