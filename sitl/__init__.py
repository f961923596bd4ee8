"""Real autopilots in their own simulators, flown with the real nodes, judged by the truth."""
