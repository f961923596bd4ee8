"""Tells timed stories to an UmbilicalLink: what the flight computer says, what is written."""

import re
from typing import Any

from umbilical_lines import BY_NAME, LAYOUTS, STATE, as_rust_prints

from chute_ros.links.umbilical.protocol.config import UmbilicalConfig
from chute_ros.links.umbilical.protocol.gate import Situation
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.protocol.effect import EffectLimits
from chute_ros.protocol.events import (
    DeviceLinkChanged,
    Notice,
    ParachuteChanged,
    RequestFinished,
    RequestReport,
)

START = 1000.0
STARTUP, STANDBY, ASCENT, COAST, DROGUE, MAIN, FAULT = range(7)
MODES = {
    Situation.STARTUP: STARTUP,
    Situation.STANDBY: STANDBY,
    Situation.ASCENT: ASCENT,
    Situation.COAST: COAST,
    Situation.DROGUE_DEPLOYED: DROGUE,
    Situation.MAIN_DEPLOYED: MAIN,
    Situation.FAULT: FAULT,
}
FLYING = (ASCENT, COAST, DROGUE, MAIN)
ONE_TOKEN = re.compile(rb"<[^<>]+>")
#: Bytes of one USB packet, at most.
PACKET = 64


def zeros(layout, **values):
    """A line with all fields 0 but these."""
    strange = set(values) - set(layout.index)
    assert not strange, f"{layout.name} has no {strange}"
    texts = [as_rust_prints(values.get(f.name, 0), f.kind.name) for f in layout.fields]
    return f"$TELEM,{','.join(texts)}\n".encode()


#: Of the stories: longer than the standard, so that their other times fit in between.
EFFECT = EffectLimits(1.5, 0.25, 5.0)


class Bench:
    """One link and the flight computer at its other end; t: seconds since the story began.

    The flight computer sends a line each 0.1 s once it talks. always_alive: our owner never hangs.
    """

    def __init__(self, layout=STATE, layout_setting="", wire=True, always_alive=False, **config):
        settings = {"effect": EFFECT, **config}
        self.link = UmbilicalLink(UmbilicalConfig(layout_setting, **settings), LAYOUTS)
        self.layout = BY_NAME[layout]
        self.t = 0.0
        self.talks = False
        self.plugged = True
        self.port = 1
        self.fields: dict[str, Any] = {}
        self.writes: list[tuple[float, bytes]] = []
        self.events: list[Any] = []
        self._booted = -100.0
        self._lines = 0
        self._number = 0
        if always_alive:
            self.link.owner_alive(float("inf"))
        if wire:
            self.link.wire_opened(self.now)

    @property
    def now(self):
        return START + self.t

    # -- the flight computer ---------------------------------------------------------------------

    def talk(self, **fields):
        """From now on its lines have these fields, besides those of before."""
        self.fields |= fields
        if not self.talks:
            self.talks = True
            self._next_line()
        return self

    def _next_line(self):
        self._lines = int(self.t * 10 + 1e-6) + 1

    def silent(self):
        self.talks = False
        return self

    def restarts(self, **fields):
        """Its clock starts anew."""
        self._booted = self.t
        return self.talk(**fields)

    def line(self):
        clock = {"ms_since_boot_cfc": round((self.t - self._booted) * 1000)}
        return zeros(self.layout, **{**clock, **self.fields})

    def hear(self, *texts):
        """These lines come."""
        return self.hear_bytes("".join(f"{text}\n" for text in texts).encode())

    def hear_bytes(self, data):
        self.link.receive(data, self.now, ("port", self.port))
        return self._woken()

    # -- time ------------------------------------------------------------------------------------

    def at(self, t):
        """Go to t, waking at each deadline and each line on the way."""
        assert t >= self.t
        for _ in range(20_000):
            wake = self.link.next_deadline() - START
            line = self._lines / 10 if self.talks and self.plugged else float("inf")
            if min(wake, line) > t:
                break
            if line <= wake:
                self.t, self._lines = max(self.t, line), self._lines + 1
                self.hear_bytes(self.line())
            else:
                self.t = max(wake, self.t)
                self._woken()
        else:
            raise AssertionError("the link wants to be woken without end")
        self.t = t
        return self._woken()

    def after(self, seconds):
        return self.at(self.t + seconds)

    def _woken(self):
        self.link.update(self.now)
        assert self.link.next_deadline() > self.now
        return self.collect()

    def collect(self):
        for data in self.link.take_output():
            assert ONE_TOKEN.fullmatch(data), data
            assert len(data) < PACKET
            self.writes.append((self.t, data))
        self.events += self.link.take_events()
        return self

    # -- the cable -------------------------------------------------------------------------------

    def pull(self):
        self.plugged = False
        self.link.stream_ended(("port", self.port))
        return self._woken()

    def plug(self):
        self.port += 1
        self.plugged = True
        self._next_line()
        self.link.wire_opened(self.now)
        return self._woken()

    # -- orders ----------------------------------------------------------------------------------

    def order(self, name, force=False):
        """A command by its name; the number of the request."""
        self._number += 1
        self.link.command(self._number, name, force, self.now)
        self.collect()
        return self._number

    def target(self, *values):
        self._number += 1
        self.link.set_target(self._number, values, self.now)
        self.collect()
        return self._number

    def deploy(self, force=False, again=False, repeated=False):
        self._number += 1
        self.link.deploy(self._number, force, self.now, again, repeated)
        self.collect()
        return self._number

    # -- what came out ---------------------------------------------------------------------------

    def clear(self):
        self.writes.clear()
        self.events.clear()
        return self

    @property
    def tokens(self):
        """What was written, but heartbeats."""
        return [data.decode() for _, data in self.writes if data != b"<H>"]

    def times(self, token):
        return [round(t, 3) for t, data in self.writes if data == token.encode()]

    def of(self, *kinds):
        return [event for event in self.events if isinstance(event, kinds)]

    def steps(self, number):
        reports = [event.report for event in self.of(RequestReport)]
        return [one.outcome.name for one in reports if one.token == number]

    def ends(self, number):
        finished = [event.finished for event in self.of(RequestFinished)]
        return [one for one in finished if one.token == number]

    def end(self, number):
        """How the request ended; exactly once."""
        (end,) = self.ends(number)
        return end

    def notices(self):
        return [event.text for event in self.of(Notice)]

    def link_states(self):
        return [event.change.after.name for event in self.of(DeviceLinkChanged)]

    def status(self):
        return self.of(ParachuteChanged)[-1].status


def ready(mode=STANDBY, layout=STATE, **rest):
    """Telemetry in this mode has come for a while; nothing of it waits to be looked at.

    rest: fields of the layout, or settings of the bench.
    """
    fields = {k: rest.pop(k) for k in list(rest) if k in BY_NAME[layout].index}
    bench = Bench(layout, **rest).talk(flight_mode=mode, **fields).at(1.05)
    assert bench.link.computer.records > 0
    return bench.clear()


def in_situation(situation, **rest):
    """A rocket that is there."""
    if situation in MODES:
        bench = ready(MODES[situation], **rest)
    elif situation is Situation.LOST_IN_FLIGHT:
        bench = ready(COAST, **rest).talk(flight_mode=FAULT).after(0.5)
    else:
        bench = ready(STANDBY, **rest).silent().after(3.5)
    assert bench.link.computer.situation(bench.now) is situation
    return bench.clear()
