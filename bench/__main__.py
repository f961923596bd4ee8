"""Measure all parts one after the other, and write docs/evidence/bench.md."""

from __future__ import annotations

from pathlib import Path

from bench import (
    device_decoding,
    executors,
    kill_switch,
    onlookers,
    umbilical_decoding,
    umbilical_telemetry,
    vehicle,
)
from bench.command import run

if __name__ == "__main__":
    parts = [
        kill_switch,
        executors,
        onlookers,
        vehicle,
        device_decoding,
        umbilical_decoding,
        umbilical_telemetry,
    ]
    run("bench", __doc__ or "", parts, Path("docs/evidence/bench.md"))
