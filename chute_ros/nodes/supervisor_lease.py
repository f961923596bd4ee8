"""The lease among the supervisors of one vehicle, over ROS: their claims on safety/lease."""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable

from chute_msgs.msg import SupervisorLease
from rclpy.clock import Clock
from rclpy.node import Node

from chute_ros.errors import NameTakenError, RecordError
from chute_ros.nodes import qos
from chute_ros.supervisor import handover
from chute_ros.supervisor.epochs import RANKS
from chute_ros.supervisor.lease import Claim, Event, Lease, LeaseConfig, Role
from chute_ros.supervisor.orders import ON_GROUND
from chute_ros.supervisor.state import State

#: Only one that has just started gives way to another of its name, s: a forged claim must not end
#: One that lives claims ten times a second; a single claim may be anybody's.
_CLAIMS_OF_ONE_THAT_LIVES = 3
#: one that has been at work.
_JUST_STARTED = 30.0
_APART = "end one, or give it a name (-r __node:=NAME), a rank and hot_standby of its own"
#: Two that differ by less than this, s, started together; then the larger instance stays.
_TOGETHER = 1.0


class LeaseKeeper:
    """state: gives the supervisor's; links_heard: how many, now; happened: told of each event;
    follow: given the state that the leader told. All in the decision loop's thread.

    NameTakenError from a callback: another of this name was there first."""

    def __init__(
        self,
        node: Node,
        config: LeaseConfig,
        wall: Clock,
        state: Callable[[], State],
        links_heard: Callable[[float], int],
        happened: Callable[[Event], None],
        follow: Callable[[State], None],
    ) -> None:
        self.config = config
        self.lease = Lease.begin(config, time.monotonic())
        #: Tells it from another of its name.
        self.instance = secrets.token_hex(8)
        self._started = time.monotonic()
        #: When another of its name was heard last, monotonic s.
        self._namesake_heard = -math.inf
        #: The namesake heard last: its instance, how often in a row, and for how long it runs.
        self._rival = ("", 0, -math.inf)
        self._node, self._wall = node, wall
        self._state, self._links_heard = state, links_heard
        self._happened, self._follow = happened, follow
        #: It has taken over from another, or followed one.
        self._experienced = False
        #: Whose state it has.
        self._followed = ""
        #: Who follows this one, and when that was last said, monotonic s.
        self._followers: dict[str, float] = {}
        self._complained: set[str] = set()
        #: Who claimed something last, and when, monotonic s.
        self._other = ("", -math.inf)
        self._publisher = node.create_publisher(SupervisorLease, "safety/lease", qos.STATUS)
        node.create_subscription(
            SupervisorLease, "safety/lease", self._claim, qos.newest(qos.STATUS)
        )

    @property
    def leading(self) -> bool:
        """What it decides is sent."""
        return self.lease.role is Role.LEADING

    def deadline(self, now: float) -> float:
        """When look has something to do, monotonic s, after now; infinity: not before it hears
        more."""
        deadline = self.lease.deadline(self.config)
        return deadline if deadline > now else math.inf

    def look(self, now: float) -> None:
        """Before each turn: does it still lead, must it take over?"""
        link_heard = self._state().newest_heartbeat()
        self.lease, event = self.lease.looked(self.config, now, link_heard)
        if event is not None:
            self._happened(event)

    def refused(self, newest_epoch: int, now: float) -> None:
        """A device has seen a newer leader."""
        if self.leading:
            self.lease, event = self.lease.refused(newest_epoch, now)
            self._happened(event)

    def next_epoch(self) -> int:
        """For taking over."""
        return self.lease.next_epoch(self.config, self._state().epoch)

    def tell(self, now: float) -> None:
        """Renew the lease; before a decision leaves, so that whoever takes over knows of it."""
        claim, state = self._own(now), self._state()
        message = SupervisorLease(
            name=claim.name,
            instance=self.instance,
            running=now - self._started,
            rank=claim.rank,
            epoch=claim.epoch,
            leading=claim.leading,
            empty=claim.empty,
            links_heard=claim.links_heard,
            leader="" if claim.leading else self._followed,
            state=handover.told(state, now) if claim.leading and self.config.standby else "",
        )
        message.header.stamp = self._wall.now().to_msg()
        self._publisher.publish(message)

    def followers(self, now: float) -> list[str]:
        """Who follows this one and is ready to take over."""
        limit = self.config.timeout * RANKS
        return sorted(name for name, when in self._followers.items() if now - when < limit)

    def trouble(self, now: float) -> str:
        """What is wrong with the supervisors' settings; empty: nothing."""
        if now - self._namesake_heard < self.config.timeout * RANKS:
            return f"another supervisor is called {self.config.name} as well: {_APART}"
        name, heard = self._other
        if not self.config.standby and now - heard < self.config.timeout * RANKS:
            return f"{name} runs as well: set hot_standby and different ranks, or stop one"
        if self.lease.same_rank:
            name, rank = self.lease.same_rank, self.config.rank
            return f"{name} has rank {rank} as well: give each supervisor its own"
        return ""

    def _own(self, now: float) -> Claim:
        state = self._state()
        empty = not self._experienced and not state.flown and state.stage in ON_GROUND
        name, rank = self.config.name, self.config.rank
        return Claim(name, rank, state.epoch, self.leading, empty, self._links_heard(now))

    def _claim(self, message: SupervisorLease) -> None:
        if message.instance == self.instance:
            return
        now = time.monotonic()
        # A supervisor always gives its instance: without one somebody else made it up.
        if message.name == self.config.name and message.instance:
            self._namesake(message, now)
        if message.leader == self.config.name:
            here = self.followers(now)
            self._followers = {name: self._followers[name] for name in here}
            if message.name in here or len(here) < RANKS:
                self._followers[message.name] = now
        other = Claim(
            message.name,
            message.rank,
            message.epoch,
            message.leading,
            message.empty,
            message.links_heard,
        )
        # Whoever it is: its number must not leave us without one that device nodes obey.
        if wrong := other.implausible(self.config.rank):
            self._complain(f"{message.name} claims {wrong}: not listened to")
            return
        self._other = (message.name, now)
        self.lease, event = self.lease.heard(self.config, self._own(now), other, now)
        if event is not None:
            self._happened(event)
        if message.leading and self.lease.leader == message.name and message.state:
            self._follow_claim(message, now)
        if trouble := self.trouble(now):
            self._complain(trouble)

    def _namesake(self, message: SupervisorLease, now: float) -> None:
        """Another of this name is at work: who came later goes, in flight as well."""
        self._namesake_heard = now
        instance, times, ran = self._rival
        goes_on = message.instance == instance and message.running > ran
        self._rival = message.instance, times + 1 if goes_on else 1, message.running
        running = now - self._started
        older = message.running > running + _TOGETHER
        together = abs(message.running - running) <= _TOGETHER
        first = older or (together and message.instance > self.instance)
        lives = self._rival[1] >= _CLAIMS_OF_ONE_THAT_LIVES
        if lives and first and running < _JUST_STARTED:
            raise NameTakenError(
                f"another supervisor called {message.name} runs for {message.running:.0f} s "
                f"already (instance {message.instance[:16]}): {_APART}"
            )

    def _follow_claim(self, message: SupervisorLease, now: float) -> None:
        try:
            state = handover.followed(self._state(), message.state, now)
            if state.epoch != message.epoch:
                raise RecordError(f"it claims epoch {message.epoch} and tells of {state.epoch}")
        except RecordError as error:
            self._complain(f"cannot follow {message.name}: {error}")
            return
        self._follow(state)
        self._experienced, self._followed = True, message.name

    def _complain(self, text: str) -> None:
        if text not in self._complained and len(self._complained) < 16:
            self._complained.add(text)
            self._node.get_logger().error(text)
