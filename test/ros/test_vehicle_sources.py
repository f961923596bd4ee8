"""The topics that the parameters name, over real ROS, and what is told of them."""

import math
import sys

import pytest
from chute_msgs.msg import VehicleState
from geometry_msgs.msg import Quaternion, Vector3
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import BatteryState, Imu, NavSatFix
from std_msgs.msg import Float64, String

from chute_ros import model
from chute_ros.errors import ParameterError
from chute_ros.ros import messages, qos, vehicle_sources
from chute_ros.ros.parameters import declare
from chute_ros.ros.vehicle_sources import TELL_INTERVAL, VehicleSettings, VehicleSources
from chute_ros.settings import parameters_of

ON_LEFT_SIDE = Quaternion(w=math.sqrt(0.5), x=-math.sqrt(0.5), y=0.0, z=0.0)
RELIABLE_AND_BEST_EFFORT = pytest.mark.parametrize(
    "profile", [qos.STATUS, qos_profile_sensor_data], ids=["reliable", "best effort"]
)


class Listener(Node):
    """A node with VehicleSources alone, and a clock that stands still until it is set."""

    def __init__(self, **options):
        super().__init__("listener", **options)
        self.now = 100.0
        self.told, self.disputed, self.told_by = [], frozenset(), None
        limits = {"vehicle_state_age": 2.5, "vehicle_source_rate": 5.0}
        values = {**declare(self, parameters_of(VehicleSettings)), **limits}
        self.sources = VehicleSources(self, values, self.hear, lambda: self.now)

    def hear(self, report, now):
        self.told.append(report.state)
        self.disputed, self.told_by = report.disputed, report.told_by


@pytest.fixture
def listen(bench):
    """listen(*sources, **parameters): a Listener to them."""

    def make(*sources, **parameters):
        if sources:
            parameters["vehicle_sources"] = list(sources)
        return bench.add(Listener, **parameters)

    return make


def falling_on_its_side(frame="odom"):
    message = Odometry(child_frame_id="base_link")
    message.header.frame_id = frame
    message.pose.pose.position.z = 40.0
    message.pose.pose.orientation = ON_LEFT_SIDE
    message.twist.twist.linear = Vector3(x=3.0, y=8.0, z=0.0)
    return message


def level(acceleration=9.81):
    return Imu(linear_acceleration=Vector3(x=0.0, y=0.0, z=acceleration))


def autopilot():
    return VehicleState(
        source="1/1",
        link_state=int(model.LinkState.OK),
        armed=VehicleState.ARMED,
        armed_age=0.5,
        landed_state=VehicleState.IN_AIR,
        height=7.0,
        height_age=0.25,
        tilt=0.125,
        vertical_speed_age=math.nan,
    )


def test_vehicle_state_alone_is_passed_on_unchanged(bench, listen):
    node = listen()
    bench.publish(autopilot(), "vehicle/state")
    (told,) = bench.until(lambda: node.told, "it is told")
    assert repr(told) == repr(messages.vehicle_state_from(autopilot()))


@RELIABLE_AND_BEST_EFFORT
def test_odometry_gives_height_attitude_and_vertical_speed(bench, listen, profile):
    node = listen("odometry", odometry_topic="estimator/odometry")
    bench.publish(falling_on_its_side(), "estimator/odometry", profile)
    (told,) = bench.until(lambda: node.told, "it is told")
    assert told.height == 40.0
    assert told.vertical_speed == pytest.approx(-8.0)
    assert told.tilt == pytest.approx(math.pi / 2)
    assert told.roll == pytest.approx(-math.pi / 2)
    assert told.height_age == told.vertical_speed_age == told.attitude_age == 0.0
    assert told.armed is model.Armed.UNKNOWN
    assert math.isnan(told.armed_age)
    assert (told.source, told.link_state) == ("odometry", model.LinkState.OK)


@RELIABLE_AND_BEST_EFFORT
def test_imu_gives_attitude_and_acceleration(bench, listen, profile):
    node = listen("imu", imu_topic="sensors/imu")
    bench.publish(level(0.5), "sensors/imu", profile)
    (told,) = bench.until(lambda: node.told, "it is told")
    assert (told.acceleration, told.acceleration_age) == (0.5, 0.0)
    assert (told.tilt, told.attitude_age) == (0.0, 0.0)
    assert told.yaw == pytest.approx(math.pi / 2)
    assert math.isnan(told.height)


def test_several_sources_make_one_picture(bench, listen):
    node = listen("vehicle/state", "odometry", "imu")
    bench.publish(autopilot(), "vehicle/state")
    bench.until(lambda: len(node.told) == 1, "vehicle/state is told")
    node.now = 100.5
    bench.publish(falling_on_its_side(), "odometry")
    bench.until(lambda: len(node.told) == 2, "odometry is told")
    node.now = 100.85
    bench.publish(level(0.5), "imu")
    bench.until(lambda: len(node.told) == 3, "the IMU is told")
    told = node.told[-1]
    assert told.source == "vehicle/state, odometry, imu"
    assert (told.armed, told.armed_age) == (model.Armed.ARMED, pytest.approx(1.35))
    # Both gave these; the first one's word is not fresh any more.
    assert (told.height, told.height_age) == (40.0, pytest.approx(0.35))
    assert (told.tilt, told.attitude_age) == (pytest.approx(math.pi / 2), pytest.approx(0.35))
    assert told.vertical_speed == pytest.approx(-8.0)
    assert (told.acceleration, told.acceleration_age) == (0.5, 0.0)


def test_a_silent_autopilot_is_lost_though_a_sensor_goes_on(bench, listen):
    node = listen("vehicle/state", "imu")
    bench.publish(autopilot(), "vehicle/state")
    bench.until(lambda: node.told, "vehicle/state is told")
    assert node.told[-1].link_state is model.LinkState.OK
    node.now = 103.0
    bench.publish(level(), "imu")
    bench.until(lambda: len(node.told) == 2, "the IMU is told")
    assert node.told[-1].link_state is model.LinkState.LOST


def test_what_comes_fast_is_told_together_and_the_last_is_not_lost(bench, listen):
    node = listen("imu")
    bench.publish(level(1.0), "imu")
    bench.until(lambda: node.told, "the first is told")
    node.now += TELL_INTERVAL / 2
    for acceleration in (2.0, 3.0, 4.0):
        bench.publish(level(acceleration), "imu")
    bench.until(lambda: node.told[-1].acceleration == 4.0, "the last is told")
    assert len(node.told) <= 3
    told = len(node.told)
    bench.turns(3 * TELL_INTERVAL)
    assert len(node.told) == told


def test_sources_that_contradict_each_other_are_told_and_logged_once(bench, listen, capfd):
    node = listen("vehicle/state", "imu")
    told, upside_down = autopilot(), level()
    told.attitude_age = 0.0
    upside_down.orientation = Quaternion(x=1.0, w=0.0)
    for n in range(1, 6):
        node.now = 100.0 + n / 10.0
        heard = len(node.told)
        bench.publish(told, "vehicle/state")
        bench.until(lambda heard=heard: len(node.told) > heard, "vehicle/state is told")
        bench.publish(upside_down, "imu")
        bench.until(lambda heard=heard: len(node.told) > heard + 1, "the IMU is told")
    assert node.disputed == {"attitude"}
    assert node.told_by == {"acceleration": "imu"}
    assert capfd.readouterr().err.count("attitude in doubt: another source differs") == 1


@pytest.mark.parametrize(
    ("frame", "child", "told"),
    [
        ("odom_ned", "base_link", "frame 'odom_ned' has its axes pointing down"),
        ("odom", "odom", "child_frame_id 'odom' is no frame of the body"),
    ],
)
def test_odometry_in_other_frames_is_not_used_and_forbids_take_off(
    bench, listen, capfd, frame, child, told
):
    node, wrong = listen("odometry"), falling_on_its_side(frame)
    wrong.child_frame_id = child
    bench.publish(wrong, "odometry")
    bench.until(lambda: told in capfd.readouterr().err, "the first is refused")
    bench.publish(falling_on_its_side(), "odometry")
    bench.until(lambda: node.told, "the second is told")
    assert [one.height for one in node.told] == [40.0]
    assert node.told[0].faults[0].startswith(f"odometry: {told}")


@pytest.mark.parametrize(
    ("sources", "fix"),
    [
        (["vehicle/state", "gps"], "'gps' is wrong"),
        (["imu", "odometry", "imu"], "'imu' is wrong"),
        (["/vehicle/state"], "'/vehicle/state' is wrong"),
        ([], "it is empty"),
    ],
)
def test_a_wrong_source_is_named_with_what_is_allowed(namespace, sources, fix):
    node = Node("wrong", namespace=namespace)
    values = {p.name: p.default for p in parameters_of(VehicleSettings)} | {
        "vehicle_state_age": 2.5
    }
    with pytest.raises(ParameterError) as error:
        VehicleSources(node, {**values, "vehicle_sources": sources}, print)
    node.destroy_node()
    text = str(error.value)
    assert text.startswith(f"parameter vehicle_sources is {sources!r}: need one or more of ")
    assert "vehicle/state, odometry, imu, mavros, each once" in text
    assert text.endswith(fix)


@pytest.mark.parametrize("topic", ["", "a b", "a//b", "{nothing}"])
def test_what_is_no_topic_is_named(listen, topic):
    with pytest.raises(ParameterError) as error:
        listen("imu", imu_topic=topic)
    assert f"parameter imu_topic is {topic!r}: need the name of a topic" in str(error.value)


def test_mavros_topics_of_standard_types(monkeypatch, bench, listen):
    # mavros_msgs itself is rarely there; what its two types say is in test_vehicle_readings.py.
    monkeypatch.setattr(vehicle_sources, "_mavros_messages", lambda: (String, String))
    node = listen("mavros", "odometry")
    bench.publish(falling_on_its_side(), "odometry")
    bench.until(lambda: node.told, "odometry is told")
    assert (node.told[-1].height, node.told[-1].link_state) == (40.0, model.LinkState.NEVER_SEEN)
    fix = NavSatFix(latitude=47.5, longitude=8.5)
    fix.status.status = 0
    bench.publish(Float64(data=12.0), "mavros/global_position/rel_alt")
    bench.publish(fix, "mavros/global_position/global")
    bench.publish(BatteryState(voltage=22.25, percentage=0.5), "mavros/battery")
    bench.until(lambda: node.told[-1].battery_age == 0.0, "the battery is told")
    bench.until(lambda: node.told[-1].position_age == 0.0, "the position is told")
    bench.until(lambda: node.told[-1].height == 12.0, "the height above home is told")
    told = node.told[-1]
    assert (told.latitude, told.longitude) == (47.5, 8.5)
    assert (told.battery_voltage, told.battery_remaining) == (22.25, 0.5)
    assert told.source == "mavros, odometry"


def test_without_mavros_msgs_it_is_said_what_to_install(monkeypatch, listen):
    # None in sys.modules: importing it raises ModuleNotFoundError, installed or not.
    monkeypatch.setitem(sys.modules, "mavros_msgs", None)
    monkeypatch.setitem(sys.modules, "mavros_msgs.msg", None)
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    with pytest.raises(ParameterError) as error:
        listen("imu", "mavros")
    text = str(error.value)
    assert "parameter vehicle_sources names 'mavros', but mavros_msgs cannot be imported" in text
    assert "install ros-jazzy-mavros-msgs, or take 'mavros' out" in text


def test_nobody_needs_mavros_msgs_who_does_not_name_mavros(monkeypatch, bench, listen):
    def imported():
        raise AssertionError("mavros_msgs was asked for")

    monkeypatch.setattr(vehicle_sources, "_mavros_messages", imported)
    listen("vehicle/state", "odometry", "imu")
