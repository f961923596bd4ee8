"""make sim: the tutorial of docs/guide/simulation.md flown by services alone, and every end."""

import os
import re
import signal
import subprocess
from functools import partial
from pathlib import Path

import pytest
from chute_msgs.msg import ParachuteStatus, SafetyDecision, SafetyState, VehicleState
from command_bench import refused, tool
from node_bench import bench  # noqa: F401
from printing_process import PrintingProcess
from std_srvs.srv import Trigger

from chute_ros.ros import qos
from chute_ros.tools import simulation

PAGE = (Path(__file__).parents[2] / "docs/guide/simulation.md").read_text()
TUTORIAL = (Path(__file__).parents[2] / "docs/guide/tutorial.md").read_text()
#: So high it is after a take-off, m.
HEIGHT = 59.0
STATES = ("READY", "BLOCKED", "IN_FLIGHT", "DEPLOYED", "FAULT")


class Simulation(PrintingProcess):
    """The tool as a process."""

    def __init__(self, *arguments, before=None):
        super().__init__(
            "chute_ros.tools.sim",
            *arguments,
            environment={**os.environ, "PYTHONUNBUFFERED": "1"},
            errors=subprocess.PIPE,
            before=before,
        )

    def box(self):
        """The folder of the black box, as it was told last."""
        return [one.split()[2] for one in self.lines if "  black box   " in one][-1]

    def children(self):
        """Command lines of its children by their process ids."""
        pid = self.process.pid
        found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return {int(one): Path(f"/proc/{one}/cmdline").read_bytes().split(b"\0") for one in found}

    def end(self, number=signal.SIGINT):
        """(exit code, standard error)."""
        code = super().end(number, 60.0)
        errors = self.process.stderr.read()
        self.process.stderr.close()
        return code, errors


@pytest.fixture
def start(bench):  # noqa: F811
    """Start it, and wait until it says how to play."""
    started = []

    def begin(*arguments):
        # The panel has tests of its own.
        one = Simulation("--no-panel", "--namespace", bench.namespace, *arguments)
        started.append(one)
        bench.until(
            lambda: one.said("Ctrl-C ends it all") or one.process.poll() is not None, "READY", 60.0
        )
        return one

    yield begin
    for one in started:
        if one.process.poll() is None:
            one.end()
        print("\n".join(one.lines))  # for whoever reads of a failure


class Player:
    """A person who calls services, and sees what the vehicle and its supervisor publish."""

    def __init__(self, bench):  # noqa: F811
        self.bench = bench
        self.safety = bench.follow(SafetyState, "safety/state", qos.LATCHED)
        self.decided = bench.follow(SafetyDecision, "safety/decision", qos.DECISION)
        self.vehicle = bench.follow(VehicleState, "vehicle/state")
        self.parachute = bench.follow(ParachuteStatus, "parachute/status")

    def call(self, name):
        service = "safety/reset" if name == "reset" else f"sim/{name}"
        return self.bench.call(Trigger, service)

    def rule(self, name):
        (rule,) = [one for one in self.safety[-1].rules if one.name == name]
        return rule

    def blocked_by(self, reason):
        return any(one.startswith(reason) for one in self.safety[-1].block_reasons)

    def await_state(self, name):
        state = getattr(SafetyState, name)
        self.bench.until(
            lambda: self.safety and self.safety[-1].state == state, f"{name} is reached", 30.0
        )

    def leave_ground(self, action):
        """On a busy machine a node may be silent for so long that the supervisor blocks flight
        and disarms the vehicle again: a person then does it once more."""

        def flies():
            state = self.safety[-1].state if self.safety else SafetyState.STARTUP
            if state == SafetyState.READY and self.vehicle[-1].armed != VehicleState.ARMED:
                self.call(action)
            return state == SafetyState.IN_FLIGHT

        self.bench.until(lambda: self.vehicle, "the vehicle is received")
        self.bench.until(flies, f"it flies after {action}", 40.0)

    def do(self, name, state):
        """One row of the tutorial."""
        if state == "refused":
            # sim_bench may hear of the block a moment after us; the supervisor disarms meanwhile.
            self.bench.until(lambda: not self.call(name).success, "it is refused")
            assert self.call(name).message.startswith("the supervisor blocks flight: ")
            assert self.vehicle[-1].height < 1.0
            return
        if name == "reset":  # which is refused until the vehicle is seen on the ground
            self.bench.until(lambda: self.call(name).success, "it may be reset")
        else:
            answer = self.call(name)
            assert answer.success, answer.message
        self.await_state(state)
        if name == "cut_parachute_link":
            # Right after a reset the supervisor blocks flight for a moment for another reason.
            self.bench.until(lambda: self.blocked_by("mavlink_parachute: its device is "), name)
        if name == "take_off":
            heights = self.vehicle
            self.bench.until(lambda: heights and heights[-1].height > HEIGHT, "it is up", 40.0)


def tutorial():
    """(action, state, what is seen) of each step."""
    found = re.search(r"<!-- tutorial: .*?-->\n(.*?)<!-- end of tutorial -->", PAGE, re.S)
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \| (\w+) \| (.+) \|$", found[1], re.M)
    assert [int(row[0]) for row in rows] == list(range(1, len(rows) + 1))
    assert len(rows) == found[1].count("\n") - 2
    assert {row[2] for row in rows} <= {*STATES, "refused"}
    return [row[1:] for row in rows]


@pytest.mark.long
def test_the_tutorial_is_flown_by_services_alone_as_it_is_told(start, bench):  # noqa: F811
    simulation = start()
    player = Player(bench)
    before = 0
    for step, (name, state, _) in enumerate(tutorial(), 1):
        print(f"step {step}: {name}, {state}")  # for whoever reads of a failure
        if name == "fail_motor":
            before = len(player.decided)
        player.do(name, state)
        if name == "make_height_lie":
            bench.until(lambda: player.vehicle[-1].height > HEIGHT + 20.0, "its height runs away")
            assert player.safety[-1].state == SafetyState.IN_FLIGHT
        elif name == "wind":
            bench.until(lambda: abs(player.vehicle[-1].vertical_speed) > 0.3, "a gust moves it")
            bench.turns(3.0)
            assert player.safety[-1].state == SafetyState.IN_FLIGHT
        elif name == "cut_vehicle_link":
            bench.until(lambda: player.rule("autopilot lost").latched, "the rule warns")
            assert player.safety[-1].unusable
        elif (name, state) == ("fail_motor", "DEPLOYED"):
            actions = [one.action for one in player.decided[before:]]
            kill, deploy = SafetyDecision.KILL, SafetyDecision.DEPLOY
            assert actions.index(kill) < actions.index(deploy)
            bench.until(lambda: player.vehicle[-1].vertical_speed < -6.5, "it falls")
            bench.until(lambda: player.vehicle[-1].vertical_speed > -6.5, "the canopy carries")
            assert player.vehicle[-1].height > 10.0
            bench.until(
                lambda: player.vehicle[-1].landed_state == VehicleState.ON_GROUND,
                "it has landed",
                40.0,
            )
            assert player.parachute[-1].deployed
        elif (name, state) == ("fail_motor", "FAULT"):
            bench.until(
                lambda: any("no parachute confirmed" in one for one in player.safety[-1].alarms),
                "its alarm",
            )
            assert not player.parachute[-1].deployed
    assert simulation.said("DEPLOY CONFIRMED")
    assert simulation.said("DEPLOY REFUSED")
    children = simulation.children()
    assert len(children) == 5
    begun = simulation.box()
    assert simulation.end() == (130, "sim: interrupted\n")
    assert not [one for one in children if Path(f"/proc/{one}").exists()]
    # The last step of docs/guide/tutorial.md, with the folder that the terminal names.
    box = simulation.box()
    assert box == begun
    assert Path(box).stat().st_mode & 0o777 == 0o700
    assert "\nreport FOLDER " in TUTORIAL
    code, out, err = tool("report", box)
    assert code == 0, err
    # A machine that is busy takes so long that its progress is told.
    assert all(line.startswith("replaying: ") for line in err.splitlines())
    page = Path(out.strip()).read_text()
    assert "DEPLOY" in page
    assert "free fall" in page


def test_one_that_is_ended_as_the_background_job_of_a_script_says_so(bench):  # noqa: F811
    """Its shell has taken SIGINT from it; rclpy takes it all the same."""
    simulation = Simulation(
        *("--no-panel", "--namespace", bench.namespace),
        before=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )
    bench.until(lambda: simulation.said("Ctrl-C ends it all"), "READY", 60.0)
    assert simulation.end() == (130, "sim: interrupted\n")


@pytest.mark.parametrize(
    ("arguments", "nodes", "simulators", "action"),
    [
        (("--vehicle", "rocket"), "umbilical", "sim_flight_computer", "launch"),
        (
            ("--parachute", "both"),
            "mavlink_parachute, upf_can",
            "sim_autopilot, sim_mavlink_parachute, sim_upf",
            "take_off",
        ),
        (
            ("--parachute", "relay"),
            "mavlink_parachute, relay",
            "sim_autopilot, sim_relay",
            "take_off",
        ),
    ],
    ids=["rocket", "both", "relay"],
)
def test_each_vehicle_is_started_flies_and_ends_on_a_termination_without_a_trace(
    arguments,
    nodes,
    simulators,
    action,
    start,
    bench,  # noqa: F811
):
    simulation = start(*arguments)
    assert simulation.said(f"nodes       {nodes}, safety_supervisor, sim_bench")
    assert simulation.said(f"simulators  {simulators}")
    assert simulation.said(f"    {action} ")
    assert simulation.said(f"--namespace {bench.namespace} --do {action}")
    player = Player(bench)
    player.leave_ground(action)
    children = simulation.children()
    (folder,) = {
        one.decode().removeprefix("folder:=")
        for words in children.values()
        for one in words
        if one.startswith(b"folder:=")
    }
    assert os.stat(folder).st_mode & 0o777 == 0o700
    code, errors = simulation.end(signal.SIGTERM)
    # rclpy of Kilted may add that a handler of its own was never awaited.
    assert (code, errors.partition("\n")[0]) == (130, "sim: interrupted")
    assert "Traceback" not in errors
    assert not [one for one in children if Path(f"/proc/{one}").exists()]
    assert not Path(folder).exists()


run = partial(tool, "sim")


def test_do_prints_what_is_done_and_a_process_that_ends_by_itself_ends_all(start, bench):  # noqa: F811
    simulation = start()
    namespace = ("--namespace", bench.namespace)
    code, out, err = run(*namespace, "--do", "refuse_to_open")
    assert (code, err) == (0, "")
    assert out.startswith("The parachute does not open")
    code, out, err = run(*namespace, "--do", "launch")
    assert (code, out) == (1, "")
    assert f"sim: launch: {bench.namespace}/sim/launch is not offered within 10 s: start" in err
    code, errors = start().end()
    assert code == 1
    assert f"sim: a vehicle runs in {bench.namespace} already: end it, or give this" in errors
    # When a simulator is killed, then its last words are told.
    children = simulation.children()
    (autopilot,) = [
        pid for pid, words in children.items() if b"chute_ros.sim.sim_autopilot" in words
    ]
    os.kill(autopilot, signal.SIGKILL)
    bench.until(lambda: simulation.process.poll() is not None, "it ends", 30.0)
    code, errors = simulation.end()
    assert code == 1
    assert errors.startswith("sim: sim_autopilot ended with code -9:")
    assert not [one for one in children if Path(f"/proc/{one}").exists()]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--vehicle", "boat"), "invalid choice: 'boat'"),
        (("--parachute", "umbilical"), "invalid choice: 'umbilical'"),
        (("--vehicle", "rocket", "--parachute", "upf"), "--parachute upf is of a drone"),
        (("--port", "0"), "port '0': need a whole number from 1 to 65535"),
        (("--port", "web"), "port 'web': need a whole number from 1 to 65535"),
        (("--namespace", "sim car"), "namespace 'sim car': need / and a name of letters"),
        (("--do", "explode"), "invalid choice: 'explode'"),
    ],
)
def test_a_mistake_is_told_in_one_line(arguments, said, monkeypatch, capsys):
    out, err = refused(simulation, monkeypatch, capsys, *arguments)
    assert out == ""
    assert said in err.splitlines()[-1]


@pytest.mark.parametrize("arguments", [("--no-panel",), ("--do", "take_off")])
def test_so_is_a_domain_that_is_none(arguments):
    code, out, err = run(*arguments, ROS_DOMAIN_ID="abc")
    assert (code, out) == (2, "")
    assert err == "sim: ROS_DOMAIN_ID is 'abc': need a whole number from 0 to 232\n"


def test_where_nothing_can_be_kept_nothing_starts():
    code, out, err = run("--no-panel", ROS_HOME="/proc/nowhere")
    assert (code, out) == (2, "")
    assert err.startswith("sim: /proc/nowhere/chute_ros/simulations: ")
    assert err.endswith(": set ROS_HOME\n")
