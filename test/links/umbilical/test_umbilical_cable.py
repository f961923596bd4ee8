"""The cable of the umbilical: pulled, plugged in, full of garbage; a port that is not there."""

import os
import random
import threading

import pytest
from chute_msgs.msg import Telem
from diagnostic_msgs.msg import DiagnosticArray
from umbilical_bench import PATIENT, RATE, Cable

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.node import UmbilicalNode
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings
from chute_ros.model import LinkState
from chute_ros.sim.pty_wire import PtyWire
from chute_ros.transport import loop as wire_loop
from chute_ros.transport.loop import WireLoop


def descriptors():
    return len(os.listdir("/proc/self/fd"))


def link_threads():
    return sorted(t.name for t in threading.enumerate() if t.name.startswith("link "))


def test_a_port_that_comes_back_is_open_again(bench):
    assert wire_loop.REOPEN_INTERVAL <= 0.5, "within a second, as it is tried twice a second"
    cable = Cable(bench, telemetry_stale_after=0.4, telemetry_lost_after=0.8)
    cable.plugged()
    cable.pull()
    bench.until(lambda: not cable.node.loop.wire.is_open, "the hang-up is seen at once")
    cable.await_link(LinkState.LOST)
    cable.plug()
    bench.until(lambda: cable.node.loop.wire.is_open, "it is open again")
    cable.await_link(LinkState.OK)


@pytest.mark.parametrize("pulls", [30, pytest.param(1000, marks=pytest.mark.long)])
def test_many_pulled_cables_leave_nothing_behind(bench, monkeypatch, pulls):
    monkeypatch.setattr(wire_loop, "REOPEN_INTERVAL", 0.005)
    cable = Cable(bench, FlightComputerSettings(rate=100.0), settle_time=0.0, **PATIENT)
    cable.plugged()
    computer = cable.node.loop.link.computer

    def cycle():
        cable.pull()
        bench.until(lambda: not cable.node.loop.wire.is_open, "the hang-up is seen")
        records = computer.records
        cable.plug()
        bench.until(lambda: computer.records > records, "telemetry is back")

    for _ in range(10):
        cycle()
    before = (descriptors(), link_threads())
    for _ in range(pulls - 10):
        cycle()
    assert (descriptors(), len(link_threads())) == (before[0], len(before[1]))
    cable.await_link(LinkState.OK)
    assert cable.arm().success, "and it does what it is told"
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    told = "exceptions in the link's thread"

    def counted():
        return [v.value for a in diagnostics for s in a.status for v in s.values if v.key == told]

    assert bench.until(counted, "it still tells how it is") == ["0"]


def test_any_garbage_is_counted_and_dropped_and_the_next_record_is_told(bench):
    """Given a cable with noise on it, when telemetry is received after all, then it is told."""
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    cable = Cable(bench, FlightComputerSettings(rate=RATE), **PATIENT)
    wire = PtyWire(str(cable.path))
    loop = WireLoop(Noise(random.Random(1)), wire, lambda events: None)
    loop.start()
    bench.loops.append(loop)
    bench.until(lambda: cable.node.loop.link.received_bytes > 100_000, "much of it has come")
    bench.unplug(loop)
    cable.plugged()
    cable.await_telemetry(lambda t: t.flight_mode == Telem.STARTUP, "telemetry is told")
    bench.until(
        lambda: any(
            v.key == "exceptions in the link's thread"
            for s in diagnostics[-1].status
            for v in s.values
        ),
        "diagnostics come",
    )
    counts = {v.key: v.value for s in diagnostics[-1].status for v in s.values}
    assert counts["exceptions in the link's thread"] == "0"
    assert any(key.startswith("dropped: ") for key in counts)


class Noise:
    """A device that sends garbage for ever: bytes, half lines, other lines, marks."""

    PIECES = (
        b"$TELEM,",
        b"$TELEM,0,1,2\n",
        b"\n",
        b"[WARN] half of a li",
        b"--- BEGIN FLASH BINARY DUMP ---\n",
        b"--- END FLASH BINARY DUMP ---\n",
        b"Wipe progress: 9/3 sectors\n",
        b"Flash: 99999999999/1 KB used (x%)\n",
    )

    def __init__(self, chance):
        self._chance = chance
        self._at = 0.0

    def receive(self, data, now, stream=None):
        """It hears nothing."""

    def stream_ended(self, stream):
        """Nor does it mind."""

    def update(self, now):
        self._at = now

    def next_deadline(self):
        return self._at + 0.0005

    def take_output(self):
        if self._chance.random() < 0.5:
            return [self._chance.choice(self.PIECES)]
        return [self._chance.randbytes(self._chance.randrange(1, 400))]

    def take_events(self):
        return []


class Flood(Noise):
    """A device that sends whole records and log lines as fast as the port takes them."""

    def __init__(self, layout):
        super().__init__(None)
        self._layout = layout
        self._sent = 0

    def take_output(self):
        self._sent += 1
        values = ["0"] * self._layout.count
        values[self._layout.index["ms_since_boot_cfc"]] = str(self._sent)
        line = f"$TELEM,{','.join(values)}\n[WARN] again and again\n".encode()
        return [line] * 20


def test_a_device_that_floods_keeps_neither_heartbeat_nor_commands_from_their_turn(bench):
    cable = Cable(bench, **PATIENT)
    flood = Flood(cable.computer.layout)
    loop = WireLoop(flood, PtyWire(str(cable.path)), lambda events: None)
    loop.start()
    bench.loops.append(loop)
    computer = cable.node.loop.link.computer
    bench.until(lambda: computer.records > 5000, "thousands of records have come")
    cable.heartbeats.clear()
    bench.until(lambda: len(cable.heartbeats) >= 5, "it beats meanwhile")
    assert cable.heartbeats[-1].link_state == LinkState.OK
    answer = cable.command("launch", force=True)
    assert "flight mode Startup" in answer.message, "and it answers"
    counts = cable.node.loop.link.counts
    assert counts["lines for the log beyond fifty a second"] > 1000, "nobody could read them"


def test_each_way_that_a_port_cannot_be_opened_is_one_clear_line_and_it_keeps_trying(bench):
    logs = bench.follow_log()
    cable = Cable(bench)

    def said(text):
        return lambda: [m.msg for m in logs if text in m.msg]

    (line,) = bench.until(said("no such port, is it plugged in?"), "no such port")
    assert str(cable.path) in line
    assert line.count("\n") == 0
    cable.plug()
    cable.await_link(LinkState.OK)
    second = bench.add(UmbilicalNode, connection=f"serial:{cable.path}")
    bench.until(said("the port is in use by another program"), "port busy")
    bench.remove(cable.node)
    bench.until(lambda: second.loop.wire.is_open, "it had kept trying")


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"connection": "udpin:0.0.0.0:1"}, "is no serial port: need serial:PATH"),
        ({"connection": "/dev/ttyACM0"}, "is no serial port: need serial:PATH"),
        ({"layout": "telem99"}, "layout 'telem99' is not known: need one of telem57_airbrake"),
        ({"telem_path": "/nowhere"}, "parameter telem_path is '/nowhere': there is no layout"),
        (
            {"telemetry_stale_after": 20.0},
            "parameter telemetry_stale_after is 20.0 and telemetry_lost_after is 15.0",
        ),
        (
            {"command_spacing": 1.0},
            "parameter umbilical_heartbeat_interval is 1.0 and command_spacing is 1.0",
        ),
        ({"command_spacing": 0.05}, "parameter command_spacing"),
        ({"deploy_stage": "both"}, "need one of drogue, main, next"),
    ],
)
def test_a_parameter_that_cannot_be_is_named_with_the_fix(bench, parameters, text):
    with pytest.raises(ParameterError) as caught:
        bench.add(UmbilicalNode, **parameters)
    assert text in str(caught.value)


def test_a_layout_of_ones_own_is_read_from_a_folder(bench):
    folder = bench.folder / "layouts"
    folder.mkdir()
    shipped = next(one for one in Cable.shipped_layouts() if one.name == "telem50")
    fields = "\n".join(
        f"  - {{name: {f.name}, type: {f.kind.name}, unit: '1'}}" for f in shipped.fields
    )
    (folder / "mine.yaml").write_text(
        f"name: mine\ntarget_floats: 2\ntarget_fields: []\nfields:\n{fields}\n"
    )
    cable = Cable(bench, sends="telem50", telem_path=str(folder))
    cable.plugged()
    assert cable.await_telemetry(lambda t: True, "it is told").layout == "mine"


def test_a_layout_with_a_mistake_is_named_with_its_file(bench):
    folder = bench.folder / "layouts"
    folder.mkdir()
    (folder / "mine.yaml").write_text("name: mine\nfields: 3\n")
    with pytest.raises(ParameterError, match=r"mine\.yaml: no layout of \$TELEM"):
        bench.add(UmbilicalNode, telem_path=str(folder))


def test_a_layout_whose_values_the_message_cannot_hold_stops_the_start(bench):
    folder = bench.folder / "layouts"
    folder.mkdir()
    shipped = next(one for one in Cable.shipped_layouts() if one.name == "telem50")
    kinds = {f.name: f.kind.name for f in shipped.fields} | {"fix_type": "f32"}
    fields = "\n".join(f"  - {{name: {n}, type: {k}, unit: '1'}}" for n, k in kinds.items())
    (folder / "mine.yaml").write_text(
        f"name: mine\ntarget_floats: 2\ntarget_fields: []\nfields:\n{fields}\n"
    )
    text = "telem_path: mine: fix_type is f32 where umbilical/telem has int16"
    with pytest.raises(ParameterError, match=text):
        bench.add(UmbilicalNode, telem_path=str(folder))
