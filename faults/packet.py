"""One packet for which Fast DDS takes all memory (CVE-2025-64438), thrown at a vehicle in flight.

A stranger on the vehicle's network hears who is there and sends it. What ends is started again, as
launch/vehicle.launch.py does; then, or as the packet arrives, a motor fails.
"""

from __future__ import annotations

import enum
import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from chute_ros.ros.memory_limit import VARIABLE
from chute_ros.supervisor.machine import Stage
from chute_ros.tools import pages
from chute_ros.tools.demo_director import StepFailedError
from faults.flight import Flight
from faults.gap_packet import Stranger, gap_packet
from faults.network import Network
from faults.respawned import RESPAWN_DELAY, RespawnedProcesses
from faults.stories import flown, fly_stories, in_seconds

VEHICLE, STRANGER = "vehicle", "stranger"
HOSTS = (VEHICLE, STRANGER)
HEIGHT = 80.0  # m
SUPERVISOR, STANDBY, DEVICE_NODE = "supervisor", "standby", "mavlink"
#: How long it is watched what it takes without a limit, s; no more than this is let it have, MB.
WATCHED, MOST = 8.0, 3_000
#: What fell from there has been on the ground for a while, s.
_FALLEN = 15.0
#: After so long, s, the packet has reached whom it can.
_REACHED = 5.0


class When(enum.Enum):
    """When a motor fails."""

    PACKET = "a motor fails as the packet arrives"
    END = "a motor fails as the process ends"
    BACK = "a motor fails once it is back"


@dataclass(frozen=True)
class Story:
    """At whom the packet is thrown, and who keeps to the vehicle's own host."""

    name: str
    victim: str
    local: tuple[str, ...] = ()
    standby: bool = False
    #: Nothing bounds the memory of the nodes, and nobody looks further than that.
    unbounded: bool = False
    #: When a motor fails.
    fails: When = When.BACK
    #: Nobody is there meanwhile who could deploy.
    may_miss: bool = False
    #: It is thrown again at each that is started, for so long, s.
    again_for: float = 0.0


STORIES = (
    Story("the supervisor, without a memory limit", SUPERVISOR, unbounded=True),
    *(Story("the supervisor", SUPERVISOR, fails=when, may_miss=when is When.END) for when in When),
    *(Story("`mavlink_parachute`", DEVICE_NODE, fails=when) for when in (When.PACKET, When.BACK)),
    Story("the supervisor, each time it is started again", SUPERVISOR, again_for=30.0),
    Story(
        "the leader, whose standby and device node keep to the host",
        SUPERVISOR,
        (DEVICE_NODE, STANDBY),
        standby=True,
        fails=When.END,
    ),
    Story(
        "everybody, where all nodes keep to the host",
        "",
        (DEVICE_NODE, SUPERVISOR),
        fails=When.PACKET,
    ),
)


@dataclass
class Told:
    """What happened; times in s, NaN: it did not."""

    story: Story
    #: From the packet: its process ends, and has its flight again.
    ended: float = math.nan
    back: float = math.nan
    #: The most memory that it took, MB.
    peak: float = math.nan
    #: From the motor's failure to the parachute's own "deployed".
    released: float = math.nan
    how: str = ""
    wrong: str = ""


class Scene(Flight):
    """One flight, and the stranger."""

    processes: RespawnedProcesses

    def __init__(self, network: Network, folder: Path, namespace: str, story: Story) -> None:
        super().__init__(network, folder, namespace, RespawnedProcesses(folder, story.local))
        self.story = story
        network.enter(STRANGER)
        self.stranger = Stranger(network.address(STRANGER))
        network.enter(VEHICLE)

    def take_off(self) -> None:
        """Everything up, the vehicle at its height."""
        director, standby = self.director, ("-p", "hot_standby:=true")
        self.rig.start_vehicle()
        self.rig.start_parachute()
        self.rig.start_supervisor(SUPERVISOR, *(standby if self.story.standby else ()))
        if self.story.standby:
            names = ("-r", f"__node:={STANDBY}", "-p", "rank:=1")
            self.rig.start_supervisor(STANDBY, *standby, *names)
        director.until("flight is released", 60.0, director.stage(Stage.READY))
        director.arm(10.0)
        self.climb(HEIGHT)

    def attack(self) -> float:
        """One packet to the victim, or one for everybody; when it was sent, monotonic s."""
        self.stranger.listen(8.0)
        heard = self.stranger.prefixes
        own = self.stranger.prefix_of(os.getpid())
        if own is None:
            raise StepFailedError(f"the stranger hears nobody: {heard}")
        if self.story.victim:
            victim = self.stranger.prefix_of(self.processes.pid(self.story.victim))
            if victim is None:
                raise StepFailedError(f"the stranger does not hear {self.story.victim}: {heard}")
            packet = gap_packet(own, victim)
        else:
            # Whoever gets it takes it for its own.
            packet = gap_packet(own, bytes(12))
        self.stranger.send(packet, self.network.address(VEHICLE))
        return time.monotonic()

    def attack_again(self, until: float) -> None:
        """Who got it and was started again gets it again and again, until then, monotonic s."""
        while time.monotonic() < until:
            self.stranger.listen(0.2)
            self.spin(0.2)
            own = self.stranger.prefix_of(os.getpid())
            prefix = self.stranger.prefix_of(self.processes.pid(self.story.victim))
            if own is not None and prefix is not None:
                self.stranger.send(gap_packet(own, prefix), self.network.address(VEHICLE))

    def goes_on(self) -> Callable[[], bool]:
        """Whether the victim is back: the flight and the vehicle are told of from now on."""
        victim, since = self.story.victim, time.monotonic() + RESPAWN_DELAY
        before = self.director.safety.header.stamp

        def does() -> bool:
            told = self.director.safety
            flies = told.header.stamp != before and told.state == Stage.IN_FLIGHT
            return (
                self.processes.memory(victim) > 0.0
                and flies
                and self.director.track[-1][0] > since
            )

        return does

    def close(self) -> None:
        """As a flight; the stranger leaves."""
        self.stranger.close()
        super().close()


def run(network: Network, story: Story, folder: Path, namespace: str) -> Told:
    """Fly it; what went wrong is in the answer."""
    told = Told(story)
    with _memory_limit("0" if story.unbounded else None):
        scene = Scene(network, folder, namespace, story)
        with flown(scene, told):
            scene.take_off()
            _fly(scene, told)
    return told


@contextmanager
def _memory_limit(megabytes: str | None) -> Iterator[None]:
    before = os.environ.get(VARIABLE)
    if megabytes is not None:
        os.environ[VARIABLE] = megabytes
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(VARIABLE, None)
        else:
            os.environ[VARIABLE] = before


def _fly(scene: Scene, told: Told) -> None:
    story, processes = scene.story, scene.processes
    if story.unbounded:
        _watch(scene, told)
        return
    sent_at = scene.attack()
    if story.fails is When.PACKET:
        _fail_motor(scene, told)
    if not story.victim:
        scene.spin(max(0.0, sent_at + _REACHED - time.monotonic()))
        told.how = "nobody ends"
        told.wrong = "; ".join(f"{one.name} ended" for one in processes.ended)
        return
    scene.director.until("it ends", 60.0, lambda: processes.first_end(story.victim) is not None)
    end = processes.first_end(story.victim)
    assert end is not None
    told.ended, told.peak, told.how = end.at - sent_at, end.peak, f"ended by signal {-end.code}"
    if story.again_for:
        scene.attack_again(sent_at + story.again_for)
        ends = sum(one.name == story.victim for one in processes.ended)
        told.how += f", {ends} times in {story.again_for:g} s"
        sent_at = time.monotonic()
    if story.fails is When.END:
        _fail_motor(scene, told)
    if story.fails is When.BACK:
        scene.director.until("the flight goes on", 30.0, scene.goes_on())
        told.back = time.monotonic() - sent_at
        # It has a picture of its own of all that is there.
        scene.spin(3.0)
        _fail_motor(scene, told)
    beside = {one.name for one in processes.ended} - {story.victim}
    if beside:
        told.wrong = f"{', '.join(sorted(beside))} ended as well"


def _fail_motor(scene: Scene, told: Told) -> None:
    failed_at = time.monotonic()
    scene.pilot.fail_motor()
    director, end = scene.director, failed_at + _FALLEN
    director.until(
        "the parachute is out, or the vehicle on the ground",
        _FALLEN + 5.0,
        lambda: bool(director.deployed_at) or time.monotonic() > end,
    )
    if director.deployed_at:
        told.released = director.deployed_at - failed_at
    elif not scene.story.may_miss:
        told.wrong = "the parachute stays in"


def _watch(scene: Scene, told: Told) -> None:
    """What it takes. The computer is not given up for it."""
    processes, victim = scene.processes, scene.story.victim
    before = processes.memory(victim)
    sent_at = scene.attack()
    end = sent_at + WATCHED
    scene.director.until(
        "it is watched",
        WATCHED + 5.0,
        lambda: time.monotonic() >= end or processes.memory(victim) > MOST,
    )
    told.peak = processes.memory(victim)
    rate = (told.peak - before) / (time.monotonic() - sent_at)
    told.how = f"takes {rate:.0f} MB/s more, and does not end"


def table(every: list[Told]) -> str:
    """As Markdown."""
    rows = []
    for told in every:
        ended, back, out = map(in_seconds, (told.ended, told.back, told.released))
        then = "-" if told.story.unbounded else told.story.fails.value
        if told.story.may_miss and told.released != told.released:
            out = "**stays in**"
        peak = "-" if told.peak != told.peak else f"{told.peak:.0f} MB"
        name, how, end = told.story.name, told.how or "-", told.wrong or "correct"
        rows.append((name, then, how, peak, ended, back, out, end))
    head = ("who gets it", "then", "its process", "memory")
    return pages.table((*head, "ends after", "back after", "out after", ""), rows)


def fly_all(network: Network, names: tuple[str, ...] = ()) -> list[Told]:
    """Every story, or those whose names contain one of names."""
    return fly_stories(
        STORIES, names, lambda story, folder, n: run(network, story, folder, f"/packet{n}")
    )
