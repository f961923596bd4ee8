"""The full screen of a vehicle as lines that fit it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from chute_ros.plain_text import span_text
from chute_ros.tools.chute.status_text import StatusLine, headline, watch_lines
from chute_ros.tools.chute.view import VehiclePicture
from chute_ros.tools.chute.words import is_old

KEYS = "q ends"


@dataclass(frozen=True)
class Page:
    """banner: the state in large, in its tone; grey: what it shows is old."""

    banner: StatusLine
    lines: tuple[StatusLine, ...]
    grey: bool = False


def page_of(picture: VehiclePicture) -> Page:
    """Everything, the most important first."""
    old = is_old(picture.age)
    if old:
        text = f"LAST WORD {span_text(picture.age)} AGO (WAS {spaced(picture.state)})"
    else:
        text = spaced(headline(picture).text)
    return Page(StatusLine(text, headline(picture).tone), tuple(watch_lines(picture)), grey=old)


def empty_page(namespace: str, around: str, vehicles: Sequence[str], seconds: float) -> Page:
    """Nothing was received yet, for so long (s)."""
    lines = (
        StatusLine(f"  no supervisor is received in {namespace} for {span_text(seconds)}"),
        StatusLine(f"  looked for in: {around}"),
        StatusLine(f"  vehicles found: {', '.join(vehicles) or 'none'}"),
    )
    return Page(StatusLine("NOTHING RECEIVED YET", "quiet"), lines, grey=True)


def spaced(state: str) -> str:
    """The name of a state in large."""
    return " ".join(state.replace("_", " "))
