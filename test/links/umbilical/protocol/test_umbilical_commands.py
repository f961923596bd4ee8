"""Each command of the reference by its name: its token, and what telemetry shows of it."""

import math

import pytest
from umbilical_lines import BY_NAME, COUNTS, STATE, as_f32
from umbilical_link_bench import ASCENT, COAST, DROGUE, FAULT, MAIN, STANDBY, STARTUP, Bench, ready

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol import commands

GOLDEN = {
    "heartbeat": b"<H>",
    "launch": b"<L>",
    "safe": b"<V>",
    "key_arm": b"<KA>",
    "key_disarm": b"<KD>",
    "drogue": b"<D>",
    "main": b"<d>",
    "open_mav": b"<M>",
    "close_mav": b"<m>",
    "open_sv": b"<S>",
    "close_sv": b"<s>",
    "payload_n1": b"<1>",
    "payload_n2": b"<2>",
    "payload_n3": b"<3>",
    "payload_n4": b"<4>",
    "payload_a1": b"<A1>",
    "payload_a2": b"<A2>",
    "payload_a3": b"<A3>",
    "reboot": b"<R>",
    "reset_fram": b"<F>",
    "dump_fram": b"<f>",
    "dump_flash": b"<G>",
    "wipe_flash": b"<W>",
    "flash_info": b"<I>",
    "wipe_fram_and_reboot": b"<X>",
}

#: Where it may be ordered: mode, and the telemetry before.
GROUND = {"flight_mode": STANDBY}
OPEN = {"mav_open": 1, "sv_open": 1}
#: command, telemetry before, telemetry that shows it, telemetry that does not.
SHOWN = [
    ("launch", GROUND, {"flight_mode": ASCENT}, {"mav_open": 1}),
    ("safe", {**GROUND, **OPEN}, {"mav_open": 0, "sv_open": 0}, {"mav_open": 0}),
    ("safe", {**GROUND, **OPEN}, {"mav_open": 0, "sv_open": 0}, {"sv_open": 0}),
    ("key_arm", {"flight_mode": STARTUP}, {"flight_mode": STANDBY}, {"flight_mode": FAULT}),
    ("key_disarm", GROUND, {"flight_mode": STARTUP}, {"flight_mode": FAULT}),
    ("open_mav", GROUND, {"mav_open": 1}, {"sv_open": 1}),
    ("close_mav", {**GROUND, "mav_open": 1}, {"mav_open": 0}, {"sv_open": 1}),
    ("open_sv", GROUND, {"sv_open": 1}, {"mav_open": 1}),
    ("close_sv", {**GROUND, "sv_open": 1}, {"sv_open": 0}, {"mav_open": 1}),
    ("drogue", {"flight_mode": COAST}, {"ssa_drogue_deployed": 1}, {"ssa_main_deployed": 1}),
    ("drogue", {"flight_mode": COAST}, {"flight_mode": DROGUE}, {"flight_mode": ASCENT}),
    ("main", {"flight_mode": DROGUE}, {"ssa_main_deployed": 1}, {"ssa_drogue_deployed": 1}),
    ("main", {"flight_mode": DROGUE}, {"flight_mode": MAIN}, {"ssa_drogue_deployed": 1}),
    *[
        (f"payload_{event}", GROUND, {f"cmd_{event}": 1}, {f"cmd_{other}": 1})
        for event, other in zip(
            ("n1", "n2", "n3", "n4", "a1", "a2", "a3"),
            ("n2", "n3", "n4", "a1", "a2", "a3", "n1"),
            strict=True,
        )
    ],
]
IDS = [f"{name}: {' and '.join(shows)}" for name, _, shows, _ in SHOWN]


def test_the_commands_are_those_of_the_reference():
    tokens = {name: kind.command.token for name, kind in commands.KINDS.items()}
    assert tokens == GOLDEN
    assert all(kind.command.name == name for name, kind in commands.KINDS.items())


def test_each_token_is_a_write_of_its_own():
    for name, token in GOLDEN.items():
        bench = ready(COAST if name in ("drogue", "main") else STANDBY)
        bench.order(name, force=True)
        # This long nothing is sent a second time.
        assert [data for _, data in bench.after(1.4).writes] == [token], name


def told(before):
    """Telemetry has said this for a while."""
    rest = dict(before)
    return ready(rest.pop("flight_mode"), **rest)


@pytest.mark.parametrize(("name", "before", "shows", "other"), SHOWN, ids=IDS)
def test_an_effect_that_telemetry_shows_confirms_it_and_no_other(name, before, shows, other):
    bench = told(before)
    number = bench.order(name, force=True)
    bench.after(0.5)
    assert bench.steps(number) == ["SENT"]
    bench.talk(**shows).after(0.2)
    end = bench.end(number)
    assert (end.success, end.sent, end.shown) == (True, True, True)
    assert end.message.startswith("telemetry reports ")
    assert end.message.endswith("; sent once")
    assert bench.steps(number) == ["SENT", "CONFIRMED"]
    bench = told(before)
    number = bench.order(name, force=True)
    bench.after(0.3).talk(**other).after(6.0)
    end = bench.end(number)
    assert (end.success, end.sent, end.shown) == (False, True, False)
    assert f"{name} given up after 5.0 s: sent " in end.message
    assert "but the device's own status never showed that telemetry reports" in end.message
    assert bench.steps(number) == ["SENT", "FAILED"]


def test_a_vehicle_that_vents_when_made_safe_has_the_sv_open():
    bench = ready(mav_open=1, safe_opens_sv=True)
    number = bench.order("safe")
    assert bench.after(0.3).talk(mav_open=0).after(0.5).ends(number) == []
    bench.talk(sv_open=1).after(0.3)
    assert bench.end(number).success
    assert "mav_open 0 and sv_open 1" in bench.end(number).message


def test_what_telemetry_cannot_show_is_sent_and_says_so():
    reset, telem50 = ready(), ready(layout="telem50")
    for bench, number, name, token in (
        (reset, reset.order("reset_fram"), "reset_fram", "<F>"),
        (telem50, telem50.target(42.1, -76.1), "set_target", "<T,42.1000000,-76.1000000>"),
    ):
        end = bench.end(number)
        assert (end.success, end.sent, end.shown) == (True, True, False)
        assert end.message == f"{name} sent; telemetry cannot show its effect"
        assert bench.tokens == [token]


def test_an_answer_or_its_clock_confirms_what_telemetry_has_no_field_for():
    # Flash info is confirmed by its answer.
    bench = ready().hear("Flash: 1/8192 KB used (0.0%)").after(0.1)
    number = bench.order("flash_info")
    assert bench.after(0.3).ends(number) == []  # the answer of before does not count
    bench.hear("Flash: 12/8192 KB used (0.1%)")
    assert bench.end(number).success
    assert "flash: 12 of 8192 KB used" in bench.notices()
    # A reboot is confirmed by its clock.
    bench = ready()
    number = bench.order("reboot")
    assert bench.after(0.5).ends(number) == []
    bench.restarts(flight_mode=STARTUP).after(0.5)
    assert bench.end(number).success
    assert bench.end(number).message.startswith("its clock restarts after 0.")
    assert bench.tokens == ["<R>"]


def test_the_target_of_the_reference():
    bench = ready()
    number = bench.target(42.441913, -76.4878)
    assert bench.tokens == ["<T,42.4419130,-76.4878000>"]
    bench.talk(blims_target_lat=as_f32(42.441913), blims_target_lon=as_f32(-76.4878)).after(0.3)
    assert bench.end(number).message.startswith(
        "telemetry reports blims_target_lat 42.441913, blims_target_lon -76.487800 after 0."
    )


@pytest.mark.parametrize(
    "point", [(42.441913, -76.4878), (-89.9999999, 179.9999999), (0.0, 150.0000076), (90, -180)]
)
def test_the_target_is_confirmed_within_what_a_32_bit_float_holds(point):
    for layout in COUNTS.keys() - {"telem50", "telem54"}:
        bench = ready(layout=layout)
        number = bench.target(*point)
        latitude, longitude = map(as_f32, map(float, bench.tokens[0][3:-1].split(",")))
        bench.talk(blims_target_lat=latitude, blims_target_lon=longitude).after(0.3)
        assert bench.end(number).shown, layout


@pytest.mark.parametrize("off", [(1e-4, 0.0), (0.0, -1e-4), (math.nan, 0.0)])
def test_another_target_does_not_confirm_it(off):
    bench = ready(blims_target_lat=42.0 + off[0], blims_target_lon=-76.0 + off[1])
    number = bench.target(42.0, -76.0)
    assert not bench.after(6.0).end(number).success
    assert len(bench.tokens) == 4  # it is set again as long as it does not show


def test_the_target_of_two_points_takes_four_floats():
    bench = ready(layout="telem54")
    number = bench.target(42.1, -76.1, 42.2, -76.2)
    assert bench.tokens == ["<T,42.1000000,-76.1000000,42.2000000,-76.2000000>"]
    points = ("upwind", "downwind")
    names = [f"blims_{point}_{part}" for point in points for part in ("lat", "lon")]
    bench.talk(**dict(zip(names, (42.1, -76.1, 42.2, 0), strict=True))).after(0.3)
    assert bench.ends(number) == []
    bench.talk(blims_downwind_lon=-76.2).after(0.3)
    assert bench.end(number).shown
    bench = ready(layout="telem54")
    bench.target(-90, -180, -90, -180)
    longest = "<T,-90.0000000,-180.0000000,-90.0000000,-180.0000000>"
    assert bench.tokens == [longest], "the longest fits one packet"


@pytest.mark.parametrize(
    ("layout", "values", "reason"),
    [
        (STATE, (), "takes 2 floats (latitude and longitude), not 0"),
        (STATE, (1.0,), "takes 2 floats (latitude and longitude), not 1"),
        (STATE, (1.0, 2.0, 3.0, 4.0), "takes 2 floats (latitude and longitude), not 4"),
        ("telem54", (1.0, 2.0), "takes 4 floats (two points), not 2"),
        (STATE, (math.nan, 2.0), "latitude nan is out of range: need -90 to 90"),
        (STATE, (1.0, math.nan), "longitude nan is out of range: need -180 to 180"),
        (STATE, (math.inf, 2.0), "latitude inf is out of range: need -90 to 90"),
        (STATE, (1.0, -math.inf), "longitude -inf is out of range: need -180 to 180"),
        (STATE, (90.0000001, 0.0), "latitude 90.0000001 is out of range"),
        (STATE, (-90.0000001, 0.0), "latitude -90.0000001 is out of range"),
        (STATE, (0.0, 180.0000001), "longitude 180.0000001 is out of range"),
        (STATE, (0.0, -180.0000001), "longitude -180.0000001 is out of range"),
        ("telem54", (1.0, 2.0, 90.1, 4.0), "latitude 90.1 is out of range"),
        ("telem54", (1.0, 2.0, 3.0, -180.1), "longitude -180.1 is out of range"),
    ],
)
def test_a_target_that_makes_no_sense_is_refused(layout, values, reason):
    with pytest.raises(ParameterError):
        commands.set_target(BY_NAME[layout], values)
    bench = ready(layout=layout)
    number = bench.target(*values)
    end = bench.end(number)
    assert (end.success, end.sent) == (False, False)
    assert end.message.startswith("set_target refused: ")
    assert reason in end.message
    assert end.message.endswith("; nothing was sent")
    assert bench.after(1.0).tokens == []


def test_before_the_layout_is_known_no_target_can_be_set():
    bench = Bench().talk(flight_mode=STANDBY).at(0.45)
    number = bench.target(1.0, 2.0)
    assert bench.end(number).message == (
        "set_target refused: the number of floats is not known before the first "
        "telemetry: set layout; nothing was sent"
    )
    assert bench.after(1.0).tokens == []
    bench = Bench("telem54", layout_setting="telem54")
    bench.target(1.0, 2.0, 3.0, 4.0)
    assert bench.after(0.5).tokens == ["<T,1.0000000,2.0000000,3.0000000,4.0000000>"]
