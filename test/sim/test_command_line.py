"""The simulators as executables: without ROS, with every mistake told in one line."""

import importlib
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from missing_modules import environment_without
from printing_process import PrintingProcess

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.sim import command_line
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.transport.signing_key import signing_from_file

PARACHUTE = "chute_ros.links.mavlink.simulator.sim_mavlink_parachute"
AUTOPILOT = "chute_ros.sim.sim_autopilot"
UPF = "chute_ros.links.upf.simulator.sim_upf"
RELAY = "chute_ros.links.relay.simulator.sim_relay"
FLIGHT_COMPUTER = "chute_ros.links.umbilical.simulator.sim_flight_computer"
DIALECT = "chute_ros.protocol.mavlink.dialect"
LOCAL = "127.0.0.1"
MSG_DEFS = Path(__file__).parents[2] / "msg_defs"
#: Makes `import rclpy` fail as on a machine without ROS.
ROS = ("rclpy", "rosidl_runtime_py", "rpyutils")


@pytest.fixture
def environment(tmp_path):
    """An environment in which rclpy cannot be imported."""
    return environment_without(ROS, tmp_path)


@pytest.fixture
def start(environment):
    started = []

    def begin(name, *arguments):
        started.append(PrintingProcess(name, *arguments, environment=environment))
        return started[-1]

    yield begin
    for simulator in started:
        if simulator.process.poll() is None:
            simulator.process.kill()
            simulator.end()
        simulator.process.stdout.close()


@pytest.fixture
def call(monkeypatch, capsys):
    """What a simulator says in this process before it runs: (exit code, stdout, stderr)."""
    monkeypatch.setenv("COLUMNS", "500")
    monkeypatch.setattr(command_line, "_hold_signals", lambda: pytest.fail("it runs"))

    def run(module, *arguments):
        monkeypatch.setattr(sys, "argv", [module, *arguments])
        with pytest.raises(SystemExit) as ended:
            importlib.import_module(module).main()
        return ended.value.code, *capsys.readouterr()

    return run


def ended(environment, *arguments):
    """Python with these arguments, in a process that ends by itself."""
    return subprocess.run(
        [sys.executable, *arguments],
        env=environment,
        capture_output=True,
        text=True,
        timeout=20.0,
        check=False,
    )


def port_in(line):
    """The port that was really bound."""
    return int(re.search(r"udpin:127\.0\.0\.1:(\d+)", line)[1])


def test_rclpy_is_really_out_of_reach_in_these_tests(environment):
    assert "no ROS here: rclpy" in ended(environment, "-c", "import rclpy").stderr


@pytest.mark.parametrize("simulator", [PARACHUTE, AUTOPILOT])
def test_it_runs_without_ros_answers_and_ends_on_an_interrupt(simulator, start, await_until):
    running = start(simulator, "--connection", f"udpin:{LOCAL}:0")
    await_until(lambda: running.said("is open"), "it is open")
    port = port_in(running.said("is open"))
    component = 161 if simulator == PARACHUTE else 1
    ask = dialect.MAVLink_command_long_message(1, component, 512, 0, 0, 0, 0, 0, 0, 0, 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.settimeout(20.0)
        station.sendto(FrameEncoder(255, 190).encode(ask, 0.0), (LOCAL, port))
        (frame,) = FrameDecoder().feed_datagram(station.recv(300), 0.0)
    assert frame.device == f"1/{component}"
    assert running.end() == 0
    assert all(re.match(r" *\d+\.\d{3} ", line) for line in running.lines), running.lines


#: What the simulators import of others, and the package that has it.
PACKAGES = {
    "pymavlink": "pymavlink",
    "serial": "pyserial",
    "orjson": "orjson",
    "yaml": "PyYAML",
    "dronecan": "dronecan",
    "can": "python-can",
    "msgpack": "msgpack",
    "mcap": "mcap",
    "ament_index_python": "a ROS",
}


@pytest.mark.parametrize(
    ("simulator", "connection", "more"),
    [
        (PARACHUTE, ("--connection", f"udpin:{LOCAL}:0"), ()),
        (AUTOPILOT, ("--connection", f"udpin:{LOCAL}:0"), ()),
        (RELAY, (), ()),
        (FLIGHT_COMPUTER, (), ("--telem-path", str(MSG_DEFS / "telem"))),
        (
            UPF,
            ("--connection", f"mcast:0:{free_udp_ports(1)[0]}"),
            ("--dsdl-path", str(MSG_DEFS / "dsdl" / "flyfire")),
        ),
    ],
)
def test_it_needs_the_packages_that_its_page_says_and_no_others(
    simulator, connection, more, tmp_path, await_until
):
    page = (MSG_DEFS.parent / "docs/guide/simulators.md").read_text()
    name = simulator.rpartition(".")[2]
    (row,) = re.findall(rf"^\| [^|]*`{name}`[^|]* \| ([\w -]+) \| ([^|]+) \|$", page, re.M)
    assert not more or f"`{more[0]} msg_defs/" in row[1]
    missing = tuple(name for name, package in PACKAGES.items() if package not in row[0].split())
    assert len(PACKAGES) - len(missing) == len(row[0].split())
    dialect = ("chute_msgs",) if "pymavlink" in missing else ()
    environment = environment_without(ROS + missing + dialect, tmp_path)
    running = PrintingProcess(simulator, *connection, *more, environment=environment)
    try:
        await_until(lambda: running.said("is open"), "it is open")
        assert running.end() == 0
    finally:
        running.process.kill()
        running.process.stdout.close()


def test_it_ends_on_a_termination_too(start, await_until):
    running = start(PARACHUTE, "--connection", f"udpin:{LOCAL}:0")
    await_until(lambda: running.said("is open"), "it is open")
    assert running.end(signal.SIGTERM) == 0


def test_with_a_key_it_signs_what_it_says_and_hears_only_what_is_signed(
    start, await_until, tmp_path
):
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    sign = ("--signing-key-file", str(key))
    running = start(PARACHUTE, "--connection", f"udpin:{LOCAL}:0", *sign)
    await_until(lambda: running.said("is open"), "it is open")
    signer, verifier = signing_from_file(str(key), 1, "the test")
    plain, signed = FrameEncoder(255, 190), FrameEncoder(255, 190, signer)
    ask = dialect.MAVLink_command_long_message(1, 161, 512, 0, 430, 0, 0, 0, 0, 0, 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.settimeout(20.0)
        for encoder in (plain, signed):
            frame = encoder.encode(ask, time.monotonic())
            station.sendto(frame, (LOCAL, port_in(running.said("is open"))))
        decoder, heard = FrameDecoder(verifier), []
        while not {"COMMAND_ACK", "PARACHUTE_STATUS"} <= set(heard):
            for frame in decoder.feed_datagram(station.recv(300), time.monotonic()):
                heard.append(frame.message.get_type())
    assert heard.count("COMMAND_ACK") == 1, "the unsigned command is not answered"
    assert not decoder.counts, "each frame bore a good signature"


def test_a_busy_port_is_told_and_taken_when_it_is_free(start, await_until):
    holder = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    holder.bind((LOCAL, 0))
    running = start(PARACHUTE, "--connection", f"udpin:{LOCAL}:{holder.getsockname()[1]}")
    await_until(lambda: running.said("cannot be opened"), "it says so")
    line = running.said("cannot be opened")
    assert "Address already in use; trying again each 0.5 s" in line
    assert running.process.poll() is None
    holder.close()
    await_until(lambda: running.said("is open"), "it is open after all")
    assert running.end() == 0
    assert len([one for one in running.lines if "cannot be opened" in one]) == 1


def test_it_does_what_the_options_and_the_script_say(start, await_until):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind((LOCAL, 0))
        station.settimeout(20.0)
        running = start(
            PARACHUTE,
            *("--connection", f"udpout:{LOCAL}:{station.getsockname()[1]}"),
            *("--system-id", "9", "--component-id", "0xa2", "--armed", "0x0c"),
            *("--error", "LOW_POWER", "--error", "GPS_ERROR", "--packed-date", "2020-01-31"),
            *("--at", "0.05:deploy=GEOFENCE", "--ats-arm-altitude", "30"),
        )
        statuses = []
        while not statuses or not statuses[-1].message.deployment_status:
            frames = FrameDecoder().feed_datagram(station.recv(300), 0.0)
            statuses += [f for f in frames if f.message.get_type() == "PARACHUTE_STATUS"]
    told = statuses[-1].message
    assert statuses[-1].device == "9/162"
    assert (told.arm_status, told.error_status) == (12, 8 | 2048)
    assert (told.deployment_status, told.ats_arm_altitude) == (5, 30)
    assert told.parachute_packed_date == "2020-01-31"
    await_until(lambda: running.said("action deploy=GEOFENCE"), "it says what it does")


def test_quiet_it_prints_nothing(start):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind((LOCAL, 0))
        station.settimeout(20.0)
        where = f"udpout:{LOCAL}:{station.getsockname()[1]}"
        running = start(AUTOPILOT, "--quiet", "--connection", where)
        assert station.recv(300)
    assert running.end() == 0
    assert running.lines == []


#: Interrupts itself where the main thread, about to wait, holds the lock of what it waits for.
EARLY = """
import os
import signal
import sys
import threading

wait = threading.Condition.wait


def interrupted(self, timeout=None):
    starts = sys._getframe(2).f_code.co_name == "start"
    if threading.current_thread() is threading.main_thread() and not starts:
        os.kill(os.getpid(), signal.SIGINT)
    return wait(self, timeout)


threading.Condition.wait = interrupted
"""


def test_it_ends_however_early_the_signal_comes(start, tmp_path):
    """What happened now and then: the handler waited for a lock that its own thread held."""
    with (tmp_path / "sitecustomize.py").open("a") as file:
        file.write(EARLY)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind((LOCAL, 0))
        station.settimeout(20.0)
        where = f"udpout:{LOCAL}:{station.getsockname()[1]}"
        running = start(AUTOPILOT, "--quiet", "--connection", where)
        assert station.recv(300)
    assert running.end() == 0


#: Interrupts itself as it imports a module that it needs, and passes over the exception, as
#: pymavlink does around numpy.
IMPORTING = """
import contextlib
import os
import signal
import sys


class Interrupted:
    def find_spec(self, name, path=None, target=None):
        if name == "MODULE":
            sys.meta_path.remove(self)
            with contextlib.suppress(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)


sys.meta_path.insert(0, Interrupted())
"""


@pytest.mark.parametrize(
    ("simulator", "module"),
    [(PARACHUTE, DIALECT), (AUTOPILOT, DIALECT), (UPF, "numpy")],
)
def test_a_library_that_passes_over_ctrl_c_does_not_keep_it_running(
    simulator, module, environment, tmp_path
):
    """It ran on after the Ctrl-C of a launch, until launch sent SIGTERM 5 s later."""
    with (tmp_path / "sitecustomize.py").open("a") as file:
        file.write(IMPORTING.replace("MODULE", module))
    done = ended(environment, "-m", simulator, "--at", "5:what it refuses, and ends")
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


@pytest.mark.parametrize("simulator", [PARACHUTE, AUTOPILOT, UPF, RELAY, FLIGHT_COMPUTER])
def test_help_names_every_action_and_form(simulator, call):
    words = ["--control PATH", "cut (nothing passes", "restore", "reboot", "--seed"]
    if simulator in (PARACHUTE, AUTOPILOT):
        words += ["udpin:HOST:PORT", "serial:PATH[:BAUD]", "--loss", "mute"]
    code, out, _ = call(simulator, "--help")
    assert (code, [word for word in words if word not in out]) == (0, [])


#: Of every simulator on MAVLink.
MISTAKES = [
    (("--at", "reboot"), "--at 'reboot': need SECONDS:ACTION, for example 5:reboot"),
    (("--at", "5:"), "--at '5:': need SECONDS:ACTION"),
    (("--at", "soon:reboot"), "--at 'soon:reboot': need SECONDS:ACTION"),
    (("--at", "nan:reboot"), "--at 'nan:reboot': need SECONDS:ACTION"),
    (("--at=-1:reboot",), "--at '-1:reboot': need SECONDS:ACTION"),
    (("--at", "5:explode"), "action 'explode' is not known: need one of "),
    (("--at", "5:reboot=now"), "action 'reboot=now': reboot takes no argument"),
    (("--connection", "udp:1"), "connection 'udp:1' is not understood: need udpin:HOST:PORT"),
    (("--connection", f"udpin:{LOCAL}:0", "--connection", "tcpin::0"), "'tcpin::0' is not"),
    (("--loss", "30"), "loss is 30.0: need 0 to 1"),
    (("--system-id", "300"), "id '300': need 1 to 255"),
    (("--system-id", "one"), "id 'one': need 1 to 255"),
    (("--signing-key-file", "/no/key"), "--signing-key-file: /no/key: No such file"),
    (("--warp", "9"), "unrecognized arguments: --warp 9"),
]
OWN_MISTAKES = [
    (PARACHUTE, ("--at", "5:error=TIRED"), "'TIRED' is no argument of error"),
    (PARACHUTE, ("--at", "5:deploy"), "'' is no argument of deploy: need deploy=one of MANUAL, "),
    (PARACHUTE, ("--packed-date", "2024-13-01"), "packed date '2024-13-01' is no date YYYY-"),
    (PARACHUTE, ("--packed-date", "yesterday"), "packed date 'yesterday' is no date YYYY-MM"),
    (PARACHUTE, ("--clear-height", "nan"), "--clear-height: m 'nan': need 0 to 10000"),
    (PARACHUTE, ("--clear-height", "high"), "--clear-height: m 'high': need 0 to 10000"),
    (PARACHUTE, ("--armed", "256"), "mask '256': need 0 to 255"),
    (PARACHUTE, ("--ats-arm-altitude", "300"), "m '300': need 0 to 255"),
    (PARACHUTE, ("--error", "TIRED"), "invalid choice: 'TIRED'"),
    (AUTOPILOT, ("--at", "5:takeoff=high"), "argument of takeoff: need takeoff=0 to 10000 m"),
    (AUTOPILOT, ("--at", "5:takeoff=nan"), "'nan' is no argument of takeoff: need "),
]


@pytest.mark.parametrize(
    ("simulator", "arguments", "said"),
    [*((one, *mistake) for mistake in MISTAKES for one in (PARACHUTE, AUTOPILOT)), *OWN_MISTAKES],
)
def test_a_mistake_is_told_in_one_line(simulator, arguments, said, call):
    code, out, err = call(simulator, *arguments)
    assert (code, out) == (2, "")
    assert said in err.splitlines()[-1]


def test_a_dialect_that_is_not_built_is_told_in_one_line(environment, tmp_path):
    (tmp_path / "chute_msgs").mkdir()
    (tmp_path / "chute_msgs" / "__init__.py").touch()
    done = ended(environment, "-m", PARACHUTE)
    assert (done.returncode, done.stdout) == (2, "")
    assert "colcon build --base-paths src src/chute_ros/msg_defs" in done.stderr
    assert len(done.stderr.splitlines()) == 1
