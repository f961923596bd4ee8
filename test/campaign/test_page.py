"""What the page says of the flights, and what is kept of them."""

from __future__ import annotations

from chute_ros.campaign.campaign import FlightSummary, Tally
from chute_ros.campaign.checkpoint import tally_of, text_of
from chute_ros.campaign.judge import Count
from chute_ros.campaign.scenario import Failure
from chute_ros.tools.campaign_page import page

PICTURES = {"delays": "d.svg", "heights": "h.svg"}


def flights(*every: tuple[Failure, Count, str]) -> Tally:
    """As many as there are, of a multirotor, 3 s each; (what fails, counted as, who tells besides
    the autopilot)."""
    tally = Tally(took=3.0 * len(every))
    for seed, (failure, count, second) in enumerate(every):
        who = (seed, "mavlink", "multirotor", failure.value)
        tally.add(FlightSummary(*who, count, "for a test", 1.5, 4.0, (), second))
    return tally


LOST = flights(
    *[(Failure.POWER, Count.NOT_TOLD, "")] * 3,
    *[(Failure.POWER, Count.CORRECT, "imu, odometry")] * 2,
    (Failure.POWER, Count.LATE, "imu"),
    (Failure.MOTOR, Count.CORRECT, "imu"),
)


def test_it_says_what_became_of_those_whose_autopilot_lost_its_power() -> None:
    text = page(LOST, 5, "2 at a time on this machine", PICTURES)
    table = text.split("## Autopilot without power\n\n")[1].split("\n\n")[0]
    assert table.splitlines() == [
        "| besides it | correct | late | not told |",
        "|---|---|---|---|",
        "| nothing | 0 | 0 | 3 |",
        "| imu | 0 | 1 | 0 |",
        "| imu, odometry | 2 | 0 | 0 |",
    ]
    alone = page(flights((Failure.MOTOR, Count.NO_TIME, "")), 5, "", PICTURES)
    assert "## Autopilot without power" not in alone


def test_it_says_how_long_they_took() -> None:
    text = page(LOST, 5, "2 at a time on this machine", PICTURES)
    written = "Written by `make campaign FLIGHTS=7 SEED=5`: 21 s, 20 flights a minute, "
    assert f"{written}2 at a time on this machine.\n" in text


def test_what_is_kept_reads_back_as_it_was() -> None:
    assert tally_of(text_of(LOST, 5, "x"), 5, "x", "kept.json") == LOST
