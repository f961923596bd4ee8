"""What mavlink_parachute sees of the vehicle, and what it does not."""

import pytest
from chute_msgs.msg import VehicleState
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mavlink_bench import Autopilot, Network, VirtualNetwork, airborne

from chute_ros.links.mavlink.diagnostics import details_of
from chute_ros.protocol.mavlink.dialect import dialect


def told(diagnostics, task):
    """The newest status of this task, or None."""
    name = f"mavlink_parachute: {task}"
    found = [one for array in diagnostics for one in array.status if one.name.endswith(name)]
    return found[-1] if found else None


def test_altitude_pressure_and_targets_are_asked_for_and_told(bench):
    network = Network(bench)
    states = bench.follow(VehicleState, "vehicle/state")
    network.plug(airborne(40.0))
    ages = ("altitude_age", "pressure_age", "attitude_error_age", "acceleration_age")
    state = bench.until(
        lambda: states and all(getattr(states[-1], age) >= 0.0 for age in ages) and states[-1],
        "all of it is told",
    )
    assert state.altitude == pytest.approx(528.0, abs=2.0)
    assert 90_000.0 < state.pressure < 102_000.0
    assert 0.0 <= state.attitude_error < 0.2


def test_diagnostics_tell_rates_and_what_is_not_seen():
    network = VirtualNetwork(Autopilot(), autopilot_message_rate=0.0).run(5.0)
    _, _, _, values, _ = details_of(network.link, network.now).autopilot
    assert "GLOBAL_POSITION_INT" in values["rates (Hz)"]
    assert "no SCALED_PRESSURE: a wrong estimator" in values["not detected"]
    assert "an uncommanded level sink" in values["not detected"]
    assert values["answers after (s, TIMESYNC)"] < 0.1, "two answers came"


def test_a_stream_that_is_too_slow_is_named_in_the_state_and_in_diagnostics(bench):
    network = Network(bench, autopilot_message_rate=0.0)
    states = bench.follow(VehicleState, "vehicle/state")
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    autopilot = Autopilot()
    autopilot.default_intervals[dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT] = 0.5
    network.plug(autopilot)
    state = bench.until(lambda: states and states[-1].faults and states[-1], "it is told")
    (fault,) = state.faults
    assert fault.startswith("GLOBAL_POSITION_INT comes at 2.")
    assert "(need 5 Hz): another program sets its rate, or the line is full: " in fault
    bench.until(
        lambda: (status := told(diagnostics, "autopilot")) and status.level == b"\x02",
        "diagnostics tell it as well",
    )
    assert told(diagnostics, "autopilot").level == DiagnosticStatus.ERROR
