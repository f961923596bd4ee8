"""Measure all parts one after the other, and write docs/bench.md."""

from __future__ import annotations

from pathlib import Path

from bench import kill_switch, umbilical_decoding, umbilical_telemetry
from bench.command import run

if __name__ == "__main__":
    parts = [kill_switch, umbilical_decoding, umbilical_telemetry]
    run("bench", __doc__ or "", parts, Path("docs/bench.md"))
