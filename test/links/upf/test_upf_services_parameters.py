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


def test_each_is_read_set_and_read_back(bench, devices):
    for name, (kind, delivered, smallest, largest, another) in TWELVE.items():
        answer = call(bench, GetParam, "get_param", name=name)
        assert answer.success, answer.message
        assert (answer.type, answer.value, answer.default_value) == (kind, delivered, delivered)
        assert (answer.minimum, answer.maximum) == (smallest, largest), name
        assert answer.message.startswith(f"{name} is {delivered}")
        answer = set_param(bench, name, another)
        assert answer.success, answer.message
        assert answer.value_read_back == another, name
        assert p.words(devices.controller.values[name]) == another, "the device itself has it"
        answer = call(bench, GetParam, "get_param", name=name)
        assert (answer.value, answer.default_value) == (another, delivered), name


def test_a_new_node_id_counts_from_the_next_start(bench, devices):
    answer = set_param(bench, p.STATIC_NODE_ID, "40")
    assert answer.success, answer.message
    assert "takes effect at the next start" in answer.message
    assert devices.controller.node_id == 33
    assert call(bench, NodeRequest, "restart").success
    bench.until(lambda: 40 in devices.network.link.devices.controllers, "it speaks as 40")
    answer = call(bench, GetParam, "get_param", name=p.STATIC_NODE_ID, node_id=40)
    assert (answer.success, answer.value) == (True, "40")


UNFIT = {
    p.STATIC_NODE_ID: {
        **dict.fromkeys(("126", "-1"), "0 to 125"),
        str(10**30): "no parameter can hold it",
        **dict.fromkeys(("thirty", "33.5", ""), "a number (integer)"),
    },
    p.NODE_STATUS_INTERVAL: dict.fromkeys(("1", "1001"), "2 to 1000"),
    p.PARACHUTE_STATUS_INTERVAL: dict.fromkeys(("1", "60001"), "2 to 60000"),
    p.AUTO_ARM: dict.fromkeys(("maybe", "2", ""), "true or false"),
}


def test_a_value_that_does_not_fit_is_refused_with_what_does(bench, devices):
    before = dict(devices.controller.values)
    for name, needs in UNFIT.items():
        for value, need in needs.items():
            answer = set_param(bench, name, value)
            assert not answer.success, (name, value)
            for told in (name, value, need, "nothing was sent"):
                assert told in answer.message, (name, value)
            assert devices.controller.values == before


def test_a_name_that_the_device_does_not_know_or_no_request_can_carry_is_refused(bench, devices):
    before = dict(devices.controller.values)
    for kind, service in ((GetParam, "get_param"), (SetParam, "set_param")):
        answer = call(bench, kind, service, name="Enable Everything")
        assert not answer.success
        assert "the device has no parameter 'Enable Everything'" in answer.message
        assert all(name in answer.message for name in TWELVE), answer.message
        for name in ("", "x" * 93, "é" * 47):
            answer = call(bench, kind, service, name=name)
            assert not answer.success, name
            assert "is no parameter's name: need 1 to 92 bytes" in answer.message
    assert devices.controller.values == before


def test_all_are_listed_in_the_devices_order(bench, devices):
    for node_id in (0, 33, 34):
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
def test_protection_is_switched_off_in_the_air_only_by_force_and_that_is_logged(
    bench, devices, name
):
    said = bench.follow_log()
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    devices.fly()
    for off in ("false", "0", "off", "no", "False ", "nonsense"):
        answer = set_param(bench, name, off)
        assert not answer.success, off
        without = f"{name} off would leave the vehicle without protection in the air"
        assert without in answer.message
        assert "force does it all the same; nothing was sent" in answer.message
        assert devices.controller.values[name] is True, off
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
