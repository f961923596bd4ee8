"""What the command `conformance` needs of a device: its clauses, and how it is reached."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chute_ros.conformance.clause import SOAK, Clause, Risk
from chute_ros.conformance.session import Allowed, Bench, Session
from chute_ros.conformance.virtual import VirtualDevice, VirtualLine


@dataclass(frozen=True)
class Kit:
    """add_options: those of this device; the bench and the wire (transport/wire.py) are made of
    what was chosen. fires: what a person must have made safe before it may fire. simulated: a
    simulated device that breaks this clause (empty: none) where these options of a clause are
    given, and the bench that may do all."""

    document: str
    clauses: tuple[Clause[Any], ...]
    forms: str
    default_connection: str
    add_options: Callable[[ArgumentParser], None]
    bench: Callable[[Namespace, Risk], Bench]
    wire: Callable[[Namespace], Any]
    fires: str
    simulated: Callable[[str, str], tuple[VirtualDevice, Bench]]

    def virtual(self, broken: str) -> VirtualLine:
        """A simulated device that breaks this clause (empty: none), and what tries it, in virtual
        time: all that the clause needs is there and allowed."""
        needs = {one.name: one.needs for one in self.clauses}.get(broken, SOAK)
        device, bench = self.simulated(broken, needs)
        return VirtualLine(
            Session(bench, self.clauses, Allowed(Risk.FIRES, needs.split())), device
        )
