"""Events of a loop's wire, among the events of the protocol."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WireChange:
    """The wire was opened, was closed, or cannot be opened."""

    is_open: bool
    text: str


@dataclass(frozen=True)
class WireTrouble:
    """What is wrong with the open wire has changed; empty: nothing is wrong any more."""

    text: str


@dataclass(frozen=True)
class LoopFault:
    """An exception inside the protocol: a mistake of ours, reported and survived."""

    text: str
