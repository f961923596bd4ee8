"""The bench of the nodes' tests, for attacks on running nodes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from node_bench import Bench


@pytest.fixture
def bench(namespace: str) -> Iterator[Bench]:
    """Nodes, simulators and a client of this test alone."""
    one = Bench(namespace)
    yield one
    one.close()
