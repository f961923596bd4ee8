"""Flights in virtual time: the real core, protocols and simulators, and faults at every layer.

Knows neither ROS, nor sockets, nor the clock. What a device node and the supervisor's node do
between core, protocol and wire is done here by parts that hold the same objects.
"""
