"""The supervisor watches itself, and the device nodes watch the supervisor."""

import itertools
import time

import pytest
from chute_msgs.msg import LinkHeartbeat, SafetyState
from chute_msgs.srv import Kill
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mavlink_bench import Autopilot, Module, Network, do
from node_bench import stamped
from supervisor_bench import Scene

from chute_ros.links.mavlink.simulator.parachute_device import ParachuteSettings
from chute_ros.model import Action
from chute_ros.ros.supervisor_health import Health
from chute_ros.runtime import supervisor as runtime
from chute_ros.supervisor import core, inputs


class Watched(Scene):
    """A supervisor whose diagnostics are followed."""

    def __init__(self, bench, **parameters):
        self.diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
        self.beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
        super().__init__(bench, **parameters)
        self.await_stage(SafetyState.READY)

    def itself(self):
        """The newest status of its task `itself`."""
        name = f"{self.bench.namespace.lstrip('/')}/safety_supervisor: itself"
        found = [s for array in self.diagnostics for s in array.status if s.name == name]
        return found[-1] if found else None

    def await_itself(self, level, words):
        self.bench.until(
            lambda: (s := self.itself()) and s.level == level and words in s.message,
            f"it says {words!r} of itself",
        )
        return {pair.key: pair.value for pair in self.itself().values}

    def own_beats(self):
        return [beat for beat in self.beats if beat.supervisor]


def failing(which):
    """The core's update, which fails for the turns that which names."""

    def update(config, state, new, now):
        if which(new):
            raise ZeroDivisionError("a mistake inside")
        return core.update(config, state, new, now)

    return update


def test_an_input_that_the_core_cannot_take_is_left_out_and_reported(bench, monkeypatch):
    scene = Watched(bench)
    scene.await_itself(DiagnosticStatus.OK, "leader")
    poison = failing(lambda new: any(isinstance(one, inputs.ActionReport) for one in new))
    monkeypatch.setattr(runtime, "update", poison)
    scene.link.flying = True
    scene.await_stage(SafetyState.IN_FLIGHT)  # it reports on the release meanwhile
    scene.link.report_newest(Action.FLIGHT_BLOCK_RELEASE, 3)
    values = scene.await_itself(DiagnosticStatus.ERROR, "internal errors")
    assert values["newest internal error"].startswith("left out ActionReport: ZeroDivisionError")
    seen = len(scene.own_beats())
    bench.until(lambda: len(scene.own_beats()) > seen + 3, "the loop goes on")


def test_who_called_for_what_the_core_cannot_take_is_answered(bench, monkeypatch):
    Watched(bench)
    poison = failing(lambda new: any(isinstance(one, inputs.KillRequest) for one in new))
    monkeypatch.setattr(runtime, "update", poison)
    answer = bench.call(Kill, "safety/kill", reason="a test")
    assert not answer.success
    assert "refused: left out KillRequest: ZeroDivisionError" in answer.message


def test_what_fails_beside_the_core_is_reported_and_does_not_end_the_process(bench, monkeypatch):
    scene = Watched(bench)
    monkeypatch.setattr(scene.supervisor.runtime, "_beat", lambda now: 1 / 0)
    values = scene.await_itself(DiagnosticStatus.ERROR, "internal errors")
    told = "a turn was not completed: ZeroDivisionError: division by zero"
    assert values["newest internal error"] == told
    seen = len(scene.own_beats())
    bench.turns(0.5)
    assert len(scene.own_beats()) == seen, "it falls silent"
    monkeypatch.undo()
    bench.until(lambda: len(scene.own_beats()) > seen + 3, "the loop goes on")


def test_a_core_that_fails_without_any_input_falls_silent(bench, monkeypatch):
    scene = Watched(bench)
    monkeypatch.setattr(runtime, "update", failing(lambda new: True))
    bench.until(lambda: scene.supervisor._health.newest, "it has failed")
    scene.supervisor._health.newest = ""
    bench.until(lambda: scene.supervisor._health.newest, "it still looks at the clock")
    silent_since = len(scene.own_beats())
    bench.turns(0.5)
    assert len(scene.own_beats()) == silent_since
    monkeypatch.undo()
    bench.until(lambda: len(scene.own_beats()) > silent_since, "it beats again once it can")


def test_a_late_update_is_reported_and_silence_meanwhile_is_not_held_against_anybody(bench):
    # Longer than a link may be silent, much shorter than vehicle/state may be.
    scene = Watched(
        bench, heartbeat_stale_after=0.7, heartbeat_lost_after=1.4, vehicle_state_age=3.0
    )
    until = time.monotonic() + 1.8
    while time.monotonic() < until:
        pass  # the whole process is held up, the supervisor with it
    values = scene.await_itself(DiagnosticStatus.ERROR, "updates late")
    assert int(values["updates late"]) >= 1
    blocked = [one.block_reasons for one in scene.states[1:] if one.state == SafetyState.BLOCKED]
    assert not blocked


def test_messages_that_a_queue_lost_are_counted_by_topic(bench):
    class Lost:
        total_count_change = 3

    health = Health()
    health.watch("safety/action").message_lost(Lost())
    health.watch("safety/action").message_lost(Lost())
    scene = Watched(bench)
    task = health.task("x", scene.supervisor.runtime, time.monotonic())
    assert task.level == DiagnosticStatus.WARN
    assert {p.key: p.value for p in task.values}["messages lost on safety/action"] == "6"
    health.refused(ValueError("no number"), ())
    for _ in range(60):
        task = health.task("x", scene.supervisor.runtime, time.monotonic())
        assert task.level == DiagnosticStatus.ERROR, "a mistake inside is worse"


class Overseen:
    """mavlink_parachute with a vehicle on the ground, and a supervisor that can fall silent."""

    def __init__(self, bench, **parameters):
        self.bench = bench
        self.autopilot = Autopilot()
        self.network = Network(bench, supervisor_lost_after=0.5, **parameters)
        self.loop = self.network.plug(self.autopilot)
        self.network.plug(Module(ParachuteSettings()))
        self.seq = itertools.count()
        self.speaks = True
        bench.client.create_timer(0.1, self.beat)
        bench.until(lambda: self.watch().silence < 0.5, "it is heard")

    def watch(self):
        return self.network.node.runtime.watch.tell(time.monotonic())

    def beat(self):
        if self.speaks:
            message = LinkHeartbeat(
                link="safety_supervisor", seq=next(self.seq), supervisor=True, device_healthy=True
            )
            self.bench.publish(stamped(self.bench.client, message), "safety/heartbeat")

    def arm(self):
        do(self.bench, self.loop, lambda: self.autopilot.act("arm"))

    def supervisor_task(self, statuses):
        found = [s for array in statuses for s in array.status if s.name.endswith(": supervisor")]
        return found[-1] if found else None


def test_without_its_supervisor_a_node_keeps_the_vehicle_on_the_ground(bench):
    scene = Overseen(bench)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    bench.until(
        lambda: (t := scene.supervisor_task(diagnostics)) and t.level == DiagnosticStatus.OK,
        "the supervisor is heard",
    )
    scene.arm()
    bench.turns(0.3)
    assert scene.autopilot.model.armed, "with a supervisor nobody undoes it"
    scene.speaks = False
    bench.until(lambda: not scene.autopilot.model.armed, "arming is undone")
    task = bench.until(
        lambda: (t := scene.supervisor_task(diagnostics)).level == DiagnosticStatus.ERROR and t,
        "diagnostics say so",
    )
    assert task.message.startswith("silent for")
    scene.speaks = True
    bench.until(
        lambda: scene.supervisor_task(diagnostics).level == DiagnosticStatus.OK, "it is back"
    )
    scene.arm()
    bench.turns(0.3)
    assert scene.autopilot.model.armed, "what was decided last holds again"


@pytest.mark.parametrize("policy", ["hold"])
def test_a_node_that_shall_hold_does_nothing(bench, policy):
    scene = Overseen(bench, on_supervisor_lost=policy)
    bench.until(lambda: scene.watch().silence < 0.5, "the supervisor is heard")
    scene.arm()
    bench.until(lambda: scene.autopilot.model.armed, "it is armed")
    scene.speaks = False
    bench.until(lambda: scene.watch().times_lost, "the supervisor is lost")
    bench.turns(0.5)
    assert scene.autopilot.model.armed


def test_a_supervisor_that_only_looks_on_does_not_count(bench):
    scene = Overseen(bench)
    bench.until(lambda: scene.watch().silence < 0.5, "the leader is heard")
    scene.speaks = False
    for number in range(40):
        follower = LinkHeartbeat(link="b", seq=number, supervisor=True, device_healthy=False)
        bench.publish(stamped(bench.client, follower), "safety/heartbeat")
        if scene.watch().times_lost:
            break
        bench.turns(0.1)
    assert scene.watch().times_lost == 1
