"""What so many flights say about all others, against values that are known."""

from __future__ import annotations

import pytest

from chute_ros.campaign.confidence import flights_needed, share_at_least, upper_bound


@pytest.mark.parametrize(("share", "flights"), [(0.9, 29), (0.95, 59), (0.99, 299)])
def test_so_many_flights_bound_a_share_by_their_largest(share: float, flights: int) -> None:
    """Wilks 1941: 59 for 95/95, the number of reactor safety."""
    assert flights_needed(share) == flights
    assert upper_bound(range(flights), share) == flights - 1
    assert upper_bound(range(flights - 1), share) is None


@pytest.mark.parametrize(("flights", "left_out"), [(92, 0), (93, 1), (124, 2), (153, 3)])
def test_more_flights_bound_it_by_one_that_is_not_the_largest(flights: int, left_out: int) -> None:
    """Wilks' table of the second, third and fourth largest for 95/95."""
    assert upper_bound(range(flights), 0.95) == flights - 1 - left_out


def test_the_order_of_the_flights_says_nothing() -> None:
    assert upper_bound([5.0, 1.0, 3.0] * 20, 0.9) == upper_bound(sorted([5.0, 1.0, 3.0] * 20), 0.9)


@pytest.mark.parametrize(
    ("good", "flights", "share"),
    [(10, 10, 0.7411), (8, 10, 0.4931), (299, 299, 0.9900), (58, 59, 0.9221), (0, 5, 0.0)],
)
def test_the_share_that_goes_well_is_bounded_from_below(
    good: int, flights: int, share: float
) -> None:
    """Clopper and Pearson 1934, one-sided, as in their tables."""
    assert share_at_least(good, flights) == pytest.approx(share, abs=1e-4)
