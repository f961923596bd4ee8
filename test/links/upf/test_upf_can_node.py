"""upf_can on a real bus: what it hears becomes what it publishes, and the other way round."""

import math

import pytest
from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, TriggerStatus
from chute_msgs.srv import Deploy, GetNodeInfo
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_bench import newest
from upf_bench import OTHER_LAYOUT, PATIENT, Devices, Network, fly, tasks, values, vehicle_state

from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.definitions import PARACHUTE_STATUS, VEHICLE_STATUS
from chute_ros.model import LinkState, ParachuteState
from chute_ros.sim.motion import Motion

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)
READY = ParachuteState.READY
NAN, INF = math.nan, math.inf


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


def test_a_trigger_in_trouble_forbids_take_off_and_takes_nothing_back_in_the_air(bench):
    network = Network(bench, vehicle_state_age=60.0)
    devices = Devices(network)
    devices.act("trigger-error")
    beat = devices.await_beat(device_healthy=False)
    assert beat.link_state == LinkState.OK
    fly(bench, network)
    devices.await_beat(device_healthy=True)
    bench.publish(vehicle_state(bench, landed_state=1, landed_state_age=0.0), "vehicle/state")
    devices.await_beat(device_healthy=False)
    devices.act("clear-errors")
    devices.await_beat(device_healthy=True)


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


#: Parts of a vehicle/state -> the state and the height that the bus is told.
UNKNOWN = {
    "no ages": ({"landed_state": 2, "height": 9.0}, 0, NAN),
    "one age": ({"landed_state": 2, "landed_state_age": 0.0, "height": 9.0}, 2, NAN),
    "old": (
        {"landed_state": 2, "landed_state_age": 90.0, "height": 9.0, "height_age": 0.0},
        *(0, 9.0),
    ),
    "no state, too high": (
        {"landed_state": 9, "landed_state_age": 0.0, "height": 1e6, "height_age": 0.0},
        *(0, NAN),
    ),
    "lost": (
        {"landed_state": 2, "landed_state_age": 0.0, "link_state": 3, "vertical_speed": 1.0},
        *(0, NAN),
    ),
}


def test_what_is_not_known_or_too_old_is_told_so(bench):
    network = Network(bench, vehicle_state_age=60.0)
    party = network.party()
    link = network.link
    for number, (story, (fields, state, height)) in enumerate(UNKNOWN.items(), 1):
        bench.publish(vehicle_state(bench, roll=float(number), **fields), "vehicle/state")
        bench.until(lambda n=number: link._vehicle._state.roll == n, f"{story}: it is heard")
        party.heard.clear()
        # The first may have been on its way.
        bench.until(lambda: len(party.values(VEHICLE_STATUS)) >= 2, "it is told")
        told = party.values(VEHICLE_STATUS)[-1]
        assert told["state"] == state, story
        assert told["height_of_home"] == pytest.approx(height, nan_ok=True), story
        assert math.isnan(told["vz"])


def test_a_vehicle_that_falls_silent_is_soon_not_known(bench):
    network = Network(bench, vehicle_state_age=0.3)
    party = network.party()
    message = vehicle_state(
        bench, landed_state=2, landed_state_age=0.0, height=9.0, height_age=0.0
    )
    bench.publish(message, "vehicle/state")
    bench.until(lambda: 2 in {one["state"] for one in party.values(VEHICLE_STATUS)}, "it is told")
    told = bench.until(
        lambda: party.values(VEHICLE_STATUS)[-1]["state"] == 0 and party.newest(VEHICLE_STATUS),
        "it is too old",
    )
    assert math.isnan(told.values["height_of_home"])


# Who is on the bus


def test_two_controllers_are_told_apart_and_the_one_that_lives_is_used(bench):
    network = Network(bench)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    first, second = network.controller(), network.controller(**{p.STATIC_NODE_ID: 35})
    network.plug(network.trigger())
    loops = [network.plug(first), network.plug(second)]
    bench.until(lambda: {one.device for one in statuses} == {"33", "35"}, "both are told")
    bench.until(newest(beats, device_healthy=True), "all is well")
    chosen = network.link.devices.controller().node_id
    lost, other = (0, second) if chosen == 33 else (1, first)
    bench.unplug(loops[lost])
    bench.until(
        lambda: network.link.devices.controllers[chosen].liveness.state is LinkState.LOST,
        "the chosen one is lost",
    )
    bench.until(newest(beats, link_state=LinkState.OK), "the other is used")
    answer = bench.call(GetNodeInfo, "upf_can/get_node_info")
    assert answer.success, answer.message
    answer = bench.call(Deploy, "upf_can/deploy", force=True, reason="a test")
    assert answer.success, answer.message
    assert other.came[0] == "TYPE_DEPLOY_FORCE"


def test_a_controller_that_restarts_is_read_anew_and_counted(bench):
    network = Network(bench, **PATIENT)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    devices = Devices(network)
    bench.until(lambda: devices.controller.now - devices.controller.booted_at > 4.0, "it runs")
    devices.act("reboot")
    controller = network.link.devices.controllers[33]
    bench.until(lambda: controller.restart_count == 1, "the restart is seen")
    devices.await_well()
    bench.until(
        lambda: values(tasks(diagnostics)["controller 33"])["restarts"] == "1", "it is counted"
    )
