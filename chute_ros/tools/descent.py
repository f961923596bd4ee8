"""How a vehicle came down after a release, from the heights that it reported."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from chute_ros.model import NAN, LandedState, VehicleState

#: A measurement that is older (s) is not one of its moment.
_FRESH = 1.0
#: A canopy carries once the vehicle sinks at most so many times as fast as in the end.
_CARRIES = 1.25
#: So many samples make a rate.
_FEWEST = 5


@dataclass(frozen=True)
class MeasuredDescent:
    """fastest: sink after the release, m/s; rate: sink under the canopy, m/s, the median of the
    second half of the way down; carried_after: from the release until it sank at most a quarter
    faster than that, s; lost: height until then, m; took: from the release to the landing, s, or
    to the last report. NaN: not known."""

    fastest: float = NAN
    rate: float = NAN
    carried_after: float = NAN
    lost: float = NAN
    took: float = NAN


def descent(vehicle: Sequence[tuple[float, VehicleState]], at: float) -> MeasuredDescent:
    """After a release at this moment. vehicle: (s, what it reported), in the order of time."""
    down = []
    for when, state in vehicle:
        if when < at:
            continue
        if state.landed_state is LandedState.ON_GROUND and state.landed_state_age < _FRESH:
            break
        if state.height_age < _FRESH and state.vertical_speed_age < _FRESH:
            down.append((when, state.height, -state.vertical_speed))
    if len(down) < 2 * _FEWEST:
        return MeasuredDescent()
    sinks = [sink for _, _, sink in down]
    fastest, rate = max(sinks), statistics.median(sinks[len(sinks) // 2 :])
    after = down[sinks.index(fastest) :]
    carried = next((one for one in after if one[2] <= _CARRIES * rate), None)
    took = down[-1][0] - at
    if rate <= 0.0 or carried is None:
        return MeasuredDescent(fastest, rate, took=took)
    return MeasuredDescent(fastest, rate, carried[0] - at, down[0][1] - carried[1], took)
