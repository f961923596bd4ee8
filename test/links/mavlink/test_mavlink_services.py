"""The services of mavlink_parachute, over real UDP."""

import json

import pytest
from chute_msgs.msg import LinkHeartbeat
from chute_msgs.srv import (
    Arm,
    Deploy,
    GetInfo,
    ParachuteAction,
    RequestMessage,
    SetMessageInterval,
    SetTriggers,
)
from mavlink_bench import Module, Network, do

from chute_ros.protocol.mavlink.dialect import dialect

STATUS = dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS
ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED


def plugged(bench, module, **parameters):
    """The loop of module, once it is heard."""
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    loop = Network(bench, **parameters).plug(module)
    bench.until(lambda: beats and beats[-1].device_healthy, "the module is heard and well")
    return loop


@pytest.fixture
def module(bench):
    one = Module()
    one.loop = plugged(bench, one)
    return one


def call(bench, kind, name, **fields):
    return bench.call(kind, f"mavlink_parachute/{name}", **fields)


# ~/arm, ~/set_triggers, ~/parachute_action


def test_arm_means_the_default_triggers_or_those_named(bench, module):
    for triggers, armed in ((2, 2), (1 | 64, 65), (0, 12)):
        module.armed = type(module.armed)(0)
        answer = call(bench, Arm, "arm", arm=True, triggers=triggers)
        assert answer.success, answer.message
        assert module.armed == armed


def test_masks_that_a_byte_cannot_hold_are_refused_and_not_sent(bench, module):
    for arm, select in ((256, 1), (1, 256), (1, 0), (2**32 - 1, 255)):
        answer = call(bench, SetTriggers, "set_triggers", arm=arm, select=select)
        assert (answer.success, answer.result) == (False, DENIED), (arm, select)
        assert str(arm) in answer.message
        assert "nothing was sent" in answer.message
    assert module.heard_command(dialect.MAV_CMD_SET_PARACHUTE_ARM) == []


def test_set_triggers_carries_both_masks_to_the_wire(bench, module):
    module.armed |= 1 | 4
    answer = call(bench, SetTriggers, "set_triggers", arm=8 | 2, select=8 | 4)
    assert answer.success, answer.message
    assert answer.result == ACCEPTED
    (heard,) = module.heard_command(dialect.MAV_CMD_SET_PARACHUTE_ARM)
    assert heard[2][:2] == (10.0, 12.0)
    assert module.armed == 1 | 8, "only the selected ones changed"
    assert answer.armed_triggers == 1 | 8


def test_parachute_action_enables_disables_and_releases(bench, module):
    for action, armed in ((1, 2), (0, 0)):
        answer = call(bench, ParachuteAction, "parachute_action", action=action)
        assert (answer.success, answer.result) == (True, ACCEPTED), answer.message
        assert module.armed == armed
    assert call(bench, Arm, "arm", arm=True).success
    answer = call(bench, ParachuteAction, "parachute_action", action=2, reason="a test")
    assert answer.success, answer.message
    assert module.deployment


def test_an_action_that_is_none_is_refused_and_not_sent(bench, module):
    answer = call(bench, ParachuteAction, "parachute_action", action=3)
    assert (answer.success, answer.result) == (False, DENIED)
    assert "action 3: need DISABLE 0, ENABLE 1 or RELEASE 2" in answer.message
    assert module.heard_command(dialect.MAV_CMD_DO_PARACHUTE) == []


def test_deploy_with_force_arms_on_the_way(bench, module):
    answer = call(bench, Deploy, "deploy", force=True, reason="a test")
    assert answer.success, answer.message
    assert module.deployment


def test_two_services_at_once_each_get_their_own_answer(bench, module):
    triggers = bench.ask(SetTriggers, "mavlink_parachute/set_triggers", arm=1, select=1)
    information = bench.ask(GetInfo, "mavlink_parachute/get_info")
    request = bench.ask(RequestMessage, "mavlink_parachute/request_message", message_id=STATUS)
    futures = (triggers, information, request)
    bench.until(lambda: all(future.done() for future in futures), "all are answered")
    assert [future.result().success for future in futures] == [True, True, True]
    assert triggers.result().armed_triggers == 1


# ~/request_message, ~/set_message_interval, ~/get_info


def test_a_requested_message_comes_as_json(bench, module):
    answer = call(bench, RequestMessage, "request_message", message_id=STATUS)
    assert (answer.success, answer.result) == (True, ACCEPTED), answer.message
    told = json.loads(answer.json)
    assert told["mavpackettype"] == "PARACHUTE_STATUS"
    assert told["parachute_packed_date"] == "2026-06-19"


def test_an_interval_is_set_and_read_back(bench, module):
    # Set, off, and its own.
    for asked, reported in ((200_000, 200_000), (-1, -1), (0, 50_000)):
        answer = call(
            bench, SetMessageInterval, "set_message_interval", message_id=STATUS, interval_us=asked
        )
        assert answer.success, answer.message
        assert answer.reported_interval_us == reported


def test_an_interval_that_is_none_is_refused_and_not_sent(bench, module):
    answer = call(bench, SetMessageInterval, "set_message_interval", interval_us=-2)
    assert (answer.success, answer.result) == (False, DENIED)
    assert "-2" in answer.message
    assert module.heard_command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL) == []


def test_the_component_information_is_told(bench, module):
    answer = call(bench, GetInfo, "get_info")
    assert answer.success, answer.message
    assert (answer.vendor_name, answer.model_name) == ("chute_ros", "simulated parachute")
    assert answer.serial_number == "SIM-0001"
    assert answer.manufacture_date == "2025-06-15"
    assert answer.uptime >= 0.0


def test_without_an_answer_the_information_is_unknown_and_not_zero(bench, module):
    do(bench, module.loop, lambda: module.act("mute"))
    answer = call(bench, GetInfo, "get_info")
    assert not answer.success
    assert answer.uptime != answer.uptime
