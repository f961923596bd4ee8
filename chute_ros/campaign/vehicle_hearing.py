"""One picture of the vehicle from several sources, as the supervisor's node has it made."""

from __future__ import annotations

import math
from collections.abc import Callable

from chute_ros.campaign.sensor_messages import Imu, Odometry
from chute_ros.model import LinkState
from chute_ros.protocol import vehicle_readings as readings
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY, TELL_INTERVAL, VehicleMerge
from chute_ros.supervisor import inputs as i


class VehicleHearing:
    """sources: as the parameter vehicle_sources; lost_after: vehicle_state_age, s; before: how the
    autopilot was heard before a restart at now. tell(report, now) is called at once, or together
    with what else comes until the interval is over."""

    def __init__(
        self,
        sources: tuple[str, ...],
        lost_after: float,
        tell: Callable[[i.VehicleReport, float], None],
        before: LinkState = LinkState.NEVER_SEEN,
        now: float = 0.0,
    ) -> None:
        self._merge, self._tell = VehicleMerge(sources, lost_after), tell
        self._merge.recall(before, now)
        self._told_at = -math.inf
        #: When what waits is told, virtual s; infinity: nothing waits.
        self.due = math.inf

    def hear(self, one: i.VehicleReport | Imu | Odometry, now: float) -> None:
        """A message of a source came."""
        if isinstance(one, i.VehicleReport):
            self._merge.hear_state(one.state, now)
        elif isinstance(one, Imu):
            self._merge.hear(IMU, readings.imu(one), now)
        else:
            self._merge.hear(ODOMETRY, readings.odometry(one), now)
        if now - self._told_at >= TELL_INTERVAL:
            self.tell_now(now)
        elif math.isinf(self.due):
            self.due = now + TELL_INTERVAL

    def tell_now(self, now: float) -> None:
        """The picture by now."""
        self.due, self._told_at = math.inf, now
        merge = self._merge
        self._tell(i.VehicleReport(merge.state(now), merge.disputed(now), merge.told_by(now)), now)
