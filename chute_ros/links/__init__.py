"""One folder a device: what its node tells the link for the supervisor, and for a person."""
