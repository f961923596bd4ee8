"""The orders of a person to a vehicle: its service, its fields, and the meaning of its answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from chute_ros.supervisor.inputs import Mode
from chute_ros.tools.chute.options import DONE, NOT_WELL, Chosen

NO_REASON = "no reason given"
#: Where the supervisor's services are.
SUPERVISOR = "safety"
#: Of a deploy that reaches no parachute: the kill before it does not wait for one.
STOPS_ALL_THE_SAME = (
    "the motors will STOP all the same where the supervisor kills before a deploy, and nothing "
    "will open"
)


@dataclass(frozen=True)
class Order:
    """service: relative to the namespace; kind: its type; word: to be typed first, empty: not
    asked for; does: what will be done, for the person who is asked; link: of whom, past the
    supervisor; unreached: what it does where no parachute can be reached, empty: it needs none."""

    name: str
    kind: str
    service: str
    fields: Mapping[str, object] = field(default_factory=dict)
    word: str = ""
    does: str = ""
    link: str = ""
    unreached: str = ""


@dataclass(frozen=True)
class ServiceAnswer:
    """accepted: None where the service has no such field."""

    success: bool
    message: str
    accepted: bool | None = None

    @property
    def code(self) -> int:
        """Of the process."""
        return DONE if self.success else NOT_WELL


def order_of(chosen: Chosen, who: str) -> Order:
    """The order that was chosen. who: gives it, for the record."""
    more, name = chosen.more, chosen.command
    if name in ("arm", "disarm"):
        return arm(name == "arm", more.link)
    if name == "reset":
        return reset()
    reason = f"{who}: {more.reason or NO_REASON}"
    if name == "deploy":
        return deploy(reason, more.force, more.link)
    if name == "kill":
        return kill(reason, more.only)
    return mode(Mode[more.mode], reason, more.force)


def arm(on: bool, link: str | None = None) -> Order:
    """Arm or disarm: the vehicle, or the parachute of this link past the supervisor."""
    # triggers 0: the link's default.
    fields = {"arm": on, "triggers": 0}
    return Order("arm" if on else "disarm", "Arm", f"{link or SUPERVISOR}/arm", fields)


def deploy(reason: str, force: bool = False, link: str | None = None) -> Order:
    """Release the parachute. force: also where a check forbids it."""
    does = f"RELEASES the parachute of {link}, past the supervisor" if link else "RELEASES the "
    if not link:
        does += "parachute of the vehicle, with a kill before it where the supervisor does so"
    if force:
        does += ", also where a check forbids it (--force)"
    fields = {"force": force, "reason": reason}
    unreached = "nothing will open" if link else STOPS_ALL_THE_SAME
    service = f"{link or SUPERVISOR}/deploy"
    return Order("deploy", "Deploy", service, fields, "DEPLOY", does, link or "", unreached)


def kill(reason: str, only: bool = False) -> Order:
    """Stop the motors. only: no deploy after it."""
    does = "STOPS the motors, on the ground and in the air"
    does += ", and nothing else (--only)" if only else ", and deploys after it where that helps"
    fields = {"force": False, "kill_only": only, "reason": reason}
    unreached = "" if only else "the motors will STOP, and nothing will open"
    service = f"{SUPERVISOR}/kill"
    return Order("kill", "Kill", service, fields, "KILL", does, unreached=unreached)


def reset() -> Order:
    """Back to the start after landing or a test."""
    return Order("reset", "Trigger", f"{SUPERVISOR}/reset")


def mode(wanted: Mode, reason: str, force: bool = False) -> Order:
    """Set the mode of the supervisor. force: although the vehicle is in flight."""
    fields = {"mode": int(wanted), "force": force, "reason": reason}
    return Order("mode", "SetMode", f"{SUPERVISOR}/set_mode", fields)


def answer_text(order: Order, answer: ServiceAnswer) -> str:
    """In words, with the whole message of who answered."""
    if answer.success:
        outcome = "done"
    elif answer.accepted:
        outcome = "ACCEPTED, NOT CONFIRMED"
    else:
        outcome = "NOT DONE"
    return f"{order.name}: {outcome}: {answer.message or 'no message'}"


def not_answered(order: Order, how: str) -> str:
    """The text for a call that nobody answered. how: the wait for the answer ended."""
    # Forced, it would release the next parachute of the ladder.
    safe = order.service.startswith(f"{SUPERVISOR}/") and not order.fields.get("force")
    again = ""
    if order.word and safe:
        again = " Giving the order again is safe: a parachute is released once."
    return (
        f"{order.name}: {order.service} did not answer {how}: it is NOT known whether it was "
        f"carried out. `chute status` shows what the vehicle reports.{again}"
    )
