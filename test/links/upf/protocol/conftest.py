"""Every story of the UPF is told with both layouts of its data types."""

from collections.abc import Callable
from typing import Any

import pytest
from upf_link_bench import LAYOUTS, Bench, Layout, layout_of

from chute_ros.links.upf.protocol.definitions import Definitions


@pytest.fixture(params=sorted(LAYOUTS))
def layout(request: pytest.FixtureRequest) -> Layout:
    """The types that we ship, then others."""
    return layout_of(request.param)


@pytest.fixture
def definitions(layout: Layout) -> Definitions:
    return layout.definitions


@pytest.fixture
def bench(layout: Layout) -> Callable[..., Bench]:
    """Makes benches with the layout."""

    def make(*arguments: Any, **settings: Any) -> Bench:
        return Bench(layout, *arguments, **settings)

    return make
