"""A parachute on a MAVLink network, and the autopilot beside it."""
