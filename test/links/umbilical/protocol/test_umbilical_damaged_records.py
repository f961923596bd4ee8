"""One damaged record proves nothing: $TELEM is text without a checksum."""

import pytest
from umbilical_link_bench import ASCENT, COAST, FAULT, STANDBY, STARTUP, in_situation, ready
from umbilical_rocket import flown, vehicle

from chute_ros.links.umbilical.protocol.config import DeployStage
from chute_ros.links.umbilical.protocol.gate import Situation
from chute_ros.model import LandedState
from chute_ros.protocol.boot_clock import Age


def damaged(bench, **fields):
    """One line that says this, between those that say what is so."""
    before = dict(bench.fields)
    bench.fields |= fields
    line = bench.line()
    bench.fields = before
    return bench.hear_bytes(line)


def test_a_clock_that_is_wrong_now_and_then_is_believed_by_nobody():
    """Also where several are, that do not agree."""
    wrong = [[clock] for clock in ("920100", "4294967295", "1100")]
    for clocks in (*wrong, ["400100", "920100", "1100", "50100"]):
        rocket = flown((0.0, COAST), (0.1, COAST))
        for n, clock in enumerate(clocks):
            told = rocket.says(0.2 + n / 10, COAST, ms_since_boot_cfc=clock)
            assert told == ([], Age.DOUBTFUL), clock
        for at in (0.6, 0.7, 0.8):
            assert rocket.says(at, COAST)[1] is Age.NEW, clocks
        assert rocket.computer.restarts == 0
        assert not vehicle(rocket, 0.8).rebooted_in_flight
    rocket = flown((0.0, COAST, {"ms_since_boot_cfc": "920100"}))
    assert rocket.says(0.1, COAST) == ([], Age.DOUBTFUL), "the first record of all was wrong"
    assert rocket.says(0.2, COAST)[1] is Age.NEW
    assert rocket.computer.restarts == 0


def test_a_clock_that_has_leapt_is_believed_at_the_second_record():
    rocket = flown((0.0, COAST), (0.1, COAST))
    rocket.started -= 500.0
    assert rocket.says(0.2, COAST) == ([], Age.DOUBTFUL)
    assert rocket.says(0.3, COAST)[1] is Age.NEW
    assert rocket.computer.restarts == 0
    rocket = flown((0.0, STANDBY), (0.1, STANDBY))
    assert rocket.says(400.0, STANDBY)[1] is Age.NEW, "as long as the cable was out"


def test_a_damaged_clock_does_not_make_up_for_a_reboot():
    bench = ready(STARTUP)
    number = bench.order("reboot")
    damaged(bench.after(0.3), ms_since_boot_cfc=920_100)
    bench.after(8.0)
    assert not bench.end(number).success


@pytest.mark.parametrize("mode", [STARTUP, STANDBY])
def test_one_mode_of_the_ground_ends_no_flight_but_two_in_a_row_do(mode):
    rocket = flown((0.0, COAST), (0.1, FAULT))
    assert rocket.says(0.2, mode) == ([], Age.DOUBTFUL)
    rocket.says(0.3, FAULT)
    assert rocket.computer.situation(0.3) is Situation.LOST_IN_FLIGHT
    assert vehicle(rocket, 0.3).landed_state is LandedState.IN_AIR
    rocket = flown((0.0, COAST), (0.1, mode), (0.2, mode))
    assert not rocket.computer.flying
    assert rocket.computer.restarts == 0


def test_one_mode_of_the_ground_does_not_abandon_a_deploy_nor_forget_what_was_fired():
    bench = ready(COAST, altitude=2900.0)
    number = bench.deploy()
    damaged(bench.after(0.33), flight_mode=STANDBY)
    bench.after(4.0)
    assert bench.times("<D>") == [1.05, 2.55, 4.05]
    assert not bench.ends(number)
    bench = ready(COAST, altitude=2900.0, deploy=DeployStage.NEXT)
    bench.deploy(force=True)
    damaged(bench.after(6.0), flight_mode=STARTUP)
    bench.after(0.5).clear().deploy(force=True)
    assert set(bench.after(0.5).tokens) == {"<d>"}


@pytest.mark.parametrize("situation", [Situation.UNKNOWN, Situation.STANDBY, Situation.FAULT])
def test_next_comes_to_the_main_though_the_flight_was_never_recognised(situation):
    bench = in_situation(situation, deploy=DeployStage.NEXT, always_alive=True)
    bench.deploy(force=True)
    assert set(bench.after(8.0).tokens) == {"<D>"}
    bench.clear().deploy(force=True)
    assert set(bench.after(8.0).tokens) == {"<d>"}


def test_what_was_fired_on_the_ground_is_packed_anew_before_the_flight():
    """As by a test of the charges: the next flight begins with the drogue again."""
    bench = ready(STANDBY, deploy=DeployStage.NEXT)
    bench.deploy(force=True)
    bench.after(310.0).talk(flight_mode=ASCENT, altitude=200.0).after(0.5)
    bench.talk(flight_mode=COAST).after(0.5).clear().deploy()
    assert set(bench.after(0.5).tokens) == {"<D>"}


def refused(bench):
    """The port takes nothing that the link hands out now."""
    for token in bench.link.take_output():
        bench.link.not_written(token)
    bench.events += bench.link.take_events()
    return bench


def test_what_was_not_written_has_failed_and_a_heartbeat_is_only_counted():
    # A drogue that was not written was not fired.
    bench = ready(COAST, altitude=2900.0, deploy=DeployStage.NEXT)
    bench.link.deploy(1, True, bench.now)
    refused(bench)
    assert bench.notices() == [
        "drogue was not written: the port takes no more data; is anything at its end?"
    ]
    bench.link.deploy(2, True, bench.now)
    assert set(bench.collect().after(1.0).tokens) == {"<D>"}
    # What is sent once and was not written has failed.
    bench = ready(STARTUP)
    bench.link.command(1, "reset_fram", True, bench.now)
    end = refused(bench).end(1)
    assert (end.success, end.sent) == (False, False)
    assert end.message.startswith("reset_fram was not written: the port takes no more data")
    # A heartbeat that was not written is only counted.
    bench = ready(STANDBY)
    bench.link.owner_alive(float("inf"))
    bench.link.update(bench.now + 1.0)
    assert bench.link.take_output() == [b"<H>"]
    bench.link.not_written(b"<H>")
    assert not [one for one in bench.link.take_events() if hasattr(one, "severity")]
