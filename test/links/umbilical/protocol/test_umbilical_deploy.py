"""Deploy: fires until telemetry shows it, and never what is out already."""

import pytest
from umbilical_link_bench import ASCENT, COAST, DROGUE, FAULT, MAIN, STANDBY, STARTUP, Bench, ready

from chute_ros.links.umbilical.protocol.config import DeployStage, UmbilicalConfig
from chute_ros.links.umbilical.protocol.events import DumpStarted
from chute_ros.links.umbilical.protocol.scheduler import SchedulerLimits
from chute_ros.protocol.events import ParachuteChanged

TOKENS = {DeployStage.DROGUE: "<D>", DeployStage.MAIN: "<d>"}
FLAGS = {DeployStage.DROGUE: "ssa_drogue_deployed", DeployStage.MAIN: "ssa_main_deployed"}
MODES = {DeployStage.DROGUE: DROGUE, DeployStage.MAIN: MAIN}
STAGES = pytest.mark.parametrize("stage", TOKENS, ids=lambda one: one.value)


def out(stage, **rest):
    """In Coast, where it has come out before our eyes."""
    bench = ready(COAST, **rest)
    return bench.talk(**{FLAGS[stage]: 1}).after(0.3).clear()


@STAGES
def test_deploy_fires_the_stage_of_the_settings(stage):
    bench = ready(COAST, deploy=stage)
    number = bench.deploy()
    assert bench.tokens == [TOKENS[stage]]
    bench.after(0.3).talk(**{FLAGS[stage]: 1}).after(0.2)
    end = bench.end(number)
    assert (end.success, end.sent, end.shown) == (True, True, True)
    assert bench.steps(number) == ["SENT", "CONFIRMED"]
    assert bench.after(9.0).tokens == [TOKENS[stage]]
    bench = ready(COAST, deploy=stage)
    number = bench.deploy()
    shown_by_mode = bench.after(0.3).talk(flight_mode=MODES[stage]).after(0.2).end(number).shown
    assert shown_by_mode


def test_next_is_the_main_once_the_drogue_is_out_and_nothing_once_both_are():
    for told, token in (
        ({"flight_mode": COAST}, "<D>"),
        ({"flight_mode": COAST, "ssa_drogue_deployed": 1}, "<d>"),
        ({"flight_mode": DROGUE, "ssa_drogue_deployed": 1}, "<d>"),
        ({"flight_mode": DROGUE}, "<d>"),
    ):
        bench = ready(COAST, deploy=DeployStage.NEXT).talk(**told).after(3.3)
        bench.deploy()
        assert bench.tokens == [token], told
    bench = ready(COAST, deploy=DeployStage.NEXT).talk(ssa_drogue_deployed=1)
    bench.talk(ssa_drogue_deployed=0).after(0.3)
    bench.deploy()
    assert bench.tokens == ["<D>"], "after one damaged record"
    bench = ready(MAIN, deploy=DeployStage.NEXT).talk().after(3.2)
    assert "already; nothing was sent" in bench.end(bench.deploy()).message
    assert bench.tokens == []


def test_a_drogue_that_came_out_a_moment_ago_has_its_time_to_open():
    """Given a deploy that was decided with nothing out, and held back until its kill had left."""
    bench = ready(COAST, deploy=DeployStage.NEXT).talk(ssa_drogue_deployed=1).after(0.6)
    end = bench.end(bench.deploy())
    assert (end.success, bench.after(1.0).tokens) == (True, [])
    assert "drogue" in end.message
    bench.after(2.0).deploy()
    assert bench.tokens == ["<d>"]


def test_one_damaged_record_keeps_nothing_from_being_fired():
    bench = ready(COAST, deploy=DeployStage.DROGUE).talk(ssa_drogue_deployed=1)
    bench.deploy()
    assert bench.after(0.2).tokens == ["<D>"]


@STAGES
def test_what_is_out_already_is_fired_only_where_that_is_wanted(stage):
    bench = out(stage, deploy=stage)
    end = bench.end(bench.deploy())
    assert (end.success, end.sent, end.shown) == (True, False, True)
    assert end.message.endswith("already; nothing was sent")
    assert bench.after(9.0).tokens == []
    bench = out(stage, deploy=stage)
    number = bench.deploy(again=True)
    assert bench.after(0.2).ends(number) == []
    assert bench.after(0.2).end(number).sent
    assert bench.after(9.0).tokens == [TOKENS[stage]]
    for force in (False, True):
        bench = out(stage)
        bench.order(stage.value, force)
        assert bench.after(2.0).tokens == ([TOKENS[stage]] if force else []), "by its name"


@STAGES
def test_stale_telemetry_that_says_out_is_not_believed(stage):
    bench = out(stage, deploy=stage).silent().after(3.5)
    number = bench.deploy(force=True)
    assert bench.tokens == [TOKENS[stage]]
    assert bench.after(1.0).ends(number) == []
    assert bench.talk().after(0.2).end(number).success


def test_stale_telemetry_is_not_believed_after_an_earlier_shot_either():
    bench = ready(COAST)
    bench.deploy()
    bench.after(0.2).talk(ssa_drogue_deployed=1).after(0.3).silent().after(3.5)
    second = bench.deploy(force=True)
    assert bench.tokens == ["<D>", "<D>"]
    assert bench.ends(second) == []


@STAGES
def test_on_the_ground_it_is_refused_unless_forced(stage):
    for mode in (STARTUP, STANDBY, FAULT):
        bench = ready(mode, deploy=stage)
        number = bench.deploy()
        assert f"the {stage.value} is not fired on the ground" in bench.end(number).message, mode
        assert bench.after(1.0).tokens == []
        bench.deploy(force=True)
        assert bench.tokens == [TOKENS[stage]]


def test_without_telemetry_it_is_refused_unless_forced():
    bench = Bench().at(1.0)
    number = bench.deploy()
    assert bench.end(number).message.endswith("(no telemetry was received yet)")
    bench.deploy(force=True)
    assert bench.after(0.5).tokens == ["<D>"]


def test_it_fires_again_until_telemetry_shows_it():
    bench = ready(ASCENT)
    number = bench.deploy()
    bench.after(3.5).talk(ssa_drogue_deployed=1).after(6.0)
    assert bench.times("<D>") == [1.05, 2.55, 4.05]
    assert bench.end(number).message == (
        "telemetry reports ssa_drogue_deployed 1, or flight mode DrogueDeployed after 3.55 s; "
        "sent 3 times"
    )
    # By the standard settings a lost one costs half a second.
    bench = ready(ASCENT, effect=UmbilicalConfig().effect)
    bench.deploy()
    bench.after(1.2).talk(ssa_drogue_deployed=1).after(6.0)
    assert bench.times("<D>") == [1.05, 1.55, 2.05]


def test_the_next_stage_is_the_same_one_while_its_order_is_under_way():
    bench = ready(COAST, deploy=DeployStage.NEXT)
    bench.deploy()
    bench.after(0.7)
    bench.deploy()
    bench.after(0.7)
    assert set(bench.tokens) == {"<D>"}, "nothing shows yet"
    bench.talk(ssa_drogue_deployed=1, flight_mode=DROGUE).after(2.0)
    bench.deploy()
    assert bench.after(0.5).tokens[-1] == "<d>"


def test_a_deploy_that_is_tried_again_is_no_order_for_the_main():
    """Given firmware that sets no flag for <D>, and a drogue that carries."""
    bench = ready(COAST, deploy=DeployStage.NEXT)
    bench.deploy()
    bench.after(12.0).clear()
    bench.deploy(repeated=True)
    assert set(bench.after(12.0).tokens) == {"<D>"}
    bench.clear()
    bench.deploy()
    assert bench.after(1.0).tokens[0] == "<d>", "another order"
    bench = ready(COAST, deploy=DeployStage.NEXT).talk(ssa_drogue_deployed=1)
    bench.talk(ssa_drogue_deployed=1).after(3.3).clear()
    bench.deploy(repeated=True)
    assert bench.after(0.3).tokens == ["<d>"], "its drogue is known to be out"


def test_it_ends_when_the_time_is_up_and_says_so():
    bench = ready(ASCENT)
    number = bench.deploy()
    bench.after(20.0)
    assert bench.times("<D>") == [1.05, 2.55, 4.05, 5.55]
    end = bench.end(number)
    assert (end.success, end.sent, end.shown) == (False, True, False)
    assert end.message == (
        "drogue given up after 5.0 s: sent 4 times, but the device's own status never showed that "
        "telemetry reports ssa_drogue_deployed 1, or flight mode DrogueDeployed"
    )


def test_it_fires_again_though_telemetry_is_lost_meanwhile_and_forced_on_the_ground():
    bench = ready(ASCENT)
    bench.deploy()
    bench.silent().after(20.0)
    assert len(bench.times("<D>")) == 4
    bench = ready(STANDBY)
    bench.deploy(force=True)
    assert len(bench.after(4.0).times("<D>")) == 3


def test_it_leaves_before_all_that_waits_and_finds_a_place_though_the_queue_is_full():
    for limits, after in (
        (SchedulerLimits(), ["<I>"] * 4),
        (SchedulerLimits(most_waiting=1), None),
    ):
        bench = ready(COAST, scheduler=limits)
        for _ in range(5):
            bench.order("flash_info")
        bench.deploy()
        assert bench.after(0.2).tokens == ["<I>", "<D>"]
        assert after is None or bench.after(0.8).tokens[2:] == after


def test_a_second_one_that_waits_is_not_fired_once_the_first_shows():
    bench = ready(ASCENT, scheduler=SchedulerLimits(0.5, 1.0, 0.5))
    bench.deploy()
    bench.after(0.1)
    second = bench.deploy()
    bench.after(0.1).talk(ssa_drogue_deployed=1).after(6.0)
    assert len(bench.times("<D>")) == 1
    assert bench.end(second).success
    assert bench.end(second).message.endswith("; nothing was sent")


def test_one_damaged_line_does_not_swallow_one_that_waits():
    bench = ready(COAST, scheduler=SchedulerLimits(0.5, 1.0, 0.5))
    bench.order("flash_info")
    bench.after(0.05)
    bench.deploy()
    bench.talk(ssa_drogue_deployed=1).after(0.1).talk(ssa_drogue_deployed=0).after(0.5)
    assert len(bench.times("<D>")) == 1


def test_ordered_while_the_cable_is_out_it_leaves_as_soon_as_it_is_back():
    for out_for in (0.0, 1.0, 4.8):
        bench = ready(COAST).pull().silent()
        number = bench.deploy()
        back = bench.after(out_for).plug().t
        bench.after(0.15)
        assert bench.times("<D>") == [pytest.approx(back + 0.12)], out_for
        assert bench.steps(number) == ["SENT"]


def test_a_cable_that_comes_back_too_late_fires_nothing():
    bench = ready(COAST).pull().silent()
    number = bench.deploy()
    bench.after(5.5).plug().after(9.0)
    assert bench.tokens == []
    end = bench.end(number)
    assert (end.success, end.sent) == (False, False)
    assert "never sent: its turn did not come, or the wire is closed" in end.message
    # Nor where nobody saw that the time was up.
    bench = ready(COAST).pull().silent()
    number = bench.deploy()
    bench.t += 30.0
    bench.plug().after(9.0)
    assert bench.tokens == []
    assert not bench.end(number).sent


def test_pulled_after_the_first_shot_it_fires_again_when_the_cable_is_back():
    bench = ready(COAST)
    number = bench.deploy()
    bench.after(0.2).pull().silent().after(2.0).plug().talk().after(0.5)
    assert bench.times("<D>") == [1.05, 3.37]
    bench.talk(ssa_drogue_deployed=1).after(0.3)
    assert bench.end(number).success


def test_a_decided_deploy_waits_for_telemetry_only_where_telemetry_must_allow_it():
    assert Bench().link.has_parachute(), "it is sent in every mode"
    bench = Bench(decided_deploy_forces=False)
    assert not bench.link.has_parachute()
    bench.talk(flight_mode=STANDBY).after(1.0)
    assert bench.link.has_parachute()
    bench.pull()
    assert not bench.link.has_parachute()
    assert bench.plug().link.has_parachute()


@STAGES
def test_a_flag_that_a_test_on_the_ground_left_does_not_keep_a_canopy_in(stage):
    bench = ready(STANDBY, deploy=stage, **{FLAGS[stage]: 1})
    bench.talk(flight_mode=ASCENT, altitude=500).after(0.3).talk(flight_mode=COAST).after(0.3)
    number = bench.deploy()
    assert bench.tokens == [TOKENS[stage]]
    assert bench.after(0.5).ends(number) == [], "nor does the flag show that it came out now"
    assert bench.talk(flight_mode=MODES[stage]).after(0.3).end(number).shown


def test_next_is_the_main_after_a_restart_in_flight_and_where_the_drogue_is_never_told():
    bench = ready(DROGUE, deploy=DeployStage.NEXT, ssa_drogue_deployed=1, altitude=900)
    bench.restarts(flight_mode=STARTUP, ssa_drogue_deployed=0, altitude=800).after(3.0)
    bench.deploy()
    assert bench.tokens == ["<d>"]
    bench = ready(COAST, deploy=DeployStage.NEXT, altitude=2000)
    bench.deploy()
    bench.after(6.0).clear().deploy()
    assert bench.after(0.2).tokens == ["<d>"]


def test_it_is_not_fired_again_once_fresh_telemetry_says_ground():
    bench = ready(COAST)
    number = bench.deploy()
    bench.after(0.5).talk(flight_mode=STANDBY).after(9.0)
    assert bench.times("<D>") == [1.05]
    assert "not to be sent again (flight mode Standby)" in bench.end(number).message


def test_where_the_main_is_the_parachute_the_drogue_does_not_count_as_deployed():
    bench = ready(DROGUE, deploy=DeployStage.MAIN, ssa_drogue_deployed=1)
    assert not bench.of(ParachuteChanged) or not bench.of(ParachuteChanged)[-1].status.deployed
    bench.talk(ssa_main_deployed=1).after(0.3)
    assert bench.of(ParachuteChanged)[-1].status.deployed


def test_a_dump_that_nobody_asked_for_is_not_followed_over_and_over():
    bench = ready(STANDBY)
    for _ in range(50):
        bench.hear("--- BEGIN FLASH CSV DUMP ---", "--- END FLASH CSV DUMP ---")
    assert len(bench.of(DumpStarted)) == 1
