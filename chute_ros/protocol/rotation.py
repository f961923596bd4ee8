"""Attitudes of aircraft as angles and as quaternions.

Angles: roll, pitch, yaw in rad, as MAVLink's ATTITUDE (forward, right, down in north, east, down).
Quaternions: w, x, y, z, of length 1.
"""

from __future__ import annotations

import math


def quaternion_of(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Of an attitude."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (math.cos(angle / 2.0), math.sin(angle / 2.0)) for angle in (roll, pitch, yaw)
    )
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def angles_of(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Of a quaternion."""
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x)))),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def tilt_of(roll: float, pitch: float) -> float:
    """From upright, rad."""
    return math.acos(max(-1.0, min(1.0, math.cos(roll) * math.cos(pitch))))
