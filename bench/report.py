"""Tables of measurements, and how busy the machine was that they were made on."""

from __future__ import annotations

import os
from collections.abc import Sequence

from chute_ros.tools.machine import machine
from chute_ros.tools.pages import summary


def ratios(values: Sequence[float], base: Sequence[float]) -> tuple[str, str]:
    """Of the medians and of the 99th percentiles (summary) to those of base; one that is small is
    told with more digits, as it is none that is not there."""
    first, second = (value / bare for value, bare in zip(values[:2], base[:2], strict=True))
    return _ratio(first), _ratio(second)


#: The heads of what compared returns.
COMPARED = ("median", "99th percentile", "largest", "ratio of medians", "of 99th percentiles")


def compared(values: Sequence[float], base: Sequence[float], told: str) -> tuple[str, ...]:
    """Cells of a table: the summary of values, each as told has it, and the ratios to base."""
    numbers = summary(values)
    return (*(told.format(number) for number in numbers), *ratios(numbers, summary(base)))


def _ratio(value: float) -> str:
    return f"{value:.1f}" if value >= 0.1 else f"{value:.4f}"


def load() -> str:
    """How busy the machine was in the last minute, as a line: to be asked before a measurement."""
    return f"Load before the run: {os.getloadavg()[0]:.1f} (of the last minute)."


def document(sections: Sequence[tuple[str, str]]) -> str:
    """The whole file, of (heading, text); what follows under the same heading goes on with it."""
    said = "Written by `make bench`. The numbers belong to the machine that made them:"
    parts = [f"# Measured\n\n{said}\n{machine()}.\n"]
    before = ""
    for heading, text in sections:
        parts.append(text if heading == before else f"## {heading}\n\n{text}")
        before = heading
    return "\n".join(parts)
