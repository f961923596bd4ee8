"""The flight computer as the others see it: picture, situation, landing, restart and silence."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from umbilical_lines import BY_NAME, body, record
from umbilical_rocket import (
    ASCENT,
    COAST,
    DROGUE,
    FAULT,
    LIMITS,
    MAIN,
    STANDBY,
    STARTUP,
    Rocket,
    flown,
    status,
    vehicle,
)

from chute_ros.links.umbilical.protocol.flight_computer import FlightComputerTracker
from chute_ros.links.umbilical.protocol.gate import Situation
from chute_ros.links.umbilical.protocol.layouts import Layout, Record
from chute_ros.links.umbilical.protocol.modes import FlightMode
from chute_ros.model import (
    Armed,
    LandedState,
    LinkState,
    ParachuteState,
    ParachuteStatus,
    TriggerFlags,
    VehicleState,
)
from chute_ros.protocol.boot_clock import Age

#: Mode: situation, parachute, armed, motors (MAV closed, MAV open), landed.
_READY, _ARMED, _LAUNCHED = ParachuteState.READY, ParachuteState.ARMED, ParachuteState.LAUNCHED
_GROUND, _AIR = LandedState.ON_GROUND, LandedState.IN_AIR
_OFF, _ON = Armed.DISARMED, Armed.ARMED
FLAGS = ("ssa_drogue_deployed", "ssa_main_deployed")
MODES = {
    STARTUP: (Situation.STARTUP, _READY, False, (_OFF, _ON), _GROUND),
    STANDBY: (Situation.STANDBY, _ARMED, True, (_ON, _ON), _GROUND),
    ASCENT: (Situation.ASCENT, _ARMED, True, (_OFF, _ON), _AIR),
    COAST: (Situation.COAST, _ARMED, True, (_OFF, _ON), _AIR),
    DROGUE: (Situation.DROGUE_DEPLOYED, _LAUNCHED, True, (_OFF, _ON), _AIR),
    MAIN: (Situation.MAIN_DEPLOYED, _LAUNCHED, True, (_OFF, _ON), _AIR),
    FAULT: (
        *(Situation.FAULT, ParachuteState.ABNORMAL, False, (Armed.UNKNOWN, _ON)),
        LandedState.UNKNOWN,
    ),
}


def test_what_each_flight_mode_means():
    for mode, (situation, state, armed, motors, landed) in MODES.items():
        for mav, motor in zip("01", motors, strict=True):
            rocket = flown((0.0, mode, {"mav_open": mav}))
            seen, moves = status(rocket, 0.5), vehicle(rocket, 0.5)
            assert rocket.computer.situation(0.5) is situation, mode
            assert (seen.state, seen.armed, seen.link_state) == (state, armed, LinkState.OK), mode
            assert seen.armed_triggers == (TriggerFlags.FC if armed else TriggerFlags(0)), mode
            assert seen.deployed == (mode in (DROGUE, MAIN)), mode
            assert seen.faults == (("flight mode Fault",) if mode == FAULT else ()), mode
            assert (moves.armed, moves.landed_state) == (motor, landed), mode
    labels = ["Startup", "Standby", "Ascent", "Coast", "DrogueDeployed", "MainDeployed", "Fault"]
    assert [FlightMode(number).label for number in range(7)] == labels


def test_a_flight_mode_without_a_name_is_no_situation_to_decide_in():
    for mode in ("7", "255", "4294967295"):
        rocket = flown((0.0, mode))
        assert rocket.computer.mode is None
        assert rocket.computer.situation(0.0) is Situation.UNKNOWN, mode
        seen, moves = status(rocket, 0.0), vehicle(rocket, 0.0)
        assert (seen.state, seen.armed) == (ParachuteState.ABNORMAL, False), mode
        assert seen.faults == (f"flight mode {mode} has no name",)
        assert (moves.armed, moves.landed_state) == (Armed.UNKNOWN, LandedState.UNKNOWN), mode


def test_a_deployment_is_seen_by_its_flag_in_any_mode():
    for mode, name, flag in itertools.product(
        (STARTUP, COAST, FAULT, 7), FLAGS, ["1", "2", "255"]
    ):
        seen = status(flown((0.0, mode, {name: flag})), 0.0)
        assert (seen.deployed, seen.state) == (True, _LAUNCHED), (mode, name, flag)


def test_in_flight_one_record_alone_may_be_damaged():
    for out in FLAGS:
        rocket = Rocket()
        for at, mode, flag, deployed in (
            (0.0, ASCENT, "0", False),
            (0.1, COAST, "1", False),
            (0.2, COAST, "0", False),
            (0.3, COAST, "1", False),
            (0.4, COAST, "1", True),
        ):
            rocket.says(at, mode, **{out: flag})
            assert status(rocket, at).deployed is deployed, (out, at)
    for mode in (DROGUE, MAIN):
        rocket = flown((0.0, COAST), (0.1, mode))
        assert not status(rocket, 0.1).deployed, mode
        rocket.says(0.2, mode)
        assert status(rocket, 0.2).deployed, mode


def test_one_record_is_enough_where_it_was_fired_from_here_or_is_the_first():
    rocket = flown((0.0, COAST))
    rocket.computer.fired("drogue", 0.0)
    rocket.says(0.1, COAST, ssa_drogue_deployed="1")
    assert status(rocket, 0.1).deployed
    assert status(flown((0.0, DROGUE, {"ssa_drogue_deployed": "1"})), 0.0).deployed


def test_a_fault_that_follows_a_flight_is_one_in_flight():
    rocket = flown((0.0, ASCENT), (0.1, FAULT), (0.2, FAULT))
    assert rocket.computer.situation(0.2) is Situation.LOST_IN_FLIGHT
    assert vehicle(rocket, 0.2).landed_state is LandedState.IN_AIR
    for at, mode in ((0.3, STANDBY), (0.4, STANDBY), (0.5, FAULT)):
        rocket.says(at, mode)
    assert rocket.computer.situation(0.5) is Situation.FAULT


def test_before_the_first_record_nothing_is_known():
    rocket = Rocket()
    assert status(rocket, 5.0) == ParachuteStatus("", LinkState.NEVER_SEEN)
    assert vehicle(rocket, 5.0) == VehicleState()
    assert rocket.computer.situation(5.0) is Situation.UNKNOWN
    assert rocket.computer.alive(5.0) == []
    assert rocket.computer.update(5.0) == ([], False)
    assert rocket.computer.next_deadline() == math.inf
    assert (rocket.computer.deployed, rocket.computer.landed) == (False, False)


def test_telemetry_is_fresh_for_three_seconds_lost_after_fifteen_and_may_come_back():
    rocket = flown((0.0, STANDBY))
    computer = rocket.computer
    assert computer.next_deadline() == 3.0
    assert computer.situation(2.999) is Situation.STANDBY
    assert computer.situation(3.0) is Situation.UNKNOWN
    changes, picture = computer.update(3.0)
    assert ([one.after for one in changes], picture) == ([LinkState.STALE], True)
    assert computer.update(3.1) == ([], False)
    seen = status(rocket, 3.0)
    assert (seen.state, seen.link_state) == (ParachuteState.ABNORMAL, LinkState.STALE)
    assert seen.faults == ("telemetry STALE: 3.0 s old",)
    assert computer.next_deadline() == 15.0
    changes, _ = computer.update(15.0)
    assert [one.after for one in changes] == [LinkState.LOST]
    assert computer.next_deadline() == math.inf
    assert status(rocket, 20.0).faults == ("telemetry LOST: 20.0 s old",)
    changes, age = rocket.says(20.0, STANDBY)
    assert ([one.regained for one in changes], age) == ([True], Age.NEW)
    assert computer.situation(20.0) is Situation.STANDBY


def test_a_pause_that_is_known_keeps_the_link_but_makes_nothing_fresh():
    rocket = Rocket()
    rocket.says(0.0, STANDBY)
    for second in range(1, 61):
        assert rocket.computer.alive(float(second)) == []
        rocket.computer.update(float(second))
    seen = status(rocket, 60.0, "dump flash in progress")
    assert (seen.link_state, seen.state) == (LinkState.OK, ParachuteState.NOT_READY)
    assert seen.faults == ("no telemetry: dump flash in progress",)
    assert rocket.computer.situation(60.0) is Situation.UNKNOWN
    assert vehicle(rocket, 60.0).height_age == 60.0
    # The pause is over, and nothing came: now the silence counts.
    assert rocket.computer.next_deadline() == 63.0
    assert status(rocket, 61.0).state is ParachuteState.ABNORMAL


def test_the_picture_changes_in_a_pause_when_the_last_record_grows_old():
    rocket = flown((0.0, STANDBY))
    rocket.computer.alive(2.0)
    assert rocket.computer.next_deadline() == 3.0
    assert rocket.computer.update(3.0) == ([], True)
    assert rocket.computer.next_deadline() == 5.0
    rocket = flown((0.0, STANDBY))
    rocket.computer.update(3.0)
    seen = status(rocket, 3.0, "wipe flash in progress")
    silent = (LinkState.STALE, ParachuteState.ABNORMAL)
    assert (seen.link_state, seen.state) == silent, "who is silent in a pause is lost as well"


def test_what_is_deployed_stays_so_in_silence():
    rocket = flown((0.0, MAIN))
    rocket.computer.update(20.0)
    for pause in ("", "dump flash in progress"):
        seen = status(rocket, 20.0, pause)
        assert (seen.state, seen.deployed) == (_LAUNCHED, True), pause


def test_under_a_drogue_before_its_parachute_it_is_launched_and_not_deployed():
    """Given the main as the parachute: the drogue is out, and the main can be fired."""
    rocket = Rocket(main_counts=True)
    for at, mode in ((0.0, ASCENT), (1.0, COAST)):
        rocket.says(at, mode)
        assert status(rocket, at).state is _ARMED
    end = rocket.descends(2.0, 1.0)
    seen = status(rocket, end)
    assert (seen.state, seen.deployed, seen.healthy) == (_LAUNCHED, False, True)
    end = rocket.descends(end + 0.1, 1.0, MAIN)
    seen = status(rocket, end)
    assert (seen.state, seen.deployed, seen.healthy) == (_LAUNCHED, True, False)


def test_a_fault_hides_no_drogue_that_is_out():
    """Given a main that is the parachute: what asks for a deploy must see that a canopy is out."""
    rocket = Rocket(main_counts=True)
    for at, mode in ((0.0, STANDBY), (1.0, ASCENT), (2.0, COAST), (3.0, DROGUE), (3.1, DROGUE)):
        rocket.says(at, mode)
    rocket.says(3.2, DROGUE, altitude="NaN")
    seen = status(rocket, 3.2)
    assert (seen.state, seen.faults) == (_LAUNCHED, ("altitude is nan",))
    rocket.says(3.3, FAULT)
    assert status(rocket, 3.3).state is _LAUNCHED
    assert status(rocket, 3.3).faults == ("flight mode Fault",)


def test_a_pulled_cable_is_called_that():
    rocket = flown((0.0, STANDBY))
    rocket.computer.cable_pulled()
    said = "the cable was pulled, or the port closed: no telemetry for 0.5 s"
    assert status(rocket, 0.5).faults == (said,)
    rocket.says(1.0, STANDBY)
    assert status(rocket, 1.0).faults == ()


def test_it_has_landed_when_its_altitude_rests_for_five_seconds_after_a_deployment():
    rocket = Rocket()
    end = rocket.descends(0.0, 10.0)
    assert status(rocket, end).state is _LAUNCHED
    rocket.descends(end, 4.9, MAIN, 12.0, 0.1)
    assert status(rocket, end + 4.9).state is _LAUNCHED
    rocket.descends(end + 5.0, 0.1, MAIN, 11.5, 0.1)
    seen = status(rocket, end + 5.1)
    assert (seen.state, seen.deployed) == (ParachuteState.TOUCHDOWN, True)
    assert vehicle(rocket, end + 5.1).landed_state is LandedState.ON_GROUND


def test_neither_the_slowest_canopy_nor_silence_nor_rest_without_a_deployment_is_a_landing():
    rocket = Rocket()
    end = rocket.descends(0.0, 60.0, MAIN, 400.0, 1.0)
    assert vehicle(rocket, end).landed_state is LandedState.IN_AIR
    for silence in (5.1, 14.0, 600.0):
        rocket = Rocket()
        at = rocket.descends(0.0, 10.0) + silence
        rocket.computer.update(at)
        assert status(rocket, at).state is _LAUNCHED, silence
        assert vehicle(rocket, at).landed_state is LandedState.IN_AIR, silence
    rocket = Rocket()
    end = rocket.descends(0.0, 10.0, COAST, 3000.0, 0.0)
    assert not rocket.computer.landed
    assert vehicle(rocket, end).landed_state is LandedState.IN_AIR


def test_an_altitude_that_is_none_never_rests():
    for altitude in ("NaN", "inf", "-inf"):
        rocket = flown(*((float(n), MAIN, {"altitude": altitude}) for n in range(20)))
        assert not rocket.computer.landed, altitude
        for second in range(20, 27):
            rocket.says(float(second), MAIN, altitude="5")
        assert rocket.computer.landed, altitude


def test_the_picture_of_the_rocket():
    texts = {"altitude": "1250.5", "vel_d": "-120.25", "latitude": "42.5", "longitude": "-76.25"}
    texts |= {"accel_x": "3", "accel_y": "-4", "accel_z": "12"}
    rocket = flown((1.0, ASCENT), (2.0, ASCENT, texts))
    seen = vehicle(rocket, 2.5)
    assert (seen.source, seen.link_state, seen.uptime) == ("flight_computer", LinkState.OK, 102.0)
    assert (seen.height, seen.vertical_speed, seen.acceleration) == (1250.5, 120.25, 13.0)
    assert (seen.latitude, seen.longitude) == (42.5, -76.25)
    ages = (seen.height_age, seen.vertical_speed_age, seen.acceleration_age, seen.position_age)
    assert (*ages, seen.armed_age, seen.landed_state_age) == (0.5,) * 6
    assert (status(rocket, 2.5).height, status(rocket, 2.5).uptime) == (1250.5, 102.0)
    assert (rocket.computer.records, rocket.computer.interval) == (2, 1.0)


def test_without_a_three_dimensional_fix_there_is_no_position_and_no_speed():
    for fix, has in (("0", False), ("2", False), ("3", True), ("4", True)):
        seen = vehicle(flown((0.0, ASCENT, {"fix_type": fix})), 1.0)
        values = (seen.vertical_speed, seen.latitude, seen.longitude)
        values = (*values, seen.vertical_speed_age, seen.position_age)
        assert [math.isfinite(one) for one in values] == [has] * 5, fix
        assert math.isfinite(seen.height)


def test_what_is_no_number_has_no_age_and_is_a_fault_of_the_barometer():
    for text in ("NaN", "inf", "-inf"):
        odd = dict.fromkeys(("altitude", "accel_y", "vel_d"), text)
        seen = vehicle(flown((0.0, ASCENT, odd)), 1.0)
        ages = (seen.height_age, seen.acceleration_age, seen.vertical_speed_age)
        assert [math.isnan(age) for age in ages] == [True] * 3, text
    for name in ("altitude", "pressure"):
        seen = status(flown((0.0, STANDBY, {name: "NaN"})), 0.0)
        assert (seen.faults, seen.state) == ((f"{name} is nan",), ParachuteState.ABNORMAL)


def test_its_height_is_above_where_it_stood_wherever_its_altitude_counts_from():
    """The reference says "altitude (m)" and no more: on a site 1400 m up it may be that."""
    rocket = Rocket()
    for step in range(80):  # the weather, and a lift on the rail
        rocket.says(step / 10, STANDBY, altitude=str(1400.0 + 0.02 * step))
    rocket.says(8.0, ASCENT, altitude="1440.0")
    rocket.says(8.1, ASCENT, altitude="1901.6")
    for seen in (vehicle(rocket, 8.1), status(rocket, 8.1)):
        assert seen.height == pytest.approx(500.0, abs=0.1)
    assert not vehicle(rocket, 8.1).height_holds, "as it has not started anew"


def test_one_that_is_first_heard_in_flight_tells_its_altitude():
    assert vehicle(flown((0.0, COAST, {"altitude": "1900"})), 0.0).height == 1900.0


@pytest.mark.parametrize("counts_from", [0.0, 1400.0, 1700.0])
def test_a_restart_in_flight_does_not_move_its_height(counts_from):
    """Whether its altitude counts from the sea, or from where it started anew: its pressure does
    not."""
    rocket = Rocket()
    rocket.says(0.0, STANDBY, altitude="1400", pressure="85600")
    rocket.says(1.0, ASCENT, altitude="1500", pressure="84560")
    rocket.says(2.0, DROGUE, altitude="1700", pressure="82520", ssa_drogue_deployed="1")
    rocket.restarts(3.0)
    rocket.says(3.0, STARTUP, altitude=str(1680 - counts_from), pressure="82720")
    rocket.says(3.1, STARTUP, altitude=str(1678 - counts_from), pressure="82740")
    rocket.says(9.0, STARTUP, altitude=str(1550 - counts_from), pressure="84040")
    seen = vehicle(rocket, 9.0)
    assert (seen.rebooted_in_flight, seen.height_holds) == (True, True)
    assert seen.height == pytest.approx(150.0, abs=5.0)
    assert status(rocket, 9.0).height == seen.height


@pytest.mark.parametrize("damaged", [0.0, 900.0])
def test_after_a_restart_it_lands_at_its_ground_on_a_high_site_as_well(damaged):
    """Given altitudes that count from the pressure of a pad 1400 m up, which are another scale
    than the standard atmosphere's, and a last one before the restart that may be damaged."""

    def above(height):
        pressure = 85600.0 * (1.0 - height / 44_330.0) ** (1.0 / 0.190263)
        return {"altitude": f"{height:.2f}", "pressure": f"{pressure:.1f}"}

    rocket = Rocket()
    for step in range(60):
        rocket.says(step / 10, STANDBY, **above(0.0))
    rocket.says(7.0, ASCENT, **above(1000.0))
    rocket.says(8.0, COAST, **{**above(3000.0), "altitude": str(3000.0 + damaged)})
    rocket.restarts(9.0)
    for step in range(2):
        rocket.says(9.0 + step / 10, STARTUP, **{**above(2900.0), "altitude": "0"})
    for height in (1500.0, 150.0, 0.0):
        anew = {**above(height), "altitude": str(height - 2900.0)}
        rocket.says(99.0 - height / 100.0, STARTUP, **anew)
        seen = vehicle(rocket, 99.0 - height / 100.0)
        assert seen.height == pytest.approx(height, abs=0.05 * height + 1.0)


def test_without_a_pressure_nobody_knows_its_height_after_a_restart():
    rocket = flown((0.0, STANDBY, {"pressure": "NaN"}), (1.0, ASCENT, {"pressure": "NaN"}))
    rocket.restarts(3.0)
    rocket.says(3.0, STARTUP, altitude="3")
    rocket.says(3.1, STARTUP, altitude="3")
    seen = vehicle(rocket, 3.1)
    assert (seen.rebooted_in_flight, seen.height_holds) == (True, False)


def test_any_layout_serves_also_one_with_hardly_a_field():
    for layout in BY_NAME.values():
        values = layout.decode(body(layout, flight_mode="1", ssa_drogue_deployed="0"))
        computer = FlightComputerTracker(LIMITS)
        computer.heard(Record(layout, values, 0.0), 0.0)
        assert computer.record.number("altitude") == 12.5, layout.name
        assert computer.status(0.0, "").deployed, layout.name
    reference = BY_NAME["telem57_airbrake_state"]
    needed = ("flight_mode", "altitude", "sv_open", "mav_open", *FLAGS, "ms_since_boot_cfc")
    small = Layout("small", tuple(f for f in reference.fields if f.name in needed), 2, ())
    computer = FlightComputerTracker(LIMITS)
    computer.heard(Record(small, small.decode("1,25,0,0,0,0,99"), 0.0), 0.0)
    seen = computer.vehicle_state(0.0)
    assert (seen.height, seen.armed, seen.landed_state) == (0.0, Armed.ARMED, _GROUND)
    values = (seen.acceleration, seen.latitude, seen.vertical_speed, seen.position_age)
    assert [math.isnan(one) for one in values] == [True] * 4


RECORDS = st.fixed_dictionaries(
    {
        "flight_mode": st.sampled_from("01234567"),
        "altitude": st.sampled_from(["0", "1", "5", "1000", "NaN", "inf", "-0"]),
        "ssa_drogue_deployed": st.sampled_from("01"),
        "ssa_main_deployed": st.sampled_from("01"),
        "mav_open": st.sampled_from("01"),
        "fix_type": st.sampled_from("0234"),
        "ms_since_boot_cfc": st.sampled_from(["0", "1", "500", "5000", "60000", "4294967295"]),
    }
)


def seen(computer, now):
    """What others decide on, without the ages."""
    one = computer.status(now, "")
    other = computer.vehicle_state(now)
    return (
        *(one.state, one.armed, one.deployed, one.link_state, computer.situation(now)),
        *(other.armed, other.landed_state, other.link_state, other.rebooted_in_flight),
    )


@given(st.lists(st.tuples(RECORDS | st.none(), st.floats(0, 20)), max_size=20))
def test_the_picture_changes_by_a_record_or_at_a_deadline_and_never_between(story):
    """Each step: a record (None: only a sign of life), and the time until the next."""
    computer, now = FlightComputerTracker(LIMITS), 0.0
    for texts, pause in story:
        if texts is None:
            computer.alive(now)
        else:
            computer.heard(record(now, **texts), now)
        computer.update(now)
        until = now + pause
        while (deadline := computer.next_deadline()) <= until:
            assert deadline > now
            assert seen(computer, math.nextafter(deadline, 0.0)) == seen(computer, now)
            before, now = seen(computer, now), deadline
            _, told = computer.update(now)
            assert told or seen(computer, now) == before
        assert seen(computer, until) == seen(computer, now)
        now = until
