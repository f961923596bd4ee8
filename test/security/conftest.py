"""The bench of the nodes' tests, for attacks on running nodes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

# The benches of the nodes' tests are used here as they are.
sys.path.append(str(Path(__file__).parents[1] / "nodes"))

from node_bench import Bench


@pytest.fixture
def bench(namespace: str) -> Iterator[Bench]:
    """Nodes, simulators and a client of this test alone."""
    one = Bench(namespace)
    yield one
    one.close()
