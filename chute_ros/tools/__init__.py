"""What a person runs besides the nodes."""
