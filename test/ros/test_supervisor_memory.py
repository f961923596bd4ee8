"""A supervisor without a standby is killed in flight and started again; what it left in a file."""

import json
import math
import signal
import stat

import pytest
from chute_msgs.msg import ParachuteStatus, SafetyState
from chute_msgs.srv import Deploy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Quaternion, Vector3
from node_bench import stamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger
from supervisor_bench import Scene

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.ros import qos

ALONE = {"hot_standby": False, "kill_to_deploy_delay": 3.0}


def flying(pair, **parameters):
    pair.start("a", 0, **(ALONE | parameters))
    pair.await_stage(SafetyState.READY)
    pair.link.flying = True
    pair.await_stage(SafetyState.IN_FLIGHT)
    return pair


def kill_and_start_again(pair, **parameters):
    pair.send_signal("a", signal.SIGKILL)
    pair.processes.end()
    pair.bench.turns(0.2)  # what it had said is heard
    pair.claims.clear()
    pair.start("a", 0, **(ALONE | parameters))
    pair.bench.until(lambda: "a" in pair.claims, "it is back")


def the_file(pair, folder="resume"):
    folder = pair.processes.ros_home / "chute_ros" / folder
    return pair.bench.until(lambda: list(folder.glob("*.json")), "something is kept")[0]


def killed_motors(pair):
    """A deploy was asked for; the kill is out and not confirmed, the deploy not due yet."""
    pair.link.outcomes = [Outcome.SENT]
    pair.bench.ask(Deploy, "safety/deploy", reason="it falls")
    pair.bench.until(lambda: pair.acted(Action.KILL), "the kill leaves")
    # Without motors it says that it stands, which no supervisor that starts now doubts.
    pair.link.flying = False
    pair.bench.until(
        lambda: json.loads(the_file(pair).read_text())["state"]["kill"], "the kill is remembered"
    )


def test_the_deploy_that_follows_the_kill_is_not_lost(pair):
    flying(pair)
    killed_motors(pair)
    first = pair.epoch("a")
    kill_and_start_again(pair)
    assert pair.epoch("a") > first
    pair.bench.until(lambda: pair.acted(Action.DEPLOY), "the deploy leaves")
    assert pair.acted(Action.DEPLOY) == [(pair.epoch("a"), pair.acted(Action.DEPLOY)[0][1])]
    assert "continuing the interrupted flight: KILLING" in pair.processes.tail("a", 40)


def test_an_autopilot_that_falls_silent_meanwhile_is_lost_and_not_never_seen(pair):
    """Given an IMU that outlives it, and tells the fall from the restart on."""
    sources = {"profile": "multirotor", "vehicle_sources": ["vehicle/state", "imu"]}
    flying(pair, **sources)
    the_file(pair)
    node = pair.bench.client
    on_its_side = Quaternion(w=math.sqrt(0.5), x=math.sqrt(0.5), y=0.0, z=0.0)
    imus = node.create_publisher(Imu, f"{pair.bench.namespace}/imu", qos_profile_sensor_data)

    def fall():
        message = Imu(orientation=on_its_side, linear_acceleration=Vector3(z=7.0))
        message.header.frame_id = "base_link"
        imus.publish(message)

    pair.link.telling = False
    kill_and_start_again(pair, **sources)
    timer = node.create_timer(0.05, fall)
    # Of a vehicle that was never seen high enough, the motors alone are stopped.
    kills = pair.bench.until(
        lambda: [one for one in pair.decisions if one.action == Action.KILL], "a kill is decided"
    )
    node.destroy_timer(timer)
    assert kills[0].rule == "autopilot lost and falling"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"resume_within": 0.0}, ""),
        ({"deploy_timeout": 19.0}, "the parameters or the profile have changed since"),
    ],
)
def test_one_that_was_set_otherwise_starts_anew(pair, changed, words):
    flying(pair)
    killed_motors(pair)
    kill_and_start_again(pair, **changed)
    pair.await_stage(SafetyState.READY)
    assert pair.acted(Action.DEPLOY) == []
    assert words in pair.processes.tail("a", 40)


def test_a_damaged_file_is_said_and_the_flight_goes_on(pair):
    flying(pair)
    path = the_file(pair)
    # It hangs, and writes nothing meanwhile.
    pair.send_signal("a", signal.SIGSTOP)
    path.write_bytes(path.read_bytes()[:100])
    kill_and_start_again(pair)
    pair.await_stage(SafetyState.IN_FLIGHT)
    assert "ignoring the saved state" in pair.processes.tail("a", 60)


def test_the_file_is_ours_alone_and_goes_with_the_landing(pair):
    flying(pair)
    path = the_file(pair)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    pair.link.flying = False
    pair.await_stage(SafetyState.READY)
    pair.bench.until(lambda: not path.exists(), "there is nothing to go on with")


def test_where_nothing_can_be_written_diagnostics_say_so(bench, monkeypatch):
    nowhere = bench.folder / "a_file"
    nowhere.write_text("no folder")
    monkeypatch.setenv("ROS_HOME", str(nowhere))
    scene = Scene(bench, profile="by_hand", black_box=False)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    scene.await_stage(SafetyState.READY)
    scene.link.flying = True
    scene.await_stage(SafetyState.IN_FLIGHT)

    def warned():
        every = (status for array in diagnostics for status in array.status)
        mine = [s for s in every if s.name.endswith("safety_supervisor: memory")]
        return [s for s in mine if s.level == DiagnosticStatus.WARN]

    task = bench.until(warned, "it is told")[-1]
    assert task.message.startswith("a restart in flight would lose it: [Errno 17]")
    assert str(nowhere) in task.message


RELEASED = "mavlink_parachute 1/161 was released: repack or replace it, then call safety/reset"


def tells(pair, stage, deployed=False, armed=False):
    """Its parachute says so, until the supervisor is there."""
    client, topic = pair.bench.client, f"{pair.bench.namespace}/parachute/status"
    publisher = client.create_publisher(ParachuteStatus, topic, qos.STATUS)
    message = ParachuteStatus(
        link="mavlink_parachute", device="1/161", link_state=int(LinkState.OK)
    )
    message.deployed, message.armed = deployed, armed

    def there():
        publisher.publish(stamped(client, message))
        return pair.states and pair.states[-1].state == stage

    pair.bench.until(there, f"the stage is {stage}")
    client.destroy_publisher(publisher)


def told_and_kept(pair, stage, kind, **said):
    """On the ground the parachute tells this: the file in which it is kept."""
    pair.start("a", 0, **ALONE)
    pair.await_stage(SafetyState.READY)
    tells(pair, stage, **said)
    return the_file(pair, kind)


def start_again_set_otherwise(pair, path, damaged):
    pair.send_signal("a", signal.SIGSTOP)
    if damaged:
        path.write_text("[[")
    kill_and_start_again(pair, deploy_timeout=19.0)
    pair.states.clear()


@pytest.mark.parametrize("damaged", [False, True])
def test_what_was_released_on_the_ground_outlives_every_restart_until_a_reset(pair, damaged):
    path = told_and_kept(pair, SafetyState.BLOCKED, "released", deployed=True)
    start_again_set_otherwise(pair, path, damaged)
    # Given a module that started anew too
    tells(pair, SafetyState.BLOCKED)
    # A heartbeat may be late, which is a reason of its own.
    alone = pair.bench.until(
        lambda: [one for one in pair.states if len(one.block_reasons) == 1], "nothing else blocks"
    )
    (reason,) = alone[-1].block_reasons
    if damaged:
        assert str(path) in reason
        assert "cannot read what was released before this start" in pair.processes.tail("a", 40)
    else:
        assert reason == RELEASED
    assert pair.bench.call(Trigger, "safety/reset").success
    tells(pair, SafetyState.READY)
    pair.bench.until(lambda: not path.exists(), "it is forgotten")


@pytest.mark.parametrize("damaged", [False, True])
def test_one_that_was_armed_as_its_node_died_is_told_whatever_starts_anew(pair, damaged):
    path = told_and_kept(pair, SafetyState.ARMED, "armed", armed=True)
    pair.link.beating = False
    pair.await_stage(SafetyState.BLOCKED)
    start_again_set_otherwise(pair, path, damaged)
    pair.await_stage(SafetyState.BLOCKED)
    told = pair.states[-1].state_text
    unknown = f"a parachute that is not known ({path} is damaged)"
    which = unknown if damaged else "mavlink_parachute 1/161"
    assert f"ARMED when it was last received: {which}" in told
    # Of a node that is dead a reset learns nothing.
    assert pair.bench.call(Trigger, "safety/reset").success
    if damaged:
        pair.bench.until(lambda: not path.exists(), "what nobody knows is forgotten")
    else:
        pair.link.beating = True
        tells(pair, SafetyState.READY)
        pair.bench.until(lambda: not path.exists(), "it says otherwise")
