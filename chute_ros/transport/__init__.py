"""Opens, reads, writes and reopens the wire. Knows nothing of what the bytes mean."""
