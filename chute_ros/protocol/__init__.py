"""Bytes and frames to events and back: no I/O, no ROS, no clock. Time comes in as an argument."""
