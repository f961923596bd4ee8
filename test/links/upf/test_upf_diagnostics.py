"""What upf_can says on /diagnostics, and in its log at the start."""

import pytest
from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, TriggerStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from upf_bench import OTHER_LAYOUT, Devices, Network, tasks, values

from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import NODE_ID
from chute_ros.links.upf.protocol.definitions import (
    PARACHUTE_STATUS,
    TRIGGER_STATUS,
    VEHICLE_SERVICE,
)
from chute_ros.model import LinkState, ParachuteState

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)


def test_diagnostics_say_what_is_missing_and_what_is_there(bench):
    network = Network(bench)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    bench.until(lambda: "link" in tasks(diagnostics), "they come")
    said = tasks(diagnostics)
    assert set(said) == {
        "link",
        "parachute",
        "vehicle service",
        "node ids",
        "supervisor",
        "middleware",
    }
    assert (said["link"].level, said["parachute"].level) == (WARN, STALE)
    assert said["link"].message == f"{network.connection} is open, nothing received yet"
    assert said["parachute"].message == "never received"
    assert said["supervisor"].level == STALE
    assert said["vehicle service"].message == "nothing was requested yet"
    assert said["node ids"].message == "0 node ids given out"
    devices = Devices(network)
    well = {"link", "controller 33", "trigger 34", "vehicle service", "node ids"}
    bench.until(
        lambda: well <= {task for task, one in tasks(diagnostics).items() if one.level == OK},
        "all is well",
    )
    said = tasks(diagnostics)
    assert (said["controller 33"].message, said["trigger 34"].message) == ("READY", "READY")
    assert said["controller 33"].hardware_id == "33"
    told = values(said["controller 33"])
    assert (told["link"], told["restarts"], told[p.LIGHT]) == ("OK", "0", "true")
    bench.until(
        lambda: "upf.controller" in values(tasks(diagnostics)["link"]).get("node 33", ""),
        "the nodes are named",
    )
    devices.act("error=IMU")
    bench.until(lambda: tasks(diagnostics)["controller 33"].level == ERROR, "the error is told")
    assert tasks(diagnostics)["controller 33"].message == "IMU"


def test_a_request_with_a_bad_magic_number_is_counted_and_answered_so(bench):
    network = Network(bench)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    party = network.party(33)
    party.ask(NODE_ID, VEHICLE_SERVICE, 0, magic_number=7, type=1)
    answer = bench.until(lambda: party.newest(VEHICLE_SERVICE), "it is answered")
    result = network.definitions.result_name(VEHICLE_SERVICE, answer.values)
    assert result == "BAD_MAGIC_NUMBER"
    bench.until(
        lambda: (
            "vehicle service" in tasks(diagnostics)
            and tasks(diagnostics)["vehicle service"].level == WARN
        ),
        "it is told",
    )
    said = tasks(diagnostics)["vehicle service"]
    assert said.message == "bad request of 33: BAD_MAGIC_NUMBER"
    assert values(said)["requests with a bad magic number"] == "1"


def test_a_launch_that_nobody_ordered_is_told_by_its_reason(bench):
    network = Network(bench)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    statuses = bench.follow(TriggerStatus, "upf/trigger_status")
    party = network.party(34)
    state = network.definitions.constant(TRIGGER_STATUS, "STATE_LAUNCHED")
    party.say(TRIGGER_STATUS, state=state)
    reason = "dropped: launched without an order, not believed yet"
    bench.until(
        lambda: (
            "trigger 34" in tasks(diagnostics)
            and values(tasks(diagnostics)["link"]).get(reason) == "1"
        ),
        "it is counted",
    )
    assert values(tasks(diagnostics)["trigger 34"])["has fired"] == "False"
    assert not any(one.launched for one in statuses)
    for _ in range(2):
        party.say(TRIGGER_STATUS, state=state)
    bench.until(lambda: statuses[-1].launched, "said again and again, it is believed")


def test_fields_that_the_types_lack_are_in_the_log_at_the_start(bench):
    said = bench.follow_log()
    network = Network(bench, dsdl_path=str(OTHER_LAYOUT))
    for absent in network.definitions.absent:
        bench.until(
            lambda absent=absent: any(f"have no {absent}" in one.msg for one in said),
            f"{absent} is named",
        )


def test_a_controller_that_came_back_under_another_node_id_is_told_so(bench):
    network = Network(bench)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    ready = network.definitions.state_number(ParachuteState.READY)
    network.party(120).say(PARACHUTE_STATUS, state=ready)
    bench.until(lambda: "controller 120" in tasks(diagnostics), "it is received")
    now = network.party(121)

    def told():
        now.say(PARACHUTE_STATUS, state=ready, is_vehicle_connected=True)
        return tasks(diagnostics)["controller 120"].message == "came back as 121"

    bench.until(told, "its former node id names the new one")
    assert tasks(diagnostics)["controller 120"].level == WARN


def test_a_named_trigger_that_is_missing_forbids_take_off(bench):
    """Given a controller that is READY, as after a restart of the node alone."""
    network = Network(bench, trigger_node_id=34)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    ready = network.definitions.state_number(ParachuteState.READY)
    controller, trigger = network.party(33), network.party(34)

    def beat_after(told):
        beats.clear()

        def seen():
            told()
            return len(beats) >= 3 and beats[-1].link_state == LinkState.OK

        bench.until(seen, "it beats")
        return beats[-1]

    def controller_tells():
        controller.say(PARACHUTE_STATUS, state=ready)

    def both_tell():
        controller_tells()
        state = network.definitions.constant(TRIGGER_STATUS, "STATE_READY")
        trigger.say(TRIGGER_STATUS, state=state)

    beat = beat_after(controller_tells)
    assert not beat.device_healthy
    assert any(one.startswith("trigger 34 was never received") for one in beat.reasons)
    bench.until(lambda: "trigger 34" in tasks(diagnostics), "it is told")
    assert tasks(diagnostics)["trigger 34"].level == ERROR
    assert beat_after(both_tell).device_healthy


@pytest.mark.parametrize("without_controller", [False, True])
def test_a_controller_that_is_missing_beside_its_trigger_is_an_error(bench, without_controller):
    network = Network(bench, without_controller=without_controller)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    network.party(34).say(
        TRIGGER_STATUS, state=network.definitions.constant(TRIGGER_STATUS, "STATE_READY")
    )
    bench.until(lambda: "trigger 34" in tasks(diagnostics), "the trigger is there")
    said = tasks(diagnostics)
    assert ("controller" in said) is not without_controller
    if not without_controller:
        assert said["controller"].level == ERROR
        assert said["controller"].message.startswith("never received, and without it")
        beats.clear()
        bench.until(lambda: len(beats) >= 3, "it beats")
        assert {(one.link_state, one.device_healthy) for one in beats} == {
            (LinkState.NEVER_SEEN, False)
        }
        assert statuses == [], "a trigger alone is no parachute"
