"""What vehicles do besides flying: landings, flights one after the other, moving decks, wings that
take over from rotors, autopilots that restart again and again."""

from __future__ import annotations

import math

import pytest
from campaign_bench import correct, fired, flown, left_alone
from combinations import combinations

from chute_ros.campaign.manoeuvre import Manoeuvre, landing
from chute_ros.campaign.scenario import Autopilot, Failure, Stop
from chute_ros.sim.autopilot_kinds import KINDS


@pytest.mark.parametrize(("touches", "slope"), combinations([0.5, 2.0, 4.0], [0.0, 25.0]))
def test_a_landing_soft_or_hard_level_or_on_a_slope_ends_no_flight(touches, slope) -> None:
    end = left_alone(
        flown(Failure.NOTHING, height=20.0, manoeuvre=landing(20.0, 3.0, touches, 0.5, slope))
    )
    assert end.landing_speed == pytest.approx(touches, abs=0.3)


def test_it_bounces_and_then_stands_and_is_disarmed() -> None:
    end = flown(Failure.NOTHING, height=15.0, manoeuvre=landing(15.0, 3.0, 4.0, 0.5))
    said = [text for at, text in end.said if at > end.landed]
    assert any("IN_FLIGHT -> LANDED" in text for text in said), said


@pytest.mark.parametrize(("kind", "arms"), combinations(list(KINDS), [True, False]))
def test_a_second_flight_without_a_reset_is_watched_as_the_first(kind, arms) -> None:
    end = correct(flown(Failure.MOTOR, flights=2, arms=arms, autopilot=Autopilot(kind=kind)))
    assert end.released < end.truth.at + 1.0


def test_a_deck_that_moves_blocks_nothing_and_releases_nothing() -> None:
    stands = flown(Failure.NOTHING, height=0.0, deck=1.5)
    assert not stands.grounded
    assert not fired(stands)
    correct(flown(Failure.MOTOR, deck=1.5))


@pytest.mark.parametrize(("tilt", "sink"), [(30.0, 5.0), (-40.0, -4.0)])
def test_wings_that_take_over_from_rotors_are_no_fall(tilt, sink) -> None:
    wing = {"profile": "fixed_wing", "vehicle": "mavlink"}
    left_alone(
        flown(Failure.NOTHING, manoeuvre=Manoeuvre("transition", tilt, 0.5, 4.0, sink), **wing)
    )


def test_an_autopilot_that_restarts_again_and_again_hides_no_fall() -> None:
    again = (Stop("autopilot", 1.8 + 1.7 * k, 0.7, dies=True) for k in range(4))
    end = correct(flown(Failure.REBOOT, *again, height=120.0))
    assert not math.isnan(end.released)
