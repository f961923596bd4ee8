"""The standard atmosphere."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Air:
    """The standard atmosphere at one height. temperature: K, pressure: Pa, density: kg/m^3."""

    temperature: float
    pressure: float
    density: float


def air_at(altitude: float) -> Air:
    """The standard atmosphere this many metres above the sea, up to 11 km."""
    temperature = 288.15 - 0.0065 * max(-1000.0, min(11_000.0, altitude))
    pressure = 101_325.0 * (temperature / 288.15) ** 5.255876
    return Air(temperature, pressure, pressure / (287.053 * temperature))
