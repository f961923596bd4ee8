"""Which combinations of several values are tried in `make test`, and which in `make test-long`."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import pytest


def combinations(*axes: Sequence[Any]) -> list[Any]:
    """Each combination of one value of each axis, for parametrize. Those that are not needed to
    have each pair of values once (of two axes: each value) are long."""
    strength = min(2, len(axes) - 1)
    every = list(itertools.product(*map(range, map(len, axes))))

    def has(places: tuple[int, ...]) -> set[tuple[tuple[int, int], ...]]:
        return set(itertools.combinations(enumerate(places), strength))

    missing, kept = set().union(*map(has, every)), set()
    while missing:
        best = max(every, key=lambda places: len(has(places) & missing))
        kept.add(best)
        missing -= has(best)
    return [
        pytest.param(
            *(axis[k] for axis, k in zip(axes, places, strict=True)),
            marks=() if places in kept else pytest.mark.long,
        )
        for places in every
    ]
