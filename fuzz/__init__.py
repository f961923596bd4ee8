"""Coverage-guided fuzzing of everything that reads foreign bytes; docs/fuzz.md. By `make fuzz`."""
