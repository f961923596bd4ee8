"""Vehicles that other people's physics flies, recorded as tapes for the fault campaign."""
