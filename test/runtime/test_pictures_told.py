"""Pictures of the vehicle wait for the owner's turn, and are as old as they are when told."""

import math

import pytest

from chute_ros.links.mavlink.runtime import MavlinkRuntime, MavlinkSettings
from chute_ros.model import VehicleState
from chute_ros.protocol.events import VehicleChanged


@pytest.mark.parametrize("waited", [0.0, 0.06, 3.0])
def test_what_waited_is_older_by_that(shell, waited):
    """Given a height of 0.2 s before and a battery of 0.5 s before, at t+0 in the link's turn; the
    owner has its turn after waited seconds."""
    runtime = MavlinkRuntime("mavlink_parachute", MavlinkSettings(), shell)
    picture = VehicleState(height=60.0, height_age=0.2, battery_age=0.5)
    runtime.take(VehicleChanged(picture, shell.now), shell.now + waited)
    (told,) = shell.published
    state = told.report.state
    assert told.at - state.battery_age == pytest.approx(shell.now - 0.5), "when it was measured"
    assert (state.height, state.height_age) == (60.0, pytest.approx(0.2 + waited))
    assert math.isnan(state.armed_age), "what was never received gets no age"
