"""A vehicle as a listener hears it, for the tests of what is shown of it."""

from __future__ import annotations

import math

from builtin_interfaces.msg import Time
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyDecision,
    SafetyState,
    VehicleState,
)

from chute_ros.tools.chute.hearing import ReceivedMessages
from chute_ros.tools.chute.status_text import status_lines
from chute_ros.tools.chute.view import view

#: The listener's monotonic clock and wall clock, s.
NOW, WALL = 1000.0, 1_780_000_000.0


def stamped(message, at=0.0, clock=0.0):
    """message, sent at t+at by a host whose wall clock is ahead by clock."""
    moment = round((WALL + at + clock) * 1e9)
    message.header.stamp = Time(sec=moment // 10**9, nanosec=moment % 10**9)
    return message


def state(**fields):
    """A vehicle that flies with one link."""
    return SafetyState(
        **{
            "supervisor": "safety_supervisor",
            "epoch": 7,
            "state": SafetyState.IN_FLIGHT,
            "state_text": "IN_FLIGHT",
            "links": ["mavlink_parachute"],
            "link_states": [1],
            "link_ages": [0.1],
            "devices_healthy": [True],
            **fields,
        }
    )


def vehicle(**fields):
    return VehicleState(
        **{
            "source": "1/1",
            "link_state": 1,
            "armed": VehicleState.ARMED,
            "armed_age": 0.2,
            "landed_state": VehicleState.IN_AIR,
            "landed_state_age": 0.2,
            "height": 61.25,
            "height_age": 0.1,
            "vertical_speed": -0.04,
            "vertical_speed_age": 0.1,
            "battery_voltage": 15.8,
            "battery_remaining": 0.87,
            "battery_age": 1.2,
            **fields,
        }
    )


def parachute(**fields):
    return ParachuteStatus(
        **{
            "link": "mavlink_parachute",
            "device": "1/161",
            "link_state": 1,
            "state": ParachuteStatus.ARMED,
            "armed": True,
            "backup_voltage": math.nan,
            **fields,
        }
    )


def heartbeat(link="mavlink_parachute", **fields):
    return LinkHeartbeat(link=link, link_state=1, **fields)


class Heard:
    """A picture, and what it shows."""

    def __init__(self):
        self.picture = ReceivedMessages()

    def hears(self, message, at=0.0):
        """A message is received at t+at."""
        kinds = {
            SafetyState: self.picture.hear_state,
            LinkHeartbeat: self.picture.hear_heartbeat,
            ParachuteStatus: self.picture.hear_parachute,
            VehicleState: self.picture.hear_vehicle,
            SafetyDecision: self.picture.hear_decision,
            ActionReport: self.picture.hear_report,
        }
        kinds[type(message)](message, NOW + at, WALL + at)
        return self

    def finds(self, message, at=0.0):
        """A decision of before is found in safety/history at t+at."""
        self.picture.hear_history(message, NOW + at, WALL + at)
        return self

    def view(self, at=0.0):
        return view(self.picture, "/drone1", NOW + at)

    def text(self, at=0.0):
        return [line.text for line in status_lines(self.view(at))]
