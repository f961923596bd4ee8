"""State and health of one parachute, and what time does to them."""

import math

from parachute_bench import Told, picture

from chute_ros.model import LinkState, ParachuteState, SafetyFlags
from chute_ros.protocol.mavlink.dialect import dialect as d

CLEARED, GROUND = SafetyFlags.GROUND_CLEARED, SafetyFlags.ON_GROUND


def test_state_in_the_numbering_of_upf():
    for fields, state in (
        ({}, ParachuteState.READY),
        ({"safety": CLEARED}, ParachuteState.TAKEOFF),
        ({"safety": CLEARED | GROUND}, ParachuteState.READY),
        ({"armed": 4, "safety": CLEARED}, ParachuteState.ARMED),
        ({"armed": 4, "errors": 8}, ParachuteState.ABNORMAL),
        ({"deployed": 1, "errors": 8}, ParachuteState.LAUNCHED),
        ({"deployed": 1, "safety": GROUND}, ParachuteState.TOUCHDOWN),
    ):
        assert picture(**fields).state is state, fields


def test_health_from_the_heartbeats_system_status():
    ready, not_ready = ParachuteState.READY, ParachuteState.NOT_READY
    healthy = {d.MAV_STATE_UNINIT: ready, d.MAV_STATE_BOOT: not_ready}
    healthy |= {d.MAV_STATE_CALIBRATING: not_ready, d.MAV_STATE_STANDBY: ready}
    for system_status, state in {**healthy, d.MAV_STATE_ACTIVE: ready}.items():
        told = Told().heartbeat(state=system_status).status().at(0.0)
        assert (told.state, told.faults) == (state, ()), system_status
    for system_status, fault in {
        d.MAV_STATE_CRITICAL: "critical",
        d.MAV_STATE_EMERGENCY: "emergency",
        d.MAV_STATE_POWEROFF: "powering off",
        d.MAV_STATE_FLIGHT_TERMINATION: "flight termination",
        99: "state 99, which has no name",
    }.items():
        told = Told().heartbeat(state=system_status).status().at(0.0)
        assert told.state is ParachuteState.ABNORMAL, fault
        assert told.faults == (f"heartbeat reports {fault}",)


def test_nothing_is_known_before_the_first_status():
    told = Told().heartbeat().at(0.0)
    assert told.state is ParachuteState.UNKNOWN
    assert told.faults == ("no PARACHUTE_STATUS received",)
    assert math.isnan(told.uptime)
    assert math.isnan(told.ats_arm_altitude)
    assert not told.healthy


def test_status_overdue_though_heartbeats_come():
    told = Told().heartbeat(0.0).status(0.5)
    for second in range(1, 4):
        told.heartbeat(float(second))
    assert told.at(3.9).healthy
    assert told.tracker.next_deadline() == 4.0
    changes, changed = told.tracker.update(4.0)
    assert (changes, changed) == ([], True)
    late = told.tracker.status(4.0)
    assert late.link_state is LinkState.OK
    assert late.state is ParachuteState.ABNORMAL
    assert late.faults == ("PARACHUTE_STATUS 3.5 s old",)
    # It comes back.
    assert told.heartbeat(4.2).status(4.3, boot_ms=9000).at(4.4).healthy


def test_silent_heartbeat_is_a_fault_in_words():
    told = Told().heartbeat(0.0).status(2.0)
    assert told.at(2.5).faults == ("heartbeat STALE: 2.5 s old",)
    assert told.at(5.0).faults == ("heartbeat LOST: 5.0 s old",)
    assert not told.at(5.0).healthy


def test_restart_is_seen_in_time_boot_ms_and_nothing_else_is_one():
    # Restart is seen in time boot ms.
    told = Told().heartbeat().status(0.0, boot_ms=60_000)
    told.status(1.0, boot_ms=61_000).status(2.0, boot_ms=400).status(3.0, boot_ms=1400)
    assert told.tracker.reboot_count == 1
    assert told.at(3.0).uptime == 1.4
    # Delayed status is no restart and undoes nothing.
    told = Told().heartbeat().status(0.0, boot_ms=60_500, deployed=4)
    told.status(0.1, boot_ms=60_000)
    assert told.tracker.deployed
    told.status(0.2, boot_ms=57_000)  # delayed by more than a second
    assert told.tracker.deployed
    told.status(0.3, boot_ms=60_800, deployed=4)
    assert told.tracker.reboot_count == 0
    # Clock that wraps after 49 days is no restart.
    told = Told().heartbeat().status(0.0, boot_ms=2**32 - 500).status(1.0, boot_ms=500)
    told.status(2.0, boot_ms=1500)
    assert told.tracker.reboot_count == 0
    assert told.at(2.0).uptime == 1.5
    # Device without a clock is followed.
    told = Told().heartbeat().status(0.0, boot_ms=0).status(1.0, boot_ms=0, deployed=3)
    assert told.tracker.deployed
    assert told.tracker.status_interval == 1.0
