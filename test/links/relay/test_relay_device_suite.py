"""relay passes the stories of all device nodes, over a real pty, as far as nothing comes back."""

from chute_msgs.msg import ActionReport
from chute_msgs.srv import Arm, Deploy
from device_suite import NodeSuite
from relay_bench import Board

from chute_ros.model import Action, LinkState, Outcome, ParachuteState
from chute_ros.ros import qos
from chute_ros.ros.messages import seconds


class TestRelay(NodeSuite):
    """The link of this suite is a serial relay board."""

    name = "relay"
    alive = LinkState.UNMONITORED
    steps = (Outcome.SENT,)

    def make(self, bench, **parameters):
        return Board(bench, **parameters)

    def ready_to_deploy(self, device):
        device.plug_in()
        self.await_link(self.alive)
        self.bench.until(lambda: self.statuses, "its picture is told")

    def test_by_silence_it_is_never_healthy_and_never_deployed(self, device):
        self.await_link(LinkState.NEVER_SEEN)
        self.ready_to_deploy(device)
        self.await_report(Outcome.SENT, self.decide(Action.DEPLOY))
        self.bench.until(lambda: device.deployed, "it is out")
        self.beats.clear()
        self.statuses.clear()
        self.bench.until(lambda: len(self.beats) > 5 and self.statuses, "it is told on")
        assert not any(beat.device_healthy for beat in self.beats)
        assert "nothing comes back" in self.beats[-1].reasons[0]
        told = self.statuses[-1]
        assert (told.link_state, told.state) == (LinkState.UNMONITORED, ParachuteState.UNKNOWN)
        assert not told.deployed
        assert {report.outcome for report in self.reports} == {int(Outcome.SENT)}

    def test_a_board_that_is_pulled_out_is_lost_and_comes_back(self, device):
        self.ready_to_deploy(device)
        device.pull_out()
        self.await_link(LinkState.LOST)
        assert "cannot be written" in self.beats[-1].reasons[0]
        self.statuses.clear()
        self.bench.until(lambda: len(self.statuses) >= 2, "its picture is told each second")
        first, later = self.statuses[:2]
        apart = seconds(later.header.stamp) - seconds(first.header.stamp)
        assert abs(apart) < 0.01, "both have the time at which it was last written"
        device.plug_in()
        self.await_link(LinkState.UNMONITORED)

    def test_a_deploy_that_is_decided_while_it_is_out_fires_once_it_is_back(self, device):
        self.ready_to_deploy(device)
        device.pull_out()
        self.await_link(LinkState.LOST)
        decision = self.decide(Action.DEPLOY)
        self.bench.turns(0.2)
        assert not self.reports, "nothing was sent yet"
        device.plug_in()
        self.await_report(Outcome.SENT, decision)
        self.bench.until(lambda: device.deployed, "it is out")

    def test_a_deploy_that_cannot_be_written_fails_in_time(self, bench):
        self.bench, self.numbers = bench, iter(range(1, 10))
        self.reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
        self.make(bench, give_up_after=0.3)
        report = self.await_report(Outcome.FAILED, self.decide(Action.DEPLOY))
        assert report.detail == "the output could not be written within 0.3 s"

    def test_a_person_must_force_it(self, device):
        self.ready_to_deploy(device)
        answer = self.bench.call(Deploy, "relay/deploy", reason="a test")
        assert (answer.success, answer.accepted) == (False, False)
        assert "cannot tell air from ground: nothing was sent" in answer.message
        assert not device.deployed
        answer = self.bench.call(Deploy, "relay/deploy", reason="a test", force=True)
        assert (answer.success, answer.accepted) == (False, False), "nothing confirms it"
        assert answer.message == "sent; a relay output confirms nothing"
        self.bench.until(lambda: device.deployed, "it is out")

    def test_it_says_that_it_has_no_arming(self, device):
        self.ready_to_deploy(device)
        answer = self.bench.call(Arm, "relay/arm", arm=True)
        assert (answer.success, answer.message) == (
            True,
            "a relay output has no arming: it can always fire",
        )
        answer = self.bench.call(Arm, "relay/arm", arm=False)
        assert not answer.success
        assert "cannot be disarmed" in answer.message

    def test_a_kill_is_not_for_it(self, device):
        self.ready_to_deploy(device)
        report = self.await_report(Outcome.FAILED, self.decide(Action.KILL))
        assert report.detail == "a relay output stops no motors: take relay out of kill_links"
        assert not device.deployed
