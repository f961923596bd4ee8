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
from chute_ros.links.umbilical.protocol.gate import TABLE, CommandVerdict, Situation, rule
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
SITUATIONS = pytest.mark.parametrize("situation", Situation, ids=lambda one: one.name)


def allows(name, situation, force):
    return LETTERS[name, situation] == "y" or (LETTERS[name, situation] == "f" and force)


def test_the_table_says_what_is_typed_here_and_nothing_else():
    assert set(TABLE) == set(PAIRS)
    assert {name for name, _ in TABLE} == {*commands.KINDS, "set_target"}
    for name, situation in PAIRS:
        for force in (False, True):
            ruling = rule(name, situation, force)
            told = (name, situation.name, force)
            assert (ruling.refusal == "") == allows(name, situation, force), told
            if ruling.refusal:
                assert name in ruling.refusal, told
                assert situation.value in ruling.refusal, told
            elif LETTERS[name, situation] == "f" and name != "launch":
                assert rule(name, situation, False).verdict is CommandVerdict.FORCE, told


def test_a_pair_that_is_not_listed_raises():
    for name, situation in (
        *(("fly", Situation.STANDBY), ("", Situation.STANDBY)),
        *(("launch", None), ("launch", 1)),
    ):
        for force in (False, True):
            with pytest.raises(TransitionError, match="no rule"):
                pytest.fail(f"{name}: {rule(name, situation, force)}")


def test_a_refusal_says_why_and_what_would_help():
    launch = rule("launch", Situation.STANDBY, False)
    assert launch.verdict is CommandVerdict.CONFIRM
    assert launch.refusal == (
        "launch (flight mode Standby) needs an explicit confirmation: set force"
    )
    assert rule("drogue", Situation.STANDBY, False).refusal == (
        "drogue refused: the drogue is not fired on the ground, nor if it may be on the ground "
        "(flight mode Standby); force sends it all the same; nothing was sent"
    )
    assert rule("launch", Situation.ASCENT, True).refusal == (
        "launch refused: launch needs the key armed and Standby (flight mode Ascent); "
        "nothing was sent"
    )


@SITUATIONS
def test_a_token_leaves_exactly_when_the_table_allows_it(situation):
    for name, force in itertools.product(commands.KINDS, (False, True)):
        bench = in_situation(situation, ssa_drogue_deployed=0, ssa_main_deployed=0)
        number = bench.order(name, force)
        bench.after(0.02)
        story = f"{name}, force {force}"
        shown_already = (name, situation.name, force) in (
            ("drogue", "DROGUE_DEPLOYED", False),
            ("main", "MAIN_DEPLOYED", False),
        )
        written = [data for _, data in bench.writes]
        if allows(name, situation, force) and not shown_already:
            assert written == [commands.KINDS[name].command.token], story
            assert bench.steps(number)[0] == "SENT", story
            continue
        end = bench.end(number)
        assert (written, end.success, end.sent) == ([], shown_already, False), story
        assert "nothing was sent" in end.message or "set force" in end.message, story
    bench = in_situation(situation)
    bench.target(1.0, 2.0)
    assert bench.tokens == ["<T,1.0000000,2.0000000>"]


def test_a_name_that_is_no_command_is_refused_in_words():
    for name in ("set_target", "fly", "", "LAUNCH", "<L>"):
        bench = in_situation(Situation.STANDBY)
        number = bench.order(name, True)
        assert bench.after(1.0).writes == [], name
        wanted = "~/set_target" if name == "set_target" else "need one of heartbeat, launch, safe"
        assert wanted in bench.end(number).message


def test_without_any_telemetry_the_refusal_says_that_none_was_heard():
    bench = Bench().at(1.0)
    number = bench.order("wipe_flash")
    assert bench.end(number).message.endswith("(no telemetry was received yet)")
    assert bench.writes == []


def test_launch_with_its_confirmation_leaves_once_and_never_again():
    bench = ready()
    number = bench.order("launch", force=True)
    bench.after(20.0)
    assert bench.tokens == ["<L>"]
    assert "launch given up after 5.0 s: sent once, but" in bench.end(number).message


def test_a_launch_is_confirmed_by_any_mode_of_flight():
    for mode in FLYING:
        bench = ready()
        number = bench.order("launch", force=True)
        bench.after(0.5).talk(flight_mode=mode).after(0.2)
        assert bench.end(number).shown, mode
    bench = ready()
    number = bench.order("launch", force=True)
    bench.silent().after(4.0).talk(flight_mode=ASCENT).after(0.2)
    assert bench.end(number).shown, "though telemetry was silent meanwhile"


def test_launch_without_a_confirmation_is_refused():
    bench = ready()
    number = bench.order("launch")
    assert "needs an explicit confirmation" in bench.end(number).message
    assert bench.after(1.0).tokens == []


def test_launch_outside_standby_or_without_fresh_telemetry_is_refused_even_if_forced():
    outside = (STARTUP, ASCENT, COAST, DROGUE, MAIN, FAULT, 7)
    cases = [(ready(mode), "launch needs the key armed and Standby") for mode in outside]
    for bench in (Bench().at(1.0), ready().silent().after(3.0)):
        cases.append((bench, "no fresh telemetry"))
    for bench, why in cases:
        number = bench.order("launch", force=True)
        assert why in bench.end(number).message, bench.fields
        assert bench.after(1.0).tokens == []


def test_launch_and_the_main_valve_are_refused_while_flight_is_blocked():
    bench = ready()
    bench.link.flight_block("parachute lost", bench.now)
    number = bench.order("launch", force=True)
    assert bench.end(number).message == (
        "launch refused: flight is blocked (parachute lost); nothing was sent"
    )
    number = bench.order("open_mav")
    assert bench.end(number).message == (
        "open_mav refused: flight is blocked (parachute lost); force sends it"
    )
    assert bench.tokens == []
    forced = bench.order("open_mav", force=True)
    assert bench.ends(forced) == []
    assert bench.tokens == ["<M>"]
    bench = ready()
    bench.link.flight_block("parachute lost", bench.now)
    bench.link.flight_block("", bench.now)
    bench.order("launch", force=True)
    assert bench.tokens == ["<L>"]
    assert bench.notices() == ["flight blocked: parachute lost", "flight block released"]


def test_a_flight_block_or_another_mode_takes_back_a_launch_that_waits():
    # A flight block takes back a launch that waits.
    bench = ready()
    bench.order("payload_n1")
    number = bench.order("launch", force=True)
    bench.link.flight_block("parachute lost", bench.now)
    bench.after(9.0)
    assert bench.tokens == ["<1>"]
    assert bench.end(number).message == "launch given up: flight is blocked: parachute lost"
    # A launch that waits when the mode changes does not leave.
    bench = ready(scheduler=SchedulerLimits(0.5, 1.0, 0.5))
    bench.order("flash_info")
    number = bench.order("launch", force=True)
    bench.talk(flight_mode=STARTUP).after(2.0)
    assert bench.tokens == ["<I>"]
    assert not bench.end(number).sent


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


def test_what_is_unsafe_is_refused_while_the_vehicle_is_made_safe():
    for name in ("launch", "open_mav", "open_sv"):
        bench = ready(mav_open=1)
        bench.order("safe")
        number = bench.after(1.0).order(name, force=True)
        assert bench.end(number).message == (
            f"{name} refused: the vehicle is being made safe; nothing was sent"
        )
        bench.talk(mav_open=0).after(0.2).order(name, force=True)
        assert len(bench.after(0.3).tokens) == 2, name
