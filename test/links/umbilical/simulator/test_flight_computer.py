"""The simulated flight computer as a host sees it: its telemetry.

That it does what the Umbilical Reference says the conformance kit tries, clause by clause:
test/tools/test_conformance_kits.py.
"""

from pathlib import Path

import pytest

from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol.layouts import Record
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings

FOLDER = Path(__file__).parents[4] / "msg_defs" / "telem"
LAYOUTS = {layout.name: layout for layout in load_layouts(str(FOLDER), "the tests")}


class Host:
    """Sends to a flight computer and keeps what comes. now: s, moves only by run."""

    def __init__(self, layout="telem57_airbrake_state", script=(), **settings):
        self.layout = LAYOUTS[layout]
        self.device = FlightComputer(FlightComputerSettings(**settings), self.layout, list(script))
        self.now = 1000.0
        self.raw = b""
        self.chunks = []
        self.log = []
        self.run(0.0)

    def run(self, seconds, step=0.01):
        """Let time pass."""
        end = self.now + seconds
        while True:
            self.device.update(self.now)
            self._collect()
            if self.now >= end - 1e-9:
                return
            self.now = min(end, self.now + step)

    def send(self, text, seconds=0.2):
        """One packet, and time for it to be taken, shown in telemetry and slept over."""
        data = text.encode() if isinstance(text, str) else text
        self.device.receive(data, self.now, "usb")
        self._collect()
        self.run(seconds)

    def act(self, action):
        self.device.act(action)

    def until(self, condition, seconds=400.0):
        """Run until condition; how long that took, s."""
        start = self.now
        while not condition():
            assert self.now < start + seconds, "it did not happen"
            self.run(0.05)
        return self.now - start

    @property
    def lines(self):
        """The whole lines so far."""
        return self.raw.decode("latin-1").split("\n")[:-1]

    @property
    def others(self):
        """Those that are no telemetry."""
        return [line for line in self.lines if not line.startswith("$TELEM,")]

    @property
    def records(self):
        """The telemetry so far."""
        bodies = [line[7:] for line in self.lines if line.startswith("$TELEM,")]
        return [Record(self.layout, self.layout.decode(body), self.now) for body in bodies]

    @property
    def newest(self):
        return self.records[-1]

    def forget(self):
        self.raw = b""
        self.chunks.clear()

    def _collect(self):
        chunks = self.device.take_output()
        self.chunks += chunks
        self.raw += b"".join(chunks)
        self.log += self.device.take_events()


def standing_by(**settings):
    host = Host(**settings)
    host.send("<KA>")
    assert host.newest["flight_mode"] == 1
    return host


# Telemetry


def test_telemetry_comes_at_its_rate_in_chunks_of_a_packet():
    host = Host(rate=13.0)
    host.run(10.0)
    assert len(host.records) == pytest.approx(131, abs=2)
    assert not host.others
    assert all(0 < len(chunk) <= 64 for chunk in host.chunks)


def test_on_the_pad_it_tells_what_is_so_there():
    host = Host()
    host.run(0.2)
    record = host.newest
    assert (record["flight_mode"], record["altitude"], record["pressure"]) == (0, 0.0, 101325.0)
    assert record["accel_z"] == pytest.approx(9.80665)
    assert record["latitude"] == pytest.approx(42.4419)
    assert (record["num_satellites"], record["fix_type"]) == (12, 3)
    assert (record["mav_open"], record["sv_open"]) == (0, 0)
    assert (record["ssa_drogue_deployed"], record["ssa_main_deployed"]) == (0, 0)


def test_its_clocks_run_in_real_time_whatever_the_speed():
    host = Host(speed=50.0, time_of_day=86_395.0)
    host.run(10.0)
    assert host.newest["ms_since_boot_cfc"] == pytest.approx(10_000, abs=101)
    assert host.newest["timestamp"] == pytest.approx(5.0, abs=0.11), "midnight has passed"


def test_a_late_update_does_not_make_up_for_lost_lines():
    host = Host()
    host.forget()
    host.now += 5.0
    host.run(0.5)
    assert len(host.records) <= 7


def test_a_field_can_be_made_to_show_anything():
    host = Host()
    host.device.overrides.update(latitude=float("nan"), altitude=float("-inf"))
    host.run(0.2)
    body = host.lines[-1].split(",")
    assert (body[5], body[4]) == ("NaN", "-inf")
