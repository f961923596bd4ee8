"""The orders of a person to a vehicle: its service, its fields, and the meaning of its answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from chute_ros.supervisor.inputs import Mode
from chute_ros.tools.chute.options import DONE, NOT_WELL, Chosen

NO_REASON = "no reason given"
#: Where the supervisor's services are.
SUPERVISOR = "safety"


@dataclass(frozen=True)
class Order:
    """service: relative to the namespace; kind: its type; word: to be typed first, empty: not
    asked for; does: what will be done, for the person who is asked."""

    name: str
    kind: str
    service: str
    fields: Mapping[str, object] = field(default_factory=dict)
    word: str = ""
    does: str = ""


@dataclass(frozen=True)
class Answer:
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
    make = {"arm": _arm, "disarm": _arm, "deploy": _deploy, "kill": _kill, "mode": _mode}
    if chosen.command == "reset":
        return Order("reset", "Trigger", f"{SUPERVISOR}/reset")
    return make[chosen.command](chosen, who)


def answer_text(order: Order, answer: Answer) -> str:
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


def _arm(chosen: Chosen, who: str) -> Order:
    arm = chosen.command == "arm"
    service = f"{chosen.more.link or SUPERVISOR}/arm"
    # triggers 0: the link's default.
    return Order(chosen.command, "Arm", service, {"arm": arm, "triggers": 0})


def _deploy(chosen: Chosen, who: str) -> Order:
    link, force = chosen.more.link, chosen.more.force
    does = f"RELEASES the parachute of {link}, past the supervisor" if link else "RELEASES the "
    if not link:
        does += "parachute of the vehicle, with a kill before it where the supervisor does so"
    if force:
        does += ", also where a check forbids it (--force)"
    fields = {"force": force, "reason": _reason(chosen, who)}
    return Order("deploy", "Deploy", f"{link or SUPERVISOR}/deploy", fields, "DEPLOY", does)


def _kill(chosen: Chosen, who: str) -> Order:
    only = chosen.more.only
    does = "STOPS the motors, on the ground and in the air"
    does += ", and nothing else (--only)" if only else ", and deploys after it where that helps"
    fields = {"force": False, "kill_only": only, "reason": _reason(chosen, who)}
    return Order("kill", "Kill", f"{SUPERVISOR}/kill", fields, "KILL", does)


def _mode(chosen: Chosen, who: str) -> Order:
    mode, force = Mode[chosen.more.mode], chosen.more.force
    fields = {"mode": int(mode), "force": force, "reason": _reason(chosen, who)}
    return Order("mode", "SetMode", f"{SUPERVISOR}/set_mode", fields)


def _reason(chosen: Chosen, who: str) -> str:
    return f"{who}: {chosen.more.reason or NO_REASON}"
