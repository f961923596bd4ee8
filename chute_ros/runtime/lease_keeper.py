"""A supervisor's handling of claims on safety/lease: leader, followers, namesakes."""

from __future__ import annotations

import math
from typing import Any, Protocol

from chute_ros.errors import NameTakenError, RecordError
from chute_ros.protocol.events import Notice, Severity
from chute_ros.runtime.topics import LeaseClaim
from chute_ros.supervisor import handover
from chute_ros.supervisor.epochs import RANKS
from chute_ros.supervisor.lease import Claim, Lease, LeaseConfig, LeaseEvent, Role
from chute_ros.supervisor.machine import ON_GROUND
from chute_ros.supervisor.state import State

#: One that lives claims ten times a second; a single claim may be anybody's.
_CLAIMS_OF_ONE_THAT_LIVES = 3
#: Only one that has just started gives way to another of its name, s: a forged claim must not end
#: one that has been at work.
_JUST_STARTED = 30.0
_APART = "end one, or give it a name (-r __node:=NAME), a rank and hot_standby of its own"
#: Two that differ by less than this, s, started together; then the larger instance stays.
_TOGETHER = 1.0


class LeaseShell(Protocol):
    """Carries claims to the other supervisors, and lines to a person."""

    def publish(self, message: Any) -> int:
        """To all others."""

    def log(self, notice: Notice) -> None:
        """A line for a person."""


class LeaseOwner(Protocol):
    """Whose lease it is."""

    @property
    def state(self) -> State:
        """The core's."""

    def links_heard(self, now: float) -> int:
        """How many."""

    def lease_event(self, event: LeaseEvent, now: float) -> None:
        """The role, or whom it leads past, has changed."""

    def follow(self, state: State) -> None:
        """The leader told its state."""


class LeaseKeeper:
    """owner: the supervisor. instance: a text that nobody else has. now: monotonic s.

    NameTakenError from claim: another of this name was there first."""

    def __init__(
        self,
        config: LeaseConfig,
        instance: str,
        shell: LeaseShell,
        owner: LeaseOwner,
        now: float,
    ) -> None:
        self.config = config
        self.lease = Lease.begin(config, now)
        #: Tells it from another of its name.
        self.instance = instance
        self._started = now
        #: When another of its name was heard last, monotonic s.
        self._namesake_heard = -math.inf
        #: The namesake heard last: its instance, how often in a row, and for how long it runs.
        self._rival = ("", 0, -math.inf)
        self._shell, self._owner = shell, owner
        #: It has taken over from another, or followed one.
        self._experienced = False
        #: Whose state it has.
        self._followed = ""
        #: Who follows this one, and when that was last said, monotonic s.
        self._followers: dict[str, float] = {}
        self._complained: set[str] = set()
        #: Who claimed something last, and who of the same rank, and when, monotonic s.
        self._other = self._of_our_rank = ("", -math.inf)

    @property
    def leading(self) -> bool:
        """True: its decisions are sent."""
        return self.lease.role is Role.LEADING

    def deadline(self, now: float) -> float:
        """When look has something to do, monotonic s, after now; infinity: not before it hears
        more."""
        deadline = self.lease.deadline(self.config)
        return deadline if deadline > now else math.inf

    def look(self, now: float) -> None:
        """Before each turn: does it still lead, must it take over?"""
        link_heard = self._owner.state.newest_heartbeat()
        self.lease, event = self.lease.looked(self.config, now, link_heard)
        if event is not None:
            self._owner.lease_event(event, now)

    def refused(self, newest_epoch: int, now: float) -> None:
        """A device has seen a newer leader."""
        if self.leading:
            self.lease, event = self.lease.refused(newest_epoch, now)
            self._owner.lease_event(event, now)

    def next_epoch(self) -> int:
        """For taking over."""
        return self.lease.next_epoch(self.config, self._owner.state.epoch)

    def tell(self, now: float) -> None:
        """Renew the lease; before a decision leaves, so that whoever takes over knows of it."""
        claim, state = self._own(now), self._owner.state
        tells = claim.leading and self.config.standby
        self._shell.publish(
            LeaseClaim(
                claim,
                self.instance,
                now - self._started,
                "" if claim.leading else self._followed,
                handover.told(state, now) if tells else "",
            )
        )

    def followers(self, now: float) -> list[str]:
        """Names of the followers that are ready to take over."""
        limit = self.config.timeout * RANKS
        return sorted(name for name, when in self._followers.items() if now - when < limit)

    def trouble(self, now: float) -> str:
        """Trouble with the supervisors' settings; empty: none."""
        since = now - self.config.timeout * RANKS
        if self._namesake_heard > since:
            return f"another supervisor is called {self.config.name} as well: {_APART}"
        name, heard = self._other
        if not self.config.standby and heard > since:
            return f"{name} runs as well: set hot_standby and different ranks, or stop one"
        name, heard = self._of_our_rank
        if heard > since:
            return f"{name} has rank {self.config.rank} as well: give each supervisor its own"
        return ""

    def _own(self, now: float) -> Claim:
        state = self._owner.state
        empty = not self._experienced and not state.flight.flown and state.stage in ON_GROUND
        name, rank = self.config.name, self.config.rank
        return Claim(name, rank, state.epoch, self.leading, empty, self._owner.links_heard(now))

    def claim(self, told: LeaseClaim, now: float) -> None:
        """Any supervisor's came, also our own."""
        if told.instance == self.instance:
            return
        other = told.claim
        # A supervisor always gives its instance: without one somebody else made it up.
        if other.name == self.config.name and told.instance:
            self._namesake(told, now)
        if told.leader == self.config.name:
            here = self.followers(now)
            self._followers = {name: self._followers[name] for name in here}
            if other.name in here or len(here) < RANKS:
                self._followers[other.name] = now
        # Whoever it is: its number must not leave us without one that device nodes obey.
        if wrong := other.implausible(self.config.rank):
            self._complain(f"{other.name} claims {wrong}: ignored")
            return
        self._other = (other.name, now)
        if other.rank == self.config.rank:
            self._of_our_rank = (other.name, now)
        self.lease, event = self.lease.heard(self._own(now), other, now)
        if event is not None:
            self._owner.lease_event(event, now)
        if other.leading and self.lease.leader == other.name and told.state:
            self._follow_claim(told, now)
        if trouble := self.trouble(now):
            self._complain(trouble)

    def _namesake(self, told: LeaseClaim, now: float) -> None:
        """Another of this name is at work: who came later goes, in flight as well."""
        self._namesake_heard = now
        instance, times, ran = self._rival
        goes_on = told.instance == instance and told.running > ran
        self._rival = told.instance, times + 1 if goes_on else 1, told.running
        running = now - self._started
        older = told.running > running + _TOGETHER
        together = abs(told.running - running) <= _TOGETHER
        first = older or (together and told.instance > self.instance)
        lives = self._rival[1] >= _CLAIMS_OF_ONE_THAT_LIVES
        if lives and first and running < _JUST_STARTED:
            raise NameTakenError(
                f"another supervisor called {told.claim.name} runs for {told.running:.0f} s "
                f"already (instance {told.instance[:16]}): {_APART}"
            )

    def _follow_claim(self, told: LeaseClaim, now: float) -> None:
        try:
            state = handover.followed(self._owner.state, told.state, now)
            if state.epoch != told.claim.epoch:
                raise RecordError(
                    f"it claims epoch {told.claim.epoch} and its state has epoch {state.epoch}"
                )
        except RecordError as error:
            self._complain(f"cannot follow {told.claim.name}: {error}")
            return
        self._owner.follow(state)
        self._experienced, self._followed = True, told.claim.name

    def _complain(self, text: str) -> None:
        if text not in self._complained and len(self._complained) < 16:
            self._complained.add(text)
            self._shell.log(Notice(Severity.ERROR, text))
