"""The simulated flight computer as a host sees it: telemetry, valves, payload, target, knobs."""

from pathlib import Path

import pytest

from chute_ros.protocol.umbilical.layouts import Record
from chute_ros.sim.flight_computer import FlightComputer
from chute_ros.sim.flight_computer_settings import FlightComputerSettings
from chute_ros.transport.telem_layouts import load_layouts

FOLDER = Path(__file__).parents[2] / "msg_defs" / "telem"
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


# Commands to valves, payload and target


@pytest.mark.parametrize(
    ("token", "field", "value"),
    [("<M>", "mav_open", 1), ("<m>", "mav_open", 0), ("<S>", "sv_open", 1), ("<s>", "sv_open", 0)],
)
def test_a_valve_opens_and_closes(token, field, value):
    host = Host()
    host.send("<M>")
    host.send("<S>")
    host.send(token)
    assert host.newest[field] == value
    assert host.device.came[-1][1] == token


@pytest.mark.parametrize(("newer", "sv_open"), [(False, 0), (True, 1)])
def test_safe_closes_mav_and_as_the_firmware_is_sv(newer, sv_open):
    host = Host(safe_opens_sv=newer)
    host.send("<M>")
    host.send("<S>")
    host.send("<V>")
    assert (host.newest["mav_open"], host.newest["sv_open"]) == (0, sv_open)


@pytest.mark.parametrize(
    ("token", "field"),
    [
        *[(f"<{n}>", f"cmd_n{n}") for n in range(1, 5)],
        *[(f"<A{n}>", f"cmd_a{n}") for n in range(1, 4)],
    ],
)
def test_a_payload_event_sets_its_flag_alone(token, field):
    host = Host()
    host.send(token)
    set_ones = [f.name for f in host.layout.fields if "cmd_" in f.name and host.newest[f.name]]
    assert set_ones == [field]


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_target_is_shown_where_the_layout_has_it(name):
    host = Host(name)
    numbers = (42.4419130, -76.4878000, 42.5, -76.5)[: host.layout.target_floats]
    host.send(f"<T,{','.join(f'{n:.7f}' for n in numbers)}>")
    assert len(host.device.came) == 1
    shown = [host.newest[field] for field in host.layout.target_fields]
    assert shown == [pytest.approx(n, rel=1e-6) for n in numbers][: len(shown)]
    if "blims_dist_to_target_m" in host.newest:
        assert host.newest["blims_dist_to_target_m"] == pytest.approx(1.45, abs=0.1)


@pytest.mark.parametrize(
    "token",
    [
        "<T,42.4>",
        "<T,42.4,-76.4,1>",
        "<T,42.4,-76.4,42.5,-76.5>",
        "<T,90.1,0>",
        "<T,0,-180.1>",
        "<T,nan,0>",
        "<T,1e1,0>",
        "<T, 1,0>",
        "<T,,>",
        "<T>",
    ],
)
def test_a_target_that_is_none_is_lost(token):
    host = Host()
    host.send(token)
    assert host.device.came == []
    assert host.device.receiver.lost == {"unknown": 1}
    assert host.newest["blims_target_lat"] == 0.0


# Knobs


def test_mute_it_takes_no_command_and_no_heartbeat_but_goes_on_talking():
    host = Host()
    host.act("mute")
    host.send("<M>")
    host.send("<H>")
    assert (host.device.came, host.device.heartbeats) == ([], [])
    assert host.device.receiver.lost["deaf"] == 2
    assert host.newest["mav_open"] == 0
    host.act("unmute")
    host.send("<M>")
    assert host.newest["mav_open"] == 1


def test_silent_it_sends_nothing_at_all_but_takes_commands():
    host = Host(debug=True)
    host.act("silent")
    host.forget()
    host.send("<M>")
    host.send("<I>")
    host.send("<G>", 1.0)
    assert host.raw == b""
    host.act("speak")
    host.run(0.2)
    assert host.newest["mav_open"] == 1


@pytest.mark.parametrize("how", ["token", "action"])
def test_a_reboot_starts_anew_and_is_silent_and_deaf_meanwhile(how):
    host = standing_by()
    for token in ("<M>", "<S>", "<1>", "<D>", "<T,42.4,-76.4>"):
        host.send(token)
    assert host.newest["ssa_drogue_deployed"] == 1
    host.act("stuck")
    host.forget()
    if how == "token":
        host.send("<R>", 0.1)
    else:
        host.act("reboot")
    host.forget()
    host.send("<M>", 0.15)
    assert host.raw == b""
    assert host.device.receiver.lost == {"booting": 1}
    host.run(0.2)
    first = host.records[0]
    assert first["ms_since_boot_cfc"] == pytest.approx(300, abs=30)
    zero = ("flight_mode", "mav_open", "sv_open", "cmd_n1", "ssa_drogue_deployed")
    assert [first[name] for name in (*zero, "blims_target_lat")] == [0] * 6
    assert host.device.flight.is_stuck, "what is broken stays so"


def test_the_script_is_done_in_time():
    host = Host(script=[(2.0, "silent"), (1.0, "jump=Coast")])
    host.run(0.9)
    assert host.newest["flight_mode"] == 0
    host.run(0.3)
    assert host.newest["flight_mode"] == 3
    host.run(0.9)
    host.forget()
    host.run(1.0)
    assert host.raw == b""
    assert [line for line in host.log if "action" in line] == [
        "action jump=Coast",
        "action silent",
    ]


def test_actions_and_arguments_are_those_of_every_simulator():
    device = Host().device
    assert set(device.arguments) <= set(device.actions)
    assert device.arguments["jump"]("Coast") == 3
    with pytest.raises(KeyError):
        device.arguments["jump"]("Landed")


# Heartbeats and log lines


def test_it_is_connected_while_heartbeats_come():
    host = Host(heartbeat_timeout=5.0, debug=True)
    assert not host.device.connected
    host.send("<H>")
    assert host.device.connected
    host.run(4.7)
    assert host.device.connected
    host.run(0.3)
    assert not host.device.connected
    told = [line for line in host.log if "umbilical" in line]
    assert told == ["umbilical connected", "umbilical disconnected"]
    assert host.others == ["[INFO] Umbilical connected", "[WARN] Umbilical disconnected"]
    host.send("<H>")
    host.send("<R>", 1.0)
    assert not host.device.connected, "a reboot forgets the heartbeat"


def test_in_debug_mode_it_logs_each_command():
    host = Host(debug=True)
    host.send("<KA>")
    host.send("<T,42.4,-76.4>")
    assert "[WARN] UMBILICAL CMD: Key arm" in host.others
    assert "[WARN] UMBILICAL CMD: Set target" in host.others
    assert "[INFO] Flight mode Startup -> Standby" in host.others


# Lines that are spoiled


def test_cut_lines_are_glued_to_the_next():
    host = Host(cut=0.5, seed=3)
    host.run(20.0)
    bodies = [line for line in host.lines if line.startswith("$TELEM,")]
    good = [b for b in bodies if isinstance(host.layout.decode(b[7:]), tuple)]
    assert 30 < len(good) < 150
    assert any(line.count("$TELEM") > 1 for line in host.lines)


def test_garbage_comes_between_lines():
    host = Host(garbage=1.0)
    host.run(5.0)
    assert any(byte > 127 for byte in host.raw)


def test_a_full_queue_cuts_a_line_at_a_chunk():
    host = Host(packet_rate=20.0)
    host.run(20.0)
    assert host.device.queue.overflows > 10
    assert all(isinstance(host.layout.decode(b[7:]), tuple) for b in host.lines)
    glued = host.raw.split(b"\n")[-1]
    assert glued.count(b"$TELEM,") > 10, "the ends of lines are lost"


def test_a_setting_that_cannot_be_is_told():
    with pytest.raises(ValueError, match="rate is 0"):
        Host(rate=0.0)
    with pytest.raises(ValueError, match="heartbeat-timeout is nan: need 0 to 3600 s"):
        Host(heartbeat_timeout=float("nan"))
