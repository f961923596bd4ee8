"""What sensors besides the autopilot publish: the fields of ROS messages that are read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import SimpleNamespace


@dataclass(frozen=True)
class Vector:
    """As geometry_msgs/Vector3."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass(frozen=True)
class Quaternion:
    """As geometry_msgs/Quaternion: of forward-left-up in east-north-up."""

    w: float
    x: float
    y: float = 0.0
    z: float = 0.0


def rolled(roll: float) -> Quaternion:
    """Turned about the axis that points forward, rad; not a number: nobody knows how."""
    return Quaternion(math.cos(roll / 2.0), math.sin(roll / 2.0))


@dataclass(frozen=True)
class Imu:
    """As sensor_msgs/Imu. A covariance of 0: it is not known."""

    orientation: Quaternion
    linear_acceleration: Vector
    orientation_covariance: tuple[float, ...] = (0.0,) * 9
    linear_acceleration_covariance: tuple[float, ...] = (0.0,) * 9


@dataclass(frozen=True)
class Odometry:
    """As nav_msgs/Odometry: pose.pose.position and .orientation, twist.twist.linear."""

    pose: SimpleNamespace
    twist: SimpleNamespace


def odometry(height: float, vertical_speed: float, roll: float) -> Odometry:
    """Of a vehicle that moves up or down only: m over the origin, m/s, rad."""
    pose = SimpleNamespace(position=Vector(z=height), orientation=rolled(roll))
    # What is upward in the world, seen from a body that is rolled.
    along = Vector(y=vertical_speed * math.sin(roll), z=vertical_speed * math.cos(roll))
    twist = SimpleNamespace(linear=along)
    return Odometry(SimpleNamespace(pose=pose), SimpleNamespace(twist=twist))
