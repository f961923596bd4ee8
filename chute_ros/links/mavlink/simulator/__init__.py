"""A simulated MAVLink parachute."""
