"""What can be done to the simulated flight computer: knobs, script, reboot, log, spoiled lines."""

import math

import pytest
from test_flight_computer import Host, standing_by

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
    assert device.arguments["jump"].convert("Coast") == 3
    with pytest.raises(KeyError):
        device.arguments["jump"].convert("Landed")


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
    assert all(isinstance(host.layout.decode(b[7:]), tuple) for b in host.lines)
    glued = host.raw.split(b"\n")[-1]
    assert glued.count(b"$TELEM,") > 10, "the ends of lines are lost"


def test_a_setting_that_cannot_be_is_told():
    with pytest.raises(ValueError, match="rate is 0"):
        Host(rate=0.0)
    with pytest.raises(ValueError, match="heartbeat-timeout is nan: need 0 to 3600 s"):
        Host(heartbeat_timeout=float("nan"))


# Between deadlines nothing is to be done


def driven_by_deadlines(token, seconds):
    """What comes after token when the device is only called when it asks for it."""
    host = Host(wipe_time=1.0, debug=True)
    host.run(0.2)
    host.forget()
    host.device.receive(token, host.now, "usb")
    # This one waits for the end of the pause.
    host.device.receive(b"<M>", host.now, "usb")
    end, turns = host.now + seconds, 0
    while host.device.next_deadline() < end:
        host.now = max(host.now, host.device.next_deadline())
        host.run(0.0)
        turns += 1
    assert turns < 1000 * seconds + 200, "it does not ask in vain"
    return host


def test_before_its_first_update_it_is_due_at_once():
    host = Host()
    fresh = type(host.device)(host.device.settings, host.layout, [(1.0, "silent")])
    assert fresh.next_deadline() == 0.0
    fresh.update(7.0)
    assert 7.0 < fresh.next_deadline() <= 7.05


@pytest.mark.parametrize(
    ("token", "said"),
    [
        (b"<I>", "Flash: 1024/14336 KB used (7.1%)"),
        (b"<W>", "Flash wiped successfully."),
        (b"<G>", "--- END FLASH CSV DUMP ---"),
    ],
)
def test_driven_by_its_deadlines_alone_it_does_all(token, said):
    host = driven_by_deadlines(token, 3.0)
    assert said in host.lines
    assert host.newest["mav_open"] == 1
    assert math.isfinite(host.device.next_deadline())
