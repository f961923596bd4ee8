"""The action safety/deploy_action: the service safety/deploy, with what happens as feedback."""

import time
from contextlib import ExitStack

import pytest
from action_msgs.msg import GoalStatus
from chute_msgs.action import Deploy
from chute_msgs.msg import ActionReport, SafetyDecision, SafetyState
from chute_msgs.srv import Deploy as DeployService
from rclpy.action import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from supervisor_bench import Scene

from chute_ros.model import Action, Outcome
from chute_ros.ros import deploy_action_node
from chute_ros.ros.deploy_action_node import DeployActionNode
from chute_ros.ros.deploy_progress import DeployProgress

KILLING, DEPLOYING, WAITING = (
    Deploy.Feedback.KILLING,
    Deploy.Feedback.DEPLOYING,
    Deploy.Feedback.WAITING,
)
PATIENCE = 20.0


class Caller:
    """The node deploy_action and a client of its action, spun together with the bench."""

    def __init__(self, bench):
        self.bench = bench
        # As the executable has it: ours serves no actions.
        self.executor = SingleThreadedExecutor()
        self.node = DeployActionNode(namespace=bench.namespace)
        self.client_node = Node("caller", namespace=bench.namespace)
        for node in (self.node, self.client_node):
            self.executor.add_node(node)
        self.client = ActionClient(self.client_node, Deploy, "safety/deploy_action")
        self.feedback = []
        self.until(self.client.server_is_ready, "the action is there")
        self.at_end = ExitStack()
        self.at_end.callback(self.close)
        bench.at_end.push(self.at_end)

    def await_service(self):
        self.until(self.node._client.service_is_ready, "the service is there")

    def until(self, condition, what):
        end = time.monotonic() + PATIENCE
        while not (value := condition()):
            assert time.monotonic() < end, f"not within {PATIENCE:g} s: {what}"
            self.executor.spin_once(timeout_sec=0.005)
            self.bench.executor.spin_once(timeout_sec=0.005)
        return value

    def send(self, **fields):
        """A goal that was accepted."""
        goal = Deploy.Goal(**fields)
        sent = self.client.send_goal_async(goal, lambda one: self.feedback.append(one.feedback))
        self.until(sent.done, "it is accepted")
        assert sent.result().accepted
        return sent.result()

    def result(self, goal):
        """(status, result)."""
        asked = goal.get_result_async()
        self.until(asked.done, "there is a result")
        return asked.result().status, asked.result().result

    def close(self):
        self.client.destroy()
        for node in (self.node, self.client_node):
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()


@pytest.fixture
def scene(bench):
    one = Scene(bench)
    one.await_stage(SafetyState.READY)
    return one


@pytest.fixture
def caller(bench, scene):
    one = Caller(bench)
    one.await_service()
    return one


def test_a_deploy_is_told_step_by_step_and_answered_as_the_service_answers(scene, caller):
    """Given a supervisor on the ground, then forced: the kill, the deploy, the status."""
    scene.link.outcomes = [Outcome.SENT, Outcome.ACCEPTED]
    goal = caller.send(force=True, reason="a test")
    caller.until(lambda: caller.feedback and caller.feedback[-1].step == WAITING, "it waits")
    steps = [one.step for one in caller.feedback]
    assert steps == sorted(steps), "one after the other"
    assert set(steps) == {KILLING, DEPLOYING, WAITING}
    texts = [one.text for one in caller.feedback]
    assert texts[0].startswith("kill ordered by rule 'operator' to mavlink_parachute: ")
    assert "mavlink_parachute: kill SENT: by the stub" in texts
    assert any(text.startswith("deploy ordered by rule 'operator' to mavlink_") for text in texts)
    scene.link.report_newest(Action.DEPLOY, Outcome.CONFIRMED)
    status, result = caller.result(goal)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert (result.success, result.accepted) == (True, True)
    assert "by the stub" in result.message
    assert len(scene.decided(Action.DEPLOY)) == 1
    assert len({one.text for one in caller.feedback}) == len(caller.feedback), "each once"


def test_it_passes_the_same_gate_as_the_service(scene, caller):
    """Given a vehicle on the ground, then without force nothing is ordered."""
    status, result = caller.result(caller.send(reason="a slip"))
    by_service = scene.call(DeployService, "deploy", reason="a slip")
    assert status == GoalStatus.STATUS_ABORTED
    assert not result.success
    assert result.message.startswith("refused: ")
    assert result.message == by_service.message
    assert scene.decided(Action.DEPLOY) == scene.decided(Action.KILL) == []
    assert caller.feedback == []


def test_a_cancel_is_refused_and_the_release_goes_on(scene, caller):
    scene.link.outcomes = [Outcome.SENT]
    goal = caller.send(force=True, reason="a test")
    caller.until(lambda: caller.feedback, "it is under way")
    cancelled = goal.cancel_goal_async()
    caller.until(cancelled.done, "the cancel is answered")
    assert list(cancelled.result().goals_canceling) == [], "refused"
    caller.until(lambda: scene.decided(Action.DEPLOY), "the deploy is decided all the same")
    scene.link.report_newest(Action.DEPLOY, Outcome.CONFIRMED)
    status, result = caller.result(goal)
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)


def test_a_caller_that_ends_in_the_middle_takes_nothing_back(scene, caller):
    """Given the client and the action's node end once the order is accepted, then the supervisor
    carries it out, once."""
    scene.link.outcomes = [Outcome.SENT]
    caller.send(force=True, reason="a test")
    caller.until(lambda: caller.feedback, "it is under way")
    caller.at_end.close()
    scene.await_decision(Action.DEPLOY)
    scene.link.report_newest(Action.DEPLOY, Outcome.CONFIRMED)
    scene.await_stage(SafetyState.DEPLOYED)
    assert len(scene.decided(Action.DEPLOY)) == 1


def test_two_callers_at_once_both_get_the_answer(scene, caller):
    scene.link.outcomes = [Outcome.SENT, Outcome.ACCEPTED]
    first, second = (caller.send(force=True, reason=reason) for reason in ("one", "two"))
    caller.until(lambda: scene.decided(Action.DEPLOY), "it is decided")
    scene.link.report_newest(Action.DEPLOY, Outcome.CONFIRMED)
    assert caller.result(first)[1].success
    assert caller.result(second)[1].success
    assert len(scene.decided(Action.DEPLOY)) == 1


def test_without_a_supervisor_nothing_waits_to_be_ordered_later(bench):
    """Given no supervisor, then the goal is aborted at once; one that comes later gets nothing."""
    caller = Caller(bench)
    status, result = caller.result(caller.send(force=True, reason="too early"))
    assert status == GoalStatus.STATUS_ABORTED
    assert result.message == "nothing was ordered: no supervisor offers safety/deploy"
    scene = Scene(bench)
    scene.await_stage(SafetyState.READY)
    caller.await_service()
    assert scene.decided(Action.DEPLOY) == []


def silent_supervisor(bench):
    """A service safety/deploy that never answers, on a node of its own."""
    node = Node("silent", namespace=bench.namespace)
    called = []

    async def never(request, response):
        called.append(request)
        await Future()

    group = ReentrantCallbackGroup()
    node.create_service(DeployService, "safety/deploy", never, callback_group=group)
    bench.executor.add_node(node)
    bench.nodes.append(node)
    return node, called


GONE = (
    "the supervisor that received the order has ended without an answer: safety/state shows what "
    "became of it"
)


def test_a_supervisor_that_ends_before_its_answer_leaves_no_goal_without_one(bench):
    node, called = silent_supervisor(bench)
    caller = Caller(bench)
    caller.await_service()
    goal = caller.send(reason="a test")
    caller.until(lambda: called, "it has the order")
    bench.remove(node)
    status, result = caller.result(goal)
    assert (status, result.message) == (GoalStatus.STATUS_ABORTED, GONE)


def test_nor_does_one_whose_standby_offers_the_service_by_then(bench, monkeypatch):
    monkeypatch.setattr(deploy_action_node, "ANSWER_WITHIN", 0.5)
    _, called = silent_supervisor(bench)
    caller = Caller(bench)
    caller.await_service()
    goal = caller.send(reason="a test")
    status, result = caller.result(goal)
    assert called
    assert (status, result.message) == (GoalStatus.STATUS_ABORTED, GONE)


def test_what_is_no_deploy_is_no_feedback():
    progress = DeployProgress()
    block = SafetyDecision(epoch=1, id=1, action=SafetyDecision.FLIGHT_BLOCK)
    assert progress.decided(block) is None
    assert progress.reported(ActionReport(epoch=1, id=1, action=block.action, outcome=1)) is None
    odd = ActionReport(epoch=1, id=2, action=SafetyDecision.DEPLOY, outcome=200, link="x")
    assert progress.reported(odd).text == "x: deploy NONE: "


def test_a_shadow_decision_is_told_as_one():
    shadow = SafetyDecision(epoch=1, id=1, action=SafetyDecision.DEPLOY, shadow=True, rule="fall")
    assert DeployProgress().decided(shadow).text == (
        "deploy would be ordered by rule 'fall' to no link: "
    )
