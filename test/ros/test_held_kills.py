"""A node that was restarted as the motors must stop has heard no autopilot yet: the kill waits for
one, and fails only when none comes."""

from chute_msgs.msg import ActionReport, SafetyDecision
from mavlink_bench import Autopilot, Network
from node_bench import stamped

from chute_ros.model import Action, Outcome
from chute_ros.ros import qos


class Restarted:
    """mavlink_parachute that hears nobody yet, and is told to kill."""

    def __init__(self, bench, give_up_after):
        self.network = Network(bench, give_up_after=give_up_after)
        self.reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
        message = SafetyDecision(
            epoch=1,
            id=1,
            action=int(Action.KILL),
            rule="test",
            reasons=["a test"],
            targets=["mavlink_parachute"],
        )
        bench.publish(stamped(bench.client, message), "safety/decision", qos.DECISION)

    def reported(self, outcome):
        return [one for one in self.reports if one.outcome == outcome]


def test_a_kill_that_comes_before_the_autopilot_is_heard_is_done_once_it_is(bench):
    node = Restarted(bench, 5.0)
    bench.turns(0.3)
    assert node.reports == [], "neither sent nor failed"
    autopilot = Autopilot()
    autopilot.model.armed = True
    node.network.plug(autopilot)
    bench.until(lambda: not autopilot.model.armed, "the motors are stopped")
    bench.until(lambda: node.reported(Outcome.CONFIRMED), "and it is confirmed")
    assert not node.reported(Outcome.FAILED)


def test_where_no_autopilot_comes_it_fails_in_time_and_says_why(bench):
    node = Restarted(bench, 0.8)
    bench.until(lambda: node.reported(Outcome.FAILED), "it is reported")
    assert "no autopilot of ours was received yet" in node.reports[-1].detail
