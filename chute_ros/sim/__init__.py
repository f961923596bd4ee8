"""Simulated devices for the bench: what the real ones do on the wire, with faults on demand."""
