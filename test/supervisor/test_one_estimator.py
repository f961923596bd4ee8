"""Height, vertical speed and attitude of an autopilot are one estimator: when it goes wrong it is
wrong with itself, and neither ends a flight that goes well nor releases on the ground."""

import copy
import functools
import math
from collections.abc import Iterator
from random import Random
from typing import Any

import pytest
from combinations import combinations
from hypothesis import given, settings
from hypothesis import strategies as st
from story import DOWN, Story, falling, pressure_at, shipped

from chute_ros.model import Action, Armed, LandedState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.contradictions import GRAVITY, least_drop
from chute_ros.supervisor.machine import Stage

EVERY = 0.1
PROFILES = ("multirotor", "fixed_wing")
AIRCRAFT = pytest.mark.parametrize("profile", PROFILES)


class Teller:
    """Tells ten times a second, with the noise of real sensors; its devices confirm."""

    def __init__(self, story: Story, seed: int = 11) -> None:
        self.story, self.random, self.true_height = story, Random(seed), 0.0

    def noise(self, width: float) -> float:
        return width * (self.random.random() - 0.5)

    def tell(self, **told: Any) -> None:
        story = self.story
        if "force" in told:
            told["acceleration"] = abs(told.pop("force") + self.noise(0.4))
        if "true_height" in told:
            self.true_height = told["true_height"]
            told["pressure"] = pressure_at(told.pop("true_height") + self.noise(0.4))
        inputs = [story.heartbeat(), story.told(**told)]
        fired = [one for one in story.decisions() if one.action >= Action.KILL]
        if fired:
            inputs.append(story.report(fired[-1].action, Outcome.CONFIRMED))
        story.at(story.t + EVERY, *inputs)

    def fork(self) -> "Teller":
        """Another one that goes on from here."""
        other = copy.copy(self)
        other.story, other.random = self.story.fork(), copy.copy(self.random)
        return other

    def silence(self, until: float) -> None:
        """Nothing is told of the vehicle but what comes next, at that time."""
        story = self.story
        while story.t < until - EVERY:
            story.at(story.t + EVERY, story.heartbeat())

    def stand(self, seconds: float, **told: Any) -> None:
        down = {**DOWN, "height": 0.0, "vertical_speed": 0.0, "tilt": 1.0, "force": 9.8}
        for _ in range(round(seconds / EVERY)):
            parts = {**down, **told}
            parts["vertical_speed"] += self.noise(0.03)
            self.tell(**parts)

    def hover(self, seconds: float, height: float, **told: Any) -> None:
        while "true_height" in told and self.true_height < height:
            now = min(height, self.true_height + 8.0 * EVERY)
            self.tell(height=now, vertical_speed=8.0, tilt=3.0, force=9.8, true_height=now)
        for _ in range(round(seconds / EVERY)):
            speed = self.noise(0.2)
            self.tell(height=height, vertical_speed=speed, **{"tilt": 3.0, "force": 9.8, **told})


def told_to(profile: str) -> Teller:
    story = Story(shipped(profile))
    story.ready()
    return Teller(story)


def hovering(
    profile: str, height: float, seconds: float, barometer: bool = True, stood: float = 1.0
) -> Teller:
    """It stood for so long, s, climbed to this height, m, and has hovered there for so long, s."""
    return _hovering(profile, height, seconds, barometer, stood).fork()


@functools.cache
def _hovering(
    profile: str, height: float, seconds: float, barometer: bool, stood: float
) -> Teller:
    """Once for all stories that begin so."""
    teller = told_to(profile)
    teller.stand(stood, **({"true_height": 0.0} if barometer else {}))
    teller.hover(seconds, height, **({"true_height": height} if barometer else {}))
    return teller


def deployed(teller: Teller) -> bool:
    return "DEPLOY" in teller.story.fired()


# -- on the ground ----------------


@AIRCRAFT
@pytest.mark.parametrize("rate", [8.0, 19.0, 60.0])
@pytest.mark.parametrize("barometer", [True, False])
def test_an_attitude_that_runs_away_on_the_ground_releases_nothing(profile, rate, barometer):
    """Given throttle up at take-off, IN_AIR said, and one estimator that leans over and, believing
    that, sinks: its height was never above 0 m."""
    teller, height, speed = told_to(profile), 0.0, 0.0
    truth = {"true_height": 0.0} if barometer else {}
    teller.stand(2.0, **truth)
    for k in range(120):
        lean = min(95.0, rate * EVERY * k)
        speed -= 0.981 * (1.0 - math.cos(math.radians(lean)))
        height += EVERY * speed
        teller.tell(height=height, vertical_speed=speed, tilt=lean, force=9.8, **truth)
    assert not deployed(teller)


@AIRCRAFT
@settings(max_examples=25)
@given(
    pushes=st.lists(st.floats(-6.0, 6.0), min_size=2, max_size=6),
    leans=st.lists(st.floats(-60.0, 60.0), min_size=2, max_size=6),
)
def test_whatever_way_one_estimator_runs_on_the_ground_nothing_is_released(profile, pushes, leans):
    """Given a barometer that tells 0 m, and a height that runs up as well as down."""
    teller = told_to(profile)
    teller.stand(1.0, true_height=0.0)
    height = speed = tilt = 0.0
    for k in range(100):
        speed += EVERY * pushes[k * len(pushes) // 100]
        tilt = min(max(tilt + EVERY * leans[k * len(leans) // 100], 0.0), 170.0)
        height += EVERY * speed
        teller.tell(height=height, vertical_speed=speed, tilt=tilt, force=9.8, true_height=0.0)
    assert not deployed(teller)


def test_one_that_runs_away_at_touch_down_releases_nothing():
    teller = told_to("multirotor")
    teller.stand(2.0, true_height=0.0)
    teller.hover(4.0, 40.0, true_height=40.0)
    for k in range(200):
        low = max(40.0 - 0.2 * k, 0.0)
        teller.tell(height=low, vertical_speed=-2.0, tilt=3.0, force=9.8, true_height=low)
    for sign in (1.0, -1.0):
        for k in range(60):
            run = sign * 0.05 * k**2
            tilt = min(2.0 * k, 120.0)
            speed = sign * k - 8.0
            teller.tell(height=run, vertical_speed=speed, tilt=tilt, force=9.8, true_height=0.0)
    assert not deployed(teller)


# -- in the air ----------------


@pytest.mark.parametrize(
    ("profile", "told", "force", "row"),
    combinations(
        PROFILES,
        [{"reboot_count": 1, "rebooted_in_flight": True}, {"system_status": 6}],
        [0.3, 2.0, 3.5],
        [2, 3, 5],
    ),
)
def test_an_accelerometer_that_fails_beside_what_an_autopilot_says_ends_no_hover(
    profile, told, force, row
):
    """What it says of itself is no sign of a fall; the force is one, which all else denies."""
    teller = hovering(profile, 60.0, 4.0)
    teller.hover(1.0, 60.0, true_height=60.0, **told)
    teller.hover(row * EVERY, 60.0, true_height=60.0, force=force, **told)
    teller.hover(1.0, 60.0, true_height=60.0, **told)
    assert teller.story.fired() == []


@pytest.mark.parametrize(
    ("profile", "drift", "barometer"),
    combinations(PROFILES, [1.5, 2.0, 3.0, 4.0, 6.0], [True, False]),
)
def test_an_estimator_that_sinks_while_the_vehicle_hovers_ends_no_flight(
    profile, drift, barometer
):
    """Given a force of 9.8 +- 0.2 all the time, and height and speed that drift down together."""
    teller = hovering(profile, 60.0, 6.0, barometer, stood=1.0 if barometer else 0.0)
    truth, height, speed = {"true_height": 60.0} if barometer else {}, 60.0, 0.0
    for _ in range(80):
        speed -= EVERY * drift
        height += EVERY * speed
        teller.tell(height=height, vertical_speed=speed, tilt=3.0, force=9.8, **truth)
    assert teller.story.fired() == []
    assert any("vertical_speed is contradicted" in one for one in teller.story.alarms())


@AIRCRAFT
@pytest.mark.parametrize("every", [0.05, 0.1, 0.15, 0.18, 0.2, 0.22])
@pytest.mark.parametrize("targets", [False, True])
def test_an_estimator_that_sinks_in_a_hover_is_denied_by_force_at_each_rate(
    profile, every, targets
):
    """Given no barometer; and the least rate that the profiles allow, 5 Hz, and its jitter."""
    teller = told_to(profile)
    story, height, speed = teller.story, 60.0, 0.0
    told = {"target_vertical_speed": 0.0, "attitude_error": 2.0} if targets else {}
    until = story.t + 14.0
    while story.t < until:
        speed -= 3.0 * every * (story.t > until - 8.0)
        height += every * speed
        told |= {"acceleration": 9.8 + teller.noise(0.8), "tilt": 3.0 + teller.noise(2.0)}
        felt = {"height": height, "vertical_speed": speed + teller.noise(0.2)}
        story.at(story.t + every, story.heartbeat(), story.told(**felt, **told))
    assert story.fired() == []
    assert any("vertical_speed is contradicted" in one for one in story.alarms())


@AIRCRAFT
@settings(max_examples=25)
@given(
    pushes=st.lists(st.floats(-8.0, 8.0), min_size=2, max_size=6),
    leans=st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=6),
)
def test_whatever_way_one_estimator_runs_in_a_level_hover_it_ends_no_flight(
    profile, pushes, leans
):
    teller = hovering(profile, 60.0, 3.0)
    height, speed, tilt = 60.0, 0.0, 3.0
    for k in range(100):
        speed += EVERY * pushes[k * len(pushes) // 100]
        tilt = min(max(tilt + EVERY * leans[k * len(leans) // 100], 0.0), 170.0)
        height += EVERY * speed
        teller.tell(height=height, vertical_speed=speed, tilt=tilt, force=9.8, true_height=60.0)
    assert teller.story.fired() == []


#: What an autopilot may say of itself, truly or not.
SAYS: tuple[dict[str, Any], ...] = (
    {},
    {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND},
    {"reboot_count": 1, "rebooted_in_flight": True},
    {"system_status": 6},
    {"battery_remaining": 0.0},
)


@AIRCRAFT
@pytest.mark.parametrize("says", SAYS, ids=str)
@settings(max_examples=5)
@given(
    lies=st.sampled_from(["estimator", "accelerometer", "barometer"]),
    sink=st.sampled_from([0.0, 1.0, 2.0]),
    pushes=st.lists(st.floats(-9.0, 3.0), min_size=2, max_size=4),
    leans=st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=4),
    forces=st.lists(st.floats(0.0, 9.0), min_size=2, max_size=8),
)
def test_whatever_one_origin_tells_beside_what_an_autopilot_says_it_ends_no_flight(
    profile, says, lies, sink, pushes, leans, forces
):
    """Given a level hover or a slow descent: of estimator, accelerometer and barometer one is
    wrong, in any way. No rule takes it for two signs."""
    teller = hovering(profile, 100.0, 4.0)
    true_height, error, height, tilt = 100.0, 0.0, 100.0, 3.0
    for k in range(80):
        true_height -= EVERY * sink
        told = {"height": true_height, "vertical_speed": -sink, "tilt": 3.0, "force": 9.8}
        barometer = true_height
        error += EVERY * pushes[k * len(pushes) // 80]
        if lies == "estimator":
            height += EVERY * (error - sink)
            tilt = min(max(tilt + EVERY * leans[k * len(leans) // 80], 0.0), 175.0)
            told |= {"height": height, "vertical_speed": error - sink, "tilt": tilt}
        elif lies == "accelerometer":
            told["force"] = forces[k * len(forces) // 80]
        else:
            barometer += 0.5 * error * EVERY * k
        told["vertical_speed"] += teller.noise(0.2)
        teller.tell(**told, **says, true_height=barometer)
    assert teller.story.fired() == []


@AIRCRAFT
@pytest.mark.parametrize("gap", [1.5, 3.0, 6.0])
@pytest.mark.parametrize("drift", [3.0, 5.0])
def test_one_that_runs_away_while_nothing_is_heard_of_it_ends_no_flight(profile, gap, drift):
    """Given an autopilot that hangs, or whose messages are lost, while its estimator sinks and
    leans over ever more: as it is back, its barometer tells how far it has not come down."""
    teller = hovering(profile, 90.0, 4.0)
    story = teller.story
    teller.silence(story.t + gap)
    for k in range(20):
        ran = gap + k * EVERY
        height, speed = 90.0 - drift * ran**2 / 2.0, -drift * ran
        tilt = min(130.0, 15.0 * ran)
        teller.tell(height=height, vertical_speed=speed, tilt=tilt, force=9.8, true_height=90.0)
    assert story.fired() == []


@given(
    forces=st.lists(st.floats(0.0, 30.0), min_size=1, max_size=60),
    begin=st.floats(-30.0, 30.0),
    back=st.integers(1, 60),
)
def test_what_falls_has_come_down_by_what_is_asked_of_it(forces, begin, back):
    """Given any force upwards, and any speed when the silence began; from its highest on."""
    sinks, lost = [begin], [0.0]
    for force in forces:
        sinks.append(sinks[-1] + EVERY * (GRAVITY - force))
        lost.append(lost[-1] + EVERY * (sinks[-2] + sinks[-1]) / 2.0)
    before = max(0, len(lost) - 1 - back)
    passed = EVERY * (len(lost) - 1 - before)
    if sinks[-1] > 0.0:
        # Between two steps it may have been a little higher still.
        highest = min(lost[before:]) - EVERY**2 * 30.0 / 8.0
        assert lost[-1] - highest >= least_drop(sinks[-1], passed)


@pytest.mark.parametrize(
    ("profile", "gap", "heard_before"), combinations(PROFILES, [0.6, 1.5, 3.0], [0.3, 1.0])
)
def test_one_that_falls_while_nothing_is_heard_of_it_is_released_no_later_with_a_barometer(
    profile, gap, heard_before
):
    """Given the same silence, which begins so long before its motors stop; then in any order."""
    released = {}
    for barometer in (True, False):
        teller = hovering(profile, 200.0, 4.0, barometer)
        story, fell_at = teller.story, teller.story.t + heard_before
        teller.silence(fell_at - heard_before + gap)
        while not deployed(teller) and story.t < fell_at + 8.0:
            told = falling(max(0.0, story.t + EVERY - fell_at), 200.0)
            force = told.pop("acceleration") if story.t > fell_at else 9.8
            truth = {"true_height": told["height"]} if barometer else {}
            tilt = 3.0 if story.t < fell_at else 120.0
            teller.tell(force=force, tilt=tilt, **told, **truth)
        released[barometer] = story.t - fell_at
    assert released[True] <= released[False] + EVERY + 1e-6


@AIRCRAFT
def test_one_that_climbs_and_falls_while_nothing_is_heard_of_it_is_released(profile):
    """Given a silence of 4 s in which it climbs by 20 m and then falls for 1.5 s: it is higher
    than before, and is believed as soon as its barometer tells a rate."""
    teller = hovering(profile, 200.0, 4.0)
    story, fell_at = teller.story, teller.story.t + 2.5
    back_at = fell_at + 1.5
    teller.silence(back_at)
    while not deployed(teller) and story.t < back_at + 5.0:
        told = falling(story.t + EVERY - fell_at, 220.0)
        force = told.pop("acceleration")
        teller.tell(force=force, tilt=120.0, **told, true_height=told["height"])
    assert story.t < back_at + 1.5


@pytest.mark.parametrize(
    ("profile", "rate", "sink"), combinations(PROFILES, [12.0, 25.0, 50.0], [1.5, 3.0, 4.5])
)
def test_an_estimator_that_leans_over_in_a_descent_by_hand_ends_no_flight(profile, rate, sink):
    """Given one that sinks as what leans so would, above what its barometer and its force tell."""
    teller, true, speed = hovering(profile, 60.0, 2.0), 60.0, -sink
    for k in range(30):
        now = -sink * min(1.0, k / 10.0)
        true += EVERY * now
        teller.tell(height=true, vertical_speed=now, tilt=5.0, force=9.8, true_height=true)
    height = true
    for k in range(80):
        lean = min(95.0, 5.0 + rate * EVERY * k)
        speed -= EVERY * GRAVITY * (1.0 - math.cos(math.radians(lean)))
        height, true = height + EVERY * speed, true - EVERY * sink
        teller.tell(height=height, vertical_speed=speed, tilt=lean, force=9.8, true_height=true)
    assert teller.story.fired() == []


@pytest.mark.parametrize("says", [{}, DOWN], ids=["flying", "disarmed"])
@pytest.mark.parametrize("noise", [6.0, 0.2])
@pytest.mark.parametrize("carried", [False, True])
def test_an_estimator_that_says_hover_hides_no_fall_from_the_barometer(says, noise, carried):
    """Given a tumble whose height and speed are told as in a hover, with noise, also by one that
    started anew, and says that it stands with its motors off. carried: by its drag, from the first
    second on."""
    teller = hovering("multirotor", 100.0, 4.0)
    start = teller.story.t
    for k in range(40):
        t = EVERY * k
        drop = 20.0**2 / 9.81 * math.log(math.cosh(9.81 * t / 20.0))
        teller.tell(
            height=100.0,
            vertical_speed=teller.noise(noise),
            tilt=min(160.0, 230.0 * t),
            force=12.0 if carried and t > 1.0 else 6.0 + 4.0 * math.sin(9.0 * t),
            **says,
            true_height=100.0 - drop,
        )
    assert teller.story.fired()[:2] == ["KILL", "DEPLOY"]
    assert teller.story.when(Action.DEPLOY) - start < 2.5


@AIRCRAFT
@pytest.mark.parametrize(("turns", "thrust"), [(1.5, 0.7), (2.0, 0.6), (2.0, 0.7), (2.5, 0.7)])
def test_a_tumble_with_some_of_its_thrust_is_not_hidden_by_a_hovering_estimator(
    profile, turns, thrust
):
    """Given a last speed of 12 m/s: barometer and accelerometer are two origins against one.
    turns: rad/s; thrust: of its weight."""
    teller = hovering(profile, 110.0, 4.0)
    start, height, speed = teller.story.t, 110.0, 0.0
    while height > 40.0 and not deployed(teller):
        lean = turns * (teller.story.t - start)
        drag = GRAVITY * (speed / 12.0) ** 2
        side, up = thrust * GRAVITY * math.sin(lean), thrust * GRAVITY * math.cos(lean) + drag
        speed += EVERY * (up - GRAVITY)
        height += EVERY * speed
        told = {"height": 110.0 + teller.noise(0.1), "vertical_speed": teller.noise(0.2)}
        teller.tell(**told, tilt=3.0, force=math.hypot(side, up), true_height=height)
    assert deployed(teller)
    assert height > 60.0


# -- accelerometers ----------------


def test_an_imu_without_gravity_is_named_and_forbids_the_take_off():
    teller = told_to("multirotor")
    teller.stand(4.0, force=0.2)
    assert teller.story.state.stage is Stage.BLOCKED
    said = teller.story.said()
    assert "acceleration cannot be used: it reports 0." in said
    assert "while the vehicle stands (need 7.8 to 11.8" in said
    # Then its driver is set right.
    teller.stand(3.0, force=9.8)
    assert teller.story.state.stage is Stage.READY


def test_an_imu_without_gravity_ends_no_flight_and_hides_no_landing():
    """Given one that nobody saw on the ground: a steep turn, level, and a landing."""
    teller = told_to("multirotor")
    teller.hover(4.0, 40.0, force=0.3)
    teller.hover(2.0, 40.0, tilt=50.0, force=0.8)
    assert teller.story.fired() == []
    teller.stand(20.0, force=0.2)
    assert teller.story.state.stage is not Stage.IN_FLIGHT


def test_accelerometers_that_differ_forbid_the_take_off():
    teller = told_to("multirotor")
    teller.stand(1.0, acceleration_spread=9.0)
    assert teller.story.state.stage is Stage.BLOCKED
    assert "acceleration is in doubt: another source differs" in teller.story.said()


@pytest.mark.parametrize(
    ("profile", "sink", "wrong"),
    combinations(PROFILES, [3.5, 4.5, 5.5], [{"force": 0.0}, {"tilt": 169.0}, {"tilt": 95.0}]),
)
def test_one_wrong_sensor_in_a_descent_that_is_flown_ends_no_flight(profile, sink, wrong):
    teller = hovering(profile, 100.0, 2.0)
    height = 100.0
    for k in range(120):
        speed = -min(sink, 0.3 * k)
        height += EVERY * speed
        told = {"tilt": 5.0, "force": 9.8, **(wrong if 40 <= k < 80 else {})}
        teller.tell(
            height=height, vertical_speed=speed + teller.noise(0.2), true_height=height, **told
        )
    assert teller.story.fired() == []


@pytest.mark.parametrize("sink", [6.0, 6.5, 7.0])
@pytest.mark.parametrize("barometer", [True, False])
@pytest.mark.parametrize("every", [0.05, 0.1, 0.2])
def test_one_wrong_number_in_the_fastest_descent_by_hand_ends_no_flight(sink, barometer, every):
    """Given no targets, and 7 m/s, which pilots sink on with as they chop the throttle."""
    teller = told_to("multirotor")
    teller.stand(1.0, **({"true_height": 0.0} if barometer else {}))
    began = teller.story.t

    def descend(teller: Teller, height: float, until: float, **wrong: float) -> float:
        """By hand until then, with these numbers wrong by so much; the height at its end."""
        story = teller.story
        while story.t < began + until:
            speed = -min(sink, max(0.0, 3.0 * (story.t - began - 4.0)))
            height += every * speed
            told = {"vertical_speed": speed + teller.noise(0.2), "acceleration": 9.8}
            told["acceleration"] += teller.noise(0.6)
            for part, by in wrong.items():
                told[part] += by
            if barometer:
                told["pressure"] = pressure_at(height + teller.noise(0.4))
            inputs = story.told(height=height, tilt=5.0, **told)
            story.at(story.t + every, story.heartbeat(), inputs)
        return height

    height = descend(teller, 100.0, 7.5)
    for wrong in ({"vertical_speed": -12.0}, {"acceleration": -7.8}):
        other = teller.fork()
        descend(other, height, 10.0, **wrong)
        assert other.story.fired() == [], wrong


# -- a landing that is not believed ----------------


@AIRCRAFT
@pytest.mark.parametrize("armed", [Armed.DISARMED, Armed.ARMED])
def test_what_sinks_on_the_ground_is_named_and_counts_for_nothing(profile, armed):
    """Given a barometer that runs away on the bench and draws its estimator along, as in a
    recorded log: 14 m/s down, until it says IN_AIR."""
    teller = told_to(profile)
    story = teller.story
    for k in range(300):
        runs = {"height": -1.4 * k, "true_height": -1.4 * k, "tilt": 2.0, "force": 9.8}
        speed = -14.0 + teller.noise(0.3)
        teller.tell(**runs, vertical_speed=speed, **({**DOWN, "armed": armed} if k < 200 else {}))
        if k == 100:
            assert story.state.stage is Stage.BLOCKED
            assert "vertical_speed cannot be used: it reports -1" in story.said()
            assert set(story.state.heard.unfit) == {
                *("vertical_speed", "height", "pressure_altitude")
            }
    assert story.fired() == []


@AIRCRAFT
def test_what_was_carried_up_as_it_stood_is_used_again_once_it_flies(profile):
    """Let go by a balloon or a ship: nothing stays unfit for a whole flight."""
    teller, up = told_to(profile), 0.0
    for k in range(300):
        up = 0.4 * k
        carried = DOWN if k < 200 else {"landed_state": LandedState.ON_GROUND}
        told = {"height": up, "vertical_speed": 4.0, "tilt": 4.0, "force": 9.8}
        teller.tell(**carried, **told, true_height=up)
    assert "vertical_speed" in teller.story.state.heard.unfit
    for _ in range(100):
        speed = teller.noise(0.2)
        teller.tell(height=up, vertical_speed=speed, tilt=3.0, force=9.8, true_height=up)
    assert teller.story.state.heard.unfit == {}
    for k in range(40):
        speed = -min(9.8 * 0.1 * k, 22.0)
        up += 0.1 * speed
        told = {"vertical_speed": speed, "tilt": min(30.0 * k * 0.1, 110.0), "force": 1.0}
        teller.tell(height=up, true_height=up, **told)
    assert deployed(teller)


def test_what_was_moved_as_it_stood_is_used_again_once_it_stands():
    """In a lift, or on a car that drives up a hill."""
    teller = told_to("multirotor")
    for k in range(100):
        up = 0.3 * k
        teller.tell(**DOWN, height=up, vertical_speed=3.0, tilt=1.0, force=9.8, true_height=up)
    assert "vertical_speed" in teller.story.state.heard.unfit
    teller.stand(3.0, height=30.0, true_height=30.0)
    assert teller.story.state.heard.unfit == {}
    assert teller.story.state.stage is Stage.READY


def test_one_that_climbs_before_it_says_so_is_believed():
    """Given a landed state that comes once in two seconds, and says ON_GROUND until then."""
    teller = told_to("multirotor")
    teller.stand(3.0, true_height=0.0)
    says = {"armed": Armed.ARMED, "landed_state": LandedState.ON_GROUND}
    for k in range(20):
        up = 0.4 * k
        teller.tell(**says, height=up, vertical_speed=4.0, tilt=3.0, force=10.0, true_height=up)
    assert teller.story.state.heard.unfit == {}


def test_in_the_air_without_a_height_a_blocked_one_stays_blocked_by_its_barometer():
    """Given a take-off that is not allowed: IN_AIR comes with the order, and no height at all."""
    teller, unknown = told_to("multirotor"), {"height": math.nan, "true_height": 0.0}
    teller.stand(2.0, **unknown)
    story = teller.story
    story.at(story.t + 0.01, i.BlockRequest("mavlink_parachute", "1/161", True, "unhappy"))
    says = {"armed": Armed.ARMED, "landed_state": LandedState.IN_AIR}
    teller.stand(2.0, **unknown, **says)
    assert story.state.stage is Stage.BLOCKED


def test_in_the_air_for_ever_after_a_crash_a_person_may_reset():
    """Given a kill in flight; the wreck lies still, and its autopilot says IN_AIR for ever."""
    teller = told_to("by_hand")
    teller.hover(2.0, 20.0)
    story = teller.story
    story.at(story.t, i.KillRequest(1, "operator", "stop", kill_only=True))
    lies = {"landed_state": LandedState.IN_AIR, "armed": Armed.ARMED, "height": 0.3}
    for _ in range(20):
        teller.tell(**lies, vertical_speed=-9.0, force=3.0)
    story.at(story.t + 0.01, i.ResetRequest(2))
    assert not story.answer(2).success
    for _ in range(130):
        teller.tell(**lies, vertical_speed=teller.noise(0.1), tilt=80.0, force=9.8)
    story.at(story.t + 0.01, i.ResetRequest(3))
    assert story.answer(3).success


@pytest.mark.parametrize("speed", [3.0, 6.0, -3.0])
def test_an_estimator_that_drifts_after_the_landing_keeps_nobody_in_flight(speed):
    """Given one that stands, says so and is disarmed; its estimator climbs or sinks for ever."""
    teller = told_to("multirotor")
    teller.hover(4.0, 20.0, true_height=20.0)
    for k in range(110):
        low = max(20.0 - 0.2 * k, 0.0)
        teller.tell(height=low, vertical_speed=-2.0, tilt=3.0, force=9.8, true_height=low)
    for _ in range(100):
        drifts = {"height": 0.0, "vertical_speed": speed + teller.noise(0.1)}
        teller.tell(**DOWN, **drifts, tilt=1.0, force=9.8, true_height=0.0)
    assert teller.story.state.stage in (Stage.BLOCKED, Stage.READY)
    assert teller.story.fired() == []


def test_in_the_air_for_ever_with_its_motors_off_a_person_may_reset_in_flight():
    """Given a crash that nobody saw: it lies still, and its autopilot says IN_AIR for ever."""
    teller = told_to("multirotor")
    teller.hover(4.0, 20.0, true_height=20.0)
    lies = {"landed_state": LandedState.IN_AIR, "height": 0.0, "tilt": 20.0, "force": 9.8}
    story = teller.story
    for _ in range(120):
        speed = teller.noise(0.1)
        teller.tell(**lies, armed=Armed.ARMED, vertical_speed=speed, true_height=0.0)
    story.at(story.t + 0.01, i.ResetRequest(1))
    assert not story.answer(1).success, "it may hover"
    assert "if it lies still: safety/kill (kill_only), and this again" in story.answer(1).message
    for _ in range(5):
        speed = teller.noise(0.1)
        teller.tell(**lies, armed=Armed.DISARMED, vertical_speed=speed, true_height=0.0)
    story.at(story.t + 0.01, i.ResetRequest(2))
    assert story.answer(2).success
    for _ in range(20):
        speed = teller.noise(0.1)
        teller.tell(**lies, armed=Armed.DISARMED, vertical_speed=speed, true_height=0.0)
    assert story.state.stage in (Stage.BLOCKED, Stage.READY)


def test_a_sink_that_the_barometer_tells_is_not_commanded_by_an_estimator_that_hovers():
    """Given an estimator that stays at the hover that it was told, as its vehicle falls flat."""
    teller = hovering("multirotor", 150.0, 4.0)
    for k in range(30):
        fall = falling(EVERY * k, 150.0)
        hovers = {"height": 150.0, "vertical_speed": teller.noise(0.2), "tilt": 3.0}
        target = {"target_vertical_speed": 0.0, "attitude_error": 1.0}
        force = fall["acceleration"]
        teller.tell(**hovers, **target, force=force, true_height=fall["height"])
    assert deployed(teller)


def test_no_force_is_missing_on_command_of_one_that_lies_otherwise_than_it_shall():
    """PX4, one of four motors dead in a hover: for its first half second it sinks no faster than
    3 m/s beyond its command, and its force was taken for commanded until then."""
    story = Story(shipped("multirotor")).ready().fly(2.0, target_vertical_speed=0.0)
    for k in range(1, 25):
        t = 0.05 * k
        tilt = min(130.0 * t, 125.0)
        parts = {"tilt": tilt, "attitude_error": tilt, "vertical_speed": -4.0 * t}
        parts |= {"acceleration": max(9.8 - 20.0 * t, 4.0), "target_vertical_speed": 0.0}
        story.fly(story.t + 0.05, **parts)
    assert story.fired() == ["KILL"]
    assert story.newest(Action.KILL).rule == "excess tilt"
    assert story.when(Action.KILL) - 2.0 <= 60.0 / 130.0 + 0.05 + 0.3 + 0.1


# -- what another origin, or nothing, tells of it ----------------


@AIRCRAFT
@pytest.mark.parametrize("rate", [2.0, 3.0, 6.0])
def test_a_sink_of_which_no_force_told_is_none_once_it_grows_no_more(profile, rate):
    """Given no barometer, and a hover: the estimator speeds up to 16 m/s down, and stays so."""
    teller, height, speed = told_to(profile), 100.0, 0.0
    teller.hover(6.0, height)
    for _ in range(300):
        speed = max(-16.0, speed - rate * EVERY)
        height += EVERY * speed
        teller.tell(height=height, vertical_speed=speed, tilt=3.0, force=9.8)
    assert not deployed(teller)


@pytest.mark.parametrize("landed", [LandedState.ON_GROUND, LandedState.IN_AIR])
def test_a_land_detector_that_erred_in_the_hover_hides_no_fall(landed):
    """Given one motor of four that dies 8 s later: it lies on its side, its force is more than
    half of the weight, and estimator and barometer tell the same sink."""
    teller, height, speed = hovering("multirotor", 60.0, 3.0), 60.0, 0.0
    teller.hover(8.0, height, true_height=height, landed_state=landed)
    begun = teller.story.t
    for k in range(60):
        speed += EVERY * (-4.5 + 4.5 * (speed / 13.0) ** 2)
        height += EVERY * speed
        told = {"height": height, "vertical_speed": speed, "true_height": height}
        lean = min(80.0, 3.0 + 12.0 * k)
        teller.tell(**told, tilt=lean, force=5.3, landed_state=landed)
        if deployed(teller):
            break
    assert deployed(teller)
    assert teller.story.t - begun <= 2.2


def test_one_that_takes_off_again_from_a_valley_is_seen_to_be_up():
    """Given no barometer, a landing 40 m below the take-off, armed on, and 25 m above that."""
    teller, height = told_to("multirotor"), 0.0
    teller.stand(1.0)
    teller.hover(5.0, 20.0)
    for height in [20.0 - 0.3 * k for k in range(200)]:
        teller.tell(height=height, vertical_speed=-3.0, tilt=3.0, force=9.8)
    for _ in range(80):
        teller.tell(height=-40.0, vertical_speed=0.0, tilt=1.0, force=9.8,
                    landed_state=LandedState.ON_GROUND)  # fmt: skip
    assert teller.story.state.stage is Stage.LANDED
    for height in [-40.0 + 0.3 * k for k in range(84)]:
        teller.tell(height=height, vertical_speed=3.0, tilt=3.0, force=9.8)
    speed = 0.0
    while height > -40.0 and not deployed(teller):
        force = GRAVITY * (speed / 18.0) ** 2
        speed -= EVERY * (GRAVITY - force)
        height += EVERY * speed
        teller.tell(height=height, vertical_speed=speed, tilt=3.0, force=force)
    assert deployed(teller)
    assert height > -30.0


@pytest.mark.parametrize("fails", [0.3, 0.0])
def test_an_accelerometer_that_fails_in_a_descent_is_no_fall_that_was_felt(fails):
    """Given a descent of 6.8 m/s that is flown; estimator and barometer tell that it is steady."""
    teller, height = hovering("multirotor", 50.0, 3.0), 50.0
    speed = 0.0
    for k in range(60):
        speed = max(-6.8, speed - 0.15)
        height += EVERY * speed
        force = 9.8 if k < 30 else fails
        told = {"height": height, "vertical_speed": speed + teller.noise(0.1)}
        teller.tell(**told, tilt=3.0, force=force, true_height=height)
    assert teller.story.fired() == []


@pytest.mark.parametrize("every", [0.02, 0.04, 0.05, 0.06, 0.07, 0.08, 0.1, 0.2])
def test_a_force_of_which_no_speed_follows_is_denied_in_time_at_each_rate(every):
    """Given a level bank of 52 degrees, held by its height and speed, and a force that fails."""
    story = told_to("multirotor").story
    story.fly(5.0, height=80.0)
    random = Random(3)
    until = story.t + 3.0
    while story.t < until:
        told = {
            "vertical_speed": random.uniform(-0.1, 0.1),
            "acceleration": random.uniform(0, 0.4),
        }
        story.at(story.t + every, story.heartbeat(), story.told(height=80.0, tilt=52.0, **told))
    assert story.fired() == []


def drifts_after_a_landing(profile: str, drift: float) -> Iterator[Teller]:
    """Given no barometer, a landing, motors off, and an estimator that drifts from then on: the
    teller, each time that it has told something more."""
    teller = told_to(profile)
    teller.stand(1.0)
    teller.hover(5.0, 20.0)
    for height in [20.0 - 0.2 * k for k in range(100)]:
        teller.tell(height=height, vertical_speed=-2.0, tilt=3.0, force=9.8)
    for k in range(620):
        drifting = {"vertical_speed": drift, "height": EVERY * drift * k}
        teller.tell(**DOWN, **drifting, tilt=1.0, force=9.81)
        yield teller


@pytest.mark.parametrize("drift", [-3.0, 3.5])
def test_a_person_may_reset_one_that_stands_although_its_estimator_drifts(drift):
    """No fall lasts for a minute at one speed; a wing may glide for longer."""
    for told, teller in enumerate(drifts_after_a_landing("fixed_wing", drift)):
        if told == 300:
            teller.story.at(teller.story.t, i.ResetRequest(9))
    assert not teller.story.answer(9).success
    assert "this again after 60 s of that" in teller.story.answer(9).message
    teller.story.at(teller.story.t, i.ResetRequest(10))
    assert teller.story.answer(10).success
    assert not deployed(teller)


@pytest.mark.parametrize("drift", [-3.0, 3.5])
def test_a_multirotor_that_stands_is_down_although_its_estimator_drifts(drift):
    """Without a person's word: nothing hovers on motors that are off."""
    stages = [teller.story.state.stage for teller in drifts_after_a_landing("multirotor", drift)]
    assert set(stages[:590]) == {Stage.IN_FLIGHT}
    assert stages[-1] in (Stage.BLOCKED, Stage.READY)


# -- an attitude that leaps -----------------


def coming_down(profile: str, sink: float, barometer: bool) -> tuple[Teller, float]:
    """It hovers at 150 m, and comes down with this for 4 s, as a person flies it: no target is
    told. The teller, and where it is."""
    teller, height = _coming_down(profile, sink, barometer)
    return teller.fork(), height


@functools.cache
def _coming_down(profile: str, sink: float, barometer: bool) -> tuple[Teller, float]:
    teller, height = hovering(profile, 150.0, 3.0, barometer, stood=0.0), 150.0
    for k in range(round(4.0 / EVERY)):
        speed = -min(sink, 4.0 * EVERY * k)
        height += EVERY * speed
        felt = 9.8 if speed == -sink else 5.8
        truth = {"true_height": height} if barometer else {}
        told = {"vertical_speed": speed + teller.noise(0.2), "tilt": 10.0 + teller.noise(1.0)}
        teller.tell(height=height, **told, force=felt, **truth)
    return teller, height


@pytest.mark.parametrize(
    ("profile", "sink", "turns_to", "rate", "barometer"),
    combinations(PROFILES, [3.5, 7.2], [85.0, 179.0], [30.0, 200.0, math.inf], [True, False]),
)
def test_an_attitude_that_turns_over_alone_in_a_descent_ends_no_flight(
    profile, sink, turns_to, rate, barometer
):
    """Given a descent by hand; a sensor that turns over, so many degrees each second, or within a
    tenth of one. What did so would be pulled downwards by what carried it before."""
    for command in (True, False):
        (teller, height), tilt = coming_down(profile, sink, barometer), 10.0
        for _ in range(70):
            height -= EVERY * sink
            tilt = min(turns_to, tilt + EVERY * rate)
            told = {"true_height": height} if barometer else {}
            told |= {"attitude_error": tilt - 10.0} if command else {}
            told |= {"vertical_speed": -sink + teller.noise(0.2), "tilt": tilt + teller.noise(1.0)}
            teller.tell(height=height, force=9.8, **told)
        assert teller.story.fired() == [], f"{command=}"


@pytest.mark.parametrize(
    ("profile", "sink", "turned", "thrust", "barometer"),
    combinations(PROFILES, [0.0, 7.0], [85.0, 179.0], [9.8, 3.0], [True, False]),
)
def test_one_that_snaps_over_and_sinks_faster_for_it_is_released(
    profile, sink, turned, thrust, barometer
):
    """Given one that breaks and lies on its side or its back within a tenth of a second; its
    motors go on, and drag holds it at 25 m/s."""
    teller, height = coming_down(profile, sink, barometer)
    begun, speed = teller.story.t, -sink
    while not deployed(teller) and teller.story.t < begun + 4.0:
        drag = 9.8 * (speed / 25.0) ** 2
        speed += EVERY * (thrust * math.cos(math.radians(turned)) + drag - 9.8)
        height += EVERY * speed
        truth = {"true_height": height} if barometer else {}
        told = {"vertical_speed": speed + teller.noise(0.2), "tilt": turned + teller.noise(1.0)}
        teller.tell(height=height, **told, force=math.hypot(thrust, drag), **truth)
    assert teller.story.t - begun <= (1.2 if profile == "multirotor" else 1.8) + EVERY


# -- a rocket, whose height is its barometer's and whose speed its satellites' -----------------


@settings(max_examples=25)
@given(
    pushes=st.lists(st.floats(-60.0, 60.0), min_size=2, max_size=6),
    climbs=st.lists(st.floats(-300.0, 300.0), min_size=2, max_size=6),
)
def test_whatever_a_rocket_tells_of_its_motion_as_it_stands_fires_nothing(
    pushes: list[float], climbs: list[float]
) -> None:
    """Given its key turned, and a flight computer that says that it stands."""
    teller, height, speed = told_to("rocket"), 0.0, 0.0
    for k in range(150):
        speed += EVERY * pushes[k * len(pushes) // 150]
        height += EVERY * climbs[k * len(climbs) // 150]
        standing = {"armed": Armed.ARMED, "landed_state": LandedState.ON_GROUND, "force": 9.8}
        teller.tell(height=height, vertical_speed=speed, **standing)
    assert teller.story.fired() == []


@pytest.mark.parametrize("wrong", ["height", "speed"])
@settings(max_examples=15)
@given(pushes=st.lists(st.floats(-60.0, 60.0), min_size=2, max_size=6))
def test_whatever_one_sensor_of_a_rocket_that_climbs_tells_fires_nothing(
    wrong: str, pushes: list[float]
) -> None:
    """Given a boost of 2 s to 200 m/s, and a coast until 20 m/s are left."""
    teller, height, speed, errs, strays = told_to("rocket"), 0.0, 0.0, 0.0, 0.0
    teller.tell(armed=Armed.ARMED, landed_state=LandedState.ON_GROUND, force=9.8, height=0.0)
    for k in range(200):
        boosts = k < 20
        speed += EVERY * (100.0 if boosts else -9.8)
        height += EVERY * speed
        errs += EVERY * pushes[k * len(pushes) // 200]
        strays += EVERY * errs
        teller.tell(
            height=height + (strays if wrong == "height" else 0.0),
            vertical_speed=speed + (errs if wrong == "speed" else teller.noise(0.2)),
            force=110.0 if boosts else 2.0,
        )
    assert speed > 20.0
    assert teller.story.state.stage is Stage.IN_FLIGHT
    assert teller.story.fired() == []


@AIRCRAFT
@pytest.mark.parametrize(("bank", "drift"), [(40.0, 3.0), (55.0, 2.0)])
@pytest.mark.parametrize("target", [True, False])
def test_an_estimator_that_sinks_in_a_level_bank_is_denied_by_the_force(
    profile, bank, drift, target
):
    """Without a barometer: the part of the force that points upwards carries it in full."""
    teller, height, speed = hovering(profile, 100.0, 2.0, barometer=False), 100.0, 0.0
    told: dict[str, Any] = {"target_vertical_speed": 0.0, "attitude_error": 3.0} if target else {}
    for step in range(130):
        tilt = min(bank, 2.0 * step)
        if step > 30:
            speed -= drift * EVERY
            height += speed * EVERY
        force = GRAVITY / math.cos(math.radians(tilt))
        teller.tell(height=height, vertical_speed=speed, tilt=tilt, force=force, **told)
    assert teller.story.fired() == []


@AIRCRAFT
@pytest.mark.parametrize("hides", [1.0, 0.5])
@pytest.mark.parametrize("target", [True, False])
def test_a_speed_that_hides_a_level_sink_hides_it_from_nobody_whom_both_heights_tell(
    profile, hides, target
):
    """9 m/s; the vertical speed alone is wrong, by this part of it."""
    teller, height, speed = hovering(profile, 110.0, 2.0), 110.0, 0.0
    told: dict[str, Any] = {"target_vertical_speed": 0.0, "attitude_error": 4.0} if target else {}
    while height > 10.0 and not deployed(teller):
        force = 6.8 if speed > -9.0 else 9.8
        speed = max(speed - 0.3, -9.0)
        height += speed * EVERY
        wrong = (1.0 - hides) * speed + teller.noise(0.1)
        parts = {"height": height, "true_height": height, "tilt": 8.0, "force": force}
        teller.tell(vertical_speed=wrong, **parts, **told)
    assert deployed(teller) is target
    assert (height > 80.0) is target
    if not target:
        assert any("it sinks faster than descents" in one for one in teller.story.alarms())


@pytest.mark.parametrize("wrong", [lambda speed, _: 0.0, lambda speed, t: speed - 3.0 * t])
def test_a_wrong_speed_in_a_dive_that_was_commanded_ends_no_flight_of_an_aeroplane(wrong):
    """20 degrees, 10 m/s; the heights, the force and the attitude are right."""
    teller, height, speed = hovering("fixed_wing", 150.0, 2.0), 150.0, 0.0
    for step in range(60):
        change = -3.0 if speed > -10.0 else 0.0
        speed, tilt = max(speed - 0.3, -10.0), max(3.0, 20.0 * min(1.0, step * EVERY))
        height += speed * EVERY
        force = (GRAVITY + change) / math.cos(math.radians(tilt))
        parts = {"height": height, "true_height": height, "tilt": tilt, "force": force}
        told = wrong(speed, step * EVERY) + teller.noise(0.1)
        teller.tell(vertical_speed=told, attitude_error=4.0, **parts)
    assert teller.story.fired() == []
