"""Who has no key changes nothing on a signed MAVLink network, however well it imitates others."""

from __future__ import annotations

import itertools
import socket
import time

import pytest
from chute_msgs.msg import (
    ActionReport,
    ParachuteStatus,
    SafetyDecision,
    VehicleState,
)
from chute_msgs.srv import (
    Arm,
    Deploy,
    GetInfo,
    ParachuteAction,
    RequestMessage,
    SetMessageInterval,
    SetTriggers,
)
from diagnostic_msgs.msg import DiagnosticStatus
from mavlink_attack import (
    AUTOPILOT,
    CHUTE,
    KEY,
    Attacked,
    clock,
    deployed,
    disarmed,
    forgers,
    healthy,
    overheard,
)
from mavlink_bench import Autopilot, Module, do
from node_bench import LOCAL, stamped

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.model import Action, LinkState, Outcome
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.protocol.mavlink.signing import (
    REPLAYED,
    UNSIGNED,
    WRONG_SIGNATURE,
    Verifier,
)
from chute_ros.ros import qos
from chute_ros.tools.isolation import free_udp_ports

RELEASE = float(dialect.PARACHUTE_RELEASE)


@pytest.fixture
def attacked(bench):
    return Attacked(bench)


@pytest.fixture
def decide(bench):
    """A function that decides as the supervisor does; its number."""
    numbers = itertools.count(1)

    def decided(action):
        number = next(numbers)
        message = SafetyDecision(
            action=int(action), epoch=1, id=number, targets=["mavlink_parachute"], reasons=["test"]
        )
        bench.publish(stamped(bench.client, message), "safety/decision", qos.DECISION)
        return number

    return decided


def read(datagrams, verifier=None):
    decoder = FrameDecoder(verifier)
    now = time.monotonic()
    frames = [frame for data in datagrams for frame in decoder.feed_datagram(data, now)]
    return frames, decoder.counts


# What we send


def test_every_frame_that_leaves_is_signed_whatever_it_orders(attacked, bench, decide):
    reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
    healthy(attacked)
    calls = [
        (SetTriggers, "set_triggers", {"arm": 4, "select": 4}),
        (RequestMessage, "request_message", {"message_id": 430}),
        (SetMessageInterval, "set_message_interval", {"message_id": 430, "interval_us": 50_000}),
        (GetInfo, "get_info", {}),
        (ParachuteAction, "parachute_action", {"action": dialect.PARACHUTE_ENABLE}),
        (Arm, "arm", {"arm": True}),
        (Deploy, "deploy", {"reason": "a test"}),
        (Deploy, "deploy", {"reason": "a test", "force": True}),
        (ParachuteAction, "parachute_action", {"action": dialect.PARACHUTE_RELEASE}),
    ]
    for kind, name, fields in calls:
        bench.call(kind, f"mavlink_parachute/{name}", **fields)
    do(bench, attacked.autopilots_loop, lambda: attacked.autopilot.act("arm"))
    for action in (Action.FLIGHT_BLOCK, Action.FLIGHT_BLOCK_RELEASE, Action.KILL, Action.DEPLOY):
        number = decide(action)
        bench.until(
            lambda number=number: [
                one for one in reports if (one.id, one.outcome) == (number, Outcome.CONFIRMED)
            ],
            f"{action.name} is carried out",
        )
        # The block is confirmed at once; the arming it undoes is heard of a beat later.
        bench.until(lambda: not attacked.autopilot.model.armed, "arming on the ground is undone")
    every = attacked.attacker.heard
    frames, counts = read(every, Verifier(KEY, clock()))
    assert len(frames) == len(every)
    assert not any(counts.values())
    assert all(frame.signed for frame in frames)
    orders = {one.message.command for one in frames if one.message.get_type() == "COMMAND_LONG"}
    assert orders >= {
        dialect.MAV_CMD_DO_PARACHUTE,
        dialect.MAV_CMD_SET_PARACHUTE_ARM,
        dialect.MAV_CMD_COMPONENT_ARM_DISARM,
        dialect.MAV_CMD_REQUEST_MESSAGE,
        dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
    }
    assert {"HEARTBEAT", "STATUSTEXT"} <= {one.message.get_type() for one in frames}


def recorded_deploy(attacked):
    """The true deploy, as the attacker heard it."""
    healthy(attacked)
    assert attacked.bench.call(Arm, "mavlink_parachute/arm", arm=True).success
    assert attacked.bench.call(Deploy, "mavlink_parachute/deploy", reason="a test").success

    def releases():
        return [
            data
            for data in attacked.attacker.heard
            for frame in read([data])[0]
            if getattr(frame.message, "command", 0) == dialect.MAV_CMD_DO_PARACHUTE
            and frame.message.param1 == RELEASE
        ]

    return attacked.bench.until(releases, "it was overheard")


def test_a_recorded_deploy_that_is_sent_again_fires_nothing(attacked, bench):
    recorded = recorded_deploy(attacked)
    fired = len(attacked.module.releases)
    dropped = attacked.modules_counts()

    def replay():
        for data in recorded * 3:
            attacked.module.receive(data, time.monotonic())

    do(bench, attacked.modules_loop, replay)
    assert len(attacked.module.releases) == fired
    assert dropped[REPLAYED] == 3 * len(recorded)


def test_a_forged_deploy_does_not_fire_a_module_with_a_key(attacked, bench):
    healthy(attacked)
    dropped = attacked.modules_counts()
    order = dialect.MAVLink_command_long_message(*CHUTE, 208, 0, RELEASE, *[0.0] * 6)
    for reason, signer in forgers().items():
        forged = FrameEncoder(1, 191, signer).encode(order, time.monotonic())
        do(
            bench,
            attacked.modules_loop,
            lambda forged=forged: attacked.module.receive(forged, time.monotonic()),
        )
        assert dropped[reason] == 1
    assert attacked.module.releases == []
    assert not attacked.module.deployment


# What we hear


def test_a_forged_status_deploys_nothing_and_is_counted_by_its_reason(attacked, bench):
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    healthy(attacked)
    for reason, signer in forgers().items():
        attacked.send(*deployed(CHUTE, signer))
        assert attacked.counts()[reason] == 2
    assert attacked.counts()[REPLAYED] == 0
    bench.turns(0.3)
    assert not any(one.deployed for one in statuses)

    def told():
        link = attacked.task("link")
        said = {pair.key: pair.value for pair in link.values} if link else {}
        return link if said.get(f"dropped: {WRONG_SIGNATURE}") == "2" else None

    link = bench.until(told, "diagnostics count them")
    assert f"dropped: {UNSIGNED}" in {pair.key for pair in link.values}
    assert link.level == DiagnosticStatus.OK, "noise on the wire is no fault of the link"


def test_a_forged_heartbeat_keeps_no_dead_parachute_alive(attacked, bench):
    beats = healthy(attacked)
    bench.unplug(attacked.modules_loop)
    encoders = forgers()

    def lost():
        for signer in encoders.values():
            attacked.attackers_loop.call(
                lambda link, now, signer=signer: link.say(*deployed(CHUTE, signer))
            )
        return beats[-1].link_state == LinkState.LOST

    bench.until(lost, "it is lost although a stranger speaks in its name")


def test_a_forged_autopilot_confirms_no_kill(attacked, bench, decide):
    reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
    vehicle = bench.follow(VehicleState, "vehicle/state")
    healthy(attacked)

    def take_off():
        attacked.autopilot.model.height = attacked.autopilot.model.target_height = 80.0
        attacked.autopilot.model.armed = True
        attacked.autopilot.act("mute")

    do(bench, attacked.autopilots_loop, take_off)
    bench.until(lambda: vehicle and vehicle[-1].armed == VehicleState.ARMED, "it flies")
    number = decide(Action.KILL)
    for _ in range(3):
        for signer in forgers().values():
            attacked.send(*disarmed(AUTOPILOT, signer))
    failed = bench.until(
        lambda: [one for one in reports if (one.id, one.outcome) == (number, Outcome.FAILED)],
        "nobody has confirmed it",
    )
    assert "given up" in failed[0].detail
    assert Outcome.ACCEPTED not in [one.outcome for one in reports]
    assert vehicle[-1].armed == VehicleState.ARMED


def test_what_was_recorded_is_heard_once(attacked, bench):
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    healthy(attacked)
    recorded = overheard()
    attacked.send(*recorded)
    bench.until(lambda: any(one.deployed for one in statuses), "it is the module's own word")
    bench.until(lambda: not statuses[-1].deployed, "the next one says otherwise")
    attacked.send(*recorded)
    assert attacked.counts()[REPLAYED] == 2
    bench.turns(0.2)
    assert not statuses[-1].deployed


# Without a key, and beside the signatures


def test_without_a_key_who_speaks_as_the_parachute_is_believed_and_diagnostics_say_so(bench):
    """What signing is for: the limit of an open wire, written down."""
    attacked = Attacked(bench, signing_key_file="")
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    attacked.send(*deployed(CHUTE))
    bench.until(lambda: statuses and statuses[-1].deployed, "the stranger is believed")
    task = bench.until(lambda: attacked.task("signing"), "diagnostics speak of it")
    assert task.message.startswith("off: anybody on this wire can imitate the parachute")


def test_a_flood_from_many_ports_does_not_keep_a_release_from_a_fixed_address(bench):
    here, there = free_udp_ports(2)
    node = bench.add(
        MavlinkParachuteNode,
        connection=f"udppair:{LOCAL}:{here}:{LOCAL}:{there}",
        give_up_after=10.0,
    )
    module = Module()
    bench.simulate(module, f"udppair:{LOCAL}:{there}:{LOCAL}:{here}")
    noise = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(20)]

    def flood():
        for one in noise:
            one.sendto(b"\xfd" * 100, (LOCAL, here))

    bench.until(lambda: flood() or node.loop.link.has_parachute(), "the module is heard")
    arm = bench.ask(Arm, "mavlink_parachute/arm", arm=True)
    bench.until(lambda: flood() or arm.done(), "it is armed")
    deploy = bench.ask(Deploy, "mavlink_parachute/deploy", reason="a test")
    bench.until(lambda: flood() or deploy.done(), "it is deployed")
    for one in noise:
        one.close()
    assert deploy.result().success, deploy.result().message
    assert module.deployment


def test_the_autopilot_of_another_without_the_key_is_nobody(attacked, bench):
    healthy(attacked)
    stranger = Autopilot(system_id=2)
    attacked.network.plug(stranger)
    bench.until(lambda: attacked.counts()[UNSIGNED] > 5, "it is there")
    assert attacked.link.doubts(time.monotonic()) == []
