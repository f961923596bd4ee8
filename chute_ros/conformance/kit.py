"""What the command `conformance` needs of a device: its clauses, and how it is reached."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chute_ros.conformance.clause import Clause, Risk
from chute_ros.conformance.session import Bench, Session
from chute_ros.conformance.virtual import Device


@dataclass(frozen=True)
class Simulated:
    """All that the clauses need is there and allowed."""

    device: Device
    session: Session[Any]


@dataclass(frozen=True)
class Kit:
    """add_options: those of this device; the bench and the wire (transport/wire.py) are made of
    what was chosen. fires: what a person must have made safe before it may fire. simulated: a
    simulated device that breaks this clause (empty: none), in virtual time, and what tries it."""

    document: str
    clauses: tuple[Clause[Any], ...]
    forms: str
    default_connection: str
    add_options: Callable[[ArgumentParser], None]
    bench: Callable[[Namespace, Risk], Bench]
    wire: Callable[[Namespace], Any]
    fires: str
    simulated: Callable[[str], Simulated]
