"""What each peer decides at its limits, and when: its constants are those of its source."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from chute_ros.campaign.peers.api import Belief, Peer, PeerDecision
from chute_ros.campaign.peers.arducopter import ArduCopter
from chute_ros.campaign.peers.arduplane import ArduPlane
from chute_ros.campaign.peers.px4 import Px4
from chute_ros.campaign.peers.threshold import Threshold
from chute_ros.model import Action

#: An autopilot looks 50 times a second, s.
STEP = 0.02
HOVER = Belief(
    now=0.0,
    armed=True,
    armed_for=20.0,
    landed=False,
    acro=False,
    height=60.0,
    vertical_speed=0.0,
    tilt=0.0,
    commanded_tilt=0.0,
    commanded_altitude=60.0,
    altitude=60.0,
    pressure_height=60.0,
    force=9.81,
)

#: What is otherwise than in a hover, so long after the begin, s.
Course = Callable[[float], dict[str, float]]


def first(peer: Peer, course: Course, lasts: float = 6.0) -> tuple[float, PeerDecision] | None:
    """When the peer orders something, s after the begin of the course, and what."""
    for number in range(100):
        assert peer.step(replace(HOVER, now=number * STEP)) is None, "in a hover"
    for number in range(round(lasts / STEP)):
        passed = number * STEP
        order = peer.step(replace(HOVER, **{"now": 2.0 + passed, **course(passed)}))
        if order is not None:
            return passed, order
    return None


def so(**values: float) -> Course:
    """The same all the time."""
    return lambda _: values


def tumbles(tilt: float) -> Course:
    """It is tilted from the first moment on, and falls."""
    return lambda t: {"tilt": tilt, "pressure_height": 60.0 - 5.0 * t**2, "force": 1.0}


def sinks(speed: float) -> Course:
    """Upright."""
    return lambda t: {
        "vertical_speed": -speed,
        "altitude": 60.0 - speed * t,
        "height": 60.0 - speed * t,
    }


DECIDES = [
    # ArduCopter: 30 degrees from what is commanded, for 1 s.
    # From the first reading of its barometer on that is lower, of 10 a second.
    (ArduCopter(), tumbles(31.0), 1.06, "loss of control"),
    (ArduCopter(), tumbles(29.0), None, ""),
    (ArduCopter(9.0), sinks(9.1), 1.02, "critical sink"),
    (ArduCopter(9.0), sinks(8.9), None, ""),
    (ArduCopter(), sinks(20.0), None, ""),
    # ArduPlane: a critical sink alone.
    (ArduPlane(9.0), sinks(9.1), 1.02, "critical sink"),
    (ArduPlane(9.0), tumbles(170.0), None, ""),
    (ArduPlane(), sinks(20.0), None, ""),
    # PX4: 60 degrees for 0.3 s, or a loss of altitude for 1 s.
    (Px4(), tumbles(61.0), 0.3, "failure detector"),
    (Px4(), tumbles(-61.0), 0.3, "failure detector"),
    (Px4(), tumbles(59.0), None, ""),
    (Px4(), sinks(20.0), None, ""),
    # Of 10 m at 10 m/s: beyond them after 1.04 s, as it was first below at 0.02 s.
    (Px4(10.0), sinks(10.0), 2.04, "failure detector"),
    (Threshold(), tumbles(61.0), 0.5, "threshold"),
    (Threshold(), sinks(10.1), 0.5, "threshold"),
    (Threshold(), sinks(9.9), None, ""),
    (Threshold(), tumbles(59.0), None, ""),
    (Threshold(wing=True), tumbles(79.0), None, ""),
    (Threshold(wing=True), tumbles(81.0), 0.5, "threshold"),
]


@pytest.mark.parametrize(
    ("peer", "course", "at", "rule"),
    DECIDES,
    ids=[f"{type(one[0]).__name__}-{number}" for number, one in enumerate(DECIDES)],
)
def test_a_peer_decides_at_its_limit_and_after_its_time(
    peer: Peer, course: Course, at: float | None, rule: str
) -> None:
    found = first(peer, course)
    if at is None:
        assert found is None
        return
    assert found is not None
    when, order = found
    assert when == pytest.approx(at, abs=1e-9)
    assert (order.action, order.rule) == (Action.DEPLOY, rule)
    assert order.reasons


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_scaled_limits_and_times_are_scaled(scale: float) -> None:
    # Twice as far and for twice as long, or half of both.
    for make, tilt, after in (
        (lambda: ArduCopter(0.0, scale), 31.0, 1.0),
        (lambda: Px4(0.0, scale), 61.0, 0.3),
        (lambda: Threshold(False, scale), 61.0, 0.5),
    ):
        assert first(make(), tumbles(scale * (tilt - 2.0))) is None
        found = first(make(), tumbles(scale * tilt))
        assert found is not None
        assert found[0] == pytest.approx(after * scale, abs=0.1)


def test_arducopter_counts_back_while_it_is_upright() -> None:
    """Given 0.6 s out of control, then 0.4 s upright, 0.8 s more are needed, not 1 s."""
    fall = tumbles(40.0)

    def course(passed: float) -> dict[str, float]:
        return {**fall(passed), "tilt": 0.0 if 0.6 <= passed < 1.0 else 40.0}

    found = first(ArduCopter(), course)
    assert found is not None
    assert found[0] == pytest.approx(1.8, abs=0.1)


@pytest.mark.parametrize("otherwise", [{"pressure_height": 60.0}, {"height": 9.0}])
def test_arducopter_releases_nothing_that_does_not_fall_or_is_too_low(otherwise: dict) -> None:
    fall = tumbles(40.0)
    sinking = {"vertical_speed": -12.0, **otherwise}
    found = first(ArduCopter(9.0), lambda t: {**fall(t), **sinking}, 1.9)
    if "height" in otherwise:
        assert found is None
    else:
        # Its sink alone is enough.
        assert found is not None
        assert found[1].rule == "critical sink"
        assert first(ArduCopter(), lambda t: {**fall(t), **otherwise}, 1.9) is None


def test_arducopter_that_loses_control_above_its_lowest_height_releases_below_it() -> None:
    found = first(ArduCopter(), lambda t: {**tumbles(40.0)(t), "height": 14.0 - 10.0 * t})
    assert found is not None
    assert found[0] == pytest.approx(1.0, abs=0.1)


def test_arducopter_that_lies_on_its_back_is_disarmed_after_two_seconds() -> None:
    """It does not fall, so that no parachute comes: the crash check stops the motors."""
    found = first(ArduCopter(), so(tilt=170.0, height=0.5))
    assert found is not None
    when, order = found
    assert when == pytest.approx(2.0)
    assert (order.action, order.rule) == (Action.KILL, "crash")
    # What still accelerates has not come to rest.
    assert first(ArduCopter(), so(tilt=170.0, height=0.5, force=1.0)) is None


def test_px4_only_disarms_right_after_the_arming() -> None:
    early = first(Px4(), so(tilt=90.0, armed_for=3.9))
    assert early is not None
    assert early[1].action is Action.KILL
    later = first(Px4(), so(tilt=90.0, armed_for=4.0))
    assert later is not None
    assert later[1].action is Action.DEPLOY


def test_px4_that_is_told_to_descend_has_lost_no_altitude() -> None:
    def course(passed: float) -> dict[str, float]:
        there = 60.0 - 8.0 * passed
        return {"altitude": there, "commanded_altitude": there}

    assert first(Px4(10.0), course) is None


@pytest.mark.parametrize("make", [ArduCopter, Px4, Threshold, lambda: ArduPlane(9.0)])
@pytest.mark.parametrize("otherwise", [{"armed": False}, {"tilt": math.nan}])
def test_what_is_disarmed_or_unknown_is_left_alone(
    make: Callable[[], Peer], otherwise: dict[str, float]
) -> None:
    assert first(make(), lambda t: {**tumbles(90.0)(t), **otherwise}) is None


@pytest.mark.parametrize("make", [ArduCopter, Threshold, lambda: ArduPlane(9.0)])
def test_what_has_landed_is_left_alone(make: Callable[[], Peer]) -> None:
    down = {"vertical_speed": -15.0, "landed": True}
    assert first(make(), lambda t: {**tumbles(90.0)(t), **down}) is None
    # PX4 asks nobody whether it has landed.
    assert first(Px4(), so(tilt=90.0, landed=True)) is not None


@pytest.mark.parametrize("make", [ArduCopter, lambda: Px4(10.0)])
def test_in_acro_attitudes_are_nobodys_business(make: Callable[[], Peer]) -> None:
    flips = {"tilt": 180.0, "acro": True, "altitude": 30.0}
    assert first(make(), lambda t: {**tumbles(180.0)(t), **flips}) is None
