"""The stories that every device node must pass, whatever its link.

A test module of a link subclasses DeviceSuite and says in make how its simulated device is plugged
in; one whose device tells nothing subclasses NodeSuite. The names and texts below are the contract
of all links.
"""

from collections.abc import Callable
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    PersonRequest,
    SafetyDecision,
    SafetyState,
)
from chute_msgs.srv import Arm, Deploy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_bench import Bench, stamped
from simulated_device import SimulatedDevice

from chute_ros.model import Action, LinkState, Outcome, ParachuteState
from chute_ros.ros import link_log, qos
from chute_ros.ros.messages import seconds

#: Parameters of every device node, quickened.
HEARTBEAT_RATE = 50.0


class NodeSuite:
    """Inherit, name the node, and give it a device: what holds for any device."""

    #: Tasks of diagnostics that do not rest on what the link says of its device.
    OF_OURS = ("link", "supervisor", "middleware")
    #: The node's name, which is its link's name as well.
    name: str
    #: The state of a link that is as it should be.
    alive = LinkState.OK
    #: What is reported of a deploy that was decided.
    steps: tuple[Outcome, ...]

    def make(self, bench: Bench, **parameters: Any) -> SimulatedDevice:
        """Start the node with short limits (stale 0.4 s, lost 0.8 s); its device, unplugged."""
        raise NotImplementedError

    # -- what the stories say -----------------------------------------------------------------

    @pytest.fixture
    def device(self, bench: Bench) -> SimulatedDevice:
        self.bench = bench
        self.beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
        self.statuses = bench.follow(ParachuteStatus, "parachute/status")
        self.reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
        self.numbers = iter(range(1, 1000))
        return self.make(bench, heartbeat_rate=HEARTBEAT_RATE)

    def ready_to_deploy(self, device: SimulatedDevice) -> None:
        """Plug it in, and do what a deploy needs."""
        raise NotImplementedError

    def await_link(self, state: LinkState) -> None:
        self.bench.until(
            lambda: self.beats and self.beats[-1].link_state == state, f"the link is {state.name}"
        )

    def decide(self, action: Action, **fields: Any) -> SafetyDecision:
        """Publish a decision as the supervisor would."""
        age = fields.pop("age", 0.0)
        values = {"epoch": 1, "id": next(self.numbers), "targets": [self.name]} | fields
        message = SafetyDecision(action=int(action), rule="test", reasons=["a test"], **values)
        stamped(self.bench.client, message, age)
        self.bench.publish(message, "safety/decision", qos.DECISION)
        return message

    def beat(self, age: float) -> None:
        """Publish a heartbeat as the supervisor would."""
        message = LinkHeartbeat(link="safety_supervisor", supervisor=True, device_healthy=True)
        stamped(self.bench.client, message, age)
        self.bench.publish(message, "safety/heartbeat")

    def picture(self, age: float, heard: Time) -> None:
        """Publish its picture, in which this was the stamp of the node's newest heartbeat."""
        message = SafetyState(
            supervisor="safety_supervisor", links=[self.name], link_stamps=[heard]
        )
        stamped(self.bench.client, message, age)
        self.bench.publish(message, "safety/state", qos.LATCHED)

    def told_in_diagnostics(self) -> Callable[[str, float], None]:
        """Waits until diagnostics tell this value under this key."""
        diagnostics = self.bench.follow(DiagnosticArray, "/diagnostics")

        def await_told(key: str, value: float) -> None:
            def told() -> bool:
                every = [status for array in diagnostics for status in array.status]
                values = [p.value for s in every for p in s.values if p.key == key]
                return bool(values) and abs(float(values[-1]) - value) < 0.5

            self.bench.until(told, f"diagnostics tell {key!r}: {value}")

        return await_told

    def await_report(self, outcome: Outcome, decision: SafetyDecision) -> ActionReport:
        order = (decision.epoch, decision.id)

        def found() -> ActionReport | None:
            matching = (r for r in self.reports if (r.epoch, r.id) == order)
            return next((r for r in matching if r.outcome == outcome), None)

        return self.bench.until(found, f"{outcome.name} is reported")

    def test_its_heartbeat_is_numbered_and_signed(self, device):
        self.bench.until(lambda: len(self.beats) >= 5, "it beats")
        numbers = [beat.seq for beat in self.beats]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        assert {beat.link for beat in self.beats} == {self.name}
        assert not any(beat.supervisor for beat in self.beats)

    @pytest.mark.parametrize("what", ["update", "next_deadline"])
    def test_a_node_whose_link_fails_inside_gives_no_sign_of_life(self, device, what, monkeypatch):
        self.ready_to_deploy(device)
        node = next(one for one in self.bench.nodes if one.get_name() == self.name)
        diagnostics = self.bench.follow(DiagnosticArray, "/diagnostics")

        def levels() -> dict[str, tuple[bytes, str]]:
            every = [status for array in diagnostics[-1:] for status in array.status]
            told = [one for one in every if f"/{self.name}: " in one.name]
            assert len({one.name for one in told}) == len(told), "each task once"
            return {one.name.rpartition(": ")[2]: (one.level, one.message) for one in told}

        def broken(*_: Any) -> None:
            raise RuntimeError("a mistake of ours")

        monkeypatch.setattr(node.loop.link, what, broken)
        self.bench.until(lambda: node._loop_faults > 0, "it fails")
        self.bench.turns(0.2)  # what was under way has come
        told, faults = len(self.beats), node._loop_faults
        self.bench.until(lambda: node._loop_faults > faults + 2, "it goes on failing")
        assert len(self.beats) == told
        self.bench.until(
            lambda: levels().get("link", ("", ""))[1].startswith("the link's thread has not run"),
            "diagnostics tell it",
        )
        rest = {task: one for task, one in levels().items() if task not in self.OF_OURS}
        assert rest
        assert {level for level, _ in rest.values()} == {DiagnosticStatus.STALE}
        assert all(text.startswith("not known now; was: ") for _, text in rest.values())
        monkeypatch.undo()
        self.bench.until(lambda: len(self.beats) > told, "it is received again")
        self.await_link(self.alive)

    def test_a_node_that_has_just_started_is_not_told_to_hang(self, device, monkeypatch):
        self.bench.until(lambda: self.beats, "its link runs")
        node = next(one for one in self.bench.nodes if one.get_name() == self.name)
        told: list[DiagnosticStatus] = []
        monkeypatch.setattr(
            node.diagnostics_publisher, "publish", lambda _, each: told.extend(each)
        )
        monkeypatch.setattr(node.runtime, "summary", None)  # as before its first heartbeat
        node._diagnose()
        assert told == []

    def test_a_decision_to_deploy_is_carried_out_once_and_each_step_reported(self, device):
        self.ready_to_deploy(device)
        decision = self.decide(Action.DEPLOY)
        self.await_report(self.steps[-1], decision)
        self.bench.until(lambda: device.deployed, "it is out")
        # On a machine that stands still for a moment it is sent again: the same step once more.
        outcomes = list(dict.fromkeys(report.outcome for report in self.reports))
        assert outcomes == list(self.steps)
        assert {report.link for report in self.reports} == {self.name}
        assert {report.action for report in self.reports} == {Action.DEPLOY}
        assert all(report.detail for report in self.reports)
        # When it comes again, then it is reported again and not fired twice.
        for _ in range(3):
            self.reports.clear()
            self.decide(Action.DEPLOY, id=decision.id)
            assert self.await_report(self.steps[-1], decision).action == Action.DEPLOY
        assert device.commands_to_deploy() == 1

    def test_a_decision_that_is_not_for_it_now_is_not_acted_on(self, device):
        """For another, for nobody, in shadow, old, from the future."""
        self.ready_to_deploy(device)
        targets: list[dict[str, Any]] = [{"targets": ["another_link"]}, {"targets": []}]
        for fields in (*targets, {"shadow": True}, {"age": 30.0}, {"age": -30.0}):
            self.decide(Action.DEPLOY, **fields)
            # What follows comes after it on the same topic: once it is done, so is the judgement.
            self.await_report(Outcome.CONFIRMED, self.decide(Action.FLIGHT_BLOCK_RELEASE))
            assert not device.deployed, fields
            assert device.commands_to_deploy() == 0, fields

    def test_a_wall_clock_that_is_set_makes_no_decision_older(self, device):
        self.ready_to_deploy(device)
        await_told = self.told_in_diagnostics()
        ages = [0.0]
        self.beat(ages[0])
        self.bench.client.create_timer(0.1, lambda: self.beat(ages[0]))
        await_told("heartbeat age (s)", 0.0)
        # Forward, and then back beyond where it was.
        for count, step in enumerate((3600.0, -3600.0), start=1):
            self.decide(Action.DEPLOY, age=step)
            await_told("decisions: came too late", count)
            await_told("clock set by (s)", ages[0])
            ages[0] = step
            await_told("clock set by (s)", step)
            released = self.decide(Action.FLIGHT_BLOCK_RELEASE, age=step)
            self.await_report(Outcome.CONFIRMED, released)
        self.await_report(self.steps[-1], self.decide(Action.DEPLOY, age=step))
        self.bench.until(device.commands_to_deploy, "it comes over the wire")
        assert device.commands_to_deploy() == 1

    def test_an_answer_of_the_supervisor_shows_that_its_clock_is_behind(self, device):
        """Given a node that was started anew on a host whose clock is an hour ahead."""
        behind = 3600.0
        self.ready_to_deploy(device)
        await_told = self.told_in_diagnostics()
        self.beat(behind)
        self.bench.client.create_timer(0.1, lambda: self.beat(behind))
        await_told("heartbeat age (s)", 0.0)
        self.picture(behind, Time(sec=17, nanosec=4))
        self.decide(Action.DEPLOY, age=behind)
        await_told("decisions: came too late", 1)
        assert device.commands_to_deploy() == 0, "that picture answers nothing of this node"
        # Again and again, as the supervisor does: one that a busy machine is slow with tells less.
        self.bench.client.create_timer(
            0.1,
            lambda: self.picture(
                behind, [one for one in self.beats if not one.supervisor][-1].header.stamp
            ),
        )
        await_told("clock set by (s)", behind)
        self.decide(Action.DEPLOY, age=behind + 30.0)
        await_told("decisions: came too late", 2)
        self.await_report(self.steps[-1], self.decide(Action.DEPLOY, age=behind))
        self.bench.until(device.commands_to_deploy, "it comes over the wire")
        assert device.commands_to_deploy() == 1

    def test_a_decision_of_an_older_epoch_fails_and_names_the_newest(self, device):
        self.ready_to_deploy(device)
        self.await_report(Outcome.CONFIRMED, self.decide(Action.FLIGHT_BLOCK_RELEASE, epoch=7))
        old = self.decide(Action.DEPLOY, epoch=6, id=10_000)
        assert self.await_report(Outcome.FAILED, old).newest_epoch == 7
        assert not device.deployed

    def test_a_decision_is_not_heard_by_a_node_that_starts_later(self, bench):
        self.bench, self.numbers = bench, iter(range(1, 10))
        self.statuses = bench.follow(ParachuteStatus, "parachute/status")
        self.beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
        publisher = bench.client.create_publisher(SafetyDecision, "safety/decision", qos.DECISION)
        message = SafetyDecision(
            epoch=1, id=1, action=int(Action.DEPLOY), rule="test", targets=[self.name]
        )
        publisher.publish(stamped(bench.client, message))
        device = self.make(bench, heartbeat_rate=HEARTBEAT_RATE, max_decision_age=10.0)
        self.ready_to_deploy(device)
        assert device.commands_to_deploy() == 0

    def test_a_decision_whose_call_fails_inside_is_reported_as_failed_and_never_as_sent(
        self, device, monkeypatch
    ):
        """Taken for sent, the supervisor would wait, and not try the next parachute."""
        self.ready_to_deploy(device)
        node = next(one for one in self.bench.nodes if one.get_name() == self.name)

        def broken(*_: Any) -> None:
            raise RuntimeError("a mistake of ours")

        runtime = node.runtime
        through = runtime.deploy_for
        monkeypatch.setattr(runtime, "deploy_for", lambda decision, _: through(decision, broken))
        decision = self.decide(Action.DEPLOY)
        report = self.await_report(Outcome.FAILED, decision)
        assert report.detail == "RuntimeError: a mistake of ours"
        assert not device.deployed
        order = (decision.epoch, decision.id)
        outcomes = {one.outcome for one in self.reports if (one.epoch, one.id) == order}
        assert outcomes == {int(Outcome.FAILED)}


class DeviceSuite(NodeSuite):
    """The same, and what holds for a device that tells how it is."""

    #: The link's protocol has acknowledgements.
    acknowledges = True
    #: What a refused deploy says: not armed, and too near the ground.
    not_armed = "failed"
    too_near = "temporarily rejected"

    @property
    def steps(self) -> tuple[Outcome, ...]:  # type: ignore[override]
        accepted = (Outcome.ACCEPTED,) if self.acknowledges else ()
        return (Outcome.SENT, *accepted, Outcome.CONFIRMED)

    def ready_to_deploy(self, device: SimulatedDevice) -> None:
        self.armed(device)
        device.clear_the_ground()

    def plugged(self, device: SimulatedDevice) -> None:
        device.plug_in()
        self.await_link(LinkState.OK)
        self.bench.until(
            lambda: self.beats[-1].device_healthy and self.statuses, "the device is healthy"
        )

    def deploy(self, force: bool = False) -> Deploy.Response:
        """A person asks for it; the answer."""
        return self.bench.call(Deploy, f"{self.name}/deploy", force=force, reason="a test")

    def arm(self) -> None:
        # A busy machine may have held the device up for so long that it is STALE just then.
        self.bench.until(
            lambda: self.bench.call(Arm, f"{self.name}/arm", arm=True).success, "it is armed"
        )

    def armed(self, device: SimulatedDevice) -> None:
        self.plugged(device)
        self.arm()

    def test_a_wire_on_which_nobody_is_heard_is_told_once(self, device, monkeypatch):
        monkeypatch.setattr(link_log, "QUIET_FOR", 1.5)
        said = self.bench.follow_log()
        device.plug_in_mute()
        diagnostics = self.bench.follow(DiagnosticArray, "/diagnostics")

        def told() -> list[str]:
            return [line.msg for line in said if "nothing received yet" in line.msg]

        self.bench.until(told, "it is told")
        assert " is open, nothing received yet, for " in told()[0]
        looked = len(diagnostics)
        self.bench.until(lambda: len(diagnostics) >= looked + 3, "it was looked at again")
        assert len(told()) == 1

    def test_never_seen_ok_stale_lost_and_regained(self, device):
        """While it is silent its node goes on, and its word gets no younger."""

        def stamps(state: LinkState) -> list[float]:
            return [seconds(s.header.stamp) for s in self.statuses if s.link_state == state]

        def now() -> float:
            return seconds(self.bench.client.get_clock().now().to_msg())

        self.await_link(LinkState.NEVER_SEEN)
        assert self.beats[-1].age != self.beats[-1].age, "not known is NaN"
        self.plugged(device)
        assert self.beats[-1].device_healthy
        assert now() - stamps(LinkState.OK)[-1] < 20.0
        device.fall_silent()
        self.await_link(LinkState.STALE)
        assert not self.beats[-1].device_healthy
        self.await_link(LinkState.LOST)
        assert self.beats[-1].age >= 0.8
        self.bench.until(lambda: stamps(LinkState.LOST), "its status is LOST")
        # The newest STALE: a machine that stood still may have seen one before.
        stale, lost = stamps(LinkState.STALE)[-1], stamps(LinkState.LOST)[-1]
        assert now() - lost >= 0.8, "the limit of LOST is that old"
        assert lost == pytest.approx(stale, abs=0.01), "both are of its last word"
        device.speak_again()
        self.await_link(LinkState.OK)
        told = [beat.link_state for beat in self.beats]
        assert list(dict.fromkeys(told)) == [0, 1, 2, 3], "none is left out"
        told = [status.link_state for status in self.statuses]
        assert list(dict.fromkeys(told)) == [1, 2, 3], "the status tells the same"
        assert told[-1] == LinkState.OK or self.bench.until(
            lambda: self.statuses[-1].link_state == LinkState.OK, "the status is back, too"
        )

    def test_a_device_that_breaks_down_is_not_healthy(self, device):
        self.plugged(device)
        fault = device.break_down()
        self.bench.until(
            lambda: any(fault in text for text in self.statuses[-1].faults), "the fault is told"
        )
        self.bench.until(lambda: not self.beats[-1].device_healthy, "the heartbeat says so")
        assert self.beats[-1].link_state == LinkState.OK, "the wire itself is well"
        assert self.statuses[-1].state == ParachuteState.ABNORMAL

    def test_arm_and_disarm_are_confirmed_by_the_devices_own_status(self, device):
        # Given one that is not armed, then it is not deployed.
        self.plugged(device)
        answer = self.deploy()
        assert (answer.success, answer.accepted) == (False, False)
        assert self.not_armed in answer.message
        assert not device.deployed
        # When it is armed and disarmed, then its status says so.
        self.arm()
        self.bench.until(lambda: self.statuses[-1].armed, "the status says so")
        assert self.statuses[-1].state == ParachuteState.ARMED
        answer = self.bench.call(Arm, f"{self.name}/arm", arm=False)
        assert answer.success, answer.message
        self.bench.until(lambda: not self.statuses[-1].armed, "the status says so")

    def test_deploy_is_accepted_and_then_shown_and_published_with_its_answer(self, device):
        told = self.bench.follow(PersonRequest, "safety/person")
        self.ready_to_deploy(device)
        told.clear()
        answer = self.deploy(force=True)
        expected = (True, self.acknowledges)
        assert (answer.success, answer.accepted) == expected, answer.message
        assert device.deployed
        self.bench.until(lambda: self.statuses[-1].deployed, "the status says so")
        self.bench.until(lambda: len(told) == 2, "the call and its answer are published")
        called, answered = told
        assert (called.link, called.service) == (self.name, "~/deploy")
        assert called.request == "force=True, reason='a test'"
        assert not called.answered
        assert called.after != called.after, "not a number: it has no answer yet"
        assert (answered.link, answered.service) == (called.link, called.service)
        assert (answered.request, answered.header) == (called.request, called.header)
        assert answered.answered
        assert (answered.success, answered.accepted) == (answer.success, answer.accepted)
        assert answered.message == answer.message
        assert answered.after > 0.0
        # When it is out already, then nothing is sent.
        sent = device.commands_to_deploy()
        answer = self.deploy()
        assert (answer.success, answer.accepted) == (True, False)
        assert "already" in answer.message
        assert device.commands_to_deploy() == sent

    def test_deploy_too_near_the_ground_is_refused_whoever_orders_it(self, device):
        self.ready_to_deploy(device)
        device.come_to_ground()
        answer = self.deploy()
        assert (answer.success, answer.accepted) == (False, False)
        assert self.too_near in answer.message
        assert self.await_report(Outcome.FAILED, self.decide(Action.DEPLOY)).detail
        assert not device.deployed

    def test_deploy_says_plainly_when_nothing_came_back_and_holds_up_nothing(self, device):
        """While it waits, heartbeat and status go on."""
        self.ready_to_deploy(device)
        device.stop_answering()
        future = self.bench.ask(Deploy, f"{self.name}/deploy", reason="a test")
        self.bench.until(device.commands_to_deploy, "the service has begun")
        self.beats.clear()
        self.statuses.clear()
        self.bench.until(lambda: len(self.beats) >= 5 and len(self.statuses) >= 3, "both go on")
        assert not future.done(), "all that while the service was waiting"
        self.bench.until(future.done, "the service ends")
        answer = future.result()
        assert (answer.success, answer.accepted) == (False, False)
        assert "given up after" in answer.message
        missing = "no acknowledgement" if self.acknowledges else "never showed"
        assert missing in answer.message

    def test_deploy_says_plainly_when_only_the_status_did_not_come(self, device):
        self.ready_to_deploy(device)
        device.be_stuck()
        answer = self.deploy()
        assert (answer.success, answer.accepted) == (False, self.acknowledges)
        assert ("acknowledged after" if self.acknowledges else "sent ") in answer.message
        assert "never showed" in answer.message

    def test_without_any_device_a_request_is_refused_at_once(self, device):
        for answer in (self.bench.call(Arm, f"{self.name}/arm"), self.deploy()):
            assert not answer.success
            assert "received" in answer.message, answer.message
