"""One picture of the vehicle from the sources of the supervisor's parameter vehicle_sources.

With vehicle/state alone, the default, each message is passed on as it came. With others they are
merged by part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from chute_ros.model import LinkState, VehicleState
from chute_ros.protocol.vehicle_merge import TELL_INTERVAL, VEHICLE_STATE, VehicleMerge
from chute_ros.protocol.vehicle_readings import Parts
from chute_ros.supervisor.inputs import VehicleReport


class VehicleHearing:
    """lost_after: vehicle_state_age, s: a source of the autopilot that is silent for longer has
    lost it; needed_rate: vehicle_source_rate, Hz; before: how the autopilot was heard before a
    restart at now. tell(report, now) is called at once, or together with what else comes until the
    interval is over."""

    def __init__(
        self,
        sources: Sequence[str],
        lost_after: float,
        needed_rate: float,
        tell: Callable[[VehicleReport, float], None],
        before: LinkState = LinkState.NEVER_SEEN,
        now: float = 0.0,
    ) -> None:
        self._alone = tuple(sources) == (VEHICLE_STATE,)
        self._merge, self._tell = VehicleMerge(sources, lost_after, needed_rate), tell
        self._merge.recall(before, now)
        self._told_at = -math.inf
        #: When what waits is told, monotonic s; infinity: nothing waits.
        self.due = math.inf

    def hear_state(self, state: VehicleState, now: float) -> None:
        """vehicle/state came."""
        if self._alone:
            self._tell(VehicleReport(state), now)
            return
        self._merge.hear_state(state, now)
        self._tell_soon(now)

    def hear(self, source: str, parts: Parts, now: float) -> None:
        """A message of another source came, and says this."""
        self._merge.hear(source, parts, now)
        self._tell_soon(now)

    def refuse(self, source: str, why: str, now: float) -> None:
        """A message of a source came that cannot be used; it is a fault of the next picture."""
        self._merge.refuse(source, why, now)

    def tell_now(self, now: float) -> None:
        """The picture by now."""
        self.due, self._told_at = math.inf, now
        merge = self._merge
        self._tell(VehicleReport(merge.state(now), merge.disputed(now), merge.told_by(now)), now)

    def _tell_soon(self, now: float) -> None:
        if now - self._told_at >= TELL_INTERVAL:
            self.tell_now(now)
        elif math.isinf(self.due):
            self.due = now + TELL_INTERVAL
