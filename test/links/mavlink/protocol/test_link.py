"""Stories of a whole link over bytes: who is heard, who is not, and the flight block."""

import importlib.util
import math
import random
import sys
from typing import Any

import pytest
from link_bench import START, Bench, ack, copter, heartbeat, landed, status

from chute_ros.errors import NotBuiltError, ParameterError
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.flight_block import DISARM_INTERVAL
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.runtime import MavlinkRuntime, MavlinkSettings
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.model import Armed, LinkState, ParachuteState
from chute_ros.protocol.events import DeviceLinkChanged, ParachuteChanged
from chute_ros.protocol.mavlink import dialect as dialect_module
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.protocol.mavlink.signing import (
    REPLAYED,
    UNSIGNED,
    WRONG_SIGNATURE,
    Signer,
    SigningClock,
    Verifier,
)
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.sim.autopilot_kinds import ARDUCOPTER, GENERIC, PX4

CHUTE, SECOND, PILOT, GROUND = (1, 161), (1, 162), (1, 1), (255, 190)
GCS = heartbeat(d.MAV_TYPE_GCS, d.MAV_AUTOPILOT_INVALID)
DISARM, RELEASE, REQUEST = 400, 208, 512


def test_several_parachutes_at_once():
    bench = Bench().hear(CHUTE, heartbeat(), status(armed=4))
    bench.hear(SECOND, heartbeat(), status(armed=0)).at(0.1)
    bench.link.deploy(1, False, bench.now, "1/162")
    bench.collect()
    (order,) = bench.commands()
    assert (order.target_system, order.target_component) == SECOND
    # The first one's answer and status do not end the second one's request.
    bench.at(0.2).hear(CHUTE, ack(RELEASE), status(boot_ms=5200, deployed=4))
    assert bench.ends(1) == []
    bench.at(0.3).hear(SECOND, ack(RELEASE), status(boot_ms=5300, deployed=4))
    assert bench.end(1).finished.success


def test_without_a_name_the_first_parachute_that_is_not_lost_is_meant():
    bench = Bench().hear(CHUTE, heartbeat()).hear(SECOND, heartbeat())
    assert bench.link.chosen_parachute(bench.now).device == "1/161"
    bench.stream(6.0, 1.0, SECOND, heartbeat)
    assert bench.link.chosen_parachute(bench.now).device == "1/162"
    bench.at(12.0)
    assert bench.link.chosen_parachute(bench.now).device == "1/161"  # both are lost


def of_two(**first):
    """Two on one link, the first one heard like this, the other whole."""
    return Bench().hear(CHUTE, heartbeat(), status(**first)).hear(SECOND, heartbeat(), status())


def told_to(bench):
    """Who was told to release, in order, each once."""
    ids = [(one.target_system, one.target_component) for one in bench.commands(RELEASE)]
    return list(dict.fromkeys(ids))


def test_a_release_goes_to_a_parachute_that_is_whole_before_one_that_is_not():
    bench = of_two(errors=d.PARACHUTE_ERROR_FLAGS_GLOW_WIRE_ERROR)
    assert bench.link.chosen_parachute(bench.now).device == "1/162"
    assert told_to(bench.call("deploy", 1, False)) == [SECOND]


def test_where_one_refuses_the_next_one_is_released_at_once():
    bench = of_two().call("deploy", 1, False).at(0.1)
    bench.hear(CHUTE, ack(RELEASE, d.MAV_RESULT_FAILED))
    assert told_to(bench) == [CHUTE, SECOND]
    bench.at(0.3).hear(SECOND, ack(RELEASE), status(boot_ms=5300, deployed=4))
    assert bench.end(1).finished.success


@pytest.mark.parametrize("acknowledged", [True, False])
def test_where_one_does_not_open_the_next_one_is_released(acknowledged):
    bench = of_two().call("deploy", 1, False).at(0.1)
    if acknowledged:
        bench.hear(CHUTE, ack(RELEASE))
    assert told_to(bench.at(0.9)) == [CHUTE]
    assert told_to(bench.at(1.8)) == [CHUTE, SECOND]
    bench.at(2.0).hear(SECOND, ack(RELEASE), status(boot_ms=7000, deployed=4))
    assert bench.end(1).finished.success


@pytest.mark.parametrize(
    ("first", "why"),
    [
        ({"deployed": 4}, "1/161 is released"),
        ({"errors": d.PARACHUTE_ERROR_FLAGS_GLOW_WIRE_ERROR}, "1/161 GLOW_WIRE_ERROR"),
        (None, "1/161 PARACHUTE_STATUS 12.0 s old"),
    ],
    ids=str,
)
def test_what_is_wrong_with_the_other_of_two_forbids_take_off_and_nothing_in_flight(first, why):
    """READY, and "device healthy", as long as one of them was."""
    bench, runtime = of_two(**(first or {})), MavlinkRuntime("x", MavlinkSettings(), Any)
    bench.hear(PILOT, copter())
    for _ in range(12 if first is None else 0):
        bench.at(bench.t + 1.0).hear(SECOND, heartbeat(), status()).hear(PILOT, copter())
    assert bench.link.chosen_parachute(bench.now).device == "1/162"
    summary = runtime.summarise(bench.link, bench.now)
    assert any(one.startswith(why) for one in summary.reasons), summary.reasons
    assert "parachute_component_id chooses one of several" in summary.reasons
    # The supervisor finds each again among those that its status told, and tells it once.
    faults = {
        f"1/161 {fault}" for fault in bench.link.parachutes.named("1/161").status(bench.now).faults
    }
    assert faults <= {*summary.reasons}
    assert (summary.link_state, summary.device_healthy) == (LinkState.OK, False)
    bench.hear(PILOT, copter(True), landed(d.MAV_LANDED_STATE_IN_AIR))
    assert runtime.summarise(bench.link, bench.now).device_healthy


def test_a_parachute_that_is_named_is_the_only_one():
    bench = of_two().hear(CHUTE, status())
    bench.link.deploy(1, False, bench.now, "1/161")
    bench.collect().at(0.1).hear(CHUTE, ack(RELEASE, d.MAV_RESULT_FAILED)).at(10.0)
    assert told_to(bench) == [CHUTE]


def test_a_release_goes_to_whom_says_what_only_a_parachute_does():
    """Given that our process was started anew, and that its heartbeats are damaged: a deploy that
    waits need not wait for them, and its own status ends it."""
    bench = Bench().hear(PILOT, copter()).hear(CHUTE, status())
    assert bench.link.has_parachute()
    assert bench.link.chosen_parachute(bench.now) is None, "its link is its heartbeats"
    bench.call("deploy", 1, False)
    (order,) = bench.commands(RELEASE)
    assert (order.target_system, order.target_component) == CHUTE
    bench.at(0.1).hear(CHUTE, ack(RELEASE), status(boot_ms=5100, deployed=4))
    assert bench.end(1).finished.success
    assert not [e for e in bench.events if isinstance(e, ParachuteChanged)]
    bench.at(0.2).hear(CHUTE, heartbeat())
    assert bench.last_status().deployed, "what it said before its heartbeat is not forgotten"


def released(bench, device=None):
    """To whom a release was sent."""
    bench.link.deploy(1, False, bench.now, *([device] if device else []))
    bench.collect()
    return [(one.target_system, one.target_component) for one in bench.commands(RELEASE)]


def test_also_the_one_that_is_named():
    for device, ids in (("1/161", CHUTE), ("1/162", SECOND), ("1/163", None), ("2/161", None)):
        bench = Bench().hear(CHUTE, status()).hear(SECOND, status())
        assert released(bench, device) == ([ids] if ids else [])
        unknown = f"no parachute '{device}' was received"
        assert ids or unknown in bench.end(1).finished.message


def test_but_not_in_doubt():
    for ids, message in (
        # By its heartbeat a gimbal; another vehicle's as well; another is known by its heartbeat.
        (CHUTE, heartbeat(d.MAV_TYPE_GIMBAL)),
        ((2, 161), status()),
        ((1, 200), heartbeat()),
    ):
        for bench in (
            Bench().hear(ids, message).hear(CHUTE, status()),
            Bench().hear(CHUTE, status()).hear(ids, message),
        ):
            assert {*released(bench)} <= {(1, 200)}, ids


def test_nor_another_than_the_parameters_name():
    # Everybody, another system, another component.
    for ids in ((0, 161), (2, 161), (1, 162)):
        bench = Bench(parachute_system_id=1, parachute_component_id=161).hear(ids, status())
        assert not bench.link.has_parachute(), ids


def test_made_up_devices_do_not_grow_what_waits_for_a_heartbeat():
    bench = Bench()
    for component in range(1, 100):
        bench.hear((1, component), status())
        bench.hear((1, 100 + component), heartbeat(d.MAV_TYPE_GIMBAL))
    assert len(bench.link._devices._unproven) == len(bench.link._devices._others) == 16


def test_an_order_need_not_wait_once_its_device_was_heard():
    bench = Bench()
    assert not bench.link.has_parachute()
    bench.hear(PILOT, copter())
    assert not bench.link.has_parachute(), "an autopilot is none"
    bench.hear(CHUTE, heartbeat()).at(60.0)
    assert bench.link.has_parachute(), "one that is lost is told all the same"
    assert bench.link.has_autopilot(), "so is such an autopilot"
    assert not Bench().hear(CHUTE, heartbeat()).link.has_autopilot(), "a parachute is none"


def test_a_heartbeat_needs_a_time_between_two():
    for interval in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ParameterError) as raised:
            MavlinkConfig(heartbeat_interval=interval)
        assert str(raised.value) == f"heartbeat_interval is {interval}: need a time above 0 s"


def test_without_its_dialect_it_says_what_to_build(monkeypatch):
    monkeypatch.setitem(sys.modules, "chute_msgs.mavlink", None)
    spec = importlib.util.spec_from_file_location("not_built", dialect_module.__file__)
    with pytest.raises(NotBuiltError, match=r"colcon build .* then source install"):
        spec.loader.exec_module(importlib.util.module_from_spec(spec))


def test_other_vehicles_and_ground_stations_do_not_confuse_it():
    bench = Bench(parachute_system_id=1, autopilot_system_id=1)
    bench.hear((2, 161), heartbeat(), status(deployed=1)).hear((2, 1), copter(armed=True))
    bench.hear(GROUND, GCS).hear((1, 154), heartbeat(d.MAV_TYPE_GIMBAL)).hear((0, 1), copter())
    assert bench.link.chosen_parachute(bench.now) is None
    assert bench.link.vehicle_state(bench.now).armed is Armed.UNKNOWN
    bench.hear(CHUTE, heartbeat(), status()).hear(PILOT, copter())
    bench.hear((2, 161), heartbeat(), status(deployed=1)).hear((2, 1), copter(armed=True))
    assert bench.link.chosen_parachute(bench.now).device == "1/161"
    assert bench.last_status().state is ParachuteState.READY
    assert bench.link.vehicle_state(bench.now).source == "1/1"
    assert bench.link.vehicle_state(bench.now).armed is Armed.DISARMED
    assert bench.link.doubts(bench.now) == []
    assert bench.commands() == []
    assert {m.target_system for m in bench.reads()} == {1}, "our autopilot's settings"


def test_our_own_frames_that_come_back_are_counted_and_nothing_else():
    bench = Bench().hear((1, 191), heartbeat(), copter())
    assert bench.link.parachutes.all() == []
    assert bench.link.counts["frames with our own system and component id"] == 2


def test_parachute_and_autopilot_of_different_systems_are_doubtful_unless_named():
    both = {"parachute_system_id": 1, "autopilot_system_id": 2}
    for config, doubts in (
        *(({}, 1), ({"parachute_system_id": 1}, 1), ({"autopilot_system_id": 2}, 1)),
        (both, 0),
    ):
        bench = Bench(**config).hear(CHUTE, heartbeat()).hear((2, 1), copter())
        assert len(bench.link.doubts(bench.now)) == doubts, config
    bench = Bench().hear(CHUTE, heartbeat()).hear(PILOT, copter())
    assert bench.link.doubts(bench.now) == []
    bench.hear((3, 161), heartbeat()).hear((3, 1), copter())
    assert bench.link.doubts(bench.now) == [
        "parachutes of systems 1, 3 received, using 1: set parachute_system_id",
        "autopilots of systems 1, 3 received, using 1: set autopilot_system_id",
    ]


def test_vehicle_is_the_chosen_autopilots_alone():
    bench = Bench(autopilot_component_id=0).hear(PILOT, copter(True)).hear((1, 2), copter(False))
    assert bench.events[-1].state.source == "1/1"
    assert bench.events[-1].state.armed is Armed.ARMED


@pytest.mark.parametrize("frames", [51, 64, 85, 128, 256])
@pytest.mark.parametrize("lost", [0.0, 0.3])
def test_a_heartbeat_with_the_number_of_an_earlier_one_is_no_copy_of_it(frames, lost):
    """Given so many frames from one heartbeat, each second, to the next: numbers have 8 bits, so
    that heartbeats within five seconds are the same to the last bit."""
    bench, chance = Bench(), random.Random(frames)
    bench.hear(PILOT, copter())
    for second in range(1, 14):
        told = [copter(), *[d.MAVLink_system_time_message(0, second * 1000)] * (frames - 1)]
        raw = [bench.encoder(PILOT).encode(one, bench.now) for one in told]
        bench.at(float(second))
        for number, one in enumerate(raw):
            if number == 0 or chance.random() >= lost:
                bench.link.receive(one, bench.now)
        state = bench.link.vehicle_state(bench.now)
        assert state.armed_age < 0.1, f"{second} s"


def test_a_copy_of_a_heartbeat_tells_nothing_new_and_is_counted():
    """Given two routes to one autopilot, of which one takes two seconds."""
    bench, late = Bench(), []
    for second in range(6):
        late.append(bench.encoder(PILOT).encode(copter(armed=second < 3), bench.now))
        bench.at(float(second)).link.receive(late[-1], bench.now)
        bench.at(second + 0.5)
        if second >= 2:
            bench.link.receive(late[second - 2], bench.now)
        state = bench.link.vehicle_state(bench.now)
        assert state.armed is (Armed.ARMED if second < 3 else Armed.DISARMED)
        assert state.armed_age == pytest.approx(0.5)
    assert bench.link.counts["duplicate heartbeats"] == 4


def test_link_comes_up_falls_silent_and_comes_back_and_restarts_are_told():
    # Link comes up falls silent and comes back.
    bench = Bench().hear(CHUTE, heartbeat()).at(6.0).hear(CHUTE, heartbeat())
    changes = [e for e in bench.events if isinstance(e, DeviceLinkChanged)]
    assert {e.name for e in changes} == {"parachute 1/161"}
    states = [e.change.after for e in changes]
    assert states == [LinkState.OK, LinkState.STALE, LinkState.LOST, LinkState.OK]
    assert changes[-1].change.regained
    # Restarts are told.
    bench = Bench().hear(CHUTE, heartbeat(), *[status(boot_ms=t) for t in (9000, 100, 200)])
    times = [d.MAVLink_system_time_message(0, t) for t in (9000, 100, 200)]
    bench.hear(PILOT, copter(armed=True), *times)
    assert bench.notices() == ["parachute 1/161 restarted", "autopilot 1/1 restarted in flight"]


def test_both_versions_are_understood_from_a_stream_cut_anywhere():
    bench = Bench()
    raw = b"noise" + FrameEncoder(*CHUTE).encode(heartbeat(), 0.0)
    raw += FrameEncoder(*CHUTE).encode(status(), 0.0)
    for position in range(len(raw)):
        bench.link.receive(raw[position : position + 1], START, stream="serial")
    bench.collect()
    assert bench.last_status().state is ParachuteState.READY
    bench.link.receive(raw[5:9], START, stream="serial")
    bench.link.stream_ended("serial")
    bench.link.receive(raw[5:], START, stream="serial")
    bench.link.stream_ended(None)
    assert bench.link.received_count == 4


def test_own_heartbeat_only_while_the_owner_is_alive():
    bench = Bench().at(1.0)
    assert bench.sent == []
    bench.link.owner_alive(START + 3.5)
    bench.at(10.0)
    assert [t for t, _ in bench.sent] == [pytest.approx(t) for t in (1.0, 2.0, 3.0)]
    beat = bench.sent[0][1]
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 191)
    assert beat.type == d.MAV_TYPE_ONBOARD_CONTROLLER
    assert beat.autopilot == d.MAV_AUTOPILOT_INVALID
    bench.link.owner_alive(START + 11.5)
    bench.at(20.0)
    assert [t for t, _ in bench.sent[3:]] == [pytest.approx(t) for t in (10.0, 11.0)]
    assert bench.link.sent_count == 5


def test_owner_that_died_between_two_heartbeats_leaves_nothing_to_wake_for():
    bench = Bench()
    bench.link.owner_alive(START + 1.5)
    bench.link.update(START)
    bench.link.update(START + 1.6)  # late: the heartbeat of 1.0 is not due any more
    assert bench.link.next_deadline() == math.inf


def grounded(armed=True, **config):
    return Bench(**config).hear(PILOT, copter(armed), landed())


def test_block_undoes_arming_on_the_ground():
    bench = grounded(armed=False).call("flight_block", "parachute lost")
    assert bench.commands() == []
    bench.at(0.5).hear(PILOT, landed(), copter(armed=True))
    (order,) = bench.commands(DISARM)
    assert (order.command, order.param1, order.param2) == (DISARM, 0, 0)
    assert bench.texts() == [
        "parachute lost: flight blocked",
        "parachute lost: flight blocked, disarming",
    ]
    assert bench.notices() == [
        "autopilot armed while flight is blocked (parachute lost): disarming"
    ]
    bench.at(0.6).hear(PILOT, ack(DISARM), copter(armed=False)).at(20.0)
    assert len(bench.commands(DISARM)) == 1


def armed_copter():
    return copter(armed=True)


def test_block_that_comes_after_arming_undoes_it_at_once_unless_a_parameter_forbids_it():
    assert len(grounded().call("flight_block", "x").commands(DISARM)) == 1
    bench = grounded(disarm_when_blocked=False).call("flight_block", "x")
    bench.at(1.0).hear(PILOT, armed_copter())
    assert bench.commands() == []
    assert bench.texts() == ["x: flight blocked"]


def test_block_never_disarms_off_the_ground_or_where_that_is_not_known():
    for where in (0, 2, 3, 4):
        bench = Bench().hear(PILOT, armed_copter(), landed(where)).call("flight_block", "x")
        assert bench.stream(10.0, 0.5, PILOT, armed_copter).commands(DISARM) == [], where
    # Nor is an old word of standing on the ground believed.
    bench = grounded(armed=False).stream(3.0, 0.5, PILOT, copter).call("flight_block", "x")
    assert bench.stream(6.0, 0.5, PILOT, armed_copter).commands(DISARM) == []


def test_disarm_that_lost_its_reason_is_not_sent_again():
    for end in ("released", "took off"):
        bench = grounded().call("flight_block", "x")
        bench.at(0.1).hear(PILOT, ack(DISARM, d.MAV_RESULT_TEMPORARILY_REJECTED))
        if end == "released":
            bench.call("flight_block", "")
        else:
            bench.hear(PILOT, landed(2))
        bench.stream(8.0, 0.1, PILOT, armed_copter)
        assert len(bench.commands(DISARM)) == 1, end
        assert not bench.end(-1).finished.success


def test_autopilot_that_refuses_for_ever_makes_no_storm():
    bench = grounded().call("flight_block", "x")
    for tenth in range(1, 101):
        bench.at(tenth / 10).hear(PILOT, landed(), copter(armed=True))
        bench.hear(PILOT, ack(DISARM, d.MAV_RESULT_DENIED)).call("flight_block", "x")
    assert 3 <= len(bench.commands(DISARM)) <= 10.0 / DISARM_INTERVAL + 1
    assert len(bench.notices()) == 1
    assert len(bench.texts()) == 2
    # Disarmed and armed once more: that is news.
    bench.at(10.1).hear(PILOT, copter(armed=False), landed(), copter(armed=True))
    assert len(bench.notices()) == 2


KEY, OTHER = bytes(range(32)), bytes(32)


def clock():
    return SigningClock(1_750_000_000.0 - START)


def test_signed_end_to_end():
    """Two ends with one key understand each other; nobody else has a say."""
    shared = clock()
    bench = Bench(Signer(KEY, shared), Verifier(KEY, shared))
    chute = FrameEncoder(*CHUTE, Signer(KEY, clock()))
    liar = FrameEncoder(*CHUTE, Signer(OTHER, SigningClock(4_000_000_000.0)))
    first = chute.encode(heartbeat(), START)
    bench.link.receive(liar.encode(heartbeat(), START), START)
    bench.link.receive(FrameEncoder(*CHUTE).encode(heartbeat(), START), START)
    assert bench.link.chosen_parachute(bench.now) is None
    bench.link.receive(first, START)
    bench.link.receive(first, START)
    bench.link.receive(chute.encode(status(), START + 0.1), START + 0.1)
    bench.collect()
    assert bench.last_status().healthy
    reasons = (WRONG_SIGNATURE, UNSIGNED, REPLAYED)
    assert [bench.link.counts[reason] for reason in reasons] == [1, 1, 1]
    assert len([e for e in bench.events if isinstance(e, ParachuteChanged)]) == 2

    bench.link.deploy(1, False, bench.now)
    raw, *_ = bench.link.take_output()
    far = Bench(None, Verifier(KEY, clock()))
    far.link.receive(raw, START)
    assert far.link.received_count == 1


def asked_for_status(bench):
    """When a PARACHUTE_STATUS was asked for."""
    return [
        t
        for t, message in bench.sent
        if message.get_type() == "COMMAND_LONG"
        and (message.command, message.param1) == (d.MAV_CMD_REQUEST_MESSAGE, 430.0)
    ]


def test_a_module_that_sends_no_status_is_asked_for_it():
    """Given one without a stream, or whose stream a ground station has switched off."""
    bench = Bench().hear(CHUTE, heartbeat()).stream(1.5, 0.5, CHUTE, heartbeat)
    bench.hear(CHUTE, ack(REQUEST)).stream(4.0, 0.5, CHUTE, heartbeat)
    assert asked_for_status(bench) == pytest.approx([1.5, 3.0])
    request = bench.commands(d.MAV_CMD_REQUEST_MESSAGE)[0]
    assert (request.target_system, request.target_component) == CHUTE
    bench.hear(CHUTE, status()).stream(5.0, 0.5, CHUTE, heartbeat)
    assert len(asked_for_status(bench)) == 2
    bench.stream(6.0, 0.5, CHUTE, heartbeat)
    assert asked_for_status(bench)[2:] == pytest.approx([5.5])


def test_one_that_streams_is_asked_now_and_then_to_know_that_it_hears_us():
    bench = Bench().hear(CHUTE, heartbeat(), status(boot_ms=1000))
    for second in range(1, 40):
        bench.at(second).hear(CHUTE, heartbeat(), status(boot_ms=1000 + 1000 * second))
        if second in asked_for_status(bench):
            bench.hear(CHUTE, ack(REQUEST, d.MAV_RESULT_UNSUPPORTED))
    assert asked_for_status(bench) == [2, 12, 22, 32]
    # In flight, and as long as it is not heard, it is not.
    bench.hear(PILOT, copter(armed=True))
    for second in range(40, 60):
        bench.at(second).hear(PILOT, copter(armed=True))
        bench.hear(CHUTE, heartbeat(), status(boot_ms=1000 + 1000 * second))
    assert len(asked_for_status(bench)) == 4
    bench = Bench().hear(CHUTE, heartbeat(), status()).at(1.0).hear(CHUTE, status(boot_ms=6000))
    assert len(asked_for_status(bench.at(60.0))) <= 3


def test_the_first_status_after_a_restart_is_followed_by_a_question():
    # It may be one from before that was delayed; the next one tells, and may say "deployed".
    bench = Bench().hear(CHUTE, heartbeat(), status(boot_ms=500_000))
    bench.at(0.5).hear(CHUTE, status(boot_ms=100, deployed=2))
    assert asked_for_status(bench) == [0.5]
    assert not bench.last_status().deployed
    bench.at(0.52).hear(CHUTE, status(boot_ms=120, deployed=2))
    assert bench.last_status().deployed
    # A flood of doubtful statuses is not answered one by one.
    bench = Bench().hear(CHUTE, heartbeat(), status(boot_ms=500_000))
    for step in range(1, 100):
        bench.at(0.5 + step * 0.01).hear(CHUTE, status(boot_ms=1000 - 10 * step))
    assert len(asked_for_status(bench)) <= 11


# -- a line that is dead in one direction ---------------------------------------------------------


class Line:
    """A parachute and an autopilot as simulated, on a line that drops these parts of what is sent
    to each, and of what it sends."""

    def __init__(self, kind, loss=0.0):
        self.t = START
        self.runtime = MavlinkRuntime("mavlink_parachute", MavlinkSettings(), Any)
        self.link = MavlinkLink(self.runtime.settings.link)
        self.parachute = ParachuteDevice(ParachuteSettings(), [])
        self.autopilot = AutopilotDevice(1, [], kind=kind)
        self.to = {self.parachute: loss, self.autopilot: loss}
        self.back, self.chance = loss, random.Random(1)

    def passes(self, loss):
        return self.chance.random() >= loss

    def run(self, seconds):
        """The reasons against flight that it gave meanwhile for not being heard."""
        told = set()
        for step in range(round(seconds / 0.04)):
            self.t += 0.04
            for device in self.to:
                device.update(self.t)
                for frame in device.take_output():
                    if self.passes(self.back):
                        self.link.receive(frame, self.t)
            self.link.update(self.t)
            for frame in self.link.take_output():
                for device, loss in self.to.items():
                    if self.passes(loss):
                        device.receive(frame, self.t)
            self.link.take_events()
            if step % 10 == 9:
                told |= set(self.reasons())
        return told

    def reasons(self):
        summary = self.runtime.summarise(self.link, self.t)
        reasons = (*summary.reasons, *self.link.vehicle_state(self.t).faults)
        return [one for one in reasons if "receives nothing from us" in one]


@pytest.mark.parametrize("kind", [PX4, ARDUCOPTER])
def test_an_autopilot_that_hears_nothing_of_ours_forbids_take_off(kind):
    line = Line(kind)
    line.to[line.autopilot] = 1.0
    assert line.run(9.0) == set()
    line.run(3.0)
    (reason,) = line.reasons()
    assert reason.startswith(
        "autopilot 1/1 receives nothing from us: no answer to any command, TIMESYNC"
    )
    assert "check our TX line" in reason
    # The first answer ends it; a line that dies later is found as well.
    line.to[line.autopilot] = 0.0
    line.run(1.5)
    assert line.run(30.0) == set()
    line.to[line.autopilot] = 1.0
    assert line.run(19.0) == set()
    assert line.run(3.0)


def test_an_unknown_autopilot_is_not_taken_to_answer():
    line = Line(GENERIC)
    line.to[line.autopilot] = 1.0
    assert line.run(60.0) == set()


def test_a_parachute_that_hears_nothing_of_ours_forbids_take_off_and_nothing_in_flight():
    line = Line(PX4)
    line.to[line.parachute] = 1.0
    assert line.run(10.0) == set()
    line.run(3.5)
    (reason,) = line.reasons()
    assert reason.startswith(
        "parachute 1/161 receives nothing from us: no answer to any command for "
    )
    assert not line.runtime.summarise(line.link, line.t).device_healthy
    line.autopilot.model.armed = True
    line.run(1.5)
    assert line.run(30.0) == set()
    line.autopilot.model.armed = False
    line.run(1.5)
    assert line.reasons()
    line.to[line.parachute] = 0.0
    line.run(1.0)
    assert line.run(30.0) == set()


@pytest.mark.parametrize("kind", [PX4, ARDUCOPTER])
def test_a_line_that_loses_three_frames_of_ten_in_each_direction_is_no_dead_one(kind):
    assert Line(kind, loss=0.3).run(120.0) == set()


def test_a_parachute_that_restarts_or_comes_back_has_to_answer_again():
    line = Line(PX4)
    line.run(30.0)
    line.to[line.parachute] = 1.0
    line.parachute.silent = True
    line.run(8.0)
    line.parachute.reboot()
    assert line.run(9.5) == set()
    assert line.run(3.0)
