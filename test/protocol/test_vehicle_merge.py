"""Which source counts for which part of the picture, and how old it is told to be."""

import dataclasses
import math

import pytest

from chute_ros.model import Armed, LandedState, LinkState, VehicleState
from chute_ros.protocol.vehicle_merge import DISPUTED, IMU, VEHICLE_STATE, VehicleMerge
from chute_ros.supervisor.measurements import STANDARD_LIMITS

LEVEL, TILTED = (0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0)
OK = (LinkState.OK, 4)


def merge(*sources):
    """Of these, or of an autopilot and an IMU."""
    return VehicleMerge(sources or ("vehicle/state", "imu"), lost_after=2.5)


def hear_all(one, *words):
    """(source, part, values, time) each."""
    for source, part, values, now in words:
        one.hear(source, {part: values}, now)
    return one


def test_before_anything_was_heard_nothing_is_known():
    state = merge("odometry", "imu").state(10.0)
    assert unknown(state) == unknown(VehicleState())
    assert (state.source, state.armed, state.landed_state) == ("", 0, 0)


def test_what_vehicle_state_says_is_told_until_it_forgets_it_or_is_lost():
    one = merge()
    one.hear_state(VehicleState(link_state=LinkState.OK, faults=("ATTITUDE is slow",)), 10.0)
    assert one.state(12.0).faults == ("ATTITUDE is slow",)
    one.hear("imu", {"attitude": LEVEL}, 13.0)
    assert one.state(13.0).faults == ()
    one.hear_state(VehicleState(armed=Armed.ARMED, armed_age=0.0), 20.0)
    one.hear_state(VehicleState(reboot_count=1), 20.1)
    state = one.state(20.1)
    assert (state.armed, state.reboot_count) == (Armed.UNKNOWN, 1)
    assert math.isnan(state.armed_age)
    one.hear_state(VehicleState(height=1.0, height_age=-5.0), 30.0)
    assert one.state(30.25).height_age == 0.25, "nothing is younger than new"


@pytest.mark.parametrize(
    ("source", "holds"), [("odometry", True), ("mavros", False), ("vehicle/state", False)]
)
def test_a_restart_of_the_autopilot_is_none_of_a_height_that_another_tells(source, holds):
    """MAVROS tells the autopilot's own."""
    one = merge(source, *({"vehicle/state"} - {source}))
    one.hear_state(VehicleState(height=3.0, height_age=0.0), 10.0)
    if source != "vehicle/state":
        one.hear(source, {"height": (8.0,)}, 10.0)
    anew = {"reboot_count": 1, "rebooted_in_flight": True}
    one.hear_state(VehicleState(height=0.0, height_age=0.0, **anew), 10.1)
    state = one.state(10.1)
    assert (state.rebooted_in_flight, state.height_holds) == (True, holds)


def test_a_height_that_is_heard_after_the_restart_alone_may_have_begun_with_it():
    one = merge("odometry", "vehicle/state")
    one.hear_state(VehicleState(height=30.0, height_age=0.0), 10.0)
    one.hear_state(VehicleState(reboot_count=1, rebooted_in_flight=True), 10.1)
    one.hear("odometry", {"height": (0.0,)}, 10.2)
    assert not one.state(10.2).height_holds


def told_at(one, *rates, until=20.0):
    """The faults at the end, of an IMU whose parts come at these rates (Hz) from 10 s on, beside
    an autopilot at 10 Hz."""
    words = [(10.0 + n / 10.0, "") for n in range(1 + int((until - 10.0) * 10.0))]
    for part, rate in zip(("attitude", "acceleration"), rates, strict=False):
        words += [(10.0 + n / rate, part) for n in range(1 + int((until - 10.0) * rate))]
    for now, part in sorted(words):
        if part:
            one.hear("imu", {part: LEVEL if part == "attitude" else (9.8, 0.0)}, now)
        else:
            one.hear_state(VehicleState(link_state=LinkState.OK), now)
    return one.state(until).faults


def test_what_cannot_be_used_is_the_whole_reason_as_long_as_it_comes():
    one = VehicleMerge(("vehicle/state", "odometry"), lost_after=2.5, needed_rate=5.0)
    why = "frame 'odom_ned' has its axes pointing down, not as REP 103 has them"
    one.hear("odometry", {"height": (0.0,)}, 10.0)
    for n in range(50):
        now = 10.0 + n / 10.0
        one.hear_state(VehicleState(link_state=LinkState.OK), now)
        one.refuse("odometry", why, now)
        assert one.state(now).faults == (f"odometry: {why}",)
    one.hear_state(VehicleState(link_state=LinkState.OK), 17.1)
    assert not any(why in fault for fault in one.state(17.1).faults)


SELDOM = "imu comes too seldom: {} (need 5 Hz): raise its rate, or take it out of vehicle_sources"


@pytest.mark.parametrize(
    ("rates", "told"),
    [
        ((50.0, 50.0), ()),
        ((5.0, 5.0), ()),
        ((2.0, 50.0), (SELDOM.format("attitude 2.0 Hz"),)),
        ((2.0, 1.0), (SELDOM.format("attitude 2.0 Hz, acceleration 1.0 Hz"),)),
        ((), ("imu was never received",)),
    ],
)
def test_a_source_that_tells_too_seldom_or_never_is_named(rates, told):
    """As a stream of the autopilot is: a rule must not starve because another program or a line
    slows a source down, and nobody is told."""
    assert told_at(VehicleMerge((VEHICLE_STATE, IMU), 2.5, 5.0), *rates) == told
    assert told_at(VehicleMerge((VEHICLE_STATE, IMU), 2.5, 0.0), *rates) == (), "not checked"


def test_a_source_has_its_time_to_begin_and_may_be_late_once():
    one = VehicleMerge((VEHICLE_STATE, IMU), 2.5, 5.0)
    assert told_at(one, until=11.9) == ()
    assert told_at(VehicleMerge((VEHICLE_STATE, IMU), 2.5, 5.0), 2.0, 50.0, until=11.9) == ()
    for now in (10.0, 10.1, 10.2, 11.4, 11.5, 11.6, 11.7, 11.8, 11.9, 12.0):
        one.hear("imu", {"attitude": LEVEL}, now)
    assert one.state(12.1).faults == (), "1.2 s of silence, and over"


def test_a_source_that_falls_silent_is_named_until_it_comes_again():
    one = VehicleMerge((VEHICLE_STATE, IMU), 2.5, 5.0)
    assert told_at(one, 50.0, 50.0) == ()
    assert one.state(21.9).faults == ()
    assert one.state(23.0).faults == (SELDOM.format("attitude 0.3 Hz, acceleration 0.3 Hz"),)
    for n in range(20):
        one.hear("imu", {"attitude": LEVEL, "acceleration": (9.8, 0.0)}, 23.0 + 0.02 * n)
    assert one.state(23.4).faults == ()


@pytest.mark.parametrize(
    ("part", "values", "told"),
    [
        ("attitude", (0.9, 0.0, 0.0, 0.9), "0.6, imu 51.6 degrees from upright (at most 20"),
        ("vertical_speed", (4.0,), "0.0, imu 4.0 m/s (at most 2.5"),
        ("acceleration", (0.2, 0.0), "9.8, imu 0.2 m/s^2 (at most 3"),
        ("attitude", (0.2, 0.0, 0.0, 0.2), ""),
    ],
)  # fmt: skip
@pytest.mark.parametrize("armed", Armed)
def test_a_source_that_is_mounted_wrong_is_named_while_the_vehicle_stands(
    part, values, told, armed
):
    """In flight the autopilot may fall silent, and that one alone is left."""
    one = merge()
    one.hear_state(
        VehicleState(
            link_state=LinkState.OK, armed=armed, armed_age=0.0, tilt=0.01, attitude_age=0.0,
            vertical_speed=0.0, vertical_speed_age=0.0, acceleration=9.8, acceleration_age=0.0,
        ),
        10.0,
    )  # fmt: skip
    one.hear("imu", {part: values}, 10.0)
    named = [text.split(" apart): turn")[0] for text in one.state(10.1).faults]
    what = f"{part.replace('_', ' ')} differs with the motors reported off: vehicle/state {told}"
    assert named == ([what] if told and armed is Armed.DISARMED else [])


def test_a_source_without_attitude_is_not_slow():
    """One that never estimated it has no rate of it."""
    one = VehicleMerge((IMU,), 2.5, 5.0)
    for n in range(200):
        one.hear("imu", {"attitude": None, "acceleration": (9.8, 0.0)}, 10.0 + 0.02 * n)
    assert one.state(14.0).faults == ()


def test_new_parts_have_their_own_source_and_age():
    one = merge("imu", "vehicle/state")
    one.hear("imu", {"acceleration": (9.8,)}, 10.0)
    told = VehicleState(
        link_state=LinkState.OK,
        altitude=488.0,
        altitude_age=0.1,
        pressure=95_500.0,
        pressure_age=0.2,
        target_vertical_speed=-1.0,
        target_age=0.3,
        acceleration=7.0,
        acceleration_spread=2.0,
        acceleration_age=0.0,
    )
    one.hear_state(told, 10.0)
    state = one.state(10.1)
    assert (state.altitude, state.pressure) == (488.0, 95_500.0)
    assert state.target_age == pytest.approx(0.4)
    assert (state.target_vertical_speed, state.acceleration) == (-1.0, 9.8)
    assert math.isnan(state.below_target)
    assert math.isnan(state.acceleration_spread), "of another source's accelerometers"


def test_each_part_has_its_own_age():
    one = merge("odometry", "imu")
    one.hear("odometry", {"height": (12.0,), "vertical_speed": None, "attitude": None}, 10.0)
    one.hear("imu", {"attitude": TILTED, "acceleration": (9.8,)}, 10.25)
    state = one.state(10.5)
    assert (state.height, state.height_age) == (12.0, 0.5)
    assert (state.tilt, state.attitude_age) == (1.0, 0.25)
    assert (state.acceleration, state.acceleration_age) == (9.8, 0.25)
    assert math.isnan(state.vertical_speed)
    assert math.isnan(state.vertical_speed_age)
    assert state.source == "odometry, imu"


def test_the_order_of_the_list_decides_while_the_first_is_fresh():
    one = merge("imu", "odometry")
    one.hear("imu", {"attitude": LEVEL, "height": (5.0,)}, 10.0)
    one.hear("odometry", {"attitude": TILTED, "height": (9.0,)}, 10.3)
    assert one.state(10.39).tilt == 0.0
    assert one.state(10.39).source == "imu"
    late = one.state(10.41)
    assert (late.tilt, late.height, late.source) == (1.0, 5.0, "imu, odometry")
    assert late.attitude_age == pytest.approx(0.11)
    assert one.state(10.79).height == 5.0
    assert one.state(10.81).height == 9.0


def test_a_fresh_word_is_younger_than_what_the_supervisor_believes():
    """Otherwise a change of the source is a gap, in which a jump is none."""
    limits = {"attitude": "tilt_deg", "acceleration": "acceleration"}
    for part in ("height", "vertical_speed", "attitude", "acceleration"):
        most = STANDARD_LIMITS[limits.get(part, part)].max_age
        one = merge("imu", "odometry")
        values = {"attitude": LEVEL}.get(part, (1.0,))
        one.hear("imu", {part: values}, 10.0)
        one.hear("odometry", {part: values}, 10.0 + most - 0.1)
        assert one.state(10.0 + most - 0.1).source == "odometry", part


def test_a_source_that_hears_its_autopilot_no_more_has_lost_it_after_the_limit():
    """However often it says so: it knows no more of it than one that is silent."""
    one = merge()
    one.hear_state(VehicleState(link_state=LinkState.OK, system_status=4), 10.0)
    for tenth in range(1, 31):
        stale = VehicleState(link_state=LinkState.STALE, system_status=4)
        one.hear_state(stale, 10.0 + tenth / 10.0)
        lost = tenth > 25
        expected = LinkState.LOST if lost else LinkState.STALE
        assert one.state(10.0 + tenth / 10.0).link_state is expected, tenth
    one.hear_state(VehicleState(link_state=LinkState.OK, system_status=4), 13.1)
    assert one.state(13.2).link_state is LinkState.OK


@pytest.mark.parametrize("said", [None, LinkState.NEVER_SEEN, LinkState.STALE])
def test_an_autopilot_that_was_heard_before_a_restart_is_lost_and_not_never_seen(said):
    """Nor does its node find it, which was started anew as well."""
    one = merge("imu", "vehicle/state")
    one.recall(LinkState.OK, 10.0)
    one.hear("imu", {"acceleration": (1.0,)}, 10.0)
    if said is not None:
        one.hear_state(VehicleState(link_state=said), 11.0)
    assert one.state(12.5).link_state is (LinkState.OK if said is None else said)
    assert one.state(12.5).system_status == 0
    assert one.state(12.6).link_state is LinkState.LOST
    one.hear_state(VehicleState(link_state=LinkState.OK, system_status=4), 13.0)
    assert (one.state(13.0).link_state, one.state(13.0).system_status) == (LinkState.OK, 4)


def test_what_was_known_of_the_autopilot_before_a_restart_is_where_it_begins():
    for source, before, link_state in (
        ("vehicle/state", LinkState.LOST, LinkState.LOST),
        ("vehicle/state", LinkState.NEVER_SEEN, LinkState.NEVER_SEEN),
        ("mavros", LinkState.OK, LinkState.OK),
        ("odometry", LinkState.LOST, LinkState.OK),
    ):
        one = merge(source, "imu")
        one.recall(before, 10.0)
        assert one.state(10.0).link_state is link_state, (source, before)


def test_when_all_are_old_the_newest_counts_and_who_does_not_know_any_more_gives_way():
    one = merge("imu", "odometry")
    hear_all(one, ("odometry", "attitude", TILTED, 10.0), ("imu", "attitude", LEVEL, 11.0))
    assert (one.state(20.0).tilt, one.state(20.0).attitude_age) == (0.0, 9.0)
    hear_all(one, ("imu", "attitude", LEVEL, 30.0), ("odometry", "attitude", TILTED, 30.0))
    one.hear("imu", {"attitude": None}, 30.01)
    assert one.state(30.01).tilt == 1.0
    one.hear("odometry", {"attitude": None}, 30.02)
    assert math.isnan(one.state(30.02).tilt)
    assert math.isnan(one.state(30.02).attitude_age)


def test_an_altitude_counts_beside_the_height_of_its_own_source_alone():
    """What home has moved by is the difference of the two."""
    both = ("mavros", "height", (12.0,), 10.0), ("mavros", "altitude", (512.0,), 10.0)
    one = hear_all(merge("odometry", "mavros"), *both)
    assert one.state(10.0).altitude == 512.0
    one.hear("odometry", {"height": (3.0,)}, 10.0)
    assert (one.state(10.0).height, math.isnan(one.state(10.0).altitude)) == (3.0, True)
    other = hear_all(merge("mavros", "odometry"), *both, ("odometry", "height", (3.0,), 10.0))
    assert (other.state(10.0).height, other.state(10.0).altitude) == (12.0, 512.0)


def test_the_ages_that_vehicle_state_brings_grow_by_the_time_since():
    one = merge()
    told = VehicleState(
        link_state=LinkState.OK,
        armed=Armed.ARMED,
        armed_age=0.5,
        landed_state=LandedState.IN_AIR,
        landed_state_age=0.25,
        height=30.0,
        height_age=0.125,
        battery_voltage=22.0,
        battery_age=3.0,
        system_status=4,
        uptime=99.0,
        reboot_count=1,
        rebooted_in_flight=True,
    )
    one.hear_state(told, 10.0)
    one.hear("imu", {"acceleration": (0.5,)}, 10.5)
    state = one.state(10.5)
    assert state == dataclasses.replace(
        told,
        source="vehicle/state, imu",
        armed_age=1.0,
        landed_state_age=0.75,
        height_age=0.625,
        battery_age=3.5,
        acceleration=0.5,
        acceleration_age=0.0,
        # NaN is not equal to itself unless it is the same object.
        **{name: getattr(state, name) for name in unknown(state)},
    )
    assert unknown(state) == unknown(told) - {"acceleration", "acceleration_age"}


def unknown(state):
    values = dataclasses.asdict(state)
    return {name for name, value in values.items() if value != value}


def test_the_autopilot_is_lost_only_when_nobody_hears_it():
    ok, never, lost, stale = LinkState.OK, LinkState.NEVER_SEEN, LinkState.LOST, LinkState.STALE
    state_and_mavros = ("vehicle/state", "mavros")
    for sources, told, expected in (
        (("odometry",), {}, (ok, 0)),
        (("mavros", "odometry"), {}, (never, 0)),
        (("mavros",), {"mavros": (10.0, OK)}, (ok, 4)),
        (("mavros", "imu"), {"mavros": (7.4, OK)}, (lost, 0)),
        (("mavros",), {"mavros": (10.0, (lost, 0))}, (lost, 0)),
        (
            state_and_mavros,
            {"vehicle/state": (10.0, (lost, 4)), "mavros": (9.0, (ok, 5))},
            (ok, 5),
        ),
        (
            state_and_mavros,
            {"vehicle/state": (10.0, (stale, 4)), "mavros": (1.0, (ok, 5))},
            (stale, 4),
        ),
        (state_and_mavros[::-1], {"vehicle/state": (10.0, OK), "mavros": (9.9, (ok, 5))}, (ok, 5)),
    ):
        one = merge(*sources)
        for source, (at, word) in told.items():
            one.hear(source, {"autopilot": word}, at)
        state = one.state(10.0)
        assert (state.link_state, state.system_status) == expected, (sources, told)


TURNED = (0.0, 0.0, 0.0, math.pi)


def hear_both(one, seconds, autopilot, imu, start=10.0):
    """Both sources at 10 Hz, the IMU 50 ms after the autopilot."""
    for tenth in range(round(seconds * 10)):
        now = start + tenth / 10.0
        one.hear("vehicle/state", autopilot, now)
        one.hear("imu", imu, now + 0.05)
    return one, start + seconds


@pytest.mark.parametrize(
    ("part", "right", "near", "wrong"),
    [
        ("attitude", LEVEL, (0.0, 0.0, 0.0, 1.5), TURNED),
        ("acceleration", (9.8,), (4.0,), (0.0,)),
        ("vertical_speed", (0.0,), (-5.0,), (-15.0,)),
    ],
)
def test_two_that_tell_otherwise_dispute_it_also_when_one_is_left(part, right, near, wrong):
    """Given an IMU that lies beside its autopilot, then the autopilot hangs."""
    both, now = hear_both(merge(), 0.5, {part: right}, {part: near})
    assert both.disputed(now) == frozenset()
    both, now = hear_both(both, 0.5, {part: right}, {part: wrong}, start=now)
    assert both.disputed(now) == {part}
    for tenth in range(10):
        both.hear("imu", {part: wrong}, now + tenth / 10.0)
    assert both.state(now + 0.9).source == "imu"
    assert both.disputed(now + 0.9) == {part}
    assert both.disputed(now + DISPUTED - 0.2) == {part}
    assert both.disputed(now + DISPUTED) == frozenset()


def test_a_last_word_before_the_power_went_disputes_nothing():
    """The autopilot dies with its motors, and what it said last was of before."""
    one, now = hear_both(
        merge(), 1.0, {"acceleration": (9.8,), "vertical_speed": (0.0,)}, {"acceleration": (9.8,)}
    )
    for hundredth in range(2, 60, 2):
        falls = {"acceleration": (0.1,)}
        one.hear("imu", falls, now - 0.1 + hundredth / 100.0)
    assert one.state(now + 0.45).acceleration == 0.1
    assert one.disputed(now + 0.45) == frozenset()


def test_one_that_jumps_disputes_its_own_word():
    for part, before, after, later, disputed in (
        ("attitude", LEVEL, TURNED, 10.02, True),
        ("vertical_speed", (0.0,), (-15.0,), 10.02, True),
        ("acceleration", (9.8,), (0.1,), 10.02, False),
        ("attitude", LEVEL, TILTED, 10.02, False),
        # After a gap it may have turned.
        ("attitude", LEVEL, TURNED, 10.2, False),
    ):
        one = hear_all(merge(), ("imu", part, before, 10.0), ("imu", part, after, later))
        assert one.disputed(later) == (frozenset({part}) if disputed else frozenset()), part


def test_only_the_source_that_counts_is_doubted():
    """Given a preferred one that nobody contradicts, and a second one that jumps."""
    one = hear_all(merge(), ("vehicle/state", "attitude", LEVEL, 9.98))
    hear_all(one, ("imu", "attitude", TURNED, 10.0), ("imu", "attitude", LEVEL, 10.02))
    assert one.disputed(10.1) == frozenset()
    one.hear("imu", {"attitude": LEVEL}, 10.5)
    assert one.disputed(10.5) == {"attitude"}


def test_after_a_pause_without_words_to_compare_it_is_another_time():
    """Given one word that differs, and another one a minute later."""
    one = merge()
    for start in (10.0, 70.0):
        hear_all(one, ("vehicle/state", "attitude", LEVEL, start))
        hear_all(one, ("imu", "attitude", TURNED, start + 0.05))
        assert one.disputed(start + 0.05) == frozenset()


def test_what_is_not_a_number_agrees_with_nobody():
    one = merge()
    unknown_tilt = (0.0, 0.0, 0.0, math.nan)
    for tenth in range(5):
        now = 10.0 + tenth / 10.0
        one.hear("vehicle/state", {"attitude": LEVEL}, now)
        one.hear("imu", {"attitude": unknown_tilt if tenth % 2 else TURNED}, now + 0.05)
    assert one.disputed(10.5) == {"attitude"}


def test_one_that_tumbles_disputes_nothing():
    """Given two truthful sources of a vehicle that turns twice a second."""
    one = merge()
    for hundredth in range(0, 300, 2):
        now = 10.0 + hundredth / 100.0
        tilt = abs(math.remainder(4.0 * math.pi * now, 2.0 * math.pi))
        one.hear("imu", {"attitude": (0.0, 0.0, 0.0, tilt)}, now)
        if hundredth % 10 == 0:
            one.hear("vehicle/state", {"attitude": (0.0, 0.0, 0.0, tilt)}, now)
        assert one.disputed(now) == frozenset()


def tilted(tilt):
    return {"attitude": (0.0, 0.0, 0.0, tilt)}


def live(seconds, tilts, imu_tilts, start=10.0, one=None):
    """The autopilot at 10 Hz and the IMU at 50 Hz; tilts by the s since the start, rad."""
    one = one or merge()
    for n in range(round(seconds * 50)):
        passed = n / 50.0
        if n % 5 == 0:
            one.hear("vehicle/state", tilted(tilts(passed)), start + passed)
        one.hear("imu", tilted(imu_tilts(passed)), start + passed)
    return one, start + seconds


def upright(passed):
    """One that lives: its noise is never twice the same."""
    return 0.02 + 0.01 * math.sin(50.0 * passed)


def turned_after(seconds, by=math.pi - 0.1):
    return lambda passed: upright(passed) + (by if passed >= seconds else 0.0)


def left_alone(one, now):
    """What is in doubt 0.5 s after the autopilot's last word."""
    one.hear("imu", tilted(0.1), now + 0.5)
    assert one.told_by(now + 0.5) == {"attitude": "imu"}
    return one.disputed(now + 0.5)


BOTH, NONE = frozenset({"attitude"}), frozenset()


def during(begin, end, by):
    return lambda passed: upright(passed) + (by if begin <= passed < end else 0.0)


def drifting(rate, most=math.inf):
    return lambda passed: upright(passed) + min(rate * passed, most)


#: Story -> s, the tilt of the autopilot and the IMU, what is in doubt, and then of the IMU alone.
LEAPS = {
    "an autopilot that turns 0.5 s before its power goes": (
        (1.0, turned_after(0.5), upright, BOTH, NONE)
    ),
    "an IMU that leapt": (1.0, upright, turned_after(0.5), NONE, BOTH),
    "an IMU that leapt back": (1.0, upright, during(0.3, 0.7, 3.0), NONE, BOTH),
    # It may have stuck, and the other one may fall.
    "a leap beside a value that does not change": (
        (1.0, turned_after(0.5), lambda _: 0.02, BOTH, BOTH)
    ),
    "both leapt": (1.0, turned_after(0.5), turned_after(0.6, by=-math.pi), BOTH, BOTH),
    "none leapt": (1.5, upright, drifting(2.5), BOTH, BOTH),
    "a leap 2 s after they began to differ": (
        (4.0, during(3.0, 3.3, 1.2), drifting(2.0, 3.0), BOTH, BOTH)
    ),
}


@pytest.mark.parametrize("story", LEAPS)
def test_the_one_that_leapt_is_in_doubt_alone(story):
    seconds, autopilot, imu, disputed, alone = LEAPS[story]
    one, now = live(seconds, autopilot, imu)
    assert one.told_by(now) == {}
    assert one.disputed(now) == disputed
    assert left_alone(one, now) == alone
    if seconds == 4.0:
        assert left_alone(one, now + 9.0) == BOTH


@pytest.mark.parametrize(("earlier", "both"), [(0.9, False), (1.2, True)])
def test_noise_is_near_the_truth_now_and_then(earlier, both):
    """Given a leap that another leap took back; then it differs without one."""

    def noise(passed):
        if passed < 0.4:
            return upright(passed) + 1.4
        return upright(passed) + min(0.45 * 10.0 * max(0.0, passed - earlier), 3.0)

    one, now = live(earlier + 0.9, noise, upright)
    assert left_alone(one, now) == (frozenset({"attitude"}) if both else frozenset())


@pytest.mark.parametrize(
    ("part", "before", "after", "leapt"),
    [
        # 30 degrees and 240 degrees a second, for 0.1 s.
        ("attitude", (0.0, 0.0, 0.0, 1.65), (0.0, 0.0, 0.0, 0.7), True),
        ("attitude", (0.0, 0.0, 0.0, 1.65), (0.0, 0.0, 0.0, 0.72), False),
        # 2 m/s and 30 m/s^2.
        ("vertical_speed", (0.0,), (-5.1,), True),
        ("vertical_speed", (0.0,), (-4.9,), False),
        # A force is another at once.
        ("acceleration", (9.8,), (0.1,), False),
    ],
)
def test_a_leap_is_more_than_what_flies_well_does(part, before, after, leapt):
    """Given two that agreed, and differ soon after the first has changed."""
    others = {"attitude": TURNED, "vertical_speed": (20.0,), "acceleration": (20.0,)}[part]
    one = merge()
    for n in range(5):
        almost = (*before[:-1], before[-1] + n / 1e6)
        one.hear("vehicle/state", {part: almost}, 9.5 + n / 10.0)
    one.hear("vehicle/state", {part: after}, 10.0)
    for n in range(1, 20):
        now, almost = 10.0 + n / 20.0, (*others[:-1], others[-1] - n / 1000.0)
        hear_all(one, ("vehicle/state", part, after, now), ("imu", part, almost, now))
    assert one.disputed(11.0) == {part}
    one.hear("imu", {part: others}, 12.0)
    assert one.told_by(12.0) == {part: "imu"}
    assert one.disputed(12.0) == (frozenset() if leapt else {part})


@pytest.mark.parametrize("held_up", [False, True])
def test_words_that_were_held_up_together_show_no_leap(held_up):
    """Given an IMU that drifts away, and an autopilot that banks by 37 degrees while its words are
    held up for a second; then it tells the one from before and the newest at once."""
    one = merge()
    for n in range(50 * 27):
        now = 10.0 + n / 50.0
        bank = lambda at: upright(at) + (0.65 if at > 25.5 else 0.0)  # noqa: E731
        one.hear("imu", tilted(min(upright(now) + 0.15 * (now - 10.0), 2.9)), now)
        if n % 5 or (25.0 <= now < 26.0 and held_up):
            continue
        if held_up and n == 800:
            one.hear("vehicle/state", tilted(bank(25.0)), now + 0.0005)
        one.hear("vehicle/state", tilted(bank(now)), now + 0.001)
    assert one.disputed(37.0) == {"attitude"}
    assert left_alone(one, 37.0) == {"attitude"}


@pytest.mark.parametrize("yaw", [lambda n: n / 100.0, lambda _: math.nan])
def test_one_whose_tilt_has_stuck_does_not_live_by_its_yaw(yaw):
    one = merge()
    for n in range(100):
        now = 10.0 + n / 50.0
        if n % 5 == 0:
            stuck = (0.0, 0.0, float(yaw(n)), 0.1)
            one.hear("vehicle/state", {"attitude": stuck}, now)
        one.hear("imu", tilted(turned_after(11.0)(now)), now)
    assert one.disputed(12.0) == {"attitude"}
    assert left_alone(one, 12.0) == {"attitude"}


def test_who_tells_a_part_is_named_where_it_is_not_the_first():
    alone = merge("odometry")
    alone.hear("odometry", {"height": (12.0,), "attitude": LEVEL}, 10.0)
    assert alone.told_by(10.0) == {}
    one = merge("vehicle/state", "odometry", "imu")
    assert one.told_by(10.0) == {}
    one.hear("odometry", {"height": (12.0,), "vertical_speed": (0.0,), "position": None}, 10.0)
    one.hear("imu", {"attitude": LEVEL, "acceleration": (9.8,)}, 10.0)
    told = {"height": "odometry", "vertical_speed": "odometry"}
    assert one.told_by(10.0) == {**told, "attitude": "imu", "acceleration": "imu"}
    one.hear("vehicle/state", {"attitude": LEVEL, "battery": (12.0, 0.5)}, 10.1)
    assert one.told_by(10.1) == {**told, "acceleration": "imu"}
    one.hear("imu", {"attitude": LEVEL}, 10.4)
    assert one.told_by(10.51)["attitude"] == "imu"


def test_every_state_of_a_link_has_its_place_among_the_others():
    """What another node says of the autopilot is taken, whatever it is."""
    for state in LinkState:
        one = VehicleMerge((VEHICLE_STATE, IMU), 2.5)
        one.hear_state(VehicleState(link_state=state), 10.0)
        assert one.state(10.1).link_state is state
