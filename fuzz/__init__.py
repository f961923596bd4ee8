"""Coverage-guided fuzzing of what reads foreign bytes; docs/evidence/fuzz.md. By `make fuzz`."""
