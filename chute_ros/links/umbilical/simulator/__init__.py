"""A simulated flight computer of a rocket."""
