"""A flight computer that restarts in flight: what came out before, and was fired, stays known."""

import pytest
from umbilical_link_bench import ASCENT, COAST, DROGUE, FAULT, MAIN, STANDBY, STARTUP, ready
from umbilical_rocket import Rocket, flown, status, vehicle

from chute_ros.links.umbilical.protocol.config import DeployStage
from chute_ros.links.umbilical.protocol.gate import Situation
from chute_ros.model import ParachuteState
from chute_ros.protocol.boot_clock import Age

FORGETS = {"flight_mode": STARTUP, "ssa_drogue_deployed": 0, "ssa_main_deployed": 0}


def restarted_under(mode=DROGUE, told=0.5, **config):
    """Its drogue (or its main) came out and was told for a while; then it starts anew, and its
    records know of nothing."""
    bench = ready(COAST, altitude=2000, **config)
    bench.talk(flight_mode=mode, ssa_drogue_deployed=1, altitude=1900).after(told)
    return bench.restarts(**FORGETS, altitude=1700).after(0.5).clear()


def test_what_was_out_before_a_restart_in_flight_is_not_fired_again():
    bench = restarted_under()
    number = bench.deploy()
    assert bench.after(6.0).tokens == []
    assert bench.end(number).success
    assert bench.end(number).message == (
        "it was out before the flight computer restarted already; nothing was sent"
    )


def test_the_picture_says_deployed_all_the_way_down():
    bench = restarted_under()
    for step in range(20):
        bench.talk(altitude=1700 - 28 * step).after(1.0)
        assert (bench.status().deployed, bench.status().state) == (True, ParachuteState.LAUNCHED)


def test_a_person_who_insists_fires_it_again():
    bench = restarted_under()
    number = bench.deploy(again=True)
    assert bench.after(0.1).tokens == ["<D>"]
    assert bench.ends(number) == [], "and what was before shows nothing of that"


def test_one_record_that_says_so_is_not_enough():
    """Its text has no checksum: a digit may have been damaged."""
    bench = ready(COAST, altitude=2000)
    bench.talk(ssa_drogue_deployed=1).after(0.1).talk(ssa_drogue_deployed=0).after(0.5)
    bench.restarts(**FORGETS, altitude=1700).after(0.5).clear().deploy()
    assert bench.after(0.1).tokens == ["<D>"]
    assert not bench.status().deployed


def test_a_flag_that_a_test_on_the_ground_left_does_not_count():
    bench = ready(STANDBY, ssa_drogue_deployed=1)
    bench.talk(flight_mode=ASCENT, altitude=500).after(0.5).talk(flight_mode=COAST).after(0.5)
    bench.restarts(**FORGETS, altitude=1700).after(0.5).clear().deploy()
    assert bench.after(0.1).tokens == ["<D>"]


def test_the_drogue_says_nothing_of_the_main_which_is_not_forgotten_either():
    for mode, deployed, tokens in ((DROGUE, False, ["<d>"]), (MAIN, True, [])):
        bench = restarted_under(mode, deploy=DeployStage.MAIN)
        assert bench.talk(altitude=1650).after(0.2).status().deployed is deployed
        bench.deploy()
        assert bench.after(0.1).tokens == tokens, mode
        assert deployed is False or bench.after(2.0).tokens == []


def test_ordered_in_the_silence_of_a_restart_it_is_sent_once():
    bench = ready(COAST, altitude=2000).talk(flight_mode=DROGUE, ssa_drogue_deployed=1).after(0.5)
    bench.silent().after(3.5).clear()
    number = bench.deploy()
    bench.restarts(**FORGETS, altitude=1700).after(6.0)
    assert bench.times("<D>") == [5.05]
    assert bench.end(number).shown


def test_once_it_has_landed_nothing_is_known_any_more():
    bench = restarted_under().talk(altitude=0).after(6.0)
    assert bench.link.computer.situation(bench.now) is Situation.STARTUP
    assert not bench.status().deployed
    bench.talk(flight_mode=ASCENT, altitude=200).after(0.5).talk(flight_mode=COAST).after(0.5)
    bench.clear().deploy()
    assert bench.after(0.1).tokens == ["<D>"]


def launched_soon_after_its_start():
    """In flight 0.8 s after its start; then it starts anew, and is heard when its clock has
    passed that."""
    rocket = Rocket()
    rocket.started = 0.0
    rocket.says(0.3, STARTUP, altitude="0")
    rocket.says(0.6, STANDBY, altitude="0")
    rocket.says(0.8, ASCENT, altitude="1")
    rocket.started = 1.3
    return rocket


@pytest.mark.parametrize("before", [ASCENT, FAULT])
def test_a_restart_whose_clock_is_ahead_of_the_one_before_is_seen_in_flight(before):
    rocket = launched_soon_after_its_start()
    rocket.started = 0.0
    rocket.says(0.9, before, altitude="2")
    rocket.started = 1.3
    assert rocket.says(2.6, STARTUP, altitude="80")[1] is Age.RESTARTED
    assert rocket.computer.situation(2.6) is Situation.LOST_IN_FLIGHT
    assert vehicle(rocket, 2.6).rebooted_in_flight
    assert status(rocket, 2.6).faults == ("it restarted in flight",)
    assert rocket.says(2.7, STARTUP, altitude="84")[1] is Age.NEW
    assert rocket.computer.restarts == 1


def test_what_is_fired_after_such_a_restart_is_not_fired_again():
    rocket = launched_soon_after_its_start()
    rocket.says(2.6, STARTUP, altitude="80")
    rocket.computer.fired("drogue", 0.0)
    rocket.says(2.7, STARTUP, altitude="84", ssa_drogue_deployed="1")
    assert rocket.computer.came_out("drogue")
    assert rocket.computer.was_fired("drogue", 3.0)


def test_neither_a_clock_that_runs_on_nor_a_record_that_comes_late_is_a_restart():
    """It says Standby again by itself, as after a launch that was broken off."""
    rocket = flown((0.0, ASCENT, {"altitude": "1"}), (0.5, STANDBY, {"altitude": "1"}))
    assert rocket.says(0.6, STANDBY, altitude="1")[1] is Age.NEW
    assert rocket.computer.restarts == 0
    assert rocket.computer.situation(0.6) is Situation.STANDBY
    late = ((2.0, "100200", "150"), (2.1, "101900", "160"))
    rocket = flown((0.0, ASCENT, {"altitude": "100"}))
    for at, clock, altitude in late:
        rocket.says(at, COAST, altitude=altitude, ms_since_boot_cfc=clock)
    assert rocket.computer.restarts == 0
