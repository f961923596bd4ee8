"""A bench for each test of the nodes, and supervisors that are processes of their own."""

from collections.abc import Iterator

import pytest
from node_bench import Bench, bench  # noqa: F401
from supervisor_processes import Pair


@pytest.fixture
def pair(bench: Bench) -> Iterator[Pair]:  # noqa: F811
    """Supervisors to start; what they wrote is shown when the test fails."""
    pair = Pair(bench)
    yield pair
    for each in (pair.processes, *pair.others):
        each.end()
    for name in pair.started:
        print(pair.processes.tail(name, 40))
