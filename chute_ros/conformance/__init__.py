"""Tries a real device against each clause of its document. Pure: bytes and time in, bytes and
verdicts out; the clauses of a device are in its own folder, links/*/conformance."""
