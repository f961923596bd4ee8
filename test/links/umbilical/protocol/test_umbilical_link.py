"""The connection: never seen, fresh, stale, lost, regained, and pauses that are none of these."""

import itertools

import pytest
from umbilical_link_bench import ASCENT, COAST, DROGUE, STANDBY, STARTUP, Bench, ready

from chute_ros.links.umbilical.protocol.events import TelemetryReceived
from chute_ros.links.umbilical.protocol.line_parser import LogLine
from chute_ros.links.umbilical.protocol.link import DOUBTED
from chute_ros.model import LinkState, ParachuteState
from chute_ros.protocol.events import DeviceLinkChanged, ParachuteChanged, Severity, VehicleChanged
from chute_ros.protocol.liveness import LivenessLimits

BEGIN, END = "--- BEGIN FLASH CSV DUMP ---", "--- END FLASH CSV DUMP ---"
WIPING = "Wiping QSPI Flash... Please wait."


def state(bench):
    return bench.link.computer.liveness.state


def test_a_flight_computer_that_was_never_seen():
    bench = Bench(always_alive=True).at(60.0)
    assert state(bench) is LinkState.NEVER_SEEN
    assert bench.events == []
    assert len(bench.times("<H>")) == 60
    # Nor do bytes that are no record make it seen.
    bench = Bench().hear("x").after(0.3).hear("x", "[INFO] hello", "Flash: 1/2 KB used (50.0%)")
    assert state(bench) is LinkState.NEVER_SEEN
    assert bench.of(DeviceLinkChanged, ParachuteChanged, VehicleChanged) == []


def test_heard_stale_lost_and_regained():
    bench = Bench().talk(flight_mode=STANDBY).at(1.0)
    assert bench.link_states() == ["OK"]
    bench.silent().at(3.9)
    assert (state(bench), bench.status().faults) == (LinkState.OK, ())
    bench.at(4.1)
    assert bench.link_states() == ["OK", "STALE"]
    assert bench.status().faults == ("telemetry STALE: 3.0 s old",)
    assert bench.status().state is ParachuteState.ABNORMAL
    bench.at(15.9)
    assert state(bench) is LinkState.STALE
    bench.at(16.1)
    assert bench.status().faults == ("telemetry LOST: 15.0 s old",)
    bench.talk().after(0.2)
    assert bench.link_states() == ["OK", "STALE", "LOST", "OK"]
    assert bench.of(DeviceLinkChanged)[-1].change.regained
    assert (bench.status().state, bench.status().faults) == (ParachuteState.ARMED, ())
    assert {event.name for event in bench.of(DeviceLinkChanged)} == {"flight computer"}


def test_the_limits_are_settings():
    bench = ready(telemetry=LivenessLimits(0.5, 2.0)).silent().after(0.6)
    assert state(bench) is LinkState.STALE
    bench.after(1.5)
    assert state(bench) is LinkState.LOST


def test_each_record_is_told_with_its_number():
    bench = Bench(settle_time=0.25).talk(flight_mode=STANDBY).at(1.0)
    records = bench.of(TelemetryReceived)
    assert [event.sequence for event in records] == list(range(1, len(records) + 1))
    # Up to 0.3 it had not settled, 0.4 was the first line, and it takes three to recognise them.
    assert records[0].record.received == pytest.approx(1000.7)


def test_our_heartbeat_goes_on_in_every_state_until_the_owner_hangs_or_the_cable_is_out():
    bench = Bench(always_alive=True).talk(flight_mode=STANDBY).at(5.0).silent().at(30.0)
    bench.hear(BEGIN).at(40.0).talk().at(50.0)
    beats = [0.0, *bench.times("<H>"), 50.0]
    assert max(b - a for a, b in itertools.pairwise(beats)) <= 1.62
    assert bench.link.scheduler.heartbeats_sent == len(beats) - 2
    bench = Bench()
    bench.link.owner_alive(bench.now + 3.5)
    assert bench.at(20.0).times("<H>") == [0.12, 1.12, 2.12, 3.12]
    bench = Bench(always_alive=True).at(5.0).pull()
    before = len(bench.times("<H>"))
    assert len(bench.at(15.0).times("<H>")) == before
    assert bench.plug().at(15.5).times("<H>")[before:] == [15.12]


def test_a_dump_is_not_taken_for_a_lost_link():
    bench = under_way("dump_flash", BEGIN)
    for _ in range(40):
        bench.after(1.0).hear_bytes(b"1,2,3\n")
        assert state(bench) is LinkState.OK
    status = bench.status()
    assert (status.link_state, status.state) == (LinkState.OK, ParachuteState.NOT_READY)
    assert status.faults == ("no telemetry: dump flash in progress",)
    bench.hear(END).talk().after(0.2)
    assert bench.link_states() == []
    assert bench.status().faults == ()


def test_a_wipe_is_not_taken_for_a_lost_link_though_nothing_comes_for_long():
    bench = under_way("wipe_flash", WIPING).after(55.0)
    assert state(bench) is LinkState.OK
    assert bench.status().state is ParachuteState.NOT_READY
    assert bench.status().faults == ("no telemetry: wipe flash in progress",)
    assert not bench.link.computer.fresh(bench.now)
    bench.hear("Flash wiped successfully.").talk().after(0.5)
    assert bench.link_states() == []


def under_way(name, *said):
    """This work was ordered, and the flight computer says no more than this."""
    bench = ready()
    bench.order(name)
    return bench.after(0.1).silent().hear(*said)


def test_no_line_of_a_wipe_comes_too_late_for_the_link():
    for end in ("Flash wiped successfully.", "ERASE FAILED!", None):
        bench = under_way("wipe_flash", WIPING)
        bench.after(50.0).hear("Wipe progress: 1/2 sectors").after(50.0)
        if end:
            bench.hear(end)
        bench.talk().after(0.5)
        assert bench.link_states() == [], end
        assert bench.status().faults == (), end


def test_silence_for_too_long_or_after_a_pause_is_a_lost_link_again():
    assert under_way("wipe_flash", WIPING).after(61.0).link_states() == ["STALE", "LOST"]
    assert under_way("dump_flash", BEGIN, END).after(3.5).link_states() == ["STALE"]
    assert under_way("dump_flash", BEGIN).after(30.0).link_states() == ["STALE", "LOST"]


def test_a_deploy_during_a_dump_in_flight_is_not_refused():
    bench = ready(COAST).silent().hear(BEGIN)
    bench.after(1.0).deploy()
    assert bench.tokens == ["<D>"]
    bench.hear_bytes(b"1\n").after(2.5).hear_bytes(b"1\n")
    bench.clear().deploy()
    assert bench.after(0.2).tokens == ["<D>"], "what was in the air is so still"


def test_what_comes_right_after_the_opening_does_not_pass_for_fresh():
    bench = ready(DROGUE).pull().after(20.0).plug().clear()
    bench.hear_bytes(bench.line() * 20).after(0.15).hear_bytes(bench.line() * 20)
    assert bench.of(TelemetryReceived) == []
    assert state(bench) is LinkState.LOST
    bench.talk().after(0.4)
    assert state(bench) is LinkState.OK
    assert bench.link.counts["bytes right after the opening"] >= 40 * len(bench.line())


def test_a_line_or_a_dump_that_began_before_the_opening_is_dropped():
    bench = ready().pull().plug().clear()
    bench.hear_bytes(b"1").after(0.3)
    cut = bench.line()[40:]
    bench.hear_bytes(cut[:30]).hear_bytes(cut[30:] + bench.line())
    assert len(bench.of(TelemetryReceived)) == 1
    assert bench.link.counts["first line after the opening"] == 2
    bench = ready().pull().plug().clear()
    bench.hear_bytes(b"1").after(0.3).hear("1,2", "3,4", END)
    assert bench.link.counts["mark of a dump that was not under way"] == 1
    # The layout is known again at once.
    bench = ready().pull().after(5.0).plug().clear().after(0.05)
    bench.talk().after(0.5)
    assert len(bench.of(TelemetryReceived)) == 2


def test_a_restart_is_told():
    for mode, where in ((STANDBY, ""), (ASCENT, " IN FLIGHT"), (DROGUE, " IN FLIGHT")):
        bench = ready(mode).restarts(flight_mode=STARTUP).after(0.5)
        assert bench.notices() == [f"flight computer restarted{where}"]
        assert bench.link_states() == []
        vehicle = bench.of(VehicleChanged)[-1].state
        assert (vehicle.reboot_count, vehicle.rebooted_in_flight) == (1, mode != STANDBY)
        assert bench.link.counts[DOUBTED] == 1


def test_after_a_restart_in_flight_nothing_is_taken_for_the_ground():
    bench = ready(ASCENT).restarts(flight_mode=STANDBY).after(0.5)
    refused = [bench.order("launch", True), bench.order("wipe_flash"), bench.order("open_mav")]
    for number in refused:
        assert "lost in flight" in bench.end(number).message
    bench.deploy()
    assert bench.tokens == ["<D>"]


def test_a_line_that_nobody_asked_for_is_no_pause_in_flight():
    for mark in (WIPING, BEGIN):
        bench = ready(COAST, altitude=2000).hear(mark).silent().after(16.0)
        assert bench.link_states() == ["STALE", "LOST"], mark


def test_a_work_that_has_not_begun_is_no_fault_while_telemetry_comes():
    bench = ready(STANDBY)
    bench.order("dump_flash")
    bench.after(1.0)
    assert bench.of(ParachuteChanged)[-1].status.faults == ()
    assert bench.of(ParachuteChanged)[-1].status.healthy


def test_a_clock_that_stands_still_is_a_fault():
    """A flight computer that restarts over and over says one record each time."""
    bench = ready(STANDBY, ms_since_boot_cfc=300).after(4.0)
    assert "its clock stands still" in bench.of(ParachuteChanged)[-1].status.faults
    number = bench.order("launch", force=True)
    assert "no fresh telemetry" in bench.end(number).message


def test_of_lines_for_the_log_fifty_a_second_are_told_and_no_error_is_left_out():
    bench = ready().silent().after(1.1)
    bench.hear(*[f"[ERROR] sensor {number}" for number in range(60)])
    assert [one.text for one in bench.of(LogLine)] == [f"sensor {n}" for n in range(50)]
    assert bench.link.counts["lines for the log beyond fifty a second"] == 10
    bench.after(0.5).restarts().after(0.3).hear("[INFO] hello")
    assert "flight computer restarted" in bench.notices(), "an error of ours is always told"
    assert len(bench.of(LogLine)) == 50
    bench.after(0.3).hear("[INFO] hello again")
    assert bench.of(LogLine)[50:] == [LogLine(Severity.INFO, "hello again")]
