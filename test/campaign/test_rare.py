"""Of each kind of flight a few: the rare ones are flown as well as the common."""

import functools
from collections import Counter
from dataclasses import replace

import pytest

from chute_ros.campaign.draw import draw
from chute_ros.campaign.manoeuvre import Manoeuvre
from chute_ros.campaign.rare import kinds, rare
from chute_ros.campaign.scenario import Failure, Person, Stop
from chute_ros.campaign.sensors import SensorFault
from chute_ros.protocol.vehicle_merge import IMU, VEHICLE_STATE

SEEDS = range(1000, 5000)
PLAIN = replace(
    draw(7), vehicle="upf", failure=Failure.HANG, faults=(), person=None,
    vehicle_sources=(VEHICLE_STATE, IMU), ground=0.0, manoeuvre=None,
)  # fmt: skip
LIES = SensorFault("force", "noise", 1.0, 2.0, IMU)
STOPS = Stop("supervisor", 1.0, 0.5)


def test_every_kind_is_among_them_and_nothing_is_that_has_no_rare_kind(monkeypatch):
    drawn = functools.cache(draw)
    monkeypatch.setattr("chute_ros.campaign.rare.draw", drawn)
    every = Counter(kind for seed in SEEDS for kind in kinds(drawn(seed)))
    for each in (1, 2):
        chosen, flown = rare(SEEDS, each), Counter()
        for seed in chosen:
            assert any(flown[kind] < each for kind in kinds(drawn(seed)))
            flown.update(kinds(drawn(seed)))
        assert {kind for kind in every if flown[kind] < min(each, every[kind])} == set()
        assert chosen == sorted(chosen)
        assert len(chosen) < 0.7 * len(SEEDS)


@pytest.mark.parametrize(
    "other",
    [
        replace(PLAIN, height=PLAIN.height + 1.0, gusts=0.5, failure_at=2.0),
        replace(PLAIN, standby=not PLAIN.standby),
    ],
)
def test_numbers_make_no_other_kind(other):
    assert kinds(other) == kinds(PLAIN)


def test_when_a_fault_begins_and_how_often_makes_no_other_kind():
    once = replace(PLAIN, faults=(LIES, STOPS))
    assert kinds(replace(PLAIN, faults=(STOPS, STOPS, LIES.later(0.5)))) == kinds(once)


@pytest.mark.parametrize(
    ("other", "differ"),
    [
        (replace(PLAIN, vehicle="mavlink"), (True, True, False)),
        (replace(PLAIN, failure=Failure.POWER), (True, True, True)),
        (replace(PLAIN, vehicle_sources=(VEHICLE_STATE,)), (True, True, False)),
        (replace(PLAIN, person=Person("kill", 1.0)), (True, False, False)),
        (replace(PLAIN, faults=(STOPS,)), (True, False, False)),
        (replace(PLAIN, faults=(LIES,)), (True, True, False)),
        (replace(PLAIN, ground=-40.0), (False, False, True)),
        (replace(PLAIN, manoeuvre=Manoeuvre("flip", 400.0, 1.0)), (False, False, True)),
    ],
)
def test_what_fails_who_acts_and_who_lies_makes_another_kind(other, differ):
    assert tuple(a != b for a, b in zip(kinds(other), kinds(PLAIN), strict=True)) == differ


def test_who_lies_and_how_makes_another_kind():
    lies = replace(PLAIN, faults=(LIES,))
    otherwise = replace(PLAIN, faults=(replace(LIES, how="zero"),))
    assert kinds(otherwise)[0] == kinds(lies)[0]
    assert kinds(otherwise)[1] != kinds(lies)[1]
