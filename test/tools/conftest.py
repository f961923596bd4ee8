"""What tests of several tools look at: one flight of the core in a black box, and two of the
simulated autopilot as judge_log's logs have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from flight_bench import Flight
    from log_bench import Told


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """It has landed."""
    # Here, as below: other tests run without what it takes.
    from flight_bench import Flight

    one = Flight(tmp_path_factory.mktemp("flight")).fly()
    one.land()
    return one


@pytest.fixture(scope="session")
def landed() -> list[Told]:
    """It takes off and lands."""
    from log_bench import LANDED_AT, LANDS, flown

    return flown(LANDS, LANDED_AT + 3.0)


@pytest.fixture(scope="session")
def fallen() -> list[Told]:
    """A motor fails at FAILS_AT."""
    from log_bench import FAILS, FAILS_AT, flown

    return flown(FAILS, FAILS_AT + 5.0)
