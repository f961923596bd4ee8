"""mavlink_parachute on a real network: what it hears becomes what it publishes."""

import itertools
import math
import socket

import pytest
from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, SafetyDecision, VehicleState
from chute_msgs.srv import Arm, Deploy, SetTriggers
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mavlink_bench import Autopilot, Module, Network, do
from node_bench import LOCAL, newest, port_of, stamped
from sensor_msgs.msg import BatteryState

from chute_ros.links.mavlink.simulator.parachute_device import ParachuteSettings
from chute_ros.model import LinkState, ParachuteState
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.ros import qos


@pytest.fixture
def network(bench):
    return Network(bench)


# parachute/status


def test_every_field_of_the_status_is_what_the_module_says(bench, network):
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    settings = ParachuteSettings(
        system_id=7,
        component_id=162,
        armed_triggers=0b0100_0010,
        errors=8 | 2048,
        ground_cleared="yes",
        ats_arm_altitude=30,
        packed_date="2024-09-12",
    )
    network.plug(Module(settings))
    told = bench.until(newest(statuses, armed_triggers=0b0100_0010), "the status is told")
    assert (told.link, told.device) == ("mavlink_parachute", "7/162")
    assert told.link_state == ParachuteStatus.LINK_OK
    assert told.state == ParachuteState.ABNORMAL
    assert (told.armed, told.deployed, told.deployment_trigger) == (True, False, 0)
    assert (told.error_flags, told.safety_flags) == (8 | 2048, 1)
    assert told.ats_arm_altitude == 30.0
    assert told.packed_date == "2024-09-12"
    assert list(told.faults) == ["LOW_POWER", "GPS_ERROR"]
    assert told.uptime >= 0.0
    assert math.isnan(told.height), "this protocol does not tell it"
    assert math.isnan(told.backup_voltage)
    age = bench.client.get_clock().now().nanoseconds * 1e-9 - told.header.stamp.sec
    assert -1.0 < age < 20.0, "stamped at receipt"


def test_an_ignored_error_is_shown_and_no_fault(bench):
    network = Network(bench, ignored_error_flags=8)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    network.plug(Module(ParachuteSettings(errors=8, ground_cleared="yes")))
    told = bench.until(newest(statuses, error_flags=8), "the status is told")
    assert told.state == ParachuteState.TAKEOFF
    assert list(told.faults) == []


# vehicle/state


def test_the_vehicle_is_told_with_the_age_of_each_part(bench, network):
    states = bench.follow(VehicleState, "vehicle/state")
    autopilot = Autopilot()
    loop = network.plug(autopilot)
    parts = ("armed", "landed_state", "height", "vertical_speed", "attitude", "acceleration")
    ages = [f"{part}_age" for part in (*parts, "battery", "position")]
    told = bench.until(
        lambda: states and all(getattr(states[-1], age) >= 0.0 for age in ages) and states[-1],
        "all parts are told",
    )
    assert (told.source, told.link_state) == ("1/1", LinkState.OK)
    assert (told.armed, told.landed_state) == (VehicleState.DISARMED, 1)
    assert told.height == pytest.approx(0.0, abs=0.01)
    assert told.acceleration == pytest.approx(9.8, abs=0.1)
    assert told.battery_voltage == pytest.approx(15.8)
    assert all(getattr(told, age) < 20.0 for age in ages)
    do(bench, loop, lambda: autopilot.act("silent"))
    told = bench.until(newest(states, link_state=LinkState.LOST), "the silence is told")
    assert told.height_age > 0.6, "what was told goes on ageing"


def test_without_an_autopilot_nothing_is_made_up(bench, network):
    states = bench.follow(VehicleState, "vehicle/state")
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    network.plug(Module())
    bench.until(newest(beats, link_state=LinkState.OK), "the parachute is heard")
    assert states == []


# vehicle/battery


def test_each_reading_of_the_battery_is_published_once_with_its_time(bench, network):
    """Given an autopilot that tells its battery four times a second and everything else often."""
    states = bench.follow(VehicleState, "vehicle/state")
    batteries = bench.follow(BatteryState, "vehicle/battery")
    autopilot = Autopilot()
    autopilot.default_intervals[dialect.MAVLINK_MSG_ID_SYS_STATUS] = 0.25
    network.plug(autopilot)
    began = bench.client.get_clock().now().nanoseconds
    bench.until(lambda: len(batteries) >= 4, "four readings are published")
    assert len(states) > 2 * len(batteries), "most pictures have no new one"
    stamps = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in batteries]
    assert all(after - before > 0.1e9 for before, after in itertools.pairwise(stamps))
    assert began - 1e9 < stamps[0] < began + 20e9
    told = batteries[-1]
    assert told.voltage == pytest.approx(15.8)
    assert told.percentage == pytest.approx(states[-1].battery_remaining)
    assert told.present
    assert told.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_UNKNOWN
    assert math.isnan(told.current), "not known"
    assert math.isnan(told.temperature)
    assert math.isnan(told.capacity)


def test_a_battery_that_is_silent_is_published_no_more(bench, network):
    states = bench.follow(VehicleState, "vehicle/state")
    batteries = bench.follow(BatteryState, "vehicle/battery")
    autopilot = Autopilot()
    loop = network.plug(autopilot)
    bench.until(lambda: batteries, "a reading is published")
    do(bench, loop, lambda: autopilot.act("silent"))
    bench.until(newest(states, link_state=LinkState.STALE), "the silence is told")
    count = len(batteries)
    bench.until(newest(states, link_state=LinkState.LOST), "it is lost")
    assert len(batteries) == count


# Who is on the network


def test_two_parachutes_on_one_link_are_told_apart(bench, network):
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    first, second = (Module(ParachuteSettings(component_id=i)) for i in (161, 162))
    loops = [network.plug(module) for module in (first, second)]
    bench.until(lambda: {s.device for s in statuses} == {"1/161", "1/162"}, "both are told")
    answer = bench.call(
        SetTriggers, "mavlink_parachute/set_triggers", arm=4, select=4, device="1/162"
    )
    assert answer.success, answer.message
    assert (first.armed, second.armed) == (0, 4)
    answer = bench.call(SetTriggers, "mavlink_parachute/set_triggers", select=4, device="9/9")
    assert not answer.success
    assert "'9/9'" in answer.message
    # In the order in which they were heard, which the network decides.
    assert "1/161" in answer.message
    assert "1/162" in answer.message
    # Without a name it is the one that is still there, whichever was told first.
    bench.unplug(loops[0])
    bench.until(
        lambda: any(s.device == "1/161" and s.link_state == LinkState.LOST for s in statuses),
        "the first is lost",
    )
    answer = bench.call(SetTriggers, "mavlink_parachute/set_triggers", arm=8, select=8)
    assert answer.success, answer.message
    assert (second.armed, answer.armed_triggers) == (12, 12)


def test_another_vehicle_on_the_network_is_neither_heard_nor_fired(bench):
    network = Network(bench, parachute_system_id=1, autopilot_system_id=1)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    states = bench.follow(VehicleState, "vehicle/state")
    others = Module(ParachuteSettings(system_id=2, armed_triggers=12, ground_cleared="yes"))
    stranger = Autopilot(system_id=2)
    network.plug(others)
    network.plug(stranger)
    answer = bench.call(Deploy, "mavlink_parachute/deploy", reason="ours is not there")
    assert not answer.success
    ours = Module()
    network.plug(ours)
    network.plug(Autopilot())
    bench.until(newest(statuses, device="1/161"), "ours is heard")
    bench.until(newest(states, source="1/1"), "our autopilot is heard")
    assert bench.call(Arm, "mavlink_parachute/arm", arm=True).success
    assert bench.call(Deploy, "mavlink_parachute/deploy", reason="a test").success
    assert {s.device for s in statuses} == {"1/161"}
    assert {s.source for s in states} == {"1/1"}
    assert others.commands_heard == stranger.commands_heard == []


def test_a_second_vehicle_where_none_was_named_forbids_take_off(bench, network, capfd):
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    network.plug(Module())
    bench.until(newest(beats, device_healthy=True), "one alone is ours")
    network.plug(Module(ParachuteSettings(system_id=2)))
    bench.until(newest(beats, device_healthy=False), "two make it doubtful")
    assert beats[-1].link_state == LinkState.OK
    log = []

    def told():
        log.append(capfd.readouterr().err)
        return "forbids take-off: " in "".join(log) and "set parachute_system_id" in "".join(log)

    bench.until(told, "the log says why")


# /diagnostics


def tasks(diagnostics):
    """Node and task, without the namespace -> its newest status."""
    found = {}
    for status in (status for array in diagnostics for status in array.status):
        node, _, task = status.name.partition(": ")
        assert "/" in node, "the namespace tells the vehicles apart"
        found[f"{node.rpartition('/')[2]}: {task}"] = status
    return found


def values(status):
    return {pair.key: pair.value for pair in status.values}


def test_diagnostics_say_what_is_missing_and_what_is_there(bench, network):
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    bench.until(lambda: diagnostics, "they come")
    said = tasks(diagnostics)
    assert set(said) == {
        f"mavlink_parachute: {task}"
        for task in (
            "link",
            "parachute",
            "autopilot",
            "kill",
            "signing",
            "supervisor",
            "middleware",
        )
    }
    assert said["mavlink_parachute: link"].level == DiagnosticStatus.WARN
    assert said["mavlink_parachute: parachute"].level == DiagnosticStatus.STALE
    assert said["mavlink_parachute: supervisor"].level == DiagnosticStatus.STALE
    network.plug(Module(ParachuteSettings(errors=8)))
    network.plug(Autopilot())
    name = "mavlink_parachute: parachute 1/161"
    bench.until(lambda: name in tasks(diagnostics), "the parachute has a task of its own")
    bench.until(
        lambda: tasks(diagnostics)["mavlink_parachute: autopilot"].level == DiagnosticStatus.OK,
        "the autopilot is well",
    )
    said = tasks(diagnostics)
    assert said["mavlink_parachute: link"].level == DiagnosticStatus.OK
    assert said["mavlink_parachute: link"].hardware_id == f"udpin:{LOCAL}:0"
    assert int(values(said["mavlink_parachute: link"])["frames received"]) > 0
    assert said[name].level == DiagnosticStatus.ERROR
    assert said[name].message == "LOW_POWER"
    assert said[name].hardware_id == "1/161"


def test_garbage_is_counted_in_diagnostics_and_harms_nothing(bench, network):
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as noise:
        for _ in range(20):
            noise.sendto(b"\xff" * 50, (LOCAL, port_of(network.node.loop)))
    network.plug(Module())
    bench.until(lambda: statuses, "the parachute is heard all the same")

    def counted():
        link = tasks(diagnostics).get("mavlink_parachute: link")
        return link and values(link).get("dropped: bytes that are no MAVLink frame") == "1000"

    bench.until(counted, "each byte is counted")


class GroundStation(Autopilot):
    """Reads the texts for the pilot, chunk by chunk."""

    def __init__(self):
        self.chunks = []
        super().__init__()

    def heard(self, frame):
        if frame.message.get_type() == "STATUSTEXT":
            self.chunks.append((frame.message.id, frame.message.chunk_seq, frame.message.text))
        super().heard(frame)

    @property
    def texts(self):
        """Whole, by their ids."""
        ids = dict.fromkeys(number for number, _, _ in self.chunks)
        return ["".join(text for one, _, text in sorted({*self.chunks}) if one == n) for n in ids]


def test_the_pilot_reads_the_whole_reason_of_a_block_first(bench, network):
    station = GroundStation()
    network.plug(station)
    reason = "battery of the parachute 13.9 V, need 14.0 V; packed 2019-04-01, need 2025 or later"
    block = SafetyDecision(
        epoch=1, id=1, action=SafetyDecision.FLIGHT_BLOCK, rule="links", reasons=[reason]
    )
    block.targets = ["mavlink_parachute"]
    bench.publish(stamped(bench.client, block), "safety/decision", qos.DECISION)
    whole = f"{reason}: flight blocked"
    bench.until(lambda: whole in station.texts, "the whole text is received")


def test_a_busy_port_is_an_error_in_diagnostics_until_it_is_free(bench):
    holder = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    holder.bind((LOCAL, 0))
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    Network(bench, connection=f"udpin:{LOCAL}:{holder.getsockname()[1]}")

    def link():
        return tasks(diagnostics).get("mavlink_parachute: link")

    bench.until(link, "they come")
    assert link().level == DiagnosticStatus.ERROR
    assert "Address already in use" in link().message
    holder.close()
    bench.until(lambda: link().level != DiagnosticStatus.ERROR, "the port is taken")
