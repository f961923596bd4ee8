"""Stories that are flown one after the other, each told as it goes."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol, TypeVar

from chute_ros.tools.demo_director import StepFailedError
from faults.flight import Flight


class Named(Protocol):
    """What shall happen."""

    @property
    def name(self) -> str:
        """For people."""


class Told(Protocol):
    """What happened. wrong: why it must not; empty: it may."""

    wrong: str


StoryT = TypeVar("StoryT", bound=Named)
ToldT = TypeVar("ToldT", bound=Told)


def fly_stories(
    stories: Iterable[StoryT], names: tuple[str, ...], fly: Callable[[StoryT, Path, int], ToldT]
) -> list[ToldT]:
    """Every story, or those whose names contain one of names. fly: it, with a folder for its logs
    and its number."""
    every = []
    for number, story in enumerate(stories):
        if names and not any(name in story.name for name in names):
            continue
        print(f"-- {story.name}", flush=True)
        with tempfile.TemporaryDirectory(prefix="chute_ros_hosts_") as folder:
            told = fly(story, Path(folder), number)
        print(f"   {told.wrong or 'correct'}", flush=True)
        every.append(told)
    return every


def in_seconds(value: float) -> str:
    """For a table; NaN: it did not happen."""
    return "-" if math.isnan(value) else f"{value:.2f} s"


@contextmanager
def flown(flight: Flight, told: Told) -> Iterator[None]:
    """A step that does not happen is what is wrong; the flight is over at the end."""
    try:
        yield
    except StepFailedError as error:
        told.wrong = str(error).splitlines()[0]
        print(error)
    finally:
        flight.close()
