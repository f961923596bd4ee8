"""Each kind of autopilot: kill, block, what is said of it; in virtual time, or on real UDP."""

import itertools
from dataclasses import replace
from typing import Any

import pytest
from chute_msgs.msg import ActionReport, LinkHeartbeat, SafetyDecision, VehicleState
from chute_msgs.srv import Deploy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mavlink_bench import Autopilot, Module, VirtualNetwork, airborne, do, quick
from node_bench import LOCAL, port_of, stamped

from chute_ros.links.mavlink.diagnostics import details_of, tasks
from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.links.mavlink.protocol.config import KillMethod
from chute_ros.links.mavlink.runtime import MavlinkRuntime, MavlinkSettings
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteSettings
from chute_ros.model import Action, LinkState, Outcome
from chute_ros.protocol.events import RequestFinished
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.ros import qos
from chute_ros.sim.autopilot_kinds import ARDUCOPTER, ARDUPLANE, GENERIC, PX4

TERMINATE = dialect.MAV_CMD_DO_FLIGHTTERMINATION
KINDS = pytest.mark.parametrize(
    "kind", [GENERIC, PX4, ARDUCOPTER, ARDUPLANE], ids=lambda kind: kind.name
)


def with_settings(kind, **values):
    return replace(kind, parameters={**kind.parameters, **values})


class Rig:
    """The node, an autopilot, and a parachute that hears both."""

    def __init__(self, bench, autopilot, triggers=12, **parameters):
        self.bench, self.autopilot = bench, autopilot
        self.vehicle = bench.follow(VehicleState, "vehicle/state")
        self.reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
        self.diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
        self.beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
        self.numbers = itertools.count(1)
        node = bench.add(MavlinkParachuteNode, **quick(**parameters))
        network = f"udpout:{LOCAL}:{port_of(node.loop)}"
        autopilot.loop = bench.simulate(autopilot, f"udpin:{LOCAL}:0", network)
        self.module = Module(ParachuteSettings(armed_triggers=triggers, ground_cleared="yes"))
        vehicle = f"udpout:{LOCAL}:{port_of(autopilot.loop)}"
        bench.simulate(self.module, network, vehicle)
        bench.until(lambda: self.beats and self.beats[-1].device_healthy, "the parachute is well")
        bench.until(lambda: self.vehicle, "the autopilot is received")

    def decide(self, action):
        message = SafetyDecision(
            action=int(action),
            rule="tipped over at take-off",
            reasons=["tilt 80 degrees"],
            epoch=1,
            id=next(self.numbers),
            targets=["mavlink_parachute"],
        )
        self.bench.publish(stamped(self.bench.client, message), "safety/decision", qos.DECISION)
        return message

    def report(self, decision, outcome):
        def found():
            return [r for r in self.reports if (r.id, r.outcome) == (decision.id, outcome)]

        return self.bench.until(found, f"{outcome.name} is reported")[0]

    def settings_read(self):
        names = set(self.autopilot.kind.parameters)
        self.bench.until(lambda: self.autopilot.asked_for >= names, "the settings are read")

    def task(self, name):
        told = [s for array in self.diagnostics for s in array.status if s.name.endswith(name)]
        return told[-1] if told else None


# Kill


@KINDS
@pytest.mark.parametrize("method", KillMethod)
def test_a_kill_at_1_3_m_stops_the_motors_and_releases_nothing(kind, method):
    autopilot = airborne(1.3, kind)
    module = Module(ParachuteSettings(armed_triggers=12, ground_cleared="yes"))
    network = VirtualNetwork(autopilot, module, kill_method=method).run(5.0)
    network.link.kill(1, network.now)
    network.run(2.0)
    (end,) = [one.finished for one in network.events if isinstance(one, RequestFinished)]
    assert end.success
    assert not autopilot.model.armed
    assert module.releases == []
    assert not module.deployment


def test_px4_that_is_terminated_releases_by_itself():
    """What the kill above must not do: a simulator that did not would prove nothing."""
    autopilot = airborne(1.3, PX4)
    autopilot._terminate((1.0, *[0.0] * 6))
    autopilot.step(autopilot.now + 0.02)
    (release,) = [raw for raw in autopilot.take_output() if len(raw) > 40]
    assert dialect.MAV_CMD_DO_PARACHUTE.to_bytes(2, "little") in release


def test_a_kill_that_an_aeroplane_refuses_is_followed_by_the_other_way(bench):
    autopilot = airborne(80.0, ARDUPLANE)
    rig = Rig(bench, autopilot, kill_method="flight_termination")
    rig.settings_read()
    decision = rig.decide(Action.KILL)
    report = rig.report(decision, Outcome.CONFIRMED)
    assert not autopilot.model.armed
    # On a busy machine it is sent again before the refusal is read.
    refused, (forced,) = autopilot.heard_command(TERMINATE), autopilot.forced
    assert refused[0][0] < forced[0]
    assert "kill (forced_disarm): the autopilot reports motors off" in report.detail
    assert "kill (flight_termination): failed" in report.detail


@pytest.mark.parametrize(("deploy", "terminated"), [(False, False), (True, True)])
def test_px4_is_terminated_only_once_a_deploy_is_decided(bench, deploy, terminated):
    autopilot = airborne(80.0, PX4)
    autopilot.commands[dialect.MAV_CMD_COMPONENT_ARM_DISARM] = lambda _: dialect.MAV_RESULT_DENIED
    rig = Rig(bench, autopilot, give_up_after=2.0)
    kill = rig.decide(Action.KILL)
    rig.report(kill, Outcome.REFUSED)
    if deploy:
        rig.report(rig.decide(Action.DEPLOY), Outcome.CONFIRMED)
    rig.report(kill, Outcome.CONFIRMED if terminated else Outcome.FAILED)
    assert bool(autopilot.heard_command(TERMINATE)) is terminated
    assert bool(rig.module.deployment) is deploy


def test_a_deploy_over_motors_that_turn_says_so_in_its_answer(bench):
    autopilot = airborne(80.0, ARDUCOPTER)
    Rig(bench, autopilot)
    answer = bench.call(Deploy, "mavlink_parachute/deploy", reason="a test")
    assert answer.success
    assert "WARNING: autopilot 1/1 reports armed: the motors may turn" in answer.message


# What is said before flight


@KINDS
def test_diagnostics_say_which_way_a_kill_goes(kind):
    network = VirtualNetwork(Autopilot(kind=kind)).run(10.0)
    _, level, message, values, _ = details_of(network.link, network.now).kill
    known = {name: f"{value:g}" for name, value in kind.parameters.items()}
    assert values.items() >= known.items()
    assert "forced disarm" in message
    assert ("only once a deploy is decided" in message) is (kind in (GENERIC, PX4))
    assert level != DiagnosticStatus.ERROR
    assert network.link.vehicle_state(network.now).faults == ()


def test_a_setting_that_makes_the_kill_impossible_forbids_take_off(bench):
    kind = with_settings(ARDUPLANE, ARMING_REQUIRE=0)
    rig = Rig(bench, Autopilot(kind=kind))
    rig.settings_read()
    # Until all are read, what is not known yet forbids a take-off, too.
    bench.until(
        lambda: all(
            name in "".join(rig.vehicle[-1].faults)
            for name in ("AFS_ENABLE is 0", "ARMING_REQUIRE is 0")
        ),
        "it is told",
    )
    bench.until(
        lambda: (task := rig.task("kill")) and task.level == DiagnosticStatus.ERROR, "as an error"
    )


@pytest.mark.parametrize(
    ("settings", "expect", "reason"),
    [
        (None, True, "no parachute was received: check its power"),
        (None, False, "no autopilot was received to send a kill to"),
        (ParachuteSettings(errors=8), True, "1/161 LOW_POWER"),
        (ParachuteSettings(system_status=1), True, "1/161 is NOT_READY"),
        (ParachuteSettings(deployment=2), True, "1/161 is released"),
    ],
    ids=["no parachute", "no autopilot", "a fault", "not ready", "released"],
)
def test_the_heartbeat_says_why_the_device_is_not_healthy(settings, expect, reason):
    devices = [] if settings is None else [Module(settings)]
    network = VirtualNetwork(*devices).run(3.0)
    runtime = MavlinkRuntime("mavlink_parachute", MavlinkSettings(expect_parachute=expect), Any)
    summary = runtime.summarise(network.link, network.now)
    assert any(text.startswith(reason) for text in summary.reasons), summary.reasons
    assert not summary.device_healthy


def test_a_parachute_of_heartbeats_alone_is_said_with_what_to_do(bench):
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    node = bench.add(MavlinkParachuteNode, **quick())
    module = Module()
    del module.default_intervals[dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS]
    del module.streams[dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS]
    bench.simulate(module, f"udpout:{LOCAL}:{port_of(node.loop)}")
    told = "1/161 sends heartbeats but no PARACHUTE_STATUS (430)"
    bench.until(lambda: beats and any(told in text for text in beats[-1].reasons), "it is said")
    assert "check its firmware" in beats[-1].reasons[0]


def test_where_no_parachute_is_expected_the_heartbeat_stands_for_the_autopilot():
    """Given a second autopilot after a while; then ours falls silent."""
    runtime = MavlinkRuntime("mavlink_parachute", MavlinkSettings(expect_parachute=False), Any)
    network = VirtualNetwork(autopilot := Autopilot())

    def told():
        summary = runtime.summarise(network.link, network.now)
        return summary.link_state, summary.device_healthy

    assert told() == (LinkState.NEVER_SEEN, False)
    network.run(2.0)
    assert told() == (LinkState.OK, True)
    details = details_of(network.link, network.now)
    for expected in (True, False):
        names = [one.name for one in tasks("node", details, expected)]
        assert ("node: parachute" in names) is expected, "the one that is missing"
    network.devices += (Autopilot(system_id=2),)
    network.run(2.0)
    assert told() == (LinkState.OK, False), "a second one makes it doubtful"
    autopilot.act("silent")
    network.run(6.0)
    assert told() == (LinkState.LOST, False)


# Flight block


@KINDS
def test_what_is_armed_and_taken_off_at_once_does_not_get_away(kind):
    autopilot, highest = Autopilot(kind=kind), 0.0
    network = VirtualNetwork(autopilot).run(5.0)
    network.link.flight_block("no parachute", network.now)
    network.run(0.5)
    autopilot.model.climb_speed = 1.5
    autopilot._set_armed(True)
    autopilot._takeoff((0.0,) * 6 + (30.0,))
    for _ in range(1000):
        network.run(0.01)
        highest = max(highest, autopilot.model.height)
    assert highest < 2.0
    assert not autopilot.model.armed
    assert autopilot.model.height == 0.0
    assert autopilot.heard_command(TERMINATE) == []


def order_to_arm(bench, autopilot):
    """By a ground station on the autopilot's own port."""
    params = (1.0, *[0.0] * 6)
    message = dialect.MAVLink_command_long_message(
        1, 1, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, *params
    )

    def order():
        autopilot.receive(FrameEncoder(255, 190).encode(message, 0.0), autopilot.now)

    do(bench, autopilot.loop, order)


def test_px4_that_asks_may_not_arm_while_flight_is_blocked(bench):
    asking = with_settings(PX4, COM_ARM_AUTH_REQ=1, COM_SPOOLUP_TIME=0.0)
    autopilot = Autopilot(kind=asking)
    # A system id of its own: PX4 takes any component's answer, also a parachute's UNSUPPORTED.
    rig = Rig(bench, autopilot, system_id=10)
    rig.report(rig.decide(Action.FLIGHT_BLOCK), Outcome.CONFIRMED)
    denied = []
    autopilot.say = denied.append
    order_to_arm(bench, autopilot)
    bench.until(lambda: "ARM AUTHORIZATION: denied" in denied, "it is denied")
    assert not autopilot.model.armed
    rig.report(rig.decide(Action.FLIGHT_BLOCK_RELEASE), Outcome.CONFIRMED)
    order_to_arm(bench, autopilot)
    bench.until(lambda: autopilot.model.armed, "it is allowed")
