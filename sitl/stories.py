"""The stories that every autopilot is flown through, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sitl.autopilots import KINDS
from sitl.flight import Flight
from sitl.vehicle import Setup


@dataclass(frozen=True)
class Story:
    """name: as the page and STORIES= have it. fly: it, to its end."""

    name: str
    text: str
    fly: Callable[[Flight], None]
    setup: Setup = Setup()
    kinds: tuple[str, ...] = KINDS
    #: What it leaves behind is not fit for another story.
    spoils: bool = False
    #: Processes start anew in it, and are silent meanwhile.
    restarts: bool = False


def every() -> dict[str, Story]:
    """All of them, in the order of the page."""
    from sitl import stories_air, stories_ground, stories_kill, stories_motors, stories_wires

    parts = (stories_ground, stories_air, stories_motors, stories_kill, stories_wires)
    return {story.name: story for part in parts for story in part.STORIES}
