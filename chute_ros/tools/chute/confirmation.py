"""Asks at the terminal for the typed word without which nothing is released and no motor stops."""

from __future__ import annotations

import os
import sys
import termios
from collections.abc import Sequence

from chute_ros.tools.chute.errors import CommandError, MistakeError


def require_terminal(name: str) -> None:
    """MistakeError where nobody can be asked."""
    if not sys.stdin.isatty():
        raise MistakeError(f"{name}: no terminal to ask at: nothing was sent; --yes does not ask")


def ask(name: str, word: str, told: Sequence[str]) -> None:
    """Show what is told, on standard error, and wait for the word; CommandError if another is
    typed."""
    for line in told:
        print(line, file=sys.stderr)
    print(
        f"type {word} to {name}, anything else to leave it: ", end="", file=sys.stderr, flush=True
    )
    # What was typed before the question is no answer to it.
    termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
    answer = os.read(sys.stdin.fileno(), 1000).decode(errors="replace").strip()
    if answer != word:
        raise CommandError(f"{name}: not confirmed, nothing was sent", {"sent": False})
