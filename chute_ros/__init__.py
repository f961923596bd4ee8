"""Connects a vehicle to its parachute and decides when to block flight, kill and deploy."""
