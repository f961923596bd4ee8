"""The services of upf_can, over real CAN frames."""

import pytest
from chute_msgs.msg import ParachuteStatus, SafetyRequest
from chute_msgs.srv import (
    Arm,
    Deploy,
    GetNodeInfo,
    GetParam,
    ListParams,
    NodeRequest,
    SetParam,
    TransportStats,
    UpfCommand,
)
from upf_bench import PATIENT, Devices, Network

from chute_ros.links.upf.protocol import parameters as p
from chute_ros.model import ParachuteState

Command = UpfCommand.Request
READY, TAKEOFF, ARMED = ParachuteState.READY, ParachuteState.TAKEOFF, ParachuteState.ARMED
#: Nothing that the vehicle says grows old within a test.
LASTING = {"vehicle_state_age": 60.0}


@pytest.fixture
def network(bench):
    return Network(bench, **PATIENT, **LASTING)


@pytest.fixture
def devices(network):
    return Devices(network)


def call(bench, kind, service, /, **fields):
    return bench.call(kind, f"upf_can/{service}", **fields)


def command(bench, number, **fields):
    return call(bench, UpfCommand, "command", command=number, reason="a test", **fields)


# ~/command


def test_each_command_moves_the_controller_is_confirmed_by_its_status_and_logged(bench, devices):
    said = bench.follow_log()
    story = [
        (Command.TAKEOFF, TAKEOFF),
        (Command.ARM, ARMED),
        (Command.DISARM, TAKEOFF),
        (Command.LAND, READY),
    ]
    for number, state in story:
        answer = command(bench, number)
        assert answer.success, answer.message
        assert devices.controller.state is state
    assert devices.controller.came == ["TYPE_TAKEOFF", "TYPE_ARM", "TYPE_DISARM", "TYPE_LAND"]
    bench.until(
        lambda: any(one.msg == "~/command TYPE_TAKEOFF called: 'a test'" for one in said),
        "it is logged with its reason",
    )
    # On the ground only the forced deploy fires.
    answer = command(bench, Command.DEPLOY)
    assert not answer.success
    assert "its state is READY: force sends TYPE_DEPLOY_FORCE" in answer.message
    assert not devices.trigger.fired
    answer = command(bench, Command.DEPLOY_FORCE)
    assert answer.success, answer.message
    assert devices.trigger.fired
    assert devices.controller.came[-1] == "TYPE_DEPLOY_FORCE"


def test_a_command_that_is_none_or_to_what_is_no_controller_is_refused(bench, devices):
    for number in (0, 7, 255):
        answer = command(bench, number)
        assert not answer.success
        assert f"command {number}: need one of 1 TYPE_TAKEOFF, 2 TYPE_ARM" in answer.message
    # The trigger, nobody, no id.
    for node_id in (34, 99, 200):
        for number in (Command.TAKEOFF, Command.DEPLOY_FORCE):
            answer = command(bench, number, node_id=node_id)
            assert not answer.success, node_id
            said = f"no controller {node_id} was received on this link (received: 33"
            assert said in answer.message
            assert "triggers received: 34" in answer.message
    assert devices.controller.came == []
    assert not devices.trigger.fired


# ~/restart, ~/save_params, ~/erase_params


def test_a_restart_is_a_restart_and_blocks_flight_meanwhile(bench, network):
    devices = Devices(network, self_test=0.3)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    asked = bench.follow(SafetyRequest, "safety/request")
    bench.until(lambda: statuses and statuses[-1].state == READY, "it is ready")
    statuses.clear()
    answer = call(bench, NodeRequest, "restart", reason="a test")
    assert answer.success, answer.message
    assert answer.message == "restart: the device answered that it will"
    bench.until(
        lambda: {one.state for one in statuses} >= {ParachuteState.NOT_READY}, "it starts anew"
    )
    bench.until(lambda: statuses[-1].state == READY, "it is ready again")
    bench.until(
        lambda: (
            [one.request for one in asked if one.device == "33"]
            and asked[-1].request == SafetyRequest.FLIGHT_BLOCK_RELEASE
        ),
        "what it asked for is released",
    )
    assert SafetyRequest.FLIGHT_BLOCK in [one.request for one in asked]
    assert {one.link for one in asked} == {"upf_can"}
    assert devices.controller.booted_at > 0.0


def test_what_was_not_saved_is_gone_after_a_restart_what_was_is_not_and_erase_ends_both(
    bench, devices
):
    assert call(bench, SetParam, "set_param", name=p.AUTO_SAVE, value="false").success
    answer = call(bench, SetParam, "set_param", name=p.LIGHT, value="false")
    assert answer.success, answer.message
    assert "lost at a restart until ~/save_params" in answer.message
    assert call(bench, NodeRequest, "restart").success
    assert call(bench, GetParam, "get_param", name=p.LIGHT).value == "true"
    assert call(bench, SetParam, "set_param", name=p.LIGHT, value="off").success
    answer = call(bench, NodeRequest, "save_params", reason="a test")
    assert (answer.success, answer.message) == (True, "save: done")
    assert call(bench, NodeRequest, "restart").success
    assert call(bench, GetParam, "get_param", name=p.LIGHT).value == "false"
    answer = call(bench, NodeRequest, "erase_params", reason="a test")
    assert (answer.success, answer.message) == (True, "erase: done")
    assert call(bench, GetParam, "get_param", name=p.LIGHT).value == "true"


def test_what_takes_the_device_away_is_refused_in_the_air_unless_forced(bench, devices):
    devices.fly()
    for name in ("erase_params", "restart"):
        started = devices.controller.booted_at
        answer = call(bench, NodeRequest, name, reason="a test")
        assert not answer.success, name
        assert "refused while the vehicle is in the air; force does it" in answer.message
        assert devices.controller.booted_at == started
        answer = call(bench, NodeRequest, name, reason="a test", force=True)
        assert answer.success, answer.message
        assert (devices.controller.booted_at > started) == (name == "restart")


# ~/transport_stats, ~/get_node_info


def test_the_devices_counters_are_told(bench, devices):
    answer = call(bench, TransportStats, "transport_stats")
    assert answer.success, answer.message
    assert answer.transfers_tx > 5
    assert answer.transfers_rx > 5
    again = call(bench, TransportStats, "transport_stats")
    assert again.transfers_tx > answer.transfers_tx


def test_a_node_says_who_it_is(bench, devices):
    for node_id in (0, 33, 34):
        one = devices.trigger if node_id == 34 else devices.controller
        answer = call(bench, GetNodeInfo, "get_node_info", node_id=node_id)
        assert answer.success, answer.message
        assert (answer.name, answer.unique_id) == (one.settings.name, one.settings.unique_id.hex())
        assert (answer.software_version, answer.hardware_version) == ("3.0", "3.0")
        assert answer.uptime < 60
        assert answer.health == 0


# All


KINDS = {
    "command": (UpfCommand, {"command": Command.TAKEOFF}),
    "get_param": (GetParam, {"name": p.LIGHT}),
    "set_param": (SetParam, {"name": p.LIGHT, "value": "true"}),
    "list_params": (ListParams, {}),
    "save_params": (NodeRequest, {}),
    "erase_params": (NodeRequest, {}),
    "restart": (NodeRequest, {}),
    "transport_stats": (TransportStats, {}),
    "get_node_info": (GetNodeInfo, {}),
    "arm": (Arm, {}),
    "deploy": (Deploy, {"force": True}),
}


def test_without_any_device_each_service_says_so_at_once(bench):
    Network(bench, call_timeout=60.0, give_up_after=600.0)
    for name, (kind, fields) in KINDS.items():
        answer = call(bench, kind, name, **fields)
        assert not answer.success, name
        assert "received" in answer.message, name


def test_a_node_that_does_not_exist_is_given_up(bench):
    Devices(Network(bench))
    for name in KINDS.keys() - {"command", "arm", "deploy"}:
        kind, fields = KINDS[name]
        answer = call(bench, kind, name, node_id=99, **fields)
        assert not answer.success, name
        assert "no acknowledgement after 2 sends" in answer.message, name
        answer = call(bench, kind, name, node_id=128, **fields)
        assert not answer.success, name
        why = "there is no node id 128 on this link; name a node id from 1 to 127"
        assert why in answer.message


def test_services_at_once_each_get_their_own_answer(bench, devices):
    # ROS itself keeps ten requests of a service.
    names = list(devices.controller.values)[:8]
    futures = [bench.ask(GetParam, "upf_can/get_param", name=name) for name in names]
    futures.append(bench.ask(ListParams, "upf_can/list_params"))
    futures.append(bench.ask(GetNodeInfo, "upf_can/get_node_info", node_id=34))
    bench.until(lambda: all(future.done() for future in futures), "all are answered")
    answers = [future.result() for future in futures]
    assert [one.success for one in answers] == [True] * len(answers)
    told = [p.words(value) for value in devices.controller.values.values()]
    assert [one.value for one in answers[:-2]] == told[:8]
    assert answers[-2].values == told
    assert answers[-1].name == "upf.trigger"
