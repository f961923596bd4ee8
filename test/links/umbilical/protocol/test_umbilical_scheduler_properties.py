"""What holds whatever is ordered or heard and whenever it is looked at: scheduler and link."""

import itertools
import math

from hypothesis import given, settings
from hypothesis import strategies as st
from umbilical_lines import LAYOUTS
from umbilical_link_bench import ASCENT, ONE_TOKEN, STANDBY, zeros

from chute_ros.links.umbilical.protocol import commands
from chute_ros.links.umbilical.protocol.config import DeployStage, UmbilicalConfig
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.links.umbilical.protocol.scheduler import (
    HEARTBEAT,
    Command,
    CommandScheduler,
    SchedulerLimits,
)
from chute_ros.protocol.events import RequestFinished

LIMITS = st.builds(
    SchedulerLimits,
    spacing=st.floats(0.1, 0.3),
    heartbeat_interval=st.floats(0.6, 2.0),
    heartbeat_slack=st.floats(0.0, 1.0),
    most_waiting=st.integers(1, 5),
)
PAUSE = st.sampled_from([0.0, 0.0, 0.05, 0.1, 0.12]) | st.floats(0.0, 3.0)
WHAT = st.sampled_from(
    ["order", "order", "urgent", "once", "cancel", "open", "close", "alive", "look"]
)
STORY = st.lists(st.tuples(PAUSE, WHAT, st.integers(0, 9)), max_size=60)
START = st.floats(0.0, 1e6)


class Run:
    """A scheduler in a story, and all that became of each command."""

    def __init__(self, limits, start):
        self.limits, self.now = limits, start
        self.scheduler = CommandScheduler(limits)
        self.is_open = False
        self.started, self.urgent, self.cancelled, self.refused = [], set(), set(), []
        self.sent, self.writes, self.once = [], [], 0

    def do(self, what, number):
        scheduler = self.scheduler
        if what in ("order", "urgent"):
            token = len(self.started) + 1
            self.started.append(token)
            if what == "urgent":
                self.urgent.add(token)
            command = Command("any", f"<{token}>".encode())
            scheduler.start(token, command, self.now, what == "urgent", 0)
            self.refused += [one.token for one in scheduler.take_finished()]
        elif what == "once":
            self.once += 1
            scheduler.send_once(Command("once", b"<G>"), self.now)
        elif what == "cancel" and self.started:
            token = self.started[-1 - number % len(self.started)]
            scheduler.cancel(token, self.now)
            if token not in self.sent and token not in self.refused:
                self.cancelled.add(token)
        elif what == "open":
            self.is_open = True
            scheduler.wire_opened(self.now)
        elif what == "close":
            self.is_open = False
            scheduler.wire_closed()
        elif what == "alive":
            scheduler.owner_alive(self.now + number)

    def look(self):
        waiting = self._waiting()
        self.scheduler.send_next(self.now)
        sends = self.scheduler.take_output()
        assert len(sends) <= 1
        assert self.scheduler.next_deadline() > self.now
        for send in sends:
            assert self.is_open
            assert send.command.token.count(b"<") == 1
            if send.token is not None:
                urgent = [one for one in waiting if one in self.urgent]
                first = urgent or waiting
                assert send.token == first[0], f"{send.token} before {first}"
                self.sent.append(send.token)
            elif send.command != HEARTBEAT:
                assert not [one for one in waiting if one in self.urgent]
                self.once -= 1
            self.writes.append((self.now, send.command))

    def _waiting(self):
        gone = {*self.sent, *self.cancelled, *self.refused}
        return [token for token in self.started if token not in gone]

    def until(self, end):
        while (wake := self.scheduler.next_deadline()) <= end:
            self.now = max(self.now, wake)
            self.look()
        self.now = end

    def check_spacing(self):
        times = [t for t, _ in self.writes]
        assert all(b >= a + self.limits.spacing for a, b in itertools.pairwise(times))

    def check_nothing_is_lost(self):
        """With an open wire and time enough each command has one fate."""
        self.do("open", 0)
        self.until(self.now + 60.0)
        assert self._waiting() == []
        assert self.once == 0
        assert self.scheduler.waiting == 0
        fates = [*self.sent, *self.cancelled, *self.refused]
        assert sorted(fates) == self.started
        assert not self.urgent & set(self.refused)


@settings(max_examples=300, deadline=None)
@given(LIMITS, START, STORY, st.booleans())
def test_any_story_keeps_the_spacing_and_loses_nothing(limits, start, story, is_late):
    """is_late: nobody wakes it between two steps of the story."""
    run = Run(limits, start)
    for pause, what, number in story:
        if is_late:
            run.now += pause
        else:
            run.until(run.now + pause)
        run.do(what, number)
        if what == "look" or not is_late:
            run.look()
    run.look()
    run.check_nothing_is_lost()
    run.check_spacing()


@settings(max_examples=300, deadline=None)
@given(LIMITS, START, STORY)
def test_no_story_makes_a_heartbeat_later_than_the_latest(limits, start, story):
    run = Run(limits, start)
    run.do("open", 0)
    run.scheduler.owner_alive(math.inf)
    for pause, what, number in story:
        run.until(run.now + pause)
        if what not in ("open", "close", "alive"):
            run.do(what, number)
            run.look()
    run.until(run.now + 3.0 * limits.latest_heartbeat)
    beats = [start, *(t for t, command in run.writes if command == HEARTBEAT), run.now]
    longest = max(b - a for a, b in itertools.pairwise(beats))
    assert longest <= limits.latest_heartbeat + 1e-9
    run.check_spacing()


# -- the whole link -----------------------------------------------------------------------------

LINES = [
    *(zeros(layout, ms_since_boot_cfc=n * 700) for layout in LAYOUTS for n in range(3)),
    zeros(LAYOUTS[0], flight_mode=STANDBY, ms_since_boot_cfc=4000),
    zeros(LAYOUTS[0], flight_mode=ASCENT, ms_since_boot_cfc=9000),
    zeros(LAYOUTS[0], flight_mode=9, ms_since_boot_cfc=100),
    *(
        f"{text}\n".encode()
        for text in (
            "--- BEGIN FLASH CSV DUMP ---",
            "--- END FLASH CSV DUMP ---",
            "--- BEGIN FLASH BINARY DUMP ---",
            "Wiping QSPI Flash... Please wait.",
            "Wipe progress: 1/2 sectors",
            "Flash wiped successfully.",
            "ERASE FAILED!",
            "SNAP seq=1",
            "Flash: 1/2 KB used (50.0%)",
            "Arming blocked: wipe flash first",
            "[WARN] low",
        )
    ),
]
PIECES = st.binary(max_size=60) | st.lists(st.sampled_from(LINES), max_size=4).map(b"".join)
CUT = st.tuples(st.sampled_from(LINES), st.integers(0, 400)).map(lambda one: one[0][one[1] :])
NAMES = st.sampled_from([*commands.KINDS, "set_target", "fly"])
ACTIONS = st.one_of(
    st.tuples(st.just("hear"), PIECES | CUT, st.sampled_from([("port", 1), ("port", 2)])),
    st.tuples(st.just("command"), NAMES, st.booleans()),
    st.tuples(st.just("deploy"), st.booleans(), st.booleans()),
    st.tuples(st.just("target"), st.lists(st.floats(), max_size=4), st.none()),
    st.tuples(st.just("arm"), st.booleans(), st.integers(0, 5)),
    st.tuples(st.sampled_from(["open", "close", "block", "release", "alive"]), *[st.none()] * 2),
)
LINK_STORY = st.lists(st.tuples(st.sampled_from([0.0, 0.1, 0.13]) | st.floats(0.0, 8.0), ACTIONS))


def act(link, number, now, what, first, second):
    """True: it was a request."""
    if what == "hear":
        link.receive(first, now, second)
    elif what == "command":
        link.command(number, first, second, now)
    elif what == "deploy":
        link.deploy(number, first, now, second)
    elif what == "target":
        link.set_target(number, tuple(first), now)
    elif what == "arm":
        link.arm(number, first, second, now)
    elif what == "open":
        link.wire_opened(now)
    elif what == "close":
        link.stream_ended(None)
    elif what == "alive":
        link.owner_alive(now + 5.0)
    else:
        link.flight_block("why" if what == "block" else "", now)
    return what in ("command", "deploy", "target", "arm")


@settings(max_examples=300, deadline=None)
@given(LINK_STORY, st.sampled_from(DeployStage), st.floats(0.0, 1e6), st.booleans())
def test_whatever_comes_each_request_ends_once_and_nothing_raises_or_spins(
    story, stage, now, is_late
):
    """is_late: it is not woken between two steps."""
    link = UmbilicalLink(UmbilicalConfig(deploy=stage), LAYOUTS)
    link.wire_opened(now)
    writes, ends, asked = [], [], set()

    def collect():
        for data in link.take_output():
            assert ONE_TOKEN.fullmatch(data)
            assert not writes or now >= writes[-1] + link.config.scheduler.spacing
            writes.append(now)
        finished = [e.finished for e in link.take_events() if isinstance(e, RequestFinished)]
        ends.extend(one.token for one in finished)

    for number, (pause, (what, first, second)) in enumerate(story, 1):
        end = now + pause
        while not is_late and (wake := link.next_deadline()) <= end:
            now = max(now, wake)
            link.update(now)
            assert link.next_deadline() > now
            collect()
        now = end
        if act(link, number, now, what, first, second):
            asked.add(number)
        collect()
        if not is_late:
            link.update(now)
            assert link.next_deadline() > now
            collect()
        link.vehicle_state(now)
    # All comes to an end, and each time it is woken there is something to do.
    link.owner_alive(now)
    link.update(now)
    collect()
    while (wake := link.next_deadline()) < math.inf:
        now = max(now, wake)
        link.update(now)
        assert link.next_deadline() > now
        collect()
    collect()
    assert sorted(ends) == sorted(asked)
