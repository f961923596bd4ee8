"""upf_can on a real bus: what it hears becomes what it publishes, and the other way round."""

import math

import pytest
from chute_msgs.msg import ParachuteStatus, TriggerStatus
from chute_msgs.srv import Arm, Deploy
from diagnostic_msgs.msg import DiagnosticArray
from node_bench import newest
from upf_bench import OTHER_LAYOUT, PATIENT, Devices, Network, tasks, values, vehicle_state

from chute_ros.links.upf.protocol.definitions import PARACHUTE_STATUS, VEHICLE_STATUS
from chute_ros.model import LinkState, ParachuteState
from chute_ros.sim.motion import Motion

READY = ParachuteState.READY
NAN = math.nan


# parachute/status, upf/trigger_status


def test_every_field_of_the_status_is_what_the_controller_says(bench):
    network = Network(bench)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    devices = Devices(network)
    devices.controller.motion = Motion(height=42.5, vertical_speed=-3.0)
    bench.until(newest(statuses, height=42.5), "the height is told")
    bench.until(lambda: not math.isnan(statuses[-1].uptime), "a NodeStatus has come")
    told = statuses[-1]
    assert (told.link, told.device) == ("upf_can", "33")
    assert (told.link_state, told.state) == (ParachuteStatus.LINK_OK, READY)
    assert (told.armed, told.deployed, told.deployment_trigger) == (False, False, 0)
    assert told.backup_voltage == pytest.approx(8.2, abs=0.01)
    assert 0.0 <= told.uptime < 60.0
    assert (told.error_flags, told.safety_flags, list(told.faults)) == (0, 0, [])
    devices.act("error=LOW_POWER")
    told = bench.until(newest(statuses, state=ParachuteState.ABNORMAL), "the error is told")
    assert list(told.faults) == ["LOW_POWER"]


def test_what_the_data_types_do_not_tell_is_nan_and_not_zero(bench):
    network = Network(bench, dsdl_path=str(OTHER_LAYOUT))
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    party = network.party(33)
    number = network.definitions.state_number(READY)
    party.say(PARACHUTE_STATUS, **network.definitions.present(PARACHUTE_STATUS, {"state": number}))
    told = bench.until(newest(statuses, state=READY), "the status is told")
    assert math.isnan(told.uptime), "no NodeStatus has come"
    absent = network.definitions.absent
    for field, name in (("height_of_home", "height"), ("backup_power_voltage", "backup_voltage")):
        gone = f"{PARACHUTE_STATUS}.{field}" in absent
        assert math.isnan(getattr(told, name)) == gone, name
    bench.until(lambda: "controller 33" in tasks(diagnostics), "it has a task")
    said = values(tasks(diagnostics)["link"])
    assert said["fields missing here"] == ", ".join(absent)
    assert said["fields new here"] == ", ".join(network.definitions.new)
    new = [one for one in network.definitions.new if one.startswith(f"{PARACHUTE_STATUS}.")]
    shown = values(tasks(diagnostics)["controller 33"])
    assert {f"new field {one.rpartition('.')[2]}" for one in new} <= set(shown)


def test_with_data_types_that_are_laid_out_differently_it_arms_and_deploys(bench):
    network = Network(bench, dsdl_path=str(OTHER_LAYOUT), **PATIENT)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    devices = Devices(network)
    answer = bench.call(Arm, "upf_can/arm", arm=True)
    assert answer.success, answer.message
    bench.until(newest(statuses, state=ParachuteState.ARMED, armed=True), "it is armed")
    answer = bench.call(Deploy, "upf_can/deploy", reason="a test")
    assert (answer.success, answer.accepted) == (True, True), answer.message
    assert devices.trigger.fired
    bench.until(newest(statuses, state=ParachuteState.LAUNCHED, deployed=True), "it is out")


def test_the_triggers_own_status_is_told(bench):
    network = Network(bench)
    told = bench.follow(TriggerStatus, "upf/trigger_status")
    devices = Devices(network)
    one = bench.until(newest(told, state=TriggerStatus.READY), "it is ready")
    assert (one.link, one.node_id, one.link_state) == ("upf_can", 34, LinkState.OK)
    assert (one.launched, one.error_flags, list(one.faults)) == (False, 0, [])
    assert one.supply_voltage == 12.0
    devices.act("trigger-error")
    one = bench.until(newest(told, state=TriggerStatus.ABNORMAL), "its error is told")
    assert one.error_flags == 1
    assert list(one.faults) == ["trigger 34: CIRCUIT_OPEN"]
    devices.act("clear-errors")
    assert bench.call(Deploy, "upf_can/deploy", force=True, reason="a test").success
    bench.until(newest(told, state=TriggerStatus.LAUNCHED, launched=True), "it has fired")
    devices.act("silent")
    bench.until(newest(told, link_state=LinkState.LOST, launched=True), "its silence is told")


# VehicleStatus on the bus


def test_the_vehicle_is_told_to_the_bus_at_its_rate(bench):
    network = Network(bench, vehicle_status_rate=50.0, vehicle_state_age=60.0)
    party = network.party()

    def heard():
        return party.values(VEHICLE_STATUS)

    bench.until(lambda: len(heard()) > 5, "it is told without anybody asking")
    assert heard()[-1]["state"] == 0, "nothing is known"
    assert math.isnan(heard()[-1]["height_of_home"])
    assert math.isnan(heard()[-1]["vz"])
    assert not heard()[-1]["is_parachute_connected"]
    for landed, state in ((1, 1), (2, 2), (3, 2), (4, 2)):
        message = vehicle_state(
            bench,
            landed_state=landed,
            landed_state_age=0.0,
            height=10.0 * landed,
            height_age=0.0,
            vertical_speed=-1.5,
            vertical_speed_age=0.0,
        )
        bench.publish(message, "vehicle/state")
        bench.until(
            lambda landed=landed: heard()[-1]["height_of_home"] == 10.0 * landed, "it is told"
        )
        assert (heard()[-1]["state"], heard()[-1]["vz"]) == (state, -1.5)
    before = len(heard())
    bench.until(lambda: len(heard()) >= before + 20, "it goes on")
    Devices(network)
    bench.until(lambda: heard()[-1]["is_parachute_connected"], "the controller is heard")
