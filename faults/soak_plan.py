"""What each loop of the soak does, drawn from the seed and the loop's number alone."""

from __future__ import annotations

import random
from dataclasses import dataclass

NODES = ("mavlink_parachute", "upf_can", "umbilical")
SUPERVISORS = ("first", "second")
DEVICES = ("parachute", "upf", "rocket", "autopilot")
WIRES = ("mavlink", "can", "serial")

#: Kind -> whom it can strike, and for how long (s).
KINDS: dict[str, tuple[tuple[str, ...], tuple[float, float]]] = {
    "kill -9": ((*NODES, *SUPERVISORS, "parachute", "upf", "rocket"), (0.0, 0.0)),
    "SIGSTOP": ((*NODES, *SUPERVISORS, *DEVICES), (0.2, 5.0)),
    "serial port vanishes": (("serial",), (0.2, 3.0)),
    "UDP port closed": (("mavlink",), (0.2, 3.0)),
    "interface down": (("eth0", "lo"), (0.2, 2.0)),
    "cable cut": (("mavlink", "can"), (0.2, 3.0)),
    "30 % lost both ways": ((*WIRES, "all"), (1.0, 4.0)),
    "flood of valid frames": ((*WIRES, "all"), (0.5, 3.0)),
    "flood of invalid frames": ((*WIRES, "all"), (0.5, 3.0)),
    "disk full": (("ROS home",), (0.5, 4.0)),
    "no descriptors left": ((*NODES, *SUPERVISORS), (0.5, 3.0)),
    "wall clock set": (("all nodes", *NODES, *SUPERVISORS), (0.5, 3.0)),
}
#: One of so many loops has a motor failure or a person's deploy, and ends its flight. Those before
#: it are flown while the vehicle climbs.
_CAUSE_EACH = 5
MOTOR, PERSON = "a motor fails", "a person deploys"
_STEPS = (-86_400.0, -3600.0, -2.0, -0.4, 0.4, 2.0, 3600.0, 86_400.0)


@dataclass(frozen=True)
class Plan:
    """One loop."""

    number: int
    kind: str
    target: str
    #: How long the fault lasts; a kill lasts until the process is started again.
    seconds: float
    #: The moment of the fault, s from the beginning of the loop.
    after: float
    #: MOTOR, PERSON, or empty; and when, s from the fault's beginning.
    cause: str = ""
    cause_after: float = 0.0
    #: Where the wall clock goes, s.
    step: float = 0.0
    #: What else happens while descriptors are exhausted: this process is killed.
    beside: str = ""

    def text(self) -> str:
        """One line."""
        parts = [f"{self.kind}: {self.target}"]
        if self.kind == "wall clock set":
            parts.append(f"by {self.step:+g} s")
        if self.seconds:
            parts.append(f"for {self.seconds:.1f} s")
        if self.beside:
            parts.append(f"while {self.beside} is killed")
        if self.cause:
            parts.append(f"and {self.cause} {self.cause_after:+.1f} s")
        return " ".join(parts)


def draw(
    seed: int, number: int, supervisors: int, kinds: tuple[str, ...] = (), spared: bool = False
) -> Plan:
    """Loop number of a run. kinds: parts of names; empty: all kinds. spared: no supervisor is
    killed, so that one lives for long enough to see what it holds."""
    chance = random.Random(f"{seed}/{number}")
    names = [one for one in KINDS if not kinds or any(part in one for part in kinds)]
    # Every kind has its turn; which comes when is still the seed's.
    kind = names[(number + seed) % len(names)]
    targets, (shortest, longest) = KINDS[kind]
    if supervisors == 1:
        targets = tuple(one for one in targets if one != "second")
    if spared and kind == "kill -9":
        targets = tuple(one for one in targets if one not in SUPERVISORS)
    target = chance.choice(targets)
    seconds = chance.uniform(shortest, longest)
    beside = ""
    if kind == "no descriptors left" and chance.random() < 0.5:
        others = NODES if spared else (*NODES, "first")
        beside = chance.choice([one for one in others if one != target])
    plan = Plan(
        number,
        kind,
        target,
        seconds,
        chance.uniform(0.0, 0.3),
        step=chance.choice(_STEPS) if kind == "wall clock set" else 0.0,
        beside=beside,
    )
    if (number + 1) % _CAUSE_EACH:
        return plan
    cause = chance.choice((MOTOR, PERSON))
    when = chance.uniform(0.0, seconds + 0.5)
    return Plan(**{**plan.__dict__, "cause": cause, "cause_after": when})
