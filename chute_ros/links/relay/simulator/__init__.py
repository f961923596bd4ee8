"""A simulated relay board."""
