"""What a device node acted on is read from its log, in its own words."""

from chute_ros.model import Action, Decision
from chute_ros.runtime.decisions import DecisionCarrier
from faults.flight import acted_on


class Log:
    """The shell of a node of which only the log is looked at."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def log(self, notice: object) -> None:
        self.lines.append(f"[WARN] [1.5] [mavlink_parachute]: {notice.text}")


def test_kills_and_deploys_are_found_with_their_epochs_in_their_order() -> None:
    log = Log()
    carrier = DecisionCarrier(
        *("mavlink_parachute", 0.5, log, lambda age: age), lambda _: None, lambda _: None
    )
    for number, action in ((3, Action.FLIGHT_BLOCK_RELEASE), (4, Action.KILL), (5, Action.DEPLOY)):
        targets = ("mavlink_parachute",)
        decision = Decision(12, number, action, "tips over", ("tilt 61 deg",), targets)
        carrier.heard([(decision, 0.0)], 100.0)
    assert len(log.lines) == 3
    assert acted_on("\n".join(log.lines)) == [(12, 4, "KILL"), (12, 5, "DEPLOY")]
