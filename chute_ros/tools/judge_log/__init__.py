"""judge_log: what the supervisor would have done in flights that were flown without it.

A file of a reader (dataflash, telemetry, ulog, bag, table) becomes a FlightLog: what an autopilot
would have sent, as MAVLink messages. recorded_autopilot sends them, log_flight has the real link,
the real core and a simulated parachute hear them in virtual time, and page tells what was decided.
"""
