"""The gate: which command leaves in which flight mode, typed out again; what launch needs."""

import itertools

import pytest
from umbilical_link_bench import (
    ASCENT,
    COAST,
    DROGUE,
    FAULT,
    FLYING,
    MAIN,
    STANDBY,
    STARTUP,
    Bench,
    in_situation,
    ready,
)

from chute_ros.errors import TransitionError
from chute_ros.links.umbilical.protocol import commands
from chute_ros.links.umbilical.protocol.gate import TABLE, Situation, Verdict, rule
from chute_ros.links.umbilical.protocol.scheduler import SchedulerLimits

#: Columns: Startup, Standby, Ascent, Coast, DrogueDeployed, MainDeployed, Fault, lost in flight,
#: no fresh telemetry. y: leaves; f: only if forced; n: never.
#: On the ground all is open but drogue and main; in flight only what saves, what a payload wants,
#: and what changes nothing. Where it may be flight or ground, both rules hold.
EXPECTED = """
heartbeat             y y  y y y y  y y y
launch                n f  n n n n  n n n
safe                  y y  y y y y  y y y
key_arm               y y  f f f f  f f f
key_disarm            y y  f f f f  y f y
open_mav              y y  f f f f  f f f
close_mav             y y  f y y y  y y y
open_sv               y y  f f y y  y y f
close_sv              y y  y y y y  y y y
drogue                f f  y y y y  f y f
main                  f f  y y y y  f y f
payload_n1            y y  y y y y  y y y
payload_n2            y y  y y y y  y y y
payload_n3            y y  y y y y  y y y
payload_n4            y y  y y y y  y y y
payload_a1            y y  y y y y  y y y
payload_a2            y y  y y y y  y y y
payload_a3            y y  y y y y  y y y
reboot                y y  f f f f  f f f
reset_fram            y y  f f f f  f f f
dump_fram             y y  f f f f  y f f
dump_flash            y y  f f f f  y f f
wipe_flash            y y  f f f f  f f f
flash_info            y y  y y y y  y y y
wipe_fram_and_reboot  y y  f f f f  f f f
set_target            y y  y y y y  y y y
"""
ROWS = {words[0]: words[1:] for words in map(str.split, EXPECTED.strip().splitlines())}
LETTERS = {
    (name, situation): letter
    for name, row in ROWS.items()
    for situation, letter in zip(Situation, row, strict=True)
}
PAIRS = list(itertools.product(ROWS, Situation))
BY_NAME = [pair for pair in PAIRS if pair[0] != "set_target"]
IN_FLIGHT = (
    Situation.ASCENT,
    Situation.COAST,
    Situation.DROGUE_DEPLOYED,
    Situation.MAIN_DEPLOYED,
    Situation.LOST_IN_FLIGHT,
)


def allows(name, situation, force):
    return LETTERS[name, situation] == "y" or (LETTERS[name, situation] == "f" and force)


def test_the_table_has_each_command_in_each_situation_and_nothing_else():
    assert set(TABLE) == set(PAIRS)
    assert {name for name, _ in TABLE} == {*commands.KINDS, "set_target"}


@pytest.mark.parametrize(
    ("name", "situation"), PAIRS, ids=lambda one: str(getattr(one, "name", one))
)
def test_the_table_says_what_is_typed_here(name, situation):
    for force in (False, True):
        ruling = rule(name, situation, force)
        assert (ruling.refusal == "") == allows(name, situation, force)
        if ruling.refusal:
            assert name in ruling.refusal
            assert situation.value in ruling.refusal


@pytest.mark.parametrize(
    ("name", "situation"),
    [("fly", Situation.STANDBY), ("", Situation.STANDBY), ("launch", None), ("launch", 1)],
)
@pytest.mark.parametrize("force", [False, True])
def test_a_pair_that_is_not_listed_raises(name, situation, force):
    with pytest.raises(TransitionError, match="no rule"):
        rule(name, situation, force)


def test_launch_asks_for_a_confirmation_and_not_for_force():
    ruling = rule("launch", Situation.STANDBY, False)
    assert ruling.verdict is Verdict.CONFIRM
    assert (
        ruling.refusal == "launch (flight mode Standby) needs an explicit confirmation: set force"
    )


def test_a_refusal_says_why_and_what_would_help():
    assert rule("drogue", Situation.STANDBY, False).refusal == (
        "drogue refused: the drogue is not fired on the ground, nor if it may be on the ground "
        "(flight mode Standby); force sends it all the same; nothing was sent"
    )
    assert rule("launch", Situation.ASCENT, True).refusal == (
        "launch refused: launch needs the key armed and Standby (flight mode Ascent); "
        "nothing was sent"
    )


@pytest.mark.parametrize("name", ["wipe_flash", "wipe_fram_and_reboot", "reset_fram", "reboot"])
@pytest.mark.parametrize("situation", IN_FLIGHT, ids=lambda one: one.name)
def test_in_flight_nothing_that_wipes_or_reboots_leaves_unless_forced(name, situation):
    assert rule(name, situation, False).verdict is Verdict.FORCE
    assert rule(name, situation, True).refusal == ""


@pytest.mark.parametrize("situation", Situation, ids=lambda one: one.name)
def test_making_safe_is_never_refused(situation):
    assert rule("safe", situation, False).refusal == ""


# -- through the link ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "situation"), BY_NAME, ids=lambda one: str(getattr(one, "name", one))
)
@pytest.mark.parametrize("force", [False, True], ids=["", "forced"])
def test_a_token_leaves_exactly_when_the_table_allows_it(name, situation, force):
    flags = {"ssa_drogue_deployed": 0, "ssa_main_deployed": 0}
    bench = in_situation(situation, **flags)
    number = bench.order(name, force)
    bench.after(0.02)
    token = commands.KINDS[name].command.token
    shown_already = (name, situation.name, force) in (
        ("drogue", "DROGUE_DEPLOYED", False),
        ("main", "MAIN_DEPLOYED", False),
    )
    if allows(name, situation, force) and not shown_already:
        assert [data for _, data in bench.writes] == [token]
        assert bench.steps(number)[0] == "SENT"
    else:
        assert bench.writes == []
        assert bench.end(number).success == shown_already
        assert not bench.end(number).sent
        assert (
            "nothing was sent" in bench.end(number).message
            or "set force" in bench.end(number).message
        )


@pytest.mark.parametrize("situation", Situation, ids=lambda one: one.name)
def test_the_target_can_be_set_in_any_situation(situation):
    bench = in_situation(situation)
    bench.target(1.0, 2.0)
    assert bench.tokens == ["<T,1.0000000,2.0000000>"]


@pytest.mark.parametrize("name", ["set_target", "fly", "", "LAUNCH", "<L>"])
def test_a_name_that_is_no_command_is_refused_in_words(name):
    bench = in_situation(Situation.STANDBY)
    number = bench.order(name, True)
    assert bench.after(1.0).writes == []
    wanted = "~/set_target" if name == "set_target" else "need one of heartbeat, launch, safe"
    assert wanted in bench.end(number).message


def test_without_any_telemetry_the_refusal_says_that_none_was_heard():
    bench = Bench().at(1.0)
    number = bench.order("wipe_flash")
    assert bench.end(number).message.endswith("(no telemetry was received yet)")
    assert bench.writes == []


# -- launch -------------------------------------------------------------------------------------


def test_launch_with_its_confirmation_leaves_once_and_never_again():
    bench = ready()
    number = bench.order("launch", force=True)
    bench.after(20.0)
    assert bench.tokens == ["<L>"]
    assert "launch given up after 5.0 s: sent once, but" in bench.end(number).message


@pytest.mark.parametrize("mode", FLYING)
def test_a_launch_is_confirmed_by_any_mode_of_flight(mode):
    bench = ready()
    number = bench.order("launch", force=True)
    bench.after(0.5).talk(flight_mode=mode).after(0.2)
    assert bench.end(number).shown


def test_a_launch_that_left_is_confirmed_though_telemetry_is_silent_meanwhile():
    bench = ready()
    number = bench.order("launch", force=True)
    bench.silent().after(4.0).talk(flight_mode=ASCENT).after(0.2)
    assert bench.end(number).shown


def test_launch_without_a_confirmation_is_refused():
    bench = ready()
    number = bench.order("launch")
    assert "needs an explicit confirmation" in bench.end(number).message
    assert bench.after(1.0).tokens == []


@pytest.mark.parametrize("mode", [STARTUP, ASCENT, COAST, DROGUE, MAIN, FAULT, 7])
def test_launch_outside_standby_is_refused_even_if_forced(mode):
    bench = ready(mode)
    number = bench.order("launch", force=True)
    assert "launch needs the key armed and Standby" in bench.end(number).message
    assert bench.after(1.0).tokens == []


def test_launch_on_stale_telemetry_or_none_is_refused_even_if_forced():
    for bench in (Bench().at(1.0), ready().silent().after(3.0)):
        number = bench.order("launch", force=True)
        assert "no fresh telemetry" in bench.end(number).message
        assert bench.after(1.0).tokens == []


def test_launch_is_refused_while_flight_is_blocked():
    bench = ready()
    bench.link.flight_block("parachute lost", bench.now)
    number = bench.order("launch", force=True)
    assert bench.end(number).message == (
        "launch refused: flight is blocked (parachute lost); nothing was sent"
    )
    bench.link.flight_block("", bench.now)
    bench.order("launch", force=True)
    assert bench.tokens == ["<L>"]
    assert bench.notices() == ["flight blocked: parachute lost", "flight block released"]


def test_the_main_valve_is_not_opened_while_flight_is_blocked_unless_forced():
    bench = ready()
    bench.link.flight_block("parachute lost", bench.now)
    number = bench.order("open_mav")
    assert bench.end(number).message == (
        "open_mav refused: flight is blocked (parachute lost); force sends it"
    )
    assert bench.tokens == []
    forced = bench.order("open_mav", force=True)
    assert bench.ends(forced) == []
    assert len(bench.tokens) == 1


def test_a_flight_block_takes_back_a_launch_that_waits():
    bench = ready()
    bench.order("payload_n1")
    number = bench.order("launch", force=True)
    bench.link.flight_block("parachute lost", bench.now)
    bench.after(9.0)
    assert bench.tokens == ["<1>"]
    assert bench.end(number).message == "launch given up: flight is blocked: parachute lost"


def test_launch_is_refused_after_the_key_was_disarmed_from_here_until_it_is_armed_from_here():
    bench = ready()
    bench.order("key_disarm")
    first = bench.after(0.5).order("launch", force=True)
    assert bench.end(first).message == (
        "launch refused: the key was disarmed by this node; nothing was sent"
    )
    bench.after(9.0)  # the key was not turned; telemetry still says Standby
    second = bench.order("launch", force=True)
    assert not bench.end(second).sent
    bench.order("key_arm")
    bench.after(0.5).order("launch", force=True)
    assert bench.after(0.5).tokens[-2:] == ["<KA>", "<L>"]


def test_a_key_disarm_that_was_refused_keeps_no_launch_back():
    bench = ready(ASCENT)
    bench.order("key_disarm")
    bench.talk(flight_mode=STANDBY).after(0.2).order("launch", force=True)
    assert bench.tokens == ["<L>"]


@pytest.mark.parametrize("name", ["launch", "open_mav", "open_sv"])
def test_what_is_unsafe_is_refused_while_the_vehicle_is_made_safe(name):
    bench = ready(mav_open=1)
    bench.order("safe")
    number = bench.after(1.0).order(name, force=True)
    assert bench.end(number).message == (
        f"{name} refused: the vehicle is being made safe; nothing was sent"
    )
    bench.talk(mav_open=0).after(0.2).order(name, force=True)
    assert len(bench.after(0.3).tokens) == 2


def test_a_launch_that_waits_when_the_mode_changes_does_not_leave():
    bench = ready(scheduler=SchedulerLimits(0.5, 1.0, 0.5))
    bench.order("flash_info")
    number = bench.order("launch", force=True)
    bench.talk(flight_mode=STARTUP).after(2.0)
    assert bench.tokens == ["<I>"]
    assert not bench.end(number).sent
