"""One flight: the world is built from its scenario, lived through, and compared with the truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

from chute_ros.campaign.aircraft import Aircraft
from chute_ros.campaign.peer_rig import MakePeer, PeerAircraft
from chute_ros.campaign.rig import Rig
from chute_ros.campaign.scenario import ClockJump, Fault, HomeMove, Scenario, Stop, WayFault
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.truth import Course
from chute_ros.campaign.virtual_node import Acted
from chute_ros.links.api import load
from chute_ros.model import Action, Decision
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.gate import OPERATOR

_READY_WITHIN, _UP_WITHIN = 15.0, 9.0  # s
#: A pilot looks at the vehicle so often, and not before, s.
_LOOKS, _FIRST_LOOK = 0.05, 0.5
#: From its height on, before anything may happen: attitude and landed state have been told, s.
_SETTLES = 0.3
#: A flight is followed so long after the last thing that happens to it, and after its release: as
#: long as anybody would order that again, or the next of several parachutes, s.
_FOLLOWED, _FOLLOWED_RELEASE, _FOLLOWED_TO_NEXT = 1.5, 2.5, 12.0
#: A person waits so long for an answer; where no supervisor leads, the next call comes after this,
#: s.
_PATIENCE, _AGAIN = 2.0, 0.5
_MOST_CALLS = 12
#: What falls is on the ground by then, s.
_FALLS = 30.0
#: So long after it came to the ground nothing happens to it any more, and so long after a landing;
#: and from its take-off until a flight before this one may be followed by it, s.
_LIES, _STANDS, _FLIGHT_BEFORE = 1.0, 5.0, 30.0


@dataclass(kw_only=True)
class Flown(Course):
    """All that happened."""

    scenario: Scenario
    #: Why it never took off; empty: it did.
    grounded: str
    #: From when on the scenario's times count.
    up: float
    killed: float
    #: Orders to release that a node sent, or a supervisor decided, although it had heard that the
    #: parachute is out.
    ordered_again: int
    #: By whichever supervisor, in the order of time.
    decided: tuple[tuple[float, Decision], ...]
    acted: tuple[Acted, ...]
    said: tuple[tuple[float, str], ...]
    alarmed: tuple[tuple[float, str], ...]
    #: When lines of a rocket's flight computer came whole.
    told: tuple[float, ...]
    #: When the only parachute refused its release, as by the height that it is told it stands.
    refused: float
    #: What the person was answered; empty: nothing.
    answer: str


def _end_of(fault: Fault) -> float:
    if isinstance(fault, WayFault):
        return fault.spell.end
    if isinstance(fault, Stop):
        return fault.at + fault.lasts
    return fault.at if isinstance(fault, (ClockJump, HomeMove)) else fault.end


class PersonCall:
    """One wish of a person at the services of the supervisor that leads, called again where there
    is no answer, or where another leads. make: the input of the core with a token."""

    def __init__(self, rig: Rig, make: Callable[[int], i.Input]) -> None:
        self._rig, self._make = rig, make
        self._calls = 0
        self.answer: i.Finish | None = None

    def begin(self, now: float) -> None:
        """Call, and again until there is an answer."""
        if self.answer is not None or self._calls >= _MOST_CALLS:
            return
        self._calls += 1
        leader = self._rig.leader
        if leader is not None:
            leader.call(self._make, self._answered)
        self._rig.world.post(now + (_AGAIN if leader is None else _PATIENCE), self.begin)

    def _answered(self, answer: i.Finish) -> None:
        if self.answer is not None:
            return
        if i.CALL_AGAIN in answer.message and not answer.accepted:
            self._rig.world.post(self._rig.world.now + _AGAIN, self.begin)
        else:
            self.answer = answer


def _rig(scenario: Scenario, shipped: Shipped, make_peer: MakePeer | None) -> Rig:
    if make_peer is not None:
        return PeerAircraft(scenario, shipped, make_peer)
    kind: type[Rig] = load(scenario.carries.rig) if scenario.carries.rig else Aircraft
    return kind(scenario, shipped)


class Flight:
    """Everything that lives in one world. make_peer: who decides in place of supervisors, of an
    aircraft."""

    def __init__(
        self, scenario: Scenario, shipped: Shipped, make_peer: MakePeer | None = None
    ) -> None:
        self.scenario = scenario
        self.rig = _rig(scenario, shipped, make_peer)
        self._arming: PersonCall | None = None
        self._person = PersonCall(self.rig, self._wish)
        several = len(scenario.carries.supervised("deploy_links")) > 1
        #: So long after its release, s.
        self._followed = _FOLLOWED_TO_NEXT if several else _FOLLOWED_RELEASE
        self.up = self._took_off = math.nan
        #: That were begun.
        self._flights = 0
        self.rig.world.post(_FIRST_LOOK, self._look)

    def _wish(self, token: int) -> i.Input:
        person, why = self.scenario.person, "a person saw it"
        if person is not None and person.does == "deploy":
            return i.DeployRequest(token, False, why)
        kill_only = person is not None and person.does == "kill_only"
        return i.KillRequest(token, OPERATOR, why, kill_only)

    def run(self) -> Flown:
        """Live through it."""
        rig, scenario = self.rig, self.scenario
        ready_within = _READY_WITHIN + _FLIGHT_BEFORE * (scenario.flights - 1)
        rig.world.run(ready_within, lambda: self._flights >= scenario.flights)
        if not math.isnan(self._took_off):
            rig.world.run(self._took_off + _UP_WITHIN, lambda: not math.isnan(self.up))
        if not math.isnan(self.up):
            happens = [scenario.failure_at, scenario.apogee_at + 1.0]
            happens += map(_end_of, scenario.faults)
            if scenario.manoeuvre is not None:
                happens.append(scenario.manoeuvre.over_by)
            if scenario.person is not None:
                happens.append(scenario.person.at)
            quiet = self.up + max(happens) + _FOLLOWED
            if scenario.tape is not None:
                quiet = self.up + scenario.tape.lasts
            rig.world.run(quiet + _FALLS, lambda: self._over(quiet))
        return self._flown()

    # -- the pilot -------------------------------------------------------------------------------

    def _look(self, now: float) -> None:
        rig = self.rig
        if math.isnan(self._took_off):
            if self._may_fly(now):
                rig.take_off(now)
                self._took_off = now
                self._flights += 1
        elif rig.is_up() and rig.sees_flight:
            if not rig.lands_first():
                self._is_up(now)
                return
            self._took_off, self._arming = math.nan, None
        rig.world.post(now + _LOOKS, self._look)

    def _is_up(self, now: float) -> None:
        self.up = now + (0.0 if self.scenario.burn else _SETTLES)
        self.rig.plan(self.up)
        if self.scenario.person is not None:
            self.rig.world.post(self.up + self.scenario.person.at, self._person.begin)

    def _may_fly(self, now: float) -> bool:
        if not self.rig.is_ready:
            return False
        if not self.scenario.arms:
            return True
        if self._arming is None:
            self._arming = PersonCall(self.rig, lambda token: i.ArmRequest(token, True, 0))
            self._arming.begin(now)
        answer = self._arming.answer
        if answer is not None and not answer.success:
            self._arming = None  # until the next look
        return answer is not None and answer.success

    # -- the end ---------------------------------------------------------------------------------

    def _over(self, quiet: float) -> bool:
        """It is down, or hangs under its canopy for longer than anybody would fire again."""
        rig = self.rig
        now = rig.world.now
        if now > rig.landed + (_STANDS if self.scenario.lands else _LIES):
            return True
        if not math.isnan(rig.released) and self._is_carried():
            due = rig.released + self._followed
            return now > max(due, quiet if self.scenario.burn else 0.0)
        return now > quiet and not (rig.truth.falls or rig.another.falls)

    def _is_carried(self) -> bool:
        """By the canopy that is out; otherwise it falls on to the ground."""
        return not self.rig.another.falls or not math.isnan(self.rig.released_another)

    def _flown(self) -> Flown:
        rig = self.rig
        acted = rig.acted()
        killed = [one.at for one in acted if one.decision.action is Action.KILL]
        again = sum(node.ordered_again for node in rig.nodes.values())
        for host in rig.supervisors:
            deploys = [at for at, one in host.decided if one.action is Action.DEPLOY]
            # Once it is known that the first one does not carry, the next one is for that.
            again += sum(at > host.knew_release and not at >= rig.another.at for at in deploys)
        decided = sorted(
            (one for host in rig.supervisors for one in host.decided), key=lambda one: one[0]
        )
        said = sorted(one for host in rig.supervisors for one in host.said)
        grounded = ""
        if math.isnan(self.up):
            grounded = "; ".join(text for _, text in said) or "nothing was said"
        answer = self._person.answer
        return Flown(
            **{one.name: getattr(rig, one.name) for one in fields(Course)},
            scenario=self.scenario,
            grounded=grounded,
            up=self.up,
            killed=killed[0] if killed else math.nan,
            ordered_again=again,
            decided=tuple(decided),
            acted=tuple(acted),
            said=tuple(said),
            alarmed=tuple(sorted(one for host in rig.supervisors for one in host.alarmed)),
            told=tuple(rig.told()),
            refused=rig.refused_at(),
            answer="" if answer is None else f"{answer.success}: {answer.message}",
        )


def fly(scenario: Scenario, shipped: Shipped, make_peer: MakePeer | None = None) -> Flown:
    """One flight from beginning to end."""
    return Flight(scenario, shipped, make_peer).run()
