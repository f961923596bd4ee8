"""The command conformance as a process of its own, and a simulated device in another one."""

from __future__ import annotations

import importlib.util
import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import pytest
from command_bench import refused
from conformance_processes import COMMAND, SIMULATOR, Bench, started
from junitparser import JUnitXml
from mcap.reader import make_reader
from mcap.writer import Writer
from missing_modules import environment_without

import chute_ros
from chute_ros.conformance.clause import ASKS, READS, SOAK
from chute_ros.conformance.session import Trying
from chute_ros.links.api import load
from chute_ros.links.registered import links
from chute_ros.ros.own_version import hash_of, own_version
from chute_ros.tools.conformance import command
from chute_ros.tools.isolation import free_udp_ports

MAVLINK = "chute_ros.links.mavlink.simulator.sim_mavlink_parachute"
UPF = "chute_ros.links.upf.simulator.sim_upf"
QUICK = ["--only", "request-status", "unknown-command"]


def bench(*options: str) -> Bench:
    """A parachute on loopback."""
    ours, theirs = (f"127.0.0.1:{port}" for port in free_udp_ports(2))
    device = (MAVLINK, "--connection", f"udppair:{theirs}:{ours}", *options)
    return Bench(device, ("mavlink", "--connection", f"udppair:{ours}:{theirs}"))


def test_a_sound_device_and_what_is_written_of_it(tmp_path: Path) -> None:
    page, verdicts, traffic = (tmp_path / name for name in ("a.html", "a.xml", "a.mcap"))
    files = ["--html", str(page), "--junit", str(verdicts), "--mcap", str(traffic)]
    code, out, errors = bench().run(*QUICK, *files)
    assert (code, errors) == (0, "")
    assert "mavlink 1/161: 2 passed\n" in out
    told = page.read_text()
    assert "COMMAND_ACK" in told
    assert "chute_ros, simulated parachute" not in told, "what was not tried"
    (suite,) = JUnitXml.fromfile(str(verdicts))
    assert [(case.name, case.is_passed) for case in suite] == [
        ("request-status", True),
        ("unknown-command", True),
    ]
    about = {one.name: one.value for one in suite.properties()}
    assert about["vendor name"] == "chute_ros"
    assert about["model name"] == "simulated parachute"
    assert about["serial number"] == "SIM-0001"
    assert about["kit"] == f"chute_ros {own_version()}"
    with traffic.open("rb") as file:
        packets = [json.loads(one.data) for *_, one in make_reader(file).iter_messages()]
    assert {"HEARTBEAT", "COMMAND_LONG", "COMMAND_ACK"} <= {one["name"] for one in packets}


def test_a_recording_goes_over_an_earlier_one_and_over_no_black_box(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    file = tmp_path / "a.mcap"
    recorded_by(file, profile="", library="chute_ros conformance")
    before = file.read_bytes()
    code, _, errors = bench().run("--only", "request-status", "--mcap", str(file))
    assert (code, errors, file.read_bytes() != before) == (0, "", True)
    recorded_by(file, profile="ros2", library="chute_ros")
    before = file.read_bytes()
    _, errors = refused(command, monkeypatch, capsys, "mavlink", "--mcap", str(file))
    assert errors == (
        f"conformance: {file} exists and is no MCAP recording of conformance: remove it, or name "
        "another\n"
    )
    assert file.read_bytes() == before


def recorded_by(file: Path, **head: str) -> None:
    """An empty recording."""
    with file.open("wb") as opened:
        writer = Writer(opened)
        writer.start(**head)
        writer.finish()  # type: ignore[no-untyped-call]


def test_a_clause_that_fails_ends_with_1(tmp_path: Path) -> None:
    verdicts = tmp_path / "a.xml"
    code, out, _ = bench("--break", "unknown-command").run(*QUICK, "--junit", str(verdicts))
    assert code == 1
    assert "FAILED         unknown-command" in out
    (suite,) = JUnitXml.fromfile(str(verdicts))
    assert (suite.tests, suite.failures) == (2, 1)


@pytest.mark.parametrize(
    ("option", "word", "typed"), [("--fire", "FIRE", "ARM\n"), ("--arm", "ARM", "")]
)
def test_without_the_word_typed_again_nothing_is_sent(option: str, word: str, typed: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
        device.bind(("127.0.0.1", 0))
        connection = f"udpout:127.0.0.1:{device.getsockname()[1]}"
        with started(*COMMAND, "mavlink", "--connection", connection, option) as kit:
            _, errors = kit.communicate(typed, timeout=60.0)
        assert (kit.returncode, errors) == (
            2,
            f"conformance: {word} was not typed: nothing was sent\n",
        )
        device.setblocking(False)
        with pytest.raises(BlockingIOError):
            device.recv(1)


def test_with_the_word_it_fires() -> None:
    code, out, errors = bench().run("--fire", "--only", "release", typed="FIRE\n")
    assert (code, errors) == (0, "")
    assert "release: IT RELEASES" in out
    assert "passed         release              DRONE, reported after" in out


@contextmanager
def allowed_to_arm(*options: str) -> Iterator[subprocess.Popen[str]]:
    """The kit, as soon as it has found the device."""
    with bench().trying("--arm", *options) as kit:
        assert kit.stdin is not None
        assert kit.stdout is not None
        kit.stdin.write("ARM\n")
        kit.stdin.flush()
        for line in kit.stdout:
            if line.endswith("found 1/161\n"):
                break
        yield kit


def test_a_ctrl_c_tells_that_the_run_is_not_whole() -> None:
    with allowed_to_arm() as kit:
        # Whatever it is doing at that moment, and however often.
        for _ in range(20):
            kit.send_signal(signal.SIGINT)
        out, errors = kit.communicate(timeout=60.0)
    assert (kit.returncode, errors) == (3, "conformance: aborted by Ctrl-C\n")
    assert out.endswith("mavlink 1/161: nothing was tried\n")


@pytest.mark.parametrize(
    ("number", "by"),
    [(signal.SIGTERM, "SIGTERM"), (signal.SIGHUP, "the end of its terminal")],
)
def test_whoever_ends_it_has_the_device_left_disarmed(number: signal.Signals, by: str) -> None:
    # Run under nohup, it would be asked to ignore this one.
    before = signal.signal(number, signal.SIG_DFL)
    with allowed_to_arm("--soak", "600", "--only", "soak") as kit:
        signal.signal(number, before)
        kit.send_signal(number)
        _, errors = kit.communicate(timeout=60.0)
    assert (kit.returncode, errors) == (3, f"conformance: aborted by {by}\n")


def test_where_nobody_reads_on_the_device_is_left_disarmed(tmp_path: Path) -> None:
    """Given `conformance ... | head -1`."""
    report = tmp_path / "report.xml"
    options = ("--only", "arm-sources", "arm-mask", "--junit", str(report))
    with allowed_to_arm(*options) as kit:
        assert kit.stdout is not None
        kit.stdout.close()
        kit.wait(60.0)
        assert kit.stderr is not None
        errors = kit.stderr.read()
    assert (kit.returncode, errors) == (3, "conformance: nobody reads what it reports\n")
    assert report.exists()


def test_a_wire_that_is_not_there_is_told_at_once() -> None:
    with started(*COMMAND, "mavlink", "--connection", "serial:/dev/not_there") as kit:
        _, errors = kit.communicate(timeout=60.0)
    assert kit.returncode == 3
    assert "/dev/not_there" in errors


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "no device is named: need one of "),
        (["gimbal"], "no kit is called 'gimbal': need one of "),
        (["mavlink", "--only", "nothing"], "--only nothing: no such clause; --list has all"),
        (["mavlink", "--html", "/nowhere/a"], "/nowhere/a: No such file or directory"),
        (["mavlink", "--connection", "abc"], "connection 'abc' is not understood"),
    ],
)
def test_a_mistake_in_the_command_line_ends_with_2(
    arguments: list[str], told: str, monkeypatch, capsys
) -> None:
    out, errors = refused(command, monkeypatch, capsys, *arguments)
    assert out == ""
    assert f"conformance: {told}" in errors


def test_help_without_a_device_names_them_and_is_no_mistake(monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["conformance", "--help"])
    with pytest.raises(SystemExit, match="0"):
        command.main()
    out, errors = capsys.readouterr()
    assert "DEVICE is one of mavlink, umbilical, upf; `conformance DEVICE --help`" in out
    assert errors == ""


def test_a_mistake_ends_the_process_with_2() -> None:
    with started(*COMMAND, "mavlink", "--connection", "abc") as kit:
        out, errors = kit.communicate(timeout=60.0)
    assert (kit.returncode, out, errors.count("\n")) == (2, "", 1)
    assert errors.startswith("conformance: connection 'abc' is not understood")


@pytest.mark.parametrize(
    ("device", "option", "value", "told"),
    [
        ("mavlink", "--soak", "nan", "seconds 'nan': need 1 to 1e+06"),
        ("mavlink", "--soak", "-5", "seconds '-5': need 1 to 1e+06"),
        ("mavlink", "--component", "0", "component id '0': need 1 to 255"),
        ("upf", "--node", "300", "node id '300': need 1 to 125"),
        ("upf", "--bitrate", "-1", "bit/s '-1': need 0 to 8000000"),
    ],
)
def test_a_number_that_cannot_be_is_refused_with_what_can(
    device: str, option: str, value: str, told: str, monkeypatch, capsys
) -> None:
    _, errors = refused(command, monkeypatch, capsys, device, option, value)
    assert errors.endswith(f"conformance {device}: error: argument {option}: {told}\n")


KITS = {one.device: load(one.kit) for one in links().values() if one.kit}


def test_the_version_of_the_kit_is_another_if_a_file_is(tmp_path: Path) -> None:
    """Given two commits of one number."""
    number, plus, files = own_version().partition("+")
    assert (number, plus) == (version("chute_ros"), "+")
    assert files == hash_of(Path(chute_ros.__file__).parent)
    before = hash_of(tmp_path)
    (tmp_path / "part").mkdir()
    (tmp_path / "part" / "a.py").write_text("A = 1\n")
    assert len({before, files, hash_of(tmp_path)}) == 3
    (tmp_path / "part" / "a.py").rename(tmp_path / "a.py")
    assert hash_of(tmp_path) != before


@pytest.mark.parametrize("device", KITS)
def test_before_each_step_stands_what_the_device_may_do(device: str) -> None:
    """In a run of the whole kit, with all that it may do allowed."""
    clauses = KITS[device].clauses
    told = {one.name: command.line_of(Trying(one, 1, len(clauses)), ()) for one in clauses}
    assert {name for name, line in told.items() if not line} == {
        one.name for one in clauses if one.does in (READS, ASKS) and SOAK not in one.needs
    }
    assert all(one.does in told[one.name] for one in clauses if told[one.name])


def test_clauses_of_another_kind_of_device_are_counted_in_one_line(tmp_path: Path) -> None:
    """Given --trigger: they stay in the report."""
    report = tmp_path / "a.xml"
    connection = ("--connection", f"mcast:0:{free_udp_ports(1)[0]}")
    names = ["--only", "node-id", "parameters", "trigger-node-id"]
    trigger = Bench((UPF, "--no-controller", *connection), ("upf", *connection), True)
    code, out, errors = trigger.run("--trigger", "--junit", str(report), *names)
    assert (code, errors) == (0, "")
    assert out.splitlines()[:2] == [
        "found node 34",
        "  not tried      2 clauses that are of another kind of device",
    ]
    assert " node-id" not in out.replace("trigger-node-id", "")
    (suite,) = JUnitXml.fromfile(str(report))
    assert [case.name for case in suite] == names[1:]


# -- without ROS --------------------------------------------------------------------------------

#: As on a machine without ROS, on which the dialect alone was generated.
ROS = ("rclpy*", "builtin_interfaces", "rosidl*", "ament*", "rpyutils", "chute_msgs.msg")
#: Device -> its simulator, the clause that is tried, and the folder of its messages.
WITHOUT_ROS = {
    "mavlink": (MAVLINK, "request-status", ()),
    "upf": (UPF, "node-info", ("--dsdl-path", "msg_defs/dsdl/flyfire")),
    "umbilical": (
        "chute_ros.links.umbilical.simulator.sim_flight_computer",
        "flash-info",
        ("--telem-path", "msg_defs/telem"),
    ),
}


@pytest.fixture
def without_ros(tmp_path: Path) -> dict[str, str]:
    """An environment in which nothing of ROS can be imported."""
    return environment_without(ROS, tmp_path)


def connections(device: str, folder: Path) -> tuple[list[str], str]:
    """(options of the simulator, connection of the kit)."""
    ours, theirs = free_udp_ports(2)
    if device == "umbilical":
        return ["--link", str(folder / "tty")], f"serial:{folder / 'tty'}"
    if device == "upf":
        return ["--connection", f"mcast:0:{ours}"], f"mcast:0:{ours}"
    turned = f"udppair:127.0.0.1:{theirs}:127.0.0.1:{ours}"
    return ["--connection", turned], f"udppair:127.0.0.1:{ours}:127.0.0.1:{theirs}"


@pytest.mark.parametrize("device", WITHOUT_ROS)
def test_a_kit_lists_and_tries_without_ros(
    device: str, without_ros: Mapping[str, str], tmp_path: Path
) -> None:
    module, clause, folder = WITHOUT_ROS[device]
    with started(*COMMAND, device, "--list", environment=without_ros) as kit:
        out, errors = kit.communicate(timeout=60.0)
    assert (kit.returncode, errors) == (0, "")
    assert f"\n{clause} " in out
    told, connection = connections(device, tmp_path)
    simulator = [*SIMULATOR, module, *told, *folder]
    page = tmp_path / "a.html"
    options = ["--connection", connection, *folder, "--only", clause, "--html", str(page)]
    with started(*simulator, environment=without_ros) as simulated:
        assert simulated.stdout is not None
        simulated.stdout.readline()
        with started(*COMMAND, device, *options, environment=without_ros) as kit:
            out, errors = kit.communicate(timeout=60.0)
    assert (kit.returncode, errors) == (0, "")
    assert f"passed         {clause}" in out
    assert page.read_text().startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(("option", "package"), [("--mcap", "mcap"), ("--junit", "junitparser")])
def test_what_one_option_alone_needs_is_named(
    option: str,
    package: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    right = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == package else right(name)
    )
    _, errors = refused(command, monkeypatch, capsys, "mavlink", option, str(tmp_path / "a"))
    assert errors == (
        f"conformance: {option}: {package} is not installed: "
        f"`python3 -m pip install {package}` brings it\n"
    )
