"""Coverage-guided fuzzing of what reads foreign bytes; docs/fuzz.md. By `make fuzz`."""
