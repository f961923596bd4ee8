"""Who tells of the vehicle, where the autopilot is not the only one."""

from __future__ import annotations

from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.scenario import AUTOPILOT_WAYS, Failure, Scenario, Stop, WayFault
from chute_ros.campaign.sensors import SensorFault
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY, VEHICLE_STATE

_SENSORS = {
    VEHICLE_STATE: ("height", "speed", "tilt", "force", "pressure", "estimator"),
    ODOMETRY: ("height", "speed", "tilt"),
    IMU: ("tilt", "force"),
}
_SILENCES = (Failure.REBOOT, Failure.POWER, Failure.HANG)


def outlives(scenario: Scenario) -> bool:
    """The autopilot has no power any more, and another source still tells of the vehicle."""
    return scenario.failure is Failure.POWER and bool(scenario.second_sources)


def may_count(scenario: Scenario, fault: SensorFault | EstimatorFault) -> bool:
    """What this sensor says may be told to the supervisor: its source is the preferred one of
    those that know it, or one that is preferred falls silent at some time."""
    teller = fault.source or VEHICLE_STATE
    for source in scenario.vehicle_sources:
        if source == teller:
            return True
        if fault.sensor in _SENSORS[source] and not _falls_silent(scenario, source):
            return False
    return True


def _falls_silent(scenario: Scenario, source: str) -> bool:
    """At some time, or one of its sensors."""
    is_autopilot = source == VEHICLE_STATE
    ways = AUTOPILOT_WAYS if is_autopilot else (source,)
    for one in scenario.faults:
        if isinstance(one, SensorFault):
            silent = one.how == "gone" and (one.source or VEHICLE_STATE) == source
        else:
            silent = isinstance(one, WayFault) and one.way in ways
            silent |= isinstance(one, Stop) and one.who in ways
        if silent:
            return True
    return is_autopilot and scenario.failure in _SILENCES
