"""The services of upf_can that read and set the parameters of its devices."""

import pytest
from chute_msgs.msg import ParachuteStatus
from chute_msgs.srv import GetParam, ListParams, SetParam
from upf_bench import PATIENT, Devices, Network

from chute_ros.links.upf.protocol import parameters as p


@pytest.fixture
def devices(bench):
    return Devices(Network(bench, **PATIENT, vehicle_state_age=60.0))


def call(bench, kind, service, /, **fields):
    return bench.call(kind, f"upf_can/{service}", **fields)


def set_param(bench, name, value, **fields):
    return call(bench, SetParam, "set_param", name=name, value=value, **fields)


#: Name -> (type, delivered, smallest, largest, another value). All twelve are set through the
#: link: protocol/test_upf_bus_requests.py.
BOTH_KINDS = {
    p.AUTO_SAVE: ("boolean", "true", "", "", "false"),
    p.NODE_STATUS_INTERVAL: ("integer", "100", "2", "1000", "120"),
}


def test_each_kind_is_read_set_and_read_back(bench, devices):
    for name, (kind, delivered, smallest, largest, another) in BOTH_KINDS.items():
        answer = call(bench, GetParam, "get_param", name=name)
        assert answer.success, answer.message
        assert (answer.type, answer.value, answer.default_value) == (kind, delivered, delivered)
        assert (answer.minimum, answer.maximum) == (smallest, largest), name
        assert answer.message.startswith(f"{name} is {delivered}")
        answer = set_param(bench, name, another)
        assert answer.success, answer.message
        assert answer.value_read_back == another, name
        assert p.words(devices.controller.values[name]) == another, "the device itself has it"


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


# What protects


def test_protection_is_switched_off_in_the_air_only_by_force_and_that_is_logged(bench, devices):
    name = p.ENABLE_APS
    said = bench.follow_log()
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    devices.fly()
    answer = set_param(bench, name, "nonsense")
    assert (answer.success, answer.value_read_back) == (False, "")
    without = f"{name} may take the parachute away in the air"
    assert without in answer.message
    assert devices.controller.values[name] is True
    answer = set_param(bench, name, "false", force=True)
    assert (answer.success, answer.value_read_back) == (True, "false"), answer.message
    for line in (f"~/set_param {name!r} = 'false' (force=True)", f"{name} is being switched off"):
        bench.until(lambda line=line: any(line in one.msg for one in said), f"the log has {line}")
    bench.until(
        lambda: statuses and any(f"{name} is off" in one for one in statuses[-1].faults),
        "it is told as a fault",
    )
