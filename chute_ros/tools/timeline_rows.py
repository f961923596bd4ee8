"""What a timeline consists of, and its looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor.machine import Stage

#: Of a colour that says what a part means; the page's light or dark colours are behind them.
TONES = ("good", "live", "warn", "bad", "quiet", "plain", "act")
STYLE = """
.timeline { --ink:#1c2733; --soft:#5b6b7b; --grid:#dfe5ea; --back:#ffffff; --good:#2f9e5b;
  --warn:#d99a1c; --bad:#cc3d3d; --quiet:#9aa7b3; --plain:#2f74c0; --act:#8a4fc4; --live:#c2541a;
  font: 12px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; width: 100%;
  height: auto; display: block; background: var(--back); }
@media (prefers-color-scheme: dark) { .timeline { --ink:#e6edf3; --soft:#9fb0c0; --grid:#2b3742;
  --back:#11181f; --good:#3fae6b; --warn:#c98d17; --bad:#e05656; --quiet:#5c6a77;
  --plain:#4b90dc; --act:#a06ee0; --live:#d9713a; } }
@media print { .timeline { --ink:#000; --soft:#444; --grid:#ccc; --back:#fff; --good:#2f9e5b;
  --warn:#d99a1c; --bad:#cc3d3d; --quiet:#9aa7b3; --plain:#2f74c0; --act:#8a4fc4; --live:#c2541a;
  print-color-adjust: exact; -webkit-print-color-adjust: exact; } }
.timeline text { fill: var(--ink); }
.timeline .soft { fill: var(--soft); font-size: 11px; }
.timeline .inside { fill: #fff; font-size: 11px; }
.timeline .grid { stroke: var(--grid); stroke-width: 1; }
.timeline .frame { fill: none; stroke: var(--grid); }
.timeline .line { fill: none; stroke: var(--plain); stroke-width: 1.6; stroke-linejoin: round; }
.timeline .limit { stroke: var(--bad); stroke-dasharray: 4 3; }
.timeline .drop { stroke-width: 1; stroke-dasharray: 2 3; opacity: .75; }
""" + "\n".join(
    f".timeline .{tone} {{ fill: var(--{tone}); }} .timeline .drop.{tone} "
    f"{{ stroke: var(--{tone}); }}"
    for tone in TONES
)

#: The colours of states and decisions, the same in every picture.
STAGE_TONES = {
    Stage.STARTUP: "quiet",
    Stage.BLOCKED: "warn",
    Stage.READY: "good",
    # A parachute that is live is no vehicle that merely may fly.
    Stage.ARMED: "live",
    Stage.IN_FLIGHT: "plain",
    Stage.KILLING: "bad",
    Stage.DEPLOYING: "bad",
    Stage.DEPLOYED: "act",
    Stage.LANDED: "quiet",
    Stage.FAULT: "bad",
}
ACTION_TONES = {
    Action.NONE: "quiet",
    Action.FLIGHT_BLOCK: "warn",
    Action.FLIGHT_BLOCK_RELEASE: "good",
    Action.KILL: "bad",
    Action.DEPLOY: "act",
}
LINK_TONES = {
    LinkState.NEVER_SEEN: "quiet",
    LinkState.OK: "good",
    LinkState.STALE: "warn",
    LinkState.LOST: "bad",
    LinkState.UNMONITORED: "warn",
}
OUTCOME_TONES = {
    Outcome.NONE: "quiet",
    Outcome.SENT: "quiet",
    Outcome.ACCEPTED: "plain",
    Outcome.CONFIRMED: "good",
    Outcome.FAILED: "bad",
    Outcome.REFUSED: "warn",
}


@dataclass(frozen=True)
class Segment:
    """From start to end (s) it was this. tone: one of TONES."""

    start: float
    end: float
    text: str
    tone: str


@dataclass(frozen=True)
class Band:
    """One thing that is in one state after another."""

    label: str
    segments: Sequence[Segment]


@dataclass(frozen=True)
class Curve:
    """A measurement: (s, value); a value that is NaN was not known."""

    label: str
    unit: str
    points: Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Level:
    """A counter: (s, share of what fires it)."""

    label: str
    points: Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Mark:
    """A moment (s) with a short sign, and in words what it is."""

    at: float
    sign: str
    text: str
    tone: str


@dataclass(frozen=True)
class Marks:
    """Moments, with a line down through everything below."""

    label: str
    marks: Sequence[Mark]


Row = Band | Curve | Level | Marks


@dataclass(frozen=True)
class Window:
    """A stretch of time (s) with its heading."""

    title: str
    start: float
    end: float
