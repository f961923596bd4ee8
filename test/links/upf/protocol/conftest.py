"""Every story of the UPF is told with both layouts of its data types."""

import pytest
from upf_link_bench import LAYOUTS, Bench, layout_of


@pytest.fixture(params=sorted(LAYOUTS))
def layout(request):
    """The types that we ship, then others."""
    return layout_of(request.param)


@pytest.fixture
def definitions(layout):
    return layout.definitions


@pytest.fixture
def bench(layout):
    """Makes benches with the layout."""

    def make(*arguments, **settings):
        return Bench(layout, *arguments, **settings)

    return make
