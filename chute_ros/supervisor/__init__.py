"""Decides when to block flight, kill and deploy: pure, from inputs and a time to decisions."""
