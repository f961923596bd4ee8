"""Whether a loop was as it must be: what was done to devices, and what had to be done."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from faults.soak_relay import DEPLOY, KILL

NAN = float("nan")
#: From the cause, or the end of the fault if that is later, to the parachute, s. The fault may
#: hide the fall, and its end begins a ladder of 2 s a step.
ANSWER_WITHIN = 12.0
#: A machine that holds up the soak itself for longer (s) has its part in what was late.
_HELD_UP = 0.5
#: From the end of a fault until nothing is to be complained of, s.
WHOLE_WITHIN = 20.0


@dataclass
class Happened:
    """What was seen in one loop. Times in s of one clock, NaN: it did not happen."""

    fault_at: float = NAN
    fault_over: float = NAN
    #: The motor has failed, or a person has asked.
    cause_at: float = NAN
    #: (when, KILL or DEPLOY) as they went by on a wire.
    orders: list[tuple[float, str]] = field(default_factory=list)
    #: (when, which device) of parachutes that came out, by their own record.
    released: list[tuple[float, str]] = field(default_factory=list)
    #: When the autopilot took a kill, by its own record.
    killed: list[float] = field(default_factory=list)
    #: When supervisors decided.
    decided: list[tuple[float, str]] = field(default_factory=list)
    whole_at: float = NAN
    #: What was to be complained of when it was waited for no longer.
    complaints: Sequence[str] = ()
    #: The longest that the soak itself was kept from looking, s: a machine that does not let it
    #: lets nobody.
    held_up: float = 0.0
    #: The flight goes on, or has ended with the parachute.
    state_text: str = ""
    ended_as_meant: bool = True
    #: Tracebacks, ends of processes, internal errors of nodes.
    troubles: Sequence[str] = ()


def judge(seen: Happened) -> list[str]:
    """What must not be; empty: all is as it must be."""
    findings = list(seen.troubles)
    caused = seen.cause_at == seen.cause_at
    for when, what in seen.orders:
        if not caused or when < seen.cause_at:
            findings.append(f"{what} on the wire without a cause")
    findings += [
        f"{name} came out without a cause"
        for when, name in seen.released
        if not caused or when < seen.cause_at
    ]
    findings += _answer(seen) if caused else []
    if not seen.ended_as_meant:
        findings.append(f"the vehicle is {seen.state_text}")
    if not caused and seen.whole_at != seen.whole_at:
        findings.append(
            f"not whole within {WHOLE_WITHIN:g} s: {'; '.join(seen.complaints) or 'a process'}"
        )
    if findings and seen.held_up > _HELD_UP:
        findings.append(f"(the machine held everything up for {seen.held_up:.1f} s at a time)")
    return list(dict.fromkeys(findings))


def _answer(seen: Happened) -> list[str]:
    """What had to follow the cause."""
    findings = []
    begins = max(seen.cause_at, seen.fault_over)
    out = min((when for when, _ in seen.released), default=NAN)
    if not out <= begins + ANSWER_WITHIN:
        findings.append(f"the parachute did not come out within {ANSWER_WITHIN:g} s")
    if not seen.killed:
        findings.append("the autopilot was told of no kill")
    if _first(seen.decided, DEPLOY) < _first(seen.decided, KILL):
        findings.append("a deploy was decided before the kill")
    # A kill that could not reach its wire may come later: then it was decided first.
    if _first(seen.orders, DEPLOY) < min(_first(seen.orders, KILL), _first(seen.decided, KILL)):
        findings.append("a deploy was on the wire before the kill")
    for name, times in Counter(name for _, name in seen.released).items():
        if times > 1:
            findings.append(f"{name} was released {times} times")
    return findings


def _first(those: Sequence[tuple[float, str]], what: str) -> float:
    return min((when for when, one in those if one == what), default=float("inf"))
