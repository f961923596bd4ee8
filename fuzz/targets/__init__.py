"""The targets by their names. A group of them is imported only when one of it is used: what a
fuzzer has not imported it need not put its instruments into."""

from __future__ import annotations

import importlib
from collections.abc import Iterable

from fuzz.target import Target

#: Module -> the targets in it.
GROUPS = {
    "mavlink_frames": ("mavlink.raw", "mavlink.mended", "mavlink.signed"),
    "mavlink_link": ("mavlink.link", "mavlink.link_signed"),
    "can": ("can.multicast", "can.slcan"),
    "upf_frames": ("upf.frames", "upf.transfers"),
    "upf_link": ("upf.link", "upf.link_triggers"),
    "umbilical_lines": ("umbilical.stream", "umbilical.lines"),
    "umbilical_link": ("umbilical.link",),
    "files": (
        *("files.record", "files.left", "files.profile", "files.address", "files.key"),
        *("files.layout", "files.node_ids", "files.mcap"),
    ),
    "handover": ("supervisor.handover",),
    "recordings": ("recordings.turns", "recordings.box", "recordings.parameters"),
    "simulated": ("simulated.parachute", "simulated.upf", "simulated.flight_computer"),
}
NAMES = tuple(name for names in GROUPS.values() for name in names)


def target_of(name: str) -> Target:
    """The target of this name; KeyError: there is none."""
    group = next((group for group, names in GROUPS.items() if name in names), None)
    if group is None:
        raise KeyError(name)
    return next(one for one in targets_in(group) if one.name == name)


def targets_in(group: str) -> Iterable[Target]:
    """All of one group."""
    targets: Iterable[Target] = importlib.import_module(f"fuzz.targets.{group}").TARGETS
    return targets
