"""judge_log over flights of the simulated autopilot, written in every format that it reads."""

from __future__ import annotations

import contextlib
import copy
import math
import os
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest
from command_bench import refused, tool
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from log_bench import (
    FAILS_AT,
    FORMATS,
    HEIGHT,
    LANDED_AT,
    Told,
    dataflash,
    judged,
    mavros,
    times_of,
    ulog,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from chute_ros.model import VTOL, Action
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.ros.config_folder import config_folder
from chute_ros.tools.judge_log import command, formats, table, told
from chute_ros.tools.judge_log.findings import ratings, unknown, verdict_of
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError
from chute_ros.tools.judge_log.log_flight import JudgedLog
from chute_ros.tools.judge_log.page import flight_section, page
from chute_ros.tools.judge_log.sweep import Tried, sweep
from chute_ros.tools.progress import Progress

EACH = pytest.mark.parametrize("name", FORMATS)
# Flights are flown and judged once for all.
pytestmark = pytest.mark.xdist_group("judge_log")


@pytest.fixture(scope="module")
def fell(fallen: list[Told], tmp_path_factory) -> Callable[[str], JudgedLog]:
    """fell(name of a format): the flight whose motor fails, judged by that log."""
    folder = tmp_path_factory.mktemp("fell")
    return cache(lambda name: judged(FORMATS[name](fallen, folder / name)))


def highest(one: JudgedLog) -> float:
    return max(state.height for _, state in one.vehicle if math.isfinite(state.height))


# -- every format ------------------------------------------------------------------------------


@EACH
def test_a_flight_that_went_well_is_not_ended(name, landed, tmp_path):
    one = judged(FORMATS[name](landed, tmp_path / name))
    assert verdict_of(one).words == "nothing ended the flight"
    assert LANDED_AT - 5.0 < one.flew < one.log.duration - 3.0, "from its take-off to its landing"
    assert highest(one) == pytest.approx(HEIGHT, abs=0.5)
    assert one.ended == pytest.approx(one.log.duration)


@EACH
def test_a_fall_is_ended_in_time(name, fallen, fell):
    one = fell(name)
    # The log begins with its first message.
    fails_at = FAILS_AT - fallen[0].at
    kill, deploy = (at for at, _ in one.fired)
    assert [decision.action for _, decision in one.fired] == [Action.KILL, Action.DEPLOY]
    assert fails_at < kill < fails_at + 1.2
    assert kill <= deploy < kill + 0.6
    assert one.ended < one.log.duration, "what follows is no answer to the release"


def test_a_quadplane_is_known_by_its_parameter(landed, tmp_path):
    for name in ("quadplane.bin", "quadplane.log"):
        log = formats.read(dataflash(landed, tmp_path / name, Q_ENABLE=1.0), {})
        assert (log.vehicle_type, log.profile) == (VTOL, "fixed_wing")
    one = command.flown(log, command.config_of(log, "multirotor"))
    assert verdict_of(one).words == "nothing ended the flight"


@EACH
def test_the_attitude_and_the_force_are_those_of_the_flight(name, fell):
    one = fell(name)
    falling = [state for at, state in one.vehicle if at > FAILS_AT + 0.5]
    assert max(state.tilt for state in falling) > 1.0
    assert min(state.acceleration for state in falling) < 3.0
    before = [state for at, state in one.vehicle if FAILS_AT - 3.0 < at < FAILS_AT - 1.0]
    assert all(state.acceleration == pytest.approx(9.8, abs=0.5) for state in before)
    assert all(state.tilt < 0.05 for state in before)


@pytest.mark.parametrize(
    ("home", "higher"),
    [
        ({}, 0.0),
        ({"home_z": 3.0}, 3.0),
        ({"home_z": 3.0, "valid_alt": False}, 0.0),
    ],
)
def test_a_height_of_px4_is_above_a_valid_home_or_the_origin(home, higher, landed, tmp_path):
    """Given a home at the altitude of the take-off, one 3 m below the origin, and one that is not
    valid, whose altitude is 0: heights were by 488 m higher."""
    raised = [replace(one, message=_raised(one.message)) for one in landed]
    log = formats.read(ulog(raised, tmp_path / "flight.ulg", **home), {})
    heights = [m.relative_alt / 1e3 for _, m in log.messages if hasattr(m, "relative_alt")]
    assert max(heights) == pytest.approx(HEIGHT + higher, abs=0.5)
    homes = [m.altitude for _, m in log.messages if m.get_type() == "HOME_POSITION"]
    assert bool(homes) is home.get("valid_alt", True)


def _raised(message: Any) -> Any:
    """Where the ground is 488 m high."""
    if message.get_type() != "GLOBAL_POSITION_INT":
        return message
    higher = copy.copy(message)
    higher.alt = message.alt + 488_000
    return higher


# -- what is damaged ---------------------------------------------------------------------------


class Files(dict):
    """Whose bytes nobody wants to read when a test fails."""

    def __repr__(self) -> str:
        return f"files {', '.join(self)}"


@pytest.fixture(scope="module")
def whole(fallen, tmp_path_factory) -> Files:
    """The bytes of each format that is one file; 2 s of flight."""
    folder = tmp_path_factory.mktemp("whole")
    short = [one for one in fallen if abs(one.at - FAILS_AT) < 1.0]
    files = [name for name in FORMATS if "." in name]
    return Files({name: FORMATS[name](short, folder / name).read_bytes() for name in files})


@given(data=st.data())
@settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_a_damaged_log_is_read_or_refused_in_words(data, whole, tmp_path):
    name = data.draw(st.sampled_from(sorted(whole)))
    damaged = bytearray(whole[name])
    for _ in range(data.draw(st.integers(0, 8))):
        place = data.draw(st.integers(0, len(damaged) - 1))
        damaged[place] = data.draw(st.integers(0, 255))
    del damaged[data.draw(st.integers(0, len(damaged))) :]
    path = tmp_path / name
    path.write_bytes(damaged)
    # Anything but a LogError is raised.
    with contextlib.suppress(LogError):
        assert formats.read(path, {}).messages


def assert_is_read_from(log: FlightLog, whole: FlightLog, share: float) -> None:
    """All kinds of messages of the same vehicle, over so much of the time."""
    assert times_of(log).keys() == times_of(whole).keys()
    assert (log.vehicle_type, log.autopilot) == (whole.vehicle_type, whole.autopilot)
    assert share * whole.duration <= log.duration <= whole.duration


@pytest.mark.parametrize("name", ["flight.tlog", "flight.bin", "flight.log"])
def test_a_log_whose_first_bytes_are_damaged_is_known_by_its_name(name, fallen, tmp_path):
    path = FORMATS[name](fallen, tmp_path / name)
    whole = formats.read(path, {})
    path.write_bytes(b"\xff" * 20 + path.read_bytes()[20:])
    assert_is_read_from(formats.read(path, {}), whole, 0.99)


def test_an_mcap_is_known_by_its_first_bytes(fallen, tmp_path):
    path = FORMATS["box.mcap"](fallen, tmp_path / "box.mcap")
    box, other = formats.read(path, {}), path.rename(tmp_path / "box")
    assert numbers(formats.read(other, {})) == numbers(box)


def test_a_recording_that_was_cut_off_too_early_says_so(fallen, tmp_path):
    path = FORMATS["box.mcap"](fallen, tmp_path / "box.mcap")
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(LogError, match=r"no topic reports a height.*ends in the middle"):
        formats.read(path, {})


@pytest.mark.parametrize("name", [one for one in FORMATS if "." in one])
def test_a_log_that_was_cut_off_is_read_to_there(name, fallen, tmp_path):
    path = FORMATS[name](fallen, tmp_path / name)
    whole = formats.read(path, {})
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.9)])
    assert_is_read_from(formats.read(path, {}), whole, 0.88)


@pytest.mark.parametrize(("middle", "tail"), [(5000, 0), (0, 5000), (300, 300), (0, 0)])
def test_damage_of_a_binary_log_is_told_in_a_line(middle, tail, landed, tmp_path, capfd):
    """Given zeros between two entries, and behind the last one, where a few are no damage. A part
    of its reader writes past Python, to the terminal itself."""
    path = dataflash(landed, tmp_path / "flight.bin")
    whole = path.read_bytes()
    place = whole.index(b"\xa3\x95\x81", len(whole) // 2)
    path.write_bytes(whole[:place] + bytes(middle) + whole[place:] + bytes(tail))
    log = formats.read(path, {})
    damaged = middle + (tail if tail > 528 else 0)
    assert log.remarks == [f"{damaged} damaged bytes were passed over"] * bool(damaged)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("empty.bin", b"", "it is empty"),
        ("notes.txt", b"the flight went well\n", "no log of a known format (ArduPilot's .bin"),
        ("noise.dat", bytes(range(256)), "no log of a known format"),
        ("noise.tlog", bytes(range(256)), "no heartbeat of an autopilot is in it"),
        ("noise.bin", bytes(range(256)), "no log of ArduPilot"),
        ("noise.mcap", bytes(range(256)), "no recording of ROS"),
        ("table.csv", b"a,b\n1,2\n", "no column for time and height; its first line has a, b"),
        ("table.csv", b"time,height\n1,x\n", "no flight: of 1 rows 0 have a number for time "),
        ("table.csv", b"time," + b"a" * 200_000 + b"\n1,2\n", "no table: field larger than"),
        (
            "table.csv",
            b"time,height\n" + b"".join(b"%d,1\n" % (k * 100_000) for k in range(9)),
            "its rows are 1e+05 s apart: if 'time' is in other units, --column 'time=time*FACTOR'",
        ),
        ("flight.mcap", b"\x89MCAP0\r\n", "no recording of ROS"),
    ],
)
def test_what_is_no_log_is_refused(name, text, says, tmp_path):
    path = tmp_path / name
    path.write_bytes(text)
    with pytest.raises(LogError) as caught:
        formats.read(path, {})
    assert says in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("number", [1e300, -1e300, 1e42, math.inf, math.nan])
def test_a_number_that_no_wire_carries_counts_as_not_told(number):
    """Given one such number after the other in each message that a log becomes."""
    encoder = FrameEncoder(1, 1)
    makers: list[tuple[Callable[..., Any], list[Any]]] = [
        (told.attitude, [0.1, 0.2, 0.3]),
        (told.position, [5.0, 1.0, 400.0, 47.0, 8.0]),
        (told.pressure, [101_325.0]),
        (partial(told.acceleration, 0), [0.0, 0.0, -9.8]),
        (told.battery, [15.0, 0.5]),
        (lambda *five: told.attitude_target(five[:4], five[4]), [1.0, 0.0, 0.0, 0.0, 0.5]),
        (told.position_target, [5.0, 1.0]),
        (told.local_position, [5.0, 1.0]),
        (told.wing_target, [0.1, 0.2, 3.0]),
        (told.home, [400.0, 47.0, 8.0, 0.0]),
    ]
    for make, right in makers:
        for place in range(len(right)):
            message = make(*[number if k == place else one for k, one in enumerate(right)])
            assert message is None or encoder.encode(message, 0.0)
    assert told.position(number, 1.0, 400.0, 47.0, 8.0) is None, "it would have no height"
    assert told.acceleration(0, math.nan, 0.0, 0.0) is None, "that would be a free fall"
    assert told.position(5.0, 1.0, 400.0, number, 8.0).relative_alt == 5000
    assert told.home(400.0, number, 8.0, 0.0).altitude == 400_000


def test_a_log_that_cannot_be_judged_keeps_no_other_from_it(landed, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    bad, good = begun(landed, tmp_path), tmp_path / "good.tlog"
    good.write_bytes(bad.read_bytes())
    fly = command.fly

    def fails(log: FlightLog, *arguments: Any) -> JudgedLog:
        if log.path == bad:
            raise OverflowError("a number")
        return fly(log, *arguments)

    monkeypatch.setattr(command, "fly", fails)
    _, errors = refused(command, monkeypatch, capsys, str(bad), str(good))
    assert errors.strip() == f"judge_log: {bad}: it cannot be judged: a number"
    assert "good.tlog" in (tmp_path / "judged.html").read_text()


# -- rockets -----------------------------------------------------------------------------------


def rocket(sinks: float, time: str, height: str, unit: float) -> str:
    """Up to 3,000 m, and down as fast as that, m/s."""
    lines = [f"{time},{height}"]
    lines += [f"{k / 10},{(150.0 * k / 10) / unit}" for k in range(200)]
    lines += [f"{20 + k / 10},{(3000.0 - sinks * k / 10) / unit}" for k in range(300)]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(("sinks", "fires"), [(25.0, False), (90.0, True)])
def test_a_rocket_is_judged_by_its_table(sinks, fires, tmp_path):
    path = tmp_path / "rocket.csv"
    path.write_text(rocket(sinks, "time", "height", 1.0))
    one = judged(path)
    assert one.config.profile.name == "rocket"
    assert bool(one.fired) is fires
    assert highest(one) == pytest.approx(3000.0, abs=20.0)


def numbers(log: FlightLog) -> list[float]:
    """All that was sent, and when."""
    sent = [(at, *message.to_dict().values()) for at, message in log.messages]
    return [one for row in sent for one in row if not isinstance(one, str)]


@pytest.mark.parametrize(
    ("time", "height", "unit"),
    [
        ("Time (s)", "Altitude (Ft-AGL)", 0.3048),
        ("ts", "filtered_altitude_AGL", 1.0),
        ("time_s", "altitude_ft", 0.3048),
        ("#t [s]", "alt(km)", 1000.0),
    ],
)
def test_a_table_of_other_headings_and_units_is_the_same_flight(time, height, unit, tmp_path):
    plain, other = tmp_path / "plain.csv", tmp_path / "other.csv"
    plain.write_text(rocket(25.0, "time", "height", 1.0))
    other.write_text(rocket(25.0, time, height, unit))
    one, same = formats.read(plain, {}), formats.read(other, {})
    assert same.profile == "rocket"
    assert [m.get_type() for _, m in same.messages] == [m.get_type() for _, m in one.messages]
    # Whole numbers of mm and cm/s.
    assert numbers(same) == pytest.approx(numbers(one), abs=1.001)


def test_a_unit_that_is_not_known_is_not_guessed(tmp_path):
    path = tmp_path / "rocket.csv"
    path.write_text(rocket(25.0, "time", "height (furlong)", 1.0))
    with pytest.raises(LogError, match="no column for time and height"):
        judged(path)
    columns = dict([table.column("height=height (furlong)*201.168")])
    log = formats.read(path, columns)
    assert log.remarks == ["height from 'height (furlong)', time from 'time'"]


@pytest.mark.parametrize(
    ("headings", "used"),
    [
        (("time_s", "altitude_m", "velocity_ms"), None),
        (("Time (s)", "Altitude (m)", "Vertical velocity (ms)"), None),
        (("time", "altitude", "speed (m)"), None),
        (("time", "altitude", "speed_s"), None),
        (("time", "altitude", "velocity_fps"), "velocity_fps"),
        (("time_m", "altitude_m", "speed"), "no column for time and height"),
        (("time (ft)", "altitude", "speed"), "no column for time and height"),
        (("time", "altitude_s", "speed"), "no column for time and height"),
        (("time", "altitude_ms", "speed"), "no column for time and height"),
    ],
)
def test_a_unit_of_another_quantity_is_not_known(headings, used, tmp_path):
    """Given a speed in ms, which is no speed: the heights tell it."""
    path = tmp_path / "rocket.csv"
    rows = [",".join(headings), *(f"{k / 10},{k},3" for k in range(100))]
    path.write_text("\n".join(rows))
    if used == "no column for time and height":
        with pytest.raises(LogError, match=used):
            formats.read(path, {})
        return
    (remark,) = formats.read(path, {}).remarks
    assert ("vertical_speed" in remark) is bool(used)
    assert used is None or f"vertical_speed from {used!r}" in remark


@pytest.mark.parametrize(
    ("heading", "apart", "is_read"),
    [("time", 50, False), ("time", 5, True), ("time (s)", 50, True), ("time (ms)", 50, True)],
)
def test_times_without_a_unit_are_seconds_only_if_rows_come_as_often(
    heading, apart, is_read, tmp_path
):
    """Given an altimeter that writes milliseconds at 20 Hz, or one that writes every 5 s."""
    path = tmp_path / "rocket.csv"
    rows = "".join(f"{k * apart},{k}\n" for k in range(100))
    path.write_text(f"{heading},height\n{rows}")
    if is_read:
        assert formats.read(path, {}).messages
        return
    with pytest.raises(LogError, match=r"its rows are 50 s apart: if 'time' is in other units"):
        formats.read(path, {})


def test_a_heading_that_was_given_and_is_not_there_is_not_replaced_by_another(tmp_path):
    path = tmp_path / "rocket.csv"
    path.write_text(rocket(25.0, "time", "height", 1.0))
    with pytest.raises(LogError, match=r"\(given: 'Height AGL' \(for height\)\); its first line"):
        formats.read(path, dict([table.column("height=Height AGL")]))


def test_a_recording_of_something_else_is_refused_with_what_it_lacks(tmp_path):
    store, kind = get_typestore(Stores.ROS2_JAZZY), "std_msgs/msg/Float64"
    with Writer(tmp_path / "other", version=9) as writer:
        topic = writer.add_connection("/temperature", kind, typestore=store)
        writer.write(topic, 10**9, store.serialize_cdr(store.types[kind](21.0), kind))
    with pytest.raises(LogError, match="no topic reports a height"):
        formats.read(tmp_path / "other", {})


STRANGERS = [
    ("/planner/state", "std_msgs/msg/String", ("IDLE",)),
    ("/lidar/altitude", "std_msgs/msg/Float64", (1.5,)),
    ("/gripper/battery", "std_msgs/msg/Float32", (12.0,)),
    ("/zed/local_position/odom", "std_msgs/msg/Float32", (12.0,)),
    ("/other/global_position/rel_alt", "std_msgs/msg/Float64", (math.nan,)),
]


@pytest.mark.parametrize("storage", StoragePlugin)
def test_topics_of_another_program_change_nothing(storage, fallen, tmp_path):
    """Given topics that end as those of MAVROS do, of other types, or without a number."""
    alone = mavros(fallen, tmp_path / "alone", storage=storage)
    beside = mavros(fallen, tmp_path / "beside", STRANGERS, storage)
    (file,) = beside.glob(f"*.{'mcap' if storage is StoragePlugin.MCAP else 'db3'}")
    log = formats.read(file, {})
    assert numbers(log) == numbers(formats.read(alone, {}))
    assert log.remarks == ["nothing reports when it was armed: taken to be armed throughout"]


def test_a_fifo_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "flight.bin")
    with pytest.raises(LogError, match="no regular file but a FIFO"):
        formats.read(tmp_path / "flight.bin", {})


@pytest.mark.parametrize("text", ["height", "size=x", "height=x*0", "height=x*-", "=x"])
def test_a_column_that_makes_no_sense_is_refused(text):
    with pytest.raises(ValueError, match=r"need NAME=HEADING|could not convert|factor"):
        table.column(text)


# -- what is told ------------------------------------------------------------------------------


def test_how_near_each_rule_came_is_told(fell):
    one = fell("flight.ulg")
    first, *rest = ratings(one)
    assert first.share == 1.0
    full = {rating.told.name for rating in ratings(one) if rating.share == 1.0}
    assert one.fired[0][1].rule in full
    assert all(first.share >= other.share for other in rest)
    assert any("tilt_deg" in text for rating in ratings(one) for text in rating.nearest)


def test_what_was_missing_to_decide_is_told(landed, tmp_path):
    """Given a radio link over which no attitude came: its flight took place, and is judged."""
    fewer = [one for one in landed if one.message.get_type() != "ATTITUDE"]
    one = judged(FORMATS["flight.tlog"](fewer, tmp_path / "flight.tlog"))
    assert "ATTITUDE has never come" not in "".join(text for _, text in one.said)
    assert one.flew > LANDED_AT - 5.0
    missing = {part.name: part for part in unknown(one)}
    assert (missing["tilt_deg"].share, missing["tilt_deg"].why) == (1.0, "never received")
    tilt = next(rating for rating in ratings(one) if rating.told.name == "excess tilt")
    assert tilt.blind > 0.9


def test_what_was_missing_to_be_in_flight_is_told(landed, tmp_path):
    """Given a log with an attitude alone: nothing tells a take-off."""
    kinds = ("HEARTBEAT", "ATTITUDE")
    fewer = [one for one in landed if one.message.get_type() in kinds]
    one = judged(FORMATS["flight.tlog"](fewer, tmp_path / "flight.tlog"))
    verdict = verdict_of(one)
    assert verdict.words == "never in flight"
    missing = {part.name: part for part in verdict.unknown}
    assert (missing["height"].share, missing["height"].why) == (1.0, "never received")
    assert "it was never in flight: in the whole log" in flight_section(0, verdict, one, [])


def test_a_rule_that_waits_for_nothing_is_told_without_a_counter(fell):
    """`parachute open` has no `for`: its counter has no highest, which was told as nan s."""
    one = fell("flight.tlog")
    rules = {rating.told.name: rating.told for rating in ratings(one)}
    first = rules[one.fired[0][1].rule]
    assert command._came(replace(first, hold=0.0)) == (
        f"{first.name} fulfilled, {first.fulfilled_at:.1f} s"
    )
    assert command._came(first).startswith(f"{first.name} {first.peak:.2f} of {first.hold:g} s, ")


@pytest.fixture(scope="module")
def swept(fell) -> tuple[JudgedLog, list[Tried]]:
    """One that falls, and what other thresholds, of few, would have made of it."""
    one = fell("flight.tlog")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr("chute_ros.tools.judge_log.sweep.FACTORS", (1.1, 3.0))
        return one, sweep(one)


def test_a_sweep_tells_which_threshold_would_have_kept_it_clean(swept):
    """Clean is a threshold with which nothing ends the whole log, by whatever rule. Given a fall
    that every rule sees, none is: it lands hard whatever one of them waits for."""
    one, tried = swept
    rule = next(r for r in one.config.profile.rules if r.name == one.fired[0][1].rule)
    assert {t.rule for t in tried} == {rule.name}
    for t in tried:
        assert math.isnan(t.clean) is bool(t.ended), t
    hold = next(t for t in tried if t.what == "for (s)")
    assert hold.shipped == rule.hold
    assert math.isnan(hold.clean)
    assert " at " in hold.ended
    assert hold.furthest == pytest.approx(3.0 * hold.shipped)


def test_the_page_has_every_log_and_nothing_of_it_raw(swept, tmp_path):
    one, tried = swept
    log = replace(one.log, path=tmp_path / "<script>.tlog", remarks=["<b>remark</b>\x1b[2J"])
    one = replace(one, log=log)
    verdict = verdict_of(one)
    part = flight_section(0, verdict, one, tried)
    text = page([(verdict, part)], [(tmp_path / "<i>", LogError("<u>no log</u>"))])
    assert text.startswith("<!DOCTYPE html>")
    for raw in ("<script>", "<b>remark", "<i>", "<u>", "\x1b"):
        assert raw not in text
    for part in ("KILL at", "Decisions", "How near each rule came", "not known", "further out"):
        assert part in text


# -- the command -------------------------------------------------------------------------------


def complaints(errors: str) -> list[str]:
    """Without what tells the progress."""
    return [line for line in errors.splitlines() if not line.endswith(" %")]


def test_the_exit_code_tells_whether_anything_would_have_left(landed, fallen, tmp_path):
    well = FORMATS["flight.tlog"](landed, tmp_path / "well.tlog")
    fell = FORMATS["flight.tlog"](fallen, tmp_path / "fell.tlog")
    html = tmp_path / "judged.html"
    code, out, err = tool("judge_log", well, "--page", html)
    assert (code, complaints(err)) == (0, [])
    assert "nothing ended the flight" in out
    assert html.read_text().count("<svg") == 1
    files = (begun(landed, tmp_path), fell, tmp_path / "none.bin")
    code, out, err = tool("judge_log", *files, "--page", html)
    missing = f"judge_log: {tmp_path}/none.bin: No such file or directory"
    assert (code, complaints(err)) == (1, [missing])
    assert f"{tmp_path}/begun.tlog: " in out
    assert "KILL at" in out
    assert tool("judge_log", tmp_path / "none.bin", "--page", html)[0] == 2


def test_the_name_of_a_file_stays_on_its_line_of_progress(monkeypatch, capsys):
    monkeypatch.setattr("chute_ros.tools.progress._EVERY", 0.0)
    Progress("judging a\n\x1b[2J.bin", 2).at(1)
    assert capsys.readouterr().err == "judging a\\n\\x1b[2J.bin: 50 %\n"


def begun(landed: list[Told], folder: Path) -> Path:
    """A log of the first 3 s."""
    return FORMATS["flight.tlog"]([one for one in landed if one.at < 3.0], folder / "begun.tlog")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--profile", "helicopter"), "--profile helicopter: No such file or directory; shipped"),
        (("--profile", "/bin/sh.yaml"), "--profile /bin/sh.yaml: No such file or directory"),
        (("--page", "/nowhere/judged.html"), "/nowhere/judged.html: No such file or directory"),
        (("--column", "size=1"), "size=1: need NAME=HEADING"),
    ],
)
def test_a_wrong_argument_is_refused(arguments, says, landed, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    log = str(begun(landed, tmp_path))
    _, errors = refused(command, monkeypatch, capsys, log, *arguments)
    # argparse tells how it is used as well.
    assert says in errors.splitlines()[-1]
    assert not (tmp_path / "judged.html").exists()


@pytest.mark.parametrize("name", ["mine.yml", "mine.yaml"])
def test_a_profile_of_ones_own_is_found_by_its_file(name, landed, tmp_path):
    mine = tmp_path / "out" / name
    mine.parent.mkdir()
    mine.write_text((config_folder() / "profiles" / "rocket.yaml").read_text())
    log = formats.read(begun(landed, tmp_path), {})
    assert command.config_of(log, str(mine)).profile.name == "rocket"


def test_no_page_goes_over_a_log_or_what_is_known_of_it(landed, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    log = begun(landed, tmp_path)
    known = tmp_path / "known.tsv"
    known.write_text("file\tsource\treal\twhat_happened\tright\tfrom\tuntil\n")
    before = log.read_bytes(), known.read_bytes()
    for arguments in (
        ("--page", log),
        ("--page", known, "--known", known),
        ("--table", known, "--known", known),
    ):
        _, told = refused(command, monkeypatch, capsys, *map(str, (log, *arguments)))
        assert f"{arguments[1]} is read here: nothing is written over it" in told
    assert (log.read_bytes(), known.read_bytes()) == before


@pytest.mark.parametrize("option", ["--profile", "--known"])
def test_a_fifo_in_place_of_an_option_is_not_waited_for(
    option, landed, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    fifo = tmp_path / "fifo.yaml"
    os.mkfifo(fifo)
    log = begun(landed, tmp_path)
    _, errors = refused(command, monkeypatch, capsys, str(log), option, str(fifo))
    assert "no regular file but a FIFO" in errors
