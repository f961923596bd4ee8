"""The services of upf_can that read and set the parameters of its devices."""

from __future__ import annotations

import pytest
from chute_msgs.msg import ParachuteStatus
from chute_msgs.srv import Deploy, GetParam, ListParams, NodeRequest, SetParam
from upf_bench import PATIENT, Devices, Network

from chute_ros.links.upf.protocol import parameters as p


@pytest.fixture
def devices(bench):
    return Devices(Network(bench, **PATIENT, vehicle_state_age=60.0))


def call(bench, kind, service, /, **fields):
    return bench.call(kind, f"upf_can/{service}", **fields)


def set_param(bench, name, value, **fields):
    return call(bench, SetParam, "set_param", name=name, value=value, **fields)


#: Name -> (type, delivered, smallest, largest, another value).
TWELVE = {
    p.STATIC_NODE_ID: ("integer", "33", "0", "125", "40"),
    p.AUTO_SAVE: ("boolean", "true", "", "", "false"),
    p.CANBUS_RESISTER: ("boolean", "false", "", "", "true"),
    p.ENABLE_PARACHUTE: ("boolean", "true", "", "", "false"),
    p.ENABLE_APS: ("boolean", "true", "", "", "false"),
    p.AUTO_TAKEOFF: ("boolean", "false", "", "", "true"),
    p.AUTO_ARM: ("boolean", "false", "", "", "true"),
    p.AUTO_DISARM: ("boolean", "false", "", "", "true"),
    p.AUTO_LAND: ("boolean", "false", "", "", "true"),
    p.LIGHT: ("boolean", "true", "", "", "false"),
    p.NODE_STATUS_INTERVAL: ("integer", "100", "2", "1000", "120"),
    p.PARACHUTE_STATUS_INTERVAL: ("integer", "50", "2", "60000", "60"),
}


@pytest.mark.parametrize("name", TWELVE)
def test_each_is_read_set_and_read_back(bench, devices, name):
    kind, delivered, smallest, largest, another = TWELVE[name]
    answer = call(bench, GetParam, "get_param", name=name)
    assert answer.success, answer.message
    assert (answer.type, answer.value, answer.default_value) == (kind, delivered, delivered)
    assert (answer.minimum, answer.maximum) == (smallest, largest)
    assert answer.message.startswith(f"{name} is {delivered}")
    answer = set_param(bench, name, another)
    assert answer.success, answer.message
    assert answer.value_read_back == another
    assert p.words(devices.controller.values[name]) == another, "the device itself has it"
    answer = call(bench, GetParam, "get_param", name=name)
    assert (answer.value, answer.default_value) == (another, delivered)


def test_a_new_node_id_counts_from_the_next_start(bench, devices):
    answer = set_param(bench, p.STATIC_NODE_ID, "40")
    assert answer.success, answer.message
    assert "takes effect at the next start" in answer.message
    assert devices.controller.node_id == 33
    assert call(bench, NodeRequest, "restart").success
    bench.until(lambda: 40 in devices.network.link.devices.controllers, "it speaks as 40")
    answer = call(bench, GetParam, "get_param", name=p.STATIC_NODE_ID, node_id=40)
    assert (answer.success, answer.value) == (True, "40")


@pytest.mark.parametrize(
    ("name", "value", "need"),
    [
        (p.STATIC_NODE_ID, "126", "0 to 125"),
        (p.STATIC_NODE_ID, "-1", "0 to 125"),
        (p.NODE_STATUS_INTERVAL, "1", "2 to 1000"),
        (p.NODE_STATUS_INTERVAL, "1001", "2 to 1000"),
        (p.PARACHUTE_STATUS_INTERVAL, "1", "2 to 60000"),
        (p.PARACHUTE_STATUS_INTERVAL, "60001", "2 to 60000"),
        (p.STATIC_NODE_ID, str(10**30), "no parameter can hold it"),
        (p.STATIC_NODE_ID, "thirty", "a number (integer)"),
        (p.STATIC_NODE_ID, "33.5", "a number (integer)"),
        (p.STATIC_NODE_ID, "", "a number (integer)"),
        (p.AUTO_ARM, "maybe", "true or false"),
        (p.AUTO_ARM, "2", "true or false"),
        (p.AUTO_ARM, "", "true or false"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_with_what_does(bench, devices, name, value, need):
    before = dict(devices.controller.values)
    answer = set_param(bench, name, value)
    assert not answer.success
    assert name in answer.message
    assert value in answer.message
    assert need in answer.message
    assert "nothing was sent" in answer.message
    assert devices.controller.values == before


@pytest.mark.parametrize(("kind", "service"), [(GetParam, "get_param"), (SetParam, "set_param")])
def test_a_name_that_the_device_does_not_know_is_answered_with_those_it_does(
    bench, devices, kind, service
):
    answer = call(bench, kind, service, name="Enable Everything")
    assert not answer.success
    assert "the device has no parameter 'Enable Everything'" in answer.message
    for name in TWELVE:
        assert name in answer.message


@pytest.mark.parametrize("name", ["", "x" * 93, "é" * 47])
@pytest.mark.parametrize(("kind", "service"), [(GetParam, "get_param"), (SetParam, "set_param")])
def test_a_name_that_no_request_can_carry_is_refused(bench, devices, kind, service, name):
    before = dict(devices.controller.values)
    answer = call(bench, kind, service, name=name)
    assert not answer.success
    assert "is no parameter's name: need 1 to 92 bytes" in answer.message
    assert devices.controller.values == before


@pytest.mark.parametrize("node_id", [0, 33, 34])
def test_all_are_listed_in_the_devices_order(bench, devices, node_id):
    one = devices.trigger if node_id == 34 else devices.controller
    answer = call(bench, ListParams, "list_params", node_id=node_id)
    assert (answer.success, answer.message) == (True, f"{len(one.values)} parameters")
    assert answer.names == list(one.values)
    assert answer.values == [p.words(value) for value in one.values.values()]


def test_a_parameter_of_the_trigger_is_set_by_its_node_id(bench, devices):
    answer = set_param(bench, p.LIGHT, "false", node_id=34)
    assert answer.success, answer.message
    assert devices.trigger.values[p.LIGHT] is False
    assert devices.controller.values[p.LIGHT] is True
    answer = set_param(bench, p.ENABLE_APS, "true", node_id=34)
    assert not answer.success, "a trigger has none"


def test_a_device_that_does_not_answer_is_told_plainly(bench):
    devices = Devices(Network(bench))
    devices.act("mute")
    answer = call(bench, GetParam, "get_param", name=p.LIGHT)
    assert not answer.success
    assert "no acknowledgement after 2 sends" in answer.message
    assert (answer.value, answer.type) == ("", "")
    answer = set_param(bench, p.LIGHT, "false")
    assert (answer.success, answer.value_read_back) == (False, "")


# What protects


@pytest.mark.parametrize("name", p.PROTECTION)
@pytest.mark.parametrize("off", ["false", "0", "off", "no", "False ", "nonsense"])
def test_protection_is_not_switched_off_in_the_air(bench, devices, name, off):
    devices.fly()
    answer = set_param(bench, name, off)
    assert not answer.success
    assert f"{name} off would leave the vehicle without protection in the air" in answer.message
    assert "force does it all the same; nothing was sent" in answer.message
    assert devices.controller.values[name] is True


@pytest.mark.parametrize("name", p.PROTECTION)
def test_protection_is_switched_off_by_force_and_that_is_logged(bench, devices, name):
    said = bench.follow_log()
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    devices.fly()
    answer = set_param(bench, name, "false", force=True)
    assert (answer.success, answer.value_read_back) == (True, "false"), answer.message
    for line in (f"~/set_param {name!r} = 'false' (force=True)", f"{name} is being switched off"):
        bench.until(lambda line=line: any(line in one.msg for one in said), f"the log has {line}")
    bench.until(
        lambda: statuses and any(f"{name} is off" in one for one in statuses[-1].faults),
        "it is told as a fault",
    )
    answer = set_param(bench, name, "true")
    assert answer.success, "it may always be switched on"
    bench.until(
        lambda: not any(f"{name} is off" in one for one in statuses[-1].faults), "it is well again"
    )


def test_a_parachute_that_never_deploys_is_not_healthy(bench):
    devices = Devices(Network(bench, **(PATIENT | {"give_up_after": 1.0})))
    assert set_param(bench, p.ENABLE_PARACHUTE, "false").success
    devices.await_beat(device_healthy=False)
    answer = bench.call(Deploy, "upf_can/deploy", force=True)
    assert not answer.success
    assert f"{p.ENABLE_PARACHUTE} is off: it never deploys" in answer.message
    assert not devices.trigger.fired
    assert set_param(bench, p.ENABLE_PARACHUTE, "true").success
    devices.await_beat(device_healthy=True)


def test_what_does_not_protect_may_be_changed_in_the_air(bench, devices):
    devices.fly()
    answer = set_param(bench, p.LIGHT, "false")
    assert answer.success, answer.message
