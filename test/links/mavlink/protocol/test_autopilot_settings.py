"""The autopilot's parameters are read one at a time, again if lost, and after a restart."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_bench import Bench, ack, ardupilot, copter, heartbeat, no_setting, px4_integer, setting

from chute_ros.links.mavlink.protocol.autopilot_settings import (
    NAMES,
    READ_AGAIN,
    AutopilotSettings,
)
from chute_ros.links.mavlink.protocol.firmware import Firmware
from chute_ros.protocol.mavlink.dialect import dialect as d

PILOT = (1, 1)


def asked(bench):
    """The names that were asked for, in order."""
    assert all(m.param_index == -1 for m in bench.reads())
    return [m.param_id for m in bench.reads()]


def test_all_are_asked_for_by_name_in_turn_and_not_at_once():
    bench = Bench()
    for _ in range(80):
        bench.at(bench.t + 0.05).hear(PILOT, copter())
        if bench.reads() and asked(bench)[-1] not in bench.link.setup().settings:
            raise AssertionError(asked(bench))
        if bench.reads():
            bench.hear(PILOT, px4_integer(asked(bench)[-1], 1))
    assert asked(bench) == list(NAMES[Firmware.PX4])
    times = [t for t, m in bench.sent if m.get_type() == "PARAM_REQUEST_READ"]
    assert all(b - a >= 0.19 for a, b in itertools.pairwise(times))
    assert set(bench.link.setup().settings.values()) == {"1"}


def test_a_lost_request_is_sent_again_and_a_name_without_an_answer_is_not_there():
    bench = Bench(needed_message_rate=0.0).hear(PILOT, ardupilot())
    for _ in range(120):
        bench.at(bench.t + 0.1).hear(PILOT, ardupilot())
        if asked(bench)[-1] != "ARMING_REQUIRE":
            bench.hear(PILOT, setting(asked(bench)[-1], 0))
    assert asked(bench).count("ARMING_REQUIRE") == 3
    told = bench.link.setup().settings
    assert told.pop("ARMING_REQUIRE") == "not there"
    assert set(told.values()) == {"0"}
    assert bench.link.vehicle_state(bench.now).faults == ()


def test_an_autopilot_that_answers_only_commands_is_said_to_and_forbids_nothing():
    bench = Bench(needed_message_rate=0.0).hear(PILOT, ardupilot())
    for _ in range(30):
        bench.stream(bench.t + 1.0, 0.1, PILOT, ardupilot)
        bench.hear(PILOT, *(ack(one.command) for one in bench.commands()))
    setup = bench.link.setup()
    assert set(setup.settings.values()) == {"not answered"}
    assert any("answers no parameter request" in text for text in setup.warnings)
    assert bench.link.vehicle_state(bench.now).faults == ()
    assert len(bench.reads()) == 3 * len(NAMES[Firmware.ARDUPILOT])


def test_an_unknown_autopilot_is_asked_for_nothing():
    bench = Bench().stream(30.0, 0.5, PILOT, lambda: heartbeat(d.MAV_TYPE_QUADROTOR, 0))
    assert bench.reads() == []
    assert bench.link.setup().settings == {}


def test_they_are_read_again_now_and_then_and_after_a_restart():
    bench = Bench()

    def talk(until, boot):
        while bench.t < until:
            clock = d.MAVLink_system_time_message(0, int((bench.t - boot) * 1000.0))
            bench.at(bench.t + 0.5).hear(PILOT, ardupilot(), clock)
            if bench.reads():
                bench.hear(PILOT, setting(asked(bench)[-1], 0))

    names = list(NAMES[Firmware.ARDUPILOT])
    talk(20.0, 0.0)
    assert asked(bench) == names
    talk(READ_AGAIN + 10.0, 0.0)
    assert asked(bench) == names * 2
    talk(READ_AGAIN + 20.0, bench.t)
    assert asked(bench) == names * 3
    assert bench.link.vehicle_state(bench.now).reboot_count == 1


@pytest.mark.parametrize("value", [0, 1, -1, 42, 121212, -(2**31), 2**31 - 1])
def test_an_integer_of_px4_lies_in_the_bytes_of_the_float(value):
    bench = Bench().hear(PILOT, copter(), px4_integer("CBRK_FLIGHTTERM", value))
    assert bench.link.setup().settings["CBRK_FLIGHTTERM"] == f"{float(value):g}"


@pytest.mark.parametrize(
    ("kind", "value"),
    [(d.MAV_PARAM_TYPE_INT8, 1.0), (d.MAV_PARAM_TYPE_INT16, 42.0), (d.MAV_PARAM_TYPE_REAL32, 0.5)],
)
def test_a_value_of_ardupilot_is_the_float_itself(kind, value):
    bench = Bench().hear(PILOT, ardupilot(), setting("AFS_TERM_ACTION", value, kind))
    assert bench.link.setup().settings["AFS_TERM_ACTION"] == f"{value:g}"


def test_what_another_device_says_of_a_parameter_is_not_the_autopilots():
    bench = Bench().hear(PILOT, ardupilot())
    bench.hear((1, 190), setting("ARMING_REQUIRE", 0)).hear((2, 1), setting("ARMING_REQUIRE", 0))
    assert bench.link.setup().settings["ARMING_REQUIRE"] == "not read yet"


def test_a_parameter_that_goes_is_not_there_and_one_that_comes_is():
    bench = Bench().hear(PILOT, ardupilot(), no_setting("AFS_ENABLE"))
    assert bench.link.setup().settings["AFS_ENABLE"] == "not there"
    bench.hear(PILOT, setting("AFS_ENABLE", 1))
    assert bench.link.setup().settings["AFS_ENABLE"] == "1"
    bench.hear(PILOT, no_setting("AFS_ENABLE"))
    assert bench.link.setup().settings["AFS_ENABLE"] == "not there"


@given(
    st.lists(
        st.tuples(
            st.sampled_from([*NAMES[Firmware.PX4], *NAMES[Firmware.ARDUPILOT], "", "X" * 16]),
            st.floats(width=32, allow_nan=True),
            st.integers(0, 255),
            st.floats(0.0, 30.0),
        ),
        max_size=30,
    ),
    st.sampled_from(Firmware),
)
def test_whatever_comes_nothing_raises_and_requests_keep_their_pace(answers, firmware):
    settings, now, requests = AutopilotSettings(), 0.0, []
    settings.begin(firmware, now)
    for name, value, kind, wait in answers:
        settings.heard(setting(name, value, kind))
        for _ in range(20):
            now += wait / 20
            if settings.due(now):
                requests.append(now)
        assert all(text for text in settings.texts().values())
        known = [settings.get(one) for one in settings.texts()]
        assert all(one is None or math.isfinite(one) for one in known)
    assert all(b - a >= 0.19 for a, b in itertools.pairwise(requests))
