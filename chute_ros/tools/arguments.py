"""Kinds of arguments that several tools take, each refused in words."""

from __future__ import annotations

import argparse


def positive(text: str) -> int:
    """1 or more."""
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text}: need a whole number, 1 or more")
    return number
