"""What a spoilt network does between a vehicle that flies and the operator who watches it.

A parachute must come out by itself whatever the ground station sees; an operator's call must be
carried out once, and a call that nobody waits for any more must not be.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.model import Action, Outcome
from chute_ros.supervisor.machine import Stage
from chute_ros.tools import pages
from faults.ground_station_flight import (
    CAREFUL,
    GROUND,
    PLAIN,
    USUAL,
    GroundStationFlight,
)
from faults.network import Network
from faults.stories import in_seconds

#: How long what must not happen is waited for, s.
WATCHED = 4.0
#: How many calls a lossy network must answer.
CALLS = 12


@dataclass
class Seen:
    """What came of a story; times in s, NaN: it did not happen or is not asked."""

    wire: float = math.nan
    answer: float = math.nan
    again: float = math.nan
    wrong: str = ""
    #: What a user must know although nothing went wrong.
    known: str = ""


Act = Callable[[GroundStationFlight, Seen], None]


@dataclass(frozen=True)
class Story:
    """cable: how the ground station's is spoilt; act: what happens then."""

    name: str
    act: Act
    cable: tuple[str, ...] = ()


def _deploys(flight: GroundStationFlight, seen: Seen, station: str = USUAL) -> None:
    """The operator deploys; the call, what leaves on the wire, the answer."""
    operator = flight.station(station)
    token, called_at = flight.deploy(operator, "the operator sees it fall")
    sent = flight.director.reported(Action.DEPLOY, Outcome.SENT)
    flight.director.until("the release is on the wire", 30.0, sent)
    seen.wire = flight.on_the_wire(Action.DEPLOY) - called_at
    seen.answer = flight.seen(operator, called_at, answered=token, success=True) - called_at
    flight.spin(2.0)
    seen.wrong = not_one_deploy(flight)


def _deploys_through_losses(station: str) -> Act:
    """Which packets are lost is chance: a call says little of how long calls take."""

    def act(flight: GroundStationFlight, seen: Seen) -> None:
        operator = flight.station(station)
        flight.network.cable(GROUND, "lossy", "0.3")
        took = sorted(flight.harmless(operator) for _ in range(CALLS))
        _deploys(flight, seen, station)
        half = took[CALLS // 2]
        seen.known = f"correct; of {CALLS} calls half within {half:.2f} s, all in {took[-1]:.2f} s"

    return act


def _kills(flight: GroundStationFlight, seen: Seen) -> None:
    operator = flight.station(USUAL)
    token, called_at = flight.kill(operator, "a person stands below")
    sent = flight.director.reported(Action.KILL, Outcome.SENT)
    flight.director.until("the kill is on the wire", 30.0, sent)
    seen.wire = flight.on_the_wire(Action.KILL) - called_at
    seen.answer = flight.seen(operator, called_at, answered=token, success=True) - called_at
    if sum(action == "KILL" for _, _, action in flight.acted()) != 1:
        seen.wrong = f"not one kill was acted on: {flight.acted()}"


def _falls_unseen(flight: GroundStationFlight, seen: Seen) -> None:
    """Nobody watches: the supervisor deploys by itself."""
    operator = flight.station(USUAL)
    failed_at = flight.fail_motor()
    flight.director.until("the parachute is out", 15.0, lambda: bool(flight.director.deployed_at))
    seen.wire = flight.on_the_wire(Action.DEPLOY) - failed_at
    flight.spin(2.0)
    flight.heal()
    healed_at = time.monotonic()
    deployed = flight.seen(operator, healed_at, state=int(Stage.DEPLOYED))
    seen.again = deployed - healed_at
    flight.seen(operator, healed_at, deployed=True)
    seen.wrong = not_one_deploy(flight)


def _asks_again(flight: GroundStationFlight, seen: Seen) -> None:
    """The calls arrive, the answers do not: the operator calls each second."""
    operator = flight.station(USUAL)
    calls = []
    for _ in range(3):
        calls.append(flight.deploy(operator, "the operator sees it fall"))
        flight.spin(1.0)
    called_at = calls[0][1]
    flight.director.until("the parachute is out", 15.0, lambda: bool(flight.director.deployed_at))
    seen.wire = flight.on_the_wire(Action.DEPLOY) - called_at
    flight.heal()
    healed_at = time.monotonic()
    answers = [flight.seen(operator, called_at, answered=token) for token, _ in calls]
    seen.answer = max(answers) - called_at
    seen.again = flight.seen(operator, healed_at, state=int(Stage.DEPLOYED)) - healed_at
    flight.spin(2.0)
    seen.wrong = not_one_deploy(flight)


def _waits(cut: float, station: str, gives_up: bool) -> Act:
    """A call that cannot leave, made when the cable was just spoilt; healed after cut, s."""

    def act(flight: GroundStationFlight, seen: Seen) -> None:
        operator = flight.station(station)
        token, called_at = flight.deploy(operator, "the operator sees it fall")
        flight.spin(cut if not gives_up else cut - 1.0)
        if gives_up:
            operator.give_up(token)
            flight.spin(1.0)
        flight.heal()
        healed_at = time.monotonic()
        seen.again = flight.seen(operator, healed_at, state=...) - healed_at
        flight.spin(WATCHED)
        if flight.director.reported(Action.DEPLOY, Outcome.SENT)():
            seen.wire = flight.on_the_wire(Action.DEPLOY) - called_at
            late = f"carried out {seen.wire:.1f} s after the call"
            # A client as ROS 2 makes it keeps its call for as long as the network needs.
            if station == CAREFUL or gives_up:
                seen.wrong = late
            else:
                seen.known = f"**{late}**"
        else:
            seen.known = "correctly not carried out"

    return act


def _joins(flight: GroundStationFlight, seen: Seen) -> None:
    """A second ground station is started while the vehicle flies and says nothing new."""
    started = flight.start_station(CAREFUL)
    begun_at = flight.seen(started, 0.0, begun=True)
    seen.again = flight.seen(started, begun_at, state=int(Stage.IN_FLIGHT)) - begun_at


def not_one_deploy(flight: GroundStationFlight) -> str:
    acted = [action for _, _, action in flight.acted()]
    if acted.count("DEPLOY") != 1:
        return f"{acted.count('DEPLOY')} deploys were acted on: {acted}"
    return "" if acted[:1] == ["KILL"] else f"the kill did not go first: {acted}"


#: Those that leave the vehicle in the air stand before one that does not: they share a flight.
STORIES: Sequence[Story] = (
    Story("another ground station joins in flight", _joins),
    Story(
        "the call cannot leave for 5 s; its lifespan is 1 s",
        _waits(5.0, CAREFUL, gives_up=False),
        ("mute",),
    ),
    Story(
        "the call cannot leave for 5 s; after 4 s the operator's client goes",
        _waits(5.0, USUAL, gives_up=True),
        ("mute",),
    ),
    Story("nothing is disturbed; the operator deploys", _deploys),
    Story("nothing is disturbed; the operator kills", _kills),
    Story("cut; a motor fails; healed after the deploy", _falls_unseen, ("cut",)),
    Story("0.2 s each way; the operator deploys", _deploys, ("slow", "0.2")),
    Story("1 s each way; the operator deploys", _deploys, ("slow", "1.0")),
    Story("30 % of all frames lost; the operator deploys", _deploys_through_losses(USUAL)),
    Story(
        "30 % lost; the operator's node has Fast DDS as delivered",
        _deploys_through_losses(PLAIN),
    ),
    Story("the answers do not arrive; the operator calls three times", _asks_again, ("deaf",)),
    Story(
        "the call cannot leave for 5 s, and nobody takes it back",
        _waits(5.0, USUAL, gives_up=False),
        ("mute",),
    ),
    Story(
        "cut for 25 s, and nobody takes the call back",
        _waits(25.0, USUAL, gives_up=False),
        ("cut",),
    ),
)


def table(every: Sequence[tuple[Story, Seen]]) -> str:
    """As Markdown."""
    rows = []
    for story, seen in every:
        times = map(in_seconds, (seen.wire, seen.answer, seen.again))
        rows.append((story.name, *times, seen.wrong or seen.known or "correct"))
    head = ("disturbance", "on the wire", "answered", "seen (again)", "")
    return pages.table(head, rows)


def fly_all(network: Network, names: tuple[str, ...] = ()) -> list[tuple[Story, Seen]]:
    """Every story, or those whose names contain one of names."""
    wanted = [s for s in STORIES if not names or any(name in s.name for name in names)]
    every: list[tuple[Story, Seen]] = []
    while wanted:
        with tempfile.TemporaryDirectory(prefix="chute_ros_hosts_") as folder:
            done = _fly(network, wanted, Path(folder), f"/ground{len(wanted)}")
        every += done
        wanted = wanted[len(done) :]
    return every


def _fly(
    network: Network, stories: Sequence[Story], folder: Path, namespace: str
) -> list[tuple[Story, Seen]]:
    """One flight, with as many of the stories as it lasts for, but at least one."""
    done: list[tuple[Story, Seen]] = []
    flight = GroundStationFlight(network, folder, namespace)
    try:
        for story in stories:
            if done and not flight.flies():
                break
            seen = Seen()
            done.append((story, seen))
            print(f"-- {story.name}", flush=True)
            _tell(flight, story, seen, first=len(done) == 1)
            print(f"   {seen.wrong or seen.known or 'correct'}", flush=True)
            if seen.wrong:
                break
    finally:
        flight.close()
    return done


def _tell(flight: GroundStationFlight, story: Story, seen: Seen, first: bool) -> None:
    try:
        if first:
            flight.take_off()
        if story.cable:
            flight.network.cable(GROUND, *story.cable)
        story.act(flight, seen)
        flight.heal()
    except ChuteError as error:
        seen.wrong = str(error).splitlines()[0]
        print(error)
