"""Two supervisors on hosts of their own, and a vehicle on a third: what a spoilt network does.

In each story the vehicle flies, a cable is spoilt, a motor fails; the parachute must come out,
after the kill, by one order; healed, one of the two must lead.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from chute_msgs.msg import SupervisorLease

from chute_ros.model import Action, Outcome
from chute_ros.ros import qos
from chute_ros.supervisor.machine import Stage
from chute_ros.tools import pages
from faults.flight import Flight
from faults.network import Network
from faults.stories import flown, fly_stories, in_seconds

VEHICLE, FIRST, SECOND = "vehicle", "first", "second"
HOSTS = (VEHICLE, FIRST, SECOND)
HEIGHT = 60.0  # m


@dataclass(frozen=True)
class Story:
    """What is spoilt, by which commands of the switch, and who leads then."""

    name: str
    spoilt: tuple[tuple[str, ...], ...]
    leader: str
    #: The cables are spoilt as the first kill leaves, not before the motor fails.
    at_kill: bool = False
    #: They are healed so long after the motor has failed, s; 0: not before the parachute is out.
    healed_after: float = 0.0


STORIES = (
    Story("nothing is disturbed", (), FIRST),
    Story("the leader's host is cut off", ((FIRST, "cut"),), SECOND),
    Story("the leader hears nothing, and is heard", ((FIRST, "deaf"),), SECOND),
    Story("the leader is not heard, and hears", ((FIRST, "mute"),), SECOND),
    Story("the standby's host is cut off", ((SECOND, "cut"),), FIRST),
    Story("the leader's messages take 0.2 s each way", ((FIRST, "slow", "0.2"),), FIRST),
    Story("the vehicle's host loses 30 % of all frames", ((VEHICLE, "lossy", "0.3"),), FIRST),
    Story("the leader is cut off as its kill leaves", ((FIRST, "cut"),), SECOND, at_kill=True),
    Story(
        "the vehicle's host is cut off for the first 1.5 s of the fall",
        ((VEHICLE, "cut"),),
        "",
        healed_after=1.5,
    ),
)


@dataclass
class Told:
    """What happened; times in s, NaN: it did not."""

    story: Story
    taken_over: float = float("nan")
    killed: float = float("nan")
    released: float = float("nan")
    healed: float = float("nan")
    wrong: str = ""


class Scene(Flight):
    """One flight with two supervisors."""

    def __init__(self, network: Network, folder: Path, namespace: str) -> None:
        super().__init__(network, folder, namespace)
        #: Name -> what it said last, and when.
        self.claims: dict[str, tuple[SupervisorLease, float]] = {}
        self.director.node.create_subscription(
            SupervisorLease, "safety/lease", self._claim, qos.STATUS
        )

    def take_off(self) -> None:
        """Both supervisors up, the first leads, the vehicle at its height."""
        director = self.director
        self.rig.start_vehicle()
        self.rig.start_parachute()
        self._start(FIRST, 0)
        director.until("the first leads", 30.0, lambda: self.leader() == FIRST)
        self._start(SECOND, 1)
        director.until("the second follows", 30.0, lambda: self.follows(SECOND))
        director.until("flight is released", 30.0, director.stage(Stage.READY))
        director.arm(10.0)
        self.climb(HEIGHT)

    def _start(self, name: str, rank: int) -> None:
        self.rig.start_supervisor(
            name,
            *("-r", f"__node:={name}", "-p", "hot_standby:=true", "-p", f"rank:={rank}"),
            on=self.network.on(name),
        )

    def leader(self) -> str:
        """Whom device nodes obey: of those that say that they lead the newest."""
        leading = [(claim.epoch, claim.name) for claim in self._heard() if claim.leading]
        return max(leading, default=(0, ""))[1]

    def one_leads(self) -> bool:
        """One leads, and the other follows it."""
        heard = self._heard()
        leading = [claim.name for claim in heard if claim.leading]
        return len(leading) == 1 and any(claim.leader == leading[0] for claim in heard)

    def follows(self, name: str) -> bool:
        """It follows somebody, with what that one told."""
        return any(claim.name == name and claim.leader for claim in self._heard())

    def _heard(self) -> list[SupervisorLease]:
        now = time.monotonic()
        return [claim for claim, heard in self.claims.values() if now < heard + 1.0]

    def spoil(self, story: Story) -> None:
        """As the story says."""
        for command in story.spoilt:
            self.network.cable(*command)

    def _claim(self, message: SupervisorLease) -> None:
        self.claims[message.name] = (message, time.monotonic())


def run(network: Network, story: Story, folder: Path, namespace: str) -> Told:
    """Fly it; what went wrong is in the answer."""
    told = Told(story)
    scene = Scene(network, folder, namespace)
    with flown(scene, told):
        scene.take_off()
        _fly(scene, story, told)
        told.wrong = _wrong(scene)
    return told


def _fly(scene: Scene, story: Story, told: Told) -> None:
    director = scene.director

    def since(start: float) -> float:
        return time.monotonic() - start

    if not story.at_kill and not story.healed_after:
        spoilt_at = time.monotonic()
        scene.spoil(story)
        director.until("the right one leads", 10.0, lambda: scene.leader() == story.leader)
        if story.leader != FIRST:
            told.taken_over = since(spoilt_at)
    failed_at = time.monotonic()
    scene.pilot.fail_motor()
    if story.healed_after:
        scene.spoil(story)
        scene.spin(story.healed_after)
        scene.heal()
    director.until("a kill is on the wire", 10.0, director.reported(Action.KILL, Outcome.SENT))
    told.killed = director.when(Action.KILL, Outcome.SENT) - failed_at
    if story.at_kill:
        scene.spoil(story)
    director.until("the parachute is out", 15.0, lambda: bool(director.deployed_at))
    told.released = director.deployed_at - failed_at
    scene.heal()
    healed_at = time.monotonic()
    director.until("one leads, the other follows", 15.0, scene.one_leads)
    told.healed = since(healed_at)
    director.until("it says deployed", 10.0, director.stage(Stage.DEPLOYED))
    # Whoever would still fire does it within its next turns.
    scene.spin(2.0)


def _wrong(scene: Scene) -> str:
    """What must never be; empty: it was not."""
    acted = scene.acted()
    deploys = [one for one in acted if one[2] == "DEPLOY"]
    actions = [one[2] for one in acted]
    if len(deploys) != 1:
        return f"{len(deploys)} deploys were acted on: {acted}"
    if actions[:1] != ["KILL"]:
        return f"the kill did not go first: {acted}"
    epochs = [epoch for epoch, _, _ in acted]
    if epochs != sorted(epochs):
        return f"an older leader was obeyed: {acted}"
    return ""


def table(every: list[Told]) -> str:
    """As Markdown."""
    rows = []
    for told in every:
        times = map(in_seconds, (told.taken_over, told.killed, told.released, told.healed))
        rows.append((told.story.name, *times, told.wrong or "correct"))
    head = ("disturbance", "takeover", "kill on the wire", "parachute out", "one leads again", "")
    return pages.table(head, rows)


def fly_all(network: Network, names: tuple[str, ...] = ()) -> list[Told]:
    """Every story, or those whose names contain one of names."""
    return fly_stories(
        STORIES, names, lambda story, folder, n: run(network, story, folder, f"/story{n}")
    )
