"""Two supervisors were given one name: the second refuses, and the first one's flight is kept."""

import os
import signal

import pytest
from chute_msgs.msg import SafetyState, SupervisorLease
from chute_msgs.srv import Kill
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from supervisor_bench import Scene
from supervisor_processes import QUICK

from chute_ros.errors import NameTakenError
from chute_ros.model import Action
from chute_ros.ros.one_of_a_name import NameLock
from chute_ros.tools.processes import ProcessEndedError

ALONE = {"hot_standby": False}


def start_namesake(pair, processes, **parameters):
    """Another supervisor called a."""
    told = [
        part
        for key, value in (QUICK | {"rank": 0} | parameters).items()
        for part in ("-p", f"{key}:={str(value).lower()}")
    ]
    names = ("-r", f"__ns:={pair.bench.namespace}", "-r", "__node:=a")
    module = "chute_ros.ros.safety_supervisor"
    processes.start("namesake", module, "--ros-args", *names, *told)


def refusal(pair, processes):
    """What one said that ended by itself."""

    def said():
        try:
            processes.check()
        except ProcessEndedError as error:
            return str(error)
        return ""

    return pair.bench.until(said, "the namesake ends")


def flying(pair):
    pair.start("a", 0, **ALONE)
    pair.await_stage(SafetyState.READY)
    pair.link.flying = True
    pair.await_stage(SafetyState.IN_FLIGHT)
    folder = pair.processes.ros_home / "chute_ros" / "resume"
    return pair.bench.until(lambda: list(folder.glob("*.json")), "its state is kept")[0]


def still_leads(pair, epoch):
    """Asked by a person, it decides, and its device obeys."""
    assert pair.bench.call(Kill, "safety/kill", reason="stop").success
    assert pair.acted(Action.KILL)[0][0] == epoch


@pytest.mark.parametrize("parameters", [ALONE, {"hot_standby": True, "rank": 1}], ids=str)
def test_on_one_computer_the_second_refuses_before_it_says_anything(pair, parameters):
    kept = flying(pair)
    epoch, states = pair.epoch("a"), len(pair.states)
    other = pair.elsewhere(pair.bench.folder)
    other.ros_home = pair.processes.ros_home
    start_namesake(pair, other, **parameters)
    said = refusal(pair, other)
    assert "ended with code 2" in said
    assert f"{pair.bench.namespace.lstrip('/')}/a runs already, as process " in said
    assert "give this one a name (-r __node:=NAME), a rank and hot_standby of its own" in said
    assert kept.is_file(), "the state of the living one is its own"
    assert {one.epoch for one in pair.states[states:]} <= {epoch}
    still_leads(pair, epoch)


def test_one_that_hangs_keeps_its_name_and_one_that_was_killed_does_not(pair):
    flying(pair)
    first = pair.epoch("a")
    pair.send_signal("a", signal.SIGSTOP)
    other = pair.elsewhere(pair.bench.folder)
    other.ros_home = pair.processes.ros_home
    start_namesake(pair, other, **ALONE)
    assert "ended with code 2" in refusal(pair, other)
    pair.send_signal("a", signal.SIGKILL)
    pair.claims.clear()
    pair.start("a", 0, **ALONE)
    assert pair.epoch("a") > first
    pair.await_stage(SafetyState.IN_FLIGHT)
    assert "continuing the interrupted flight: IN_FLIGHT" in pair.processes.tail("a", 40)


@pytest.mark.parametrize("parameters", [ALONE, {"hot_standby": True}], ids=str)
def test_on_another_computer_the_second_refuses_once_it_hears_the_first(
    pair, tmp_path, parameters
):
    """Two computers share no file: they are told apart by what their leases say."""
    kept = flying(pair)
    pair.bench.until(
        lambda: "a" in pair.claims and pair.claims["a"][1].running > 3.0, "it was first for sure"
    )
    elsewhere = pair.elsewhere(tmp_path)
    start_namesake(pair, elsewhere, **parameters)
    said = refusal(pair, elsewhere)
    assert "ended with code 2" in said
    assert "another supervisor called a runs for " in said
    assert kept.is_file()
    pair.bench.until(lambda: pair.leads("a"), "the first one leads")
    pair.await_stage(SafetyState.IN_FLIGHT)
    assert pair.bench.call(Kill, "safety/kill", reason="stop").success
    assert pair.acted(Action.KILL)
    pair.processes.check()


@pytest.mark.parametrize("flies", [False, True])
def test_a_forged_claim_of_its_name_ends_no_supervisor_that_is_at_work(bench, flies):
    """It says so, as two that lead are no less bad for being forged."""
    scene = Scene(bench, profile="by_hand")
    scene.await_stage(SafetyState.READY)
    name = scene.supervisor.get_name()
    if flies:
        scene.link.flying = True
        scene.await_stage(SafetyState.IN_FLIGHT)
    else:
        scene.supervisor.runtime.lease._started -= 60.0
    said = bench.follow(DiagnosticArray, "/diagnostics")

    def told():
        for _ in range(3):
            bench.publish(
                SupervisorLease(name=name, instance="forged", running=float("inf")), "safety/lease"
            )
        every = [one for array in said for one in array.status if one.name.endswith(": itself")]
        return [one for one in every if "is called" in one.message]

    (first, *_) = bench.until(told, "it is said")
    assert first.level == DiagnosticStatus.ERROR
    assert f"another supervisor is called {name} as well: end one" in first.message
    assert scene.supervisor.runtime.lease.leading


def test_a_name_is_free_again_when_its_lock_is_closed(tmp_path):
    path = tmp_path / "resume" / "a.lock"
    first = NameLock(path, "a")
    with pytest.raises(NameTakenError, match=f"as process {os.getpid()}, which holds"):
        NameLock(path, "a")
    first.close()
    assert NameLock(path, "a").trouble == ""
    assert path.read_text().strip() == str(os.getpid())
    assert path.stat().st_mode & 0o777 == 0o600


def test_where_no_lock_can_be_it_is_said_and_the_supervisor_starts_all_the_same(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "link.lock").symlink_to(tmp_path / "elsewhere")
    os.mkfifo(tmp_path / "pipe.lock")
    for name in ("file/a.lock", "link.lock", "pipe.lock"):
        assert str(tmp_path / name) in NameLock(tmp_path / name, "a").trouble
    assert not (tmp_path / "elsewhere").exists()
