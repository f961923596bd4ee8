"""The command line tool: what a person asks a vehicle, and tells it, at a terminal.

The files without ROS turn messages into texts and JSON; session.py, listening.py, calling.py and
node_parameters.py are the thin part that speaks ROS.
"""
