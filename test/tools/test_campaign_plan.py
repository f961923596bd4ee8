"""What many flights take, from the rate of a few."""

from chute_ros.tools.campaign_plan import plan


def test_it_tells_hours_and_core_hours_from_the_rate_of_one_core():
    text = plan(10_000_000, 2.5, 600, None)
    assert text.startswith("10000000 flights, if each core flies 150 a minute, as in the 600 ")
    head, _, one, four, *_, last = text.splitlines()[2:]
    assert head == "| workers, one a core | hours | core hours |"
    assert one == "| 1 | 1111.1 | 1111 |"
    assert four == "| 4 | 277.8 | 1111 |"
    assert last == "| 1024 | 1.1 | 1111 |"


def test_a_price_is_only_what_it_is_given():
    head, _, one, *_ = plan(3600, 1.0, 600, 0.25).splitlines()[2:]
    assert head.endswith("| cost at 0.25 a core hour |")
    assert one == "| 1 | 1.0 | 1 | 0.25 |"
