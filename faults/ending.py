"""Ended from outside, a run of faults must leave neither hosts nor mounts nor processes behind."""

from __future__ import annotations

import signal
import sys


def take_down_when_ended(program: str) -> None:
    """SIGTERM and Ctrl-C take down what was set up; so does an interrupt of one that a shell runs
    in its background, where it is ignored otherwise."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(f"{program}: ended from outside"))
    signal.signal(signal.SIGINT, lambda *_: sys.exit(f"{program}: interrupted"))
