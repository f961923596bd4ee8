"""Protocol of an output that is written and never answers."""
