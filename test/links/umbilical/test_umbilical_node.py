"""The node umbilical: what it publishes of a flight computer at the other end of a real pty."""

import math

import pytest
from chute_msgs.msg import Telem, VehicleState
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.logging import LoggingSeverity
from umbilical_bench import RATE, Cable

from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol.layouts import Record
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings
from chute_ros.links.umbilical.telem_message import RENAMED, telem, without_place
from chute_ros.model import LandedState

LAYOUTS = (
    "telem57_airbrake_state",
    "telem57_airbrake_deployment",
    "telem54",
    "telem52",
    "telem50",
)


@pytest.fixture(scope="module")
def layouts(ros):
    found = {one.name: one for one in load_layouts("", "test")}
    assert {*found} == {*LAYOUTS}
    return found


def told(layout, values, sequence=1):
    return telem(Record(layout, tuple(values), 5.0), sequence, Telem().header.stamp)


@pytest.mark.parametrize("name", LAYOUTS)
def test_each_field_of_a_layout_is_told_under_one_name_and_the_others_as_not_there(layouts, name):
    layout = layouts[name]
    assert without_place(layout) == []
    names = [RENAMED.get(one, one) for one in layout.index]
    for place, field in enumerate(names):
        values = [1] * layout.count
        values[place] = 0
        message = told(layout, values, 7)
        assert getattr(message, field) == 0
        others = [one for one in names if one != field]
        assert all(getattr(message, one) in (1, 0.001) for one in others), field
        assert (message.layout, message.sequence) == (name, 7)
    lacking = {*Telem.get_fields_and_field_types()} - {*names, "header", "layout", "sequence"}
    assert lacking, "no layout has every field"
    for one in lacking:
        value = getattr(message, one)
        whole = -32768 if one in ("blims_phase_id", "blims_loiter_step") else -1
        assert math.isnan(value) if isinstance(value, float) else value == whole, one


ERROR, WARN, OK = DiagnosticStatus.ERROR, DiagnosticStatus.WARN, DiagnosticStatus.OK


def test_a_number_that_is_too_large_for_its_place_reads_as_the_largest(layouts):
    layout = layouts["telem57_airbrake_state"]
    for field, value, wanted in (
        ("flight_mode", 2**32 - 1, 255),
        ("flight_mode", -1, 255),
        ("num_satellites", 2**32 - 1, 32767),
        ("cmd_n1", 70_000, 32767),
        ("sv_open", -200, -128),
    ):
        values = [0] * layout.count
        values[layout.index[field]] = value
        assert getattr(told(layout, values), field) == wanted, (field, value)


def test_telemetry_is_published_with_the_layout_that_is_recognised(bench):
    cable = Cable(bench, sends="telem50")
    cable.plugged()
    one = cable.await_telemetry(lambda t: True, "telemetry is published")
    assert one.layout == "telem50"
    assert one.flight_mode == Telem.STARTUP
    assert 100_000 < one.pressure < 102_000
    sequences = [t.sequence for t in cable.telemetry]
    assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))
    bench.until(lambda: len(cable.telemetry) > 5, "it goes on")
    uptimes = [t.device_uptime for t in cable.telemetry]
    assert uptimes == sorted(uptimes), "the device's own clock, in s"
    assert uptimes[-1] - uptimes[0] == pytest.approx((len(uptimes) - 1) / RATE, abs=1.0)


def test_the_vehicles_state_is_told_when_asked_to(bench):
    cable = Cable(bench, publish_vehicle_state=True)
    states = bench.follow(VehicleState, "vehicle/state")
    cable.plugged()
    bench.until(lambda: states, "it is told")
    assert states[-1].landed_state == LandedState.ON_GROUND
    assert states[-1].armed == VehicleState.DISARMED
    cable.act("jump=Standby")
    bench.until(lambda: states[-1].armed == VehicleState.ARMED, "the key is armed")
    cable.act("jump=Coast")
    bench.until(lambda: states[-1].landed_state == LandedState.IN_AIR, "it flies")
    one = states[-1]
    assert one.source == "flight_computer"
    assert 1900.0 < one.height < 2200.0
    assert 0.0 < one.vertical_speed < 60.0, "up is positive"
    assert one.latitude == pytest.approx(42.44, abs=0.1)
    assert math.isnan(one.tilt), "a flight computer tells no attitude"


def test_without_being_asked_it_tells_no_vehicle_state(bench):
    cable = Cable(bench)
    cable.plugged()
    topics = {
        topic
        for topic, _ in cable.node.get_publisher_names_and_types_by_node(
            "umbilical", bench.namespace
        )
    }
    assert f"{bench.namespace}/umbilical/telem" in topics
    assert f"{bench.namespace}/vehicle/state" not in topics


def test_the_flight_computer_hears_our_heartbeat_and_misses_it_when_we_are_gone(bench):
    cable = Cable(bench, FlightComputerSettings(rate=RATE, heartbeat_timeout=1.0))
    cable.plugged()
    bench.until(lambda: len(cable.computer.heartbeats) >= 5, "heartbeats come")
    assert cable.computer.connected
    assert cable.computer.receiver.lost == {}, "never glued to anything"
    bench.remove(cable.node)
    bench.until(lambda: not cable.computer.connected, "without us it is not connected")


def test_a_hung_executor_is_a_silent_heartbeat(bench):
    cable = Cable(bench, FlightComputerSettings(rate=RATE, heartbeat_timeout=1.0))
    cable.plugged()
    bench.until(lambda: cable.computer.connected, "it is connected")
    # Not spun any more, the node's executor is as good as hung.
    bench.executor.remove_node(cable.node)
    before = len(cable.computer.heartbeats)
    bench.until(lambda: not cable.computer.connected, "the flight computer misses us")
    # Four a second: the link's own thread sends on for a second, and for no more.
    assert len(cable.computer.heartbeats) - before <= 8
    bench.executor.add_node(cable.node)
    bench.until(lambda: cable.computer.connected, "it hears us again")


def newest(diagnostics, task):
    found = [s for a in diagnostics for s in a.status if s.name.endswith(f"umbilical: {task}")]
    return found[-1] if found else DiagnosticStatus()


def values(status):
    return {one.key: one.value for one in status.values}


def test_its_log_lines_go_to_the_log_at_their_level(bench):
    logs = bench.follow_log()
    cable = Cable(bench, FlightComputerSettings(rate=RATE, debug=True))
    cable.plugged()
    assert cable.arm().success

    def told():
        return {(m.level, m.msg) for m in logs if m.name.endswith("umbilical.flight_computer")}

    bench.until(lambda: any("UMBILICAL CMD" in text for _, text in told()), "it is logged")
    level = next(level for level, text in told() if "UMBILICAL CMD" in text)
    assert level == LoggingSeverity.WARN


def test_diagnostics_tell_the_truth_through_a_day_with_a_cable(bench):
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    cable = Cable(bench)
    bench.until(lambda: newest(diagnostics, "link").level == ERROR, "no port")
    assert "no such port" in newest(diagnostics, "link").message
    bench.until(
        lambda: newest(diagnostics, "parachute").message == "never received", "never received"
    )
    bench.until(
        lambda: "the port is closed" in newest(diagnostics, "umbilical heartbeat").message,
        "no heartbeat without a port",
    )
    cable.plugged()
    bench.until(lambda: newest(diagnostics, "parachute").level == OK, "all is well")
    bench.until(lambda: newest(diagnostics, "link").level == OK, "the port is open")
    link = values(newest(diagnostics, "link"))
    assert link["layout"] == "telem57_airbrake_state"
    bench.until(
        lambda: (
            float(values(newest(diagnostics, "link"))["records per s"])
            == pytest.approx(RATE, rel=0.5)
        ),
        "the rate is told",
    )
    bench.until(lambda: newest(diagnostics, "umbilical heartbeat").level == OK, "it beats")
    assert newest(diagnostics, "memory").message == "no dump or wipe under way"
    cable.act("fault")
    bench.until(
        lambda: newest(diagnostics, "parachute").message == "flight mode Fault", "it is told"
    )
    assert newest(diagnostics, "parachute").level == ERROR
    cable.pull()
    bench.until(lambda: newest(diagnostics, "link").level == ERROR, "the cable is out")
    pulled = "the cable was pulled, or the port closed: no telemetry for"
    bench.until(lambda: pulled in newest(diagnostics, "parachute").message, "the cause is told")
    bench.until(
        lambda: int(values(newest(diagnostics, "parachute"))["times lost"]) == 1, "and it is lost"
    )
