"""Kills and deploys of before, for whoever comes late: also of a supervisor that died."""

from typing import Any

from runtime_shell import Shell

from chute_ros.model import Action, Decision
from chute_ros.runtime.supervisor import Start, SupervisorRuntime
from chute_ros.runtime.topics import PastDecision, SafetyTold
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.lease import LeaseConfig

LINK = "mavlink_parachute"


class SupervisorShell(Shell):
    """Of a supervisor; what it keeps is what a start anew goes on with."""

    kept: Any = None

    def record(self, turn: Any) -> None:
        """No black box."""

    def keep(self, state: Any) -> None:
        self.kept = state

    def say(self, said: Any) -> None:
        """Nobody reads it."""

    def offer(self, offered: bool) -> None:
        """No services."""

    def arm(self, link: str, order: Any, answered: Any) -> str:
        return "nothing is there"

    def failed(self, error: Exception, new: Any) -> str:
        raise error

    def of(self, kind: type) -> list[Any]:
        """What was published of a kind, in its order."""
        return [one for one in self.published if isinstance(one, kind)]


def start(shell: SupervisorShell, now: float, before: Any = None) -> SupervisorRuntime:
    lease = LeaseConfig(name="safety_supervisor")
    return SupervisorRuntime(SupervisorConfig(), lease, shell, Start(7, "a", before), now)


def test_each_kill_and_deploy_is_told_again_and_no_flight_block_is():
    shell = SupervisorShell()
    one = start(shell, 100.0)
    one.turn((), 100.0)
    one.ask(lambda token: i.DeployRequest(token, True, "smoke"), lambda answer: None, 101.0)
    for number in range(200):
        one.turn((), 101.0 + 0.05 * number)
    decided = [d for d in dict.fromkeys(shell.of(Decision)) if d.action >= Action.KILL]
    past = shell.of(PastDecision)
    assert [told.decision for told in past] == decided
    assert {told.decision.action for told in past} == {Action.KILL, Action.DEPLOY}
    assert any(d.action is Action.FLIGHT_BLOCK for d in shell.of(Decision))
    assert past[0].decided_at == 101.0
    assert shell.of(SafetyTold)[-1].fired == decided[-1].id


def test_a_supervisor_that_goes_on_tells_what_the_last_one_decided():
    shell = SupervisorShell()
    one = start(shell, 100.0)
    one.turn((), 100.0)
    one.ask(lambda token: i.KillRequest(token, "operator", "smoke"), lambda answer: None, 101.0)
    one.turn((), 101.2)
    (kill,) = {d for d in shell.of(Decision) if d.action is Action.KILL}
    # When it dies, and another process starts in its place,
    after = SupervisorShell()
    again = start(after, 103.0, shell.kept)
    again.turn((), 103.0)
    # then whoever comes now finds the kill of before, with its time.
    first = after.of(PastDecision)[0]
    assert (first.decision, first.decided_at) == (kill, 101.0)
    for number in range(30):
        again.turn((), 103.1 + 0.05 * number)
    assert after.of(SafetyTold)[-1].fired >= kill.id
