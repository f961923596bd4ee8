"""A kill stops the motors by whatever way this autopilot obeys, and opens no parachute alone."""

import pytest
from link_bench import (
    Bench,
    ack,
    ardupilot,
    copter,
    heartbeat,
    landed,
    no_setting,
    px4_integer,
    setting,
    status,
)

from chute_ros.links.mavlink.protocol.autopilot_settings import READ_AGAIN
from chute_ros.links.mavlink.protocol.config import KillMethod
from chute_ros.model import Armed
from chute_ros.protocol.events import RequestReport, Severity
from chute_ros.protocol.mavlink.dialect import dialect as d

CHUTE, PILOT = (1, 161), (1, 1)
RELEASE, REQUEST, TERMINATE, DISARM = 208, 512, 185, 400
DENIED, FAILED, NOT_NOW = (
    d.MAV_RESULT_DENIED,
    d.MAV_RESULT_FAILED,
    d.MAV_RESULT_TEMPORARILY_REJECTED,
)
REFUSALS = (DENIED, FAILED, NOT_NOW, d.MAV_RESULT_UNSUPPORTED)
PLANE = d.MAV_TYPE_FIXED_WING


def unknown(armed=False):
    mode = d.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return heartbeat(d.MAV_TYPE_QUADROTOR, d.MAV_AUTOPILOT_GENERIC, mode)


def plane(armed=False):
    return ardupilot(armed, kind=PLANE)


def flying(make, *settings, **config):
    """An autopilot that has told its settings, armed and flies."""
    bench = Bench(**config).hear(PILOT, make(False), *settings)
    bench.at(0.5).hear(PILOT, make(True), landed(d.MAV_LANDED_STATE_IN_AIR)).at(1.0).clear()
    return bench


def kill(bench):
    return bench.call("kill", 1)


def ways(bench):
    """The orders to stop the motors so far: (when, 400 or 185)."""
    return [
        (round(t - 1.0, 3), m.command)
        for t, m in bench.sent
        if m.get_type() == "COMMAND_LONG" and m.command in (TERMINATE, DISARM)
    ]


def outcomes(bench, token):
    return [e.report.outcome.name for e in bench.events if isinstance(e, RequestReport)]


@pytest.mark.parametrize("make", [copter, ardupilot, plane, unknown])
def test_a_kill_alone_terminates_nothing_that_may_release(make):
    """No setting was read yet: of none of them it is known what termination does."""
    for method in KillMethod:
        bench = flying(make, kill_method=method)
        kill(bench)
        for result in REFUSALS:
            bench.at(bench.t + 0.3).hear(PILOT, make(True), ack(DISARM, result))
        bench.stream(9.0, 0.5, PILOT, lambda: make(True))
        assert {way for _, way in ways(bench)} == {DISARM}, method


@pytest.mark.parametrize("method", list(KillMethod))
def test_px4_is_terminated_only_once_a_deploy_was_decided(method):
    bench = flying(copter, kill_method=method).hear(CHUTE, heartbeat(), status(armed=12))
    kill(bench)
    bench.at(1.1).hear(PILOT, ack(DISARM, NOT_NOW))
    assert ways(bench) == [(0.0, DISARM)]
    bench.at(1.15).call("deploy", 2, False)
    assert (0.15, TERMINATE) in ways(bench), "without waiting for anything more"
    bench.hear(PILOT, ack(TERMINATE)).at(1.2).hear(
        PILOT, copter(True, d.MAV_STATE_FLIGHT_TERMINATION)
    )
    end = bench.end(1).finished
    assert end.success
    assert "kill (flight_termination): the autopilot reports motors off" in end.message
    assert "kill (forced_disarm): temporarily rejected" in end.message


def test_a_deploy_that_another_link_carries_out_allows_it_as_well():
    """Given a parachute on DroneCAN: the autopilot refuses to disarm, and the canopy opens."""
    bench = flying(copter)
    kill(bench)
    bench.at(1.1).hear(PILOT, ack(DISARM, NOT_NOW))
    assert ways(bench) == [(0.0, DISARM)]
    bench.at(1.15).call("deploy_decided")
    assert (0.15, TERMINATE) in ways(bench), "without waiting for anything more"


def test_a_deploy_of_the_flight_before_allows_nothing_in_this_one():
    bench = flying(copter).hear(CHUTE, heartbeat(), status()).call("deploy", 2, False)
    bench.hear(PILOT, copter(False)).at(1.5).hear(PILOT, copter(True))
    kill(bench)
    bench.at(1.6).hear(PILOT, ack(DISARM, NOT_NOW)).at(2.0)
    assert {way for _, way in ways(bench)} == {DISARM}


def test_flight_termination_is_the_first_way_on_px4_once_a_deploy_was_decided():
    bench = flying(copter, kill_method=KillMethod.FLIGHT_TERMINATION)
    bench.hear(CHUTE, heartbeat(), status()).call("deploy", 2, False)
    kill(bench)
    assert ways(bench) == [(0.0, TERMINATE)]


@pytest.mark.parametrize("result", REFUSALS)
def test_a_refused_way_is_followed_by_the_other_at_once(result):
    bench = flying(ardupilot, no_setting("AFS_ENABLE"))
    kill(bench)
    bench.at(1.03).hear(PILOT, ack(DISARM, result))
    assert ways(bench) == [(0.0, DISARM), (0.03, TERMINATE)]
    assert outcomes(bench, 1) == ["SENT", "REFUSED", "SENT"]
    bench.hear(PILOT, ack(TERMINATE)).at(1.06).hear(PILOT, ardupilot(False))
    end = bench.end(1).finished
    assert (end.success, end.accepted) == (True, True)
    assert outcomes(bench, 1)[-1] == "CONFIRMED"


def test_a_way_that_is_not_answered_or_has_no_effect_is_followed_by_the_other():
    # A way without an answer is followed by the other and not given up.
    bench = flying(ardupilot, setting("AFS_ENABLE", 0))
    kill(bench)
    bench.at(1.5)
    assert (0.2, TERMINATE) in ways(bench), "after one wait for an acknowledgement"
    assert len([way for _, way in ways(bench) if way == DISARM]) >= 3
    bench.hear(PILOT, ack(DISARM), ardupilot(False))
    assert bench.end(1).finished.success
    assert "kill (flight_termination): not answered" in bench.end(1).finished.message
    # An accepted way without effect is followed by the other.
    bench = flying(ardupilot, setting("AFS_ENABLE", 0))
    kill(bench)
    bench.at(1.02).hear(PILOT, ack(DISARM)).stream(3.0, 0.1, PILOT, lambda: ardupilot(True))
    first = next(t for t, way in ways(bench) if way == TERMINATE)
    assert first == pytest.approx(1.52, abs=0.11)


def test_both_ways_fail_and_the_end_names_both():
    bench = flying(ardupilot, setting("AFS_ENABLE", 0))
    kill(bench)
    for _ in range(80):
        bench.at(bench.t + 0.1).hear(PILOT, ardupilot(True))
        bench.hear(PILOT, ack(DISARM, FAILED), ack(TERMINATE, DENIED))
    end = bench.end(1).finished
    assert not end.success
    assert "kill (flight_termination) given up" in end.message
    assert "kill (forced_disarm): failed" in end.message


def test_an_aeroplane_without_afs_is_disarmed_and_one_that_runs_its_motor_unarmed_terminated():
    bench = flying(plane, setting("AFS_ENABLE", 0), kill_method=KillMethod.FLIGHT_TERMINATION)
    kill(bench)
    bench.at(1.02).hear(PILOT, ack(TERMINATE, FAILED))
    assert ways(bench) == [(0.0, TERMINATE), (0.02, DISARM)]
    afs = (setting("AFS_ENABLE", 1), setting("AFS_TERM_ACTION", 42), setting("AFS_TERM_PIN", -1))
    bench = flying(plane, setting("ARMING_REQUIRE", 0), *afs)
    kill(bench)
    assert ways(bench) == [(0.0, TERMINATE)]


def test_a_termination_that_lands_is_no_kill_and_its_pin_may_be_a_parachutes():
    lands = (setting("AFS_ENABLE", 1), setting("AFS_TERM_ACTION", 43))
    pin = (setting("AFS_ENABLE", 1), setting("AFS_TERM_ACTION", 42), setting("AFS_TERM_PIN", 50))
    for bench in (flying(ardupilot, *lands), flying(plane, *pin)):
        kill(bench)
        bench.at(1.02).hear(PILOT, ack(DISARM, FAILED)).at(4.0)
        assert {way for _, way in ways(bench)} == {DISARM}
    assert "AFS_TERM_PIN is 50" in bench.link.setup().kill


PIN = {"AFS_ENABLE": 1, "AFS_TERM_ACTION": 42, "AFS_TERM_PIN": 54}


@pytest.mark.parametrize(
    "told",
    [
        {**PIN, "AFS_TERM_ACTION": 0},
        {**PIN, "AFS_TERM_ACTION": 43},
        *({key: value for key, value in PIN.items() if key != lost} for lost in PIN),
    ],
)
@pytest.mark.parametrize("make", [plane, ardupilot])
@pytest.mark.parametrize("method", KillMethod)
def test_a_pin_that_is_set_or_not_known_is_driven_by_no_kill_alone(method, make, told):
    """ArduPilot drives it as soon as termination is asked for, also where it then refuses it. An
    answer may be lost: the others show that the autopilot has it."""
    bench = Bench(kill_method=method).hear(PILOT, make())
    for _ in range(80):
        bench.at(bench.t + 0.25).hear(PILOT, make())
        bench.hear(PILOT, *(setting(*one) for one in told.items()))
    bench.hear(PILOT, make(True), landed(d.MAV_LANDED_STATE_IN_AIR)).clear()
    kill(bench)
    for _ in range(20):
        bench.at(bench.t + 0.1).hear(PILOT, make(True), ack(DISARM, FAILED))
    assert {way for _, way in ways(bench)} == {DISARM}


def test_where_only_a_way_that_releases_is_left_take_off_is_forbidden():
    bench = Bench().hear(PILOT, plane(), *(setting(*one) for one in PIN.items()))
    bench.hear(PILOT, setting("ARMING_REQUIRE", 0))
    (text,) = bench.link.vehicle_state(bench.now).faults
    for part in ("nothing stops the motors without a deploy", "AFS_TERM_PIN is 54"):
        assert part in text


def test_a_second_vehicle_with_the_same_ids_confirms_no_kill():
    """Ours flies; the other stands, disarmed. Whose heartbeat it is nobody knows."""
    bench, booted = Bench().hear(PILOT, copter()), {True: 500_000, False: 5_000}
    for step in range(140):
        bench.at(bench.t + 0.1)
        for ours in (True,) if step < 60 else (True, False):
            ms = booted[ours] + int(bench.t * 1000)
            bench.hear(PILOT, d.MAVLink_attitude_message(ms, 0, 0, 0, 0, 0, 0))
            if step % 10 == (0 if ours else 5):
                bench.hear(PILOT, copter(ours))
    assert bench.link.doubts(bench.now)
    bench.call("kill", 1).at(bench.t + 0.03).hear(PILOT, ack(DISARM, FAILED), copter(True))
    for _ in range(5):
        bench.at(bench.t + 0.05).hear(PILOT, copter(False))
    assert bench.ends(1) == []


def test_a_late_copy_of_a_heartbeat_of_before_the_arming_confirms_no_kill():
    """By a second way, 3 s late."""
    bench = Bench()
    before = bench.encoder(PILOT).encode(copter(False), bench.now)
    bench.link.receive(before, bench.now)
    bench.at(1.0).hear(PILOT, copter(True)).at(2.9)
    kill(bench)
    bench.link.receive(before, bench.now + 0.1)
    bench.at(3.0).hear(PILOT, ack(DISARM, FAILED)).at(3.1)
    assert bench.ends(1) == []
    assert bench.link.vehicle_state(bench.now).armed is Armed.ARMED


def test_a_deploy_of_a_parachute_that_is_not_there_lets_no_kill_alone_release():
    bench = flying(copter).hear(CHUTE, heartbeat(), status(armed=12))
    bench.link.deploy(5, False, bench.now, "1/162")
    kill(bench)
    bench.at(bench.t + 0.02).hear(PILOT, ack(DISARM, FAILED)).at(bench.t + 1.0)
    assert {way for _, way in ways(bench)} == {DISARM}


def test_the_way_is_said_once_the_settings_are_read():
    bench = Bench().hear(PILOT, copter())
    assert bench.notices() == []
    for name, value in (
        ("COM_ARM_AUTH_REQ", 0),
        ("COM_ARM_AUTH_ID", 10),
        ("COM_ARM_AUTH_MET", 0),
        ("CBRK_FLIGHTTERM", 121212),
        ("COM_PARACHUTE", 0),
    ):
        bench.hear(PILOT, px4_integer(name, value))
    bench.hear(PILOT, setting("COM_SPOOLUP_TIME", 1.0), setting("MPC_TKO_RAMP_T", 3.0), copter())
    (text,) = bench.notices()
    assert text == (
        "autopilot 1/1 (PX4): kill by forced disarm; if it is refused or not answered: flight "
        "termination, only once a deploy is decided (PX4 itself orders the parachute's "
        "release when it terminates)"
    )
    bench.stream(5.0, 0.1, PILOT, copter)
    assert len(bench.notices()) == 1
    assert bench.texts() == [text], "the pilot reads it, too"


@pytest.mark.parametrize(
    ("config", "settings", "fault"),
    [
        ({}, {"ARMING_REQUIRE": 0, "AFS_ENABLE": 0}, ("ARMING_REQUIRE is 0", "AFS_ENABLE is 0")),
        (
            {"kill_method": KillMethod.FLIGHT_TERMINATION},
            {"AFS_ENABLE": 0},
            ("kill_method is flight_termination", "AFS_ENABLE is 0", "set AFS_ENABLE to 1"),
        ),
        (
            {"kill_method": KillMethod.FLIGHT_TERMINATION},
            {"AFS_ENABLE": 1, "AFS_TERM_ACTION": 0},
            ("AFS_TERM_ACTION is 0",),
        ),
        (
            {"kill_method": KillMethod.FORCED_DISARM},
            {"ARMING_REQUIRE": 0, "AFS_ENABLE": 1, "AFS_TERM_ACTION": 42},
            ("kill_method is forced_disarm", "ARMING_REQUIRE is 0"),
        ),
    ],
)
def test_settings_that_make_the_kill_impossible_forbid_take_off_by_name(config, settings, fault):
    bench = Bench(**config).hear(PILOT, plane())
    for name, value in settings.items():
        bench.hear(PILOT, setting(name, value))
    (text,) = bench.link.vehicle_state(bench.now).faults
    for part in fault:
        assert part in text
    missing = {"ARMING_REQUIRE", "AFS_TERM_ACTION", "AFS_TERM_PIN", "CHUTE_ENABLED"}
    for name in {*missing, "HOME_RESET_ALT", "AFS_ENABLE"} - set(settings):
        bench.hear(PILOT, no_setting(name))
    said = [e for e in bench.events if getattr(e, "severity", None) is Severity.ERROR]
    assert said[-1].text.startswith("forbids take-off: autopilot 1/1: ")
    assert any(text.startswith("forbids take-off") for text in bench.texts())
    # Set right by a ground station, which everybody hears.
    for name, right in (("ARMING_REQUIRE", 1), ("AFS_ENABLE", 1), ("AFS_TERM_ACTION", 42)):
        bench.hear(PILOT, setting(name, right))
    assert bench.link.vehicle_state(bench.now).faults == ()


def waited_for(bench):
    """The faults that only more answers of the autopilot can take away."""
    faults = bench.link.vehicle_state(bench.now).faults
    return [text for text in faults if "not known yet" in text]


@pytest.mark.parametrize("make", [ardupilot, plane])
@pytest.mark.parametrize(
    ("method", "read"),
    [
        (KillMethod.AUTO, ("ARMING_REQUIRE",)),
        (KillMethod.FORCED_DISARM, ("ARMING_REQUIRE",)),
        (KillMethod.FLIGHT_TERMINATION, ("AFS_ENABLE", "AFS_TERM_ACTION", "HOME_RESET_ALT")),
    ],
)
def test_until_the_settings_that_decide_a_kill_are_read_take_off_is_forbidden(method, read, make):
    """READY for a second, and then the setting that makes the kill impossible."""
    values = {"ARMING_REQUIRE": 1, "AFS_ENABLE": 1, "AFS_TERM_ACTION": 42, "HOME_RESET_ALT": -1}
    values = {name: setting(name, value) for name, value in values.items()}
    last = values.pop(read[-1])
    bench = Bench(kill_method=method, needed_message_rate=0.0)
    bench.hear(PILOT, make(), *values.values())
    (text,) = waited_for(bench)
    assert text.endswith(f"works is not known yet: {read[-1]} is being read")
    assert waited_for(bench.hear(PILOT, last)) == []
    # What is read again was known before.
    bench.stream(READ_AGAIN + 1.0, 0.5, PILOT, make)
    assert bench.reads()
    assert waited_for(bench) == []


@pytest.mark.parametrize("method", KillMethod)
def test_an_autopilot_that_answers_nothing_is_waited_for_no_longer_than_it_is_asked(method):
    bench = Bench(kill_method=method, needed_message_rate=0.0).hear(PILOT, ardupilot())
    assert waited_for(bench)
    bench.stream(20.0, 0.1, PILOT, ardupilot)
    assert waited_for(bench) == []


def test_with_its_delivered_settings_no_autopilot_is_kept_from_taking_off():
    read = setting("ARMING_REQUIRE", 1), setting("AFS_ENABLE", 0)
    for told in ([copter()], [unknown()], [ardupilot(), *read], [plane(), *read]):
        bench = Bench().hear(PILOT, *told)
        assert bench.link.vehicle_state(bench.now).faults == (), told
    # What termination does on PX4 is said where it was chosen.
    bench = Bench(kill_method=KillMethod.FLIGHT_TERMINATION).hear(PILOT, copter())
    (warning,) = bench.link.setup().warnings
    assert "a kill without a deploy goes by forced disarm" in warning


def asked(bench):
    """When a heartbeat was asked for, since the order."""
    return [
        round(t - 1.0, 3)
        for t, m in bench.sent
        if m.get_type() == "COMMAND_LONG" and (m.command, m.param1) == (REQUEST, 0)
    ]


def test_the_heartbeat_is_asked_for_soon_after_any_answer_and_again():
    for result in (d.MAV_RESULT_ACCEPTED, DENIED, NOT_NOW):
        bench = flying(ardupilot)
        kill(bench)
        bench.at(1.01).hear(PILOT, ack(DISARM, result)).at(1.2)
        assert asked(bench) == [0.01, 0.035, 0.06, 0.11], result
    # A motor that was off already is confirmed by the heartbeat after the denial.
    bench = flying(copter)
    kill(bench)
    bench.at(1.01).hear(PILOT, ack(DISARM, DENIED)).at(1.04).hear(PILOT, copter(False))
    assert bench.end(1).finished.success
    assert "after 0.04 s" in bench.end(1).finished.message


def test_a_deploy_over_motors_that_turn_says_so():
    for beats, warned in (
        ([copter(True)], True),
        ([copter(False)], False),
        ([copter(True, d.MAV_STATE_FLIGHT_TERMINATION)], False),
        ([], False),
    ):
        bench = Bench().hear(CHUTE, heartbeat(), status(armed=12)).hear(PILOT, *beats)
        bench.at(0.5).call("deploy", 1, False)
        bench.at(0.6).hear(CHUTE, ack(RELEASE), status(boot_ms=5100, deployed=4))
        end = bench.end(1).finished
        assert end.success
        assert ("WARNING: autopilot 1/1" in end.message) is warned, beats


def test_an_autopilot_that_fell_silent_says_nothing_of_the_motors():
    bench = Bench().hear(PILOT, copter(True)).at(4.0).hear(CHUTE, heartbeat(), status(armed=12))
    assert bench.link.vehicle_state(bench.now).armed is Armed.ARMED
    bench.call("deploy", 1, False)
    bench.at(4.1).hear(CHUTE, ack(RELEASE), status(boot_ms=5100, deployed=4))
    assert "WARNING" not in bench.end(1).finished.message
