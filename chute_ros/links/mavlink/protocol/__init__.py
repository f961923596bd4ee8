"""The MAVLink parachute protocol, seen from the vehicle's companion computer."""
