"""One damaged record proves nothing: $TELEM is text without a checksum."""

import pytest
from umbilical_link_bench import (
    ASCENT,
    COAST,
    FAULT,
    STANDBY,
    STARTUP,
    Bench,
    in_situation,
    ready,
)
from umbilical_rocket import Rocket, vehicle

from chute_ros.links.umbilical.protocol.config import DeployStage
from chute_ros.links.umbilical.protocol.gate import Situation
from chute_ros.model import LandedState
from chute_ros.protocol.boot_clock import Age


def damaged(bench: Bench, **fields: int) -> Bench:
    """One line that says this, between those that say what is so."""
    before = dict(bench.fields)
    bench.fields |= fields
    line = bench.line()
    bench.fields = before
    return bench.hear_bytes(line)


# -- its clock ----------------------------------------------------------------------------------


@pytest.mark.parametrize("clock", ["920100", "4294967295", "1100"])
def test_one_clock_that_is_wrong_is_no_restart(clock):
    rocket = Rocket()
    rocket.says(0.0, COAST)
    rocket.says(0.1, COAST)
    assert rocket.says(0.2, COAST, ms_since_boot_cfc=clock) == ([], Age.DOUBTFUL)
    for at in (0.3, 0.4, 0.5):
        assert rocket.says(at, COAST)[1] is Age.NEW
    assert rocket.computer.restarts == 0
    assert not vehicle(rocket, 0.5).rebooted_in_flight


def test_one_that_is_wrong_in_the_first_record_of_all_is_no_restart():
    rocket = Rocket()
    rocket.says(0.0, COAST, ms_since_boot_cfc="920100")
    assert rocket.says(0.1, COAST) == ([], Age.DOUBTFUL)
    assert rocket.says(0.2, COAST)[1] is Age.NEW
    assert rocket.computer.restarts == 0


def test_a_clock_that_has_leapt_is_believed_at_the_second_record():
    rocket = Rocket()
    rocket.says(0.0, COAST)
    rocket.says(0.1, COAST)
    rocket.started -= 500.0
    assert rocket.says(0.2, COAST) == ([], Age.DOUBTFUL)
    assert rocket.says(0.3, COAST)[1] is Age.NEW
    assert rocket.computer.restarts == 0


def test_two_damaged_clocks_that_do_not_agree_are_believed_by_nobody():
    rocket = Rocket()
    rocket.says(0.0, COAST)
    rocket.says(0.1, COAST)
    for at, clock in ((0.2, "400100"), (0.3, "920100"), (0.4, "1100"), (0.5, "50100")):
        assert rocket.says(at, COAST, ms_since_boot_cfc=clock) == ([], Age.DOUBTFUL)
    assert rocket.says(0.6, COAST)[1] is Age.NEW
    assert rocket.computer.restarts == 0


def test_the_clock_may_go_on_as_long_as_the_cable_was_out():
    rocket = Rocket()
    rocket.says(0.0, STANDBY)
    rocket.says(0.1, STANDBY)
    assert rocket.says(400.0, STANDBY)[1] is Age.NEW


def test_a_damaged_clock_does_not_make_up_for_a_reboot():
    bench = ready(STARTUP)
    number = bench.order("reboot")
    damaged(bench.after(0.3), ms_since_boot_cfc=920_100)
    bench.after(8.0)
    assert not bench.end(number).success


# -- its mode -----------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [STARTUP, STANDBY])
def test_one_mode_of_the_ground_ends_no_flight(mode):
    rocket = Rocket()
    rocket.says(0.0, COAST)
    rocket.says(0.1, FAULT)
    assert rocket.says(0.2, mode) == ([], Age.DOUBTFUL)
    rocket.says(0.3, FAULT)
    assert rocket.computer.situation(0.3) is Situation.LOST_IN_FLIGHT
    assert vehicle(rocket, 0.3).landed_state is LandedState.IN_AIR


@pytest.mark.parametrize("mode", [STARTUP, STANDBY])
def test_two_in_a_row_do(mode):
    rocket = Rocket()
    rocket.says(0.0, COAST)
    rocket.says(0.1, mode)
    rocket.says(0.2, mode)
    assert not rocket.computer.flying
    assert rocket.computer.restarts == 0


def test_one_mode_of_the_ground_does_not_abandon_a_deploy():
    bench = ready(COAST, altitude=2900.0)
    number = bench.deploy()
    damaged(bench.after(0.33), flight_mode=STANDBY)
    bench.after(4.0)
    assert bench.times("<D>") == [1.05, 2.55, 4.05]
    assert not bench.ends(number)


def test_nor_forget_what_was_fired():
    bench = ready(COAST, altitude=2900.0, deploy=DeployStage.NEXT)
    bench.deploy(force=True)
    damaged(bench.after(6.0), flight_mode=STARTUP)
    bench.after(0.5).clear().deploy(force=True)
    assert set(bench.after(0.5).tokens) == {"<d>"}


# -- next, where nothing says that it flies ------------------------------------------------------


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


# -- what the port does not take -----------------------------------------------------------------


def refused(bench: Bench) -> Bench:
    """The port takes nothing that the link hands out now."""
    for token in bench.link.take_output():
        bench.link.not_written(token)
    bench.events += bench.link.take_events()
    return bench


def test_a_drogue_that_was_not_written_was_not_fired():
    bench = ready(COAST, altitude=2900.0, deploy=DeployStage.NEXT)
    bench.link.deploy(1, True, bench.now)
    refused(bench)
    assert bench.notices() == [
        "drogue was not written: the port takes no more data; is anything at its end?"
    ]
    bench.link.deploy(2, True, bench.now)
    assert set(bench.collect().after(1.0).tokens) == {"<D>"}


def test_what_is_sent_once_and_was_not_written_has_failed():
    bench = ready(STARTUP)
    bench.link.command(1, "reset_fram", True, bench.now)
    end = refused(bench).end(1)
    assert (end.success, end.sent) == (False, False)
    assert end.message.startswith("reset_fram was not written: the port takes no more data")


def test_a_heartbeat_that_was_not_written_is_only_counted():
    bench = ready(STANDBY)
    bench.link.owner_alive(float("inf"))
    bench.link.update(bench.now + 1.0)
    assert bench.link.take_output() == [b"<H>"]
    bench.link.not_written(b"<H>")
    assert not [one for one in bench.link.take_events() if hasattr(one, "severity")]
