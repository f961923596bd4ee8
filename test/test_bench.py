"""The bench runs end to end and writes its table; how fast anything is, is not asserted."""

import os
import re
import runpy
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
KILL_SWITCH, DECODING, TELEMETRY = (
    "bench.kill_switch",
    "bench.umbilical_decoding",
    "bench.umbilical_telemetry",
)
FEW = ("--requests", "5", "--batches", "3", "--seconds", "0.5", "--top-rate", "100")
FEW += ("--rounds", "2", "--deploys", "2", "--cost-seconds", "1", "--message-batches", "3")
FEW += ("--executor-requests", "2", "--onlooker-requests", "4", "--onlooker-deploys", "4")
#: The sections of docs/evidence/bench.md, and those that have pages of their own.
KEPT = ("Kill switch", "A vehicle", "Decoding", "Decoding a line", "Through the node")
ELSEWHERE = ("Executors", "Onlookers")
PEERS = ("chute_ros", "ROS alone", "bare relay")
EXECUTORS = ["NodeExecutor", "SingleThreadedExecutor"]
HOW = ("idle", "under 10 times the frames")
HOPS = tuple(
    f"{hop}, {how}"
    for how in HOW
    for hop in ("to the kill on MAVLink", "to the answer on the bus")
)
LAYOUTS = (
    "telem57_airbrake_state",
    "telem50",
    "telem52",
    "telem54",
    "telem57_airbrake_deployment",
)
DECODERS = ("chute_ros, whole link", "chute_ros, decoder", "bare split and float")
WIRES = {
    "MAVLink": ("chute_ros, whole link", "chute_ros, decoder", "pymavlink"),
    "DroneCAN": ("chute_ros, whole link", "chute_ros, decoder", "dronecan"),
}
WAYS = (
    "a link's limit passed, until flight is blocked on the wire",
    "safety/deploy called, until the release is on the wire",
)
ENDS = ("chute_ros", "bare script")
RATES = ("at 13 lines/s", "at 100 lines/s")
ROW = re.compile(r"^\| ([^|:]+): ([^|]+) \| (.+) \|$", re.MULTILINE)


def rows(text):
    """(what, peer) -> the other cells."""
    return {(m[1], m[2]): m[3].split(" | ") for m in ROW.finditer(text)}


def number(cell, unit=""):
    assert re.fullmatch(rf"\d+(\.\d+)?{unit}", cell), cell
    return float(cell.removesuffix(unit))


def parts(text):
    """Each table with what stands before it."""
    found = re.split(r"(?<=\|)\n\n?(?!\|)", text)
    return [part for part in found if "\n|" in part]


def check_times(table, unit, base):
    """Median, 99th percentile, largest, two ratios, missed."""
    for (_, peer), cells in table.items():
        median, late, largest = (number(cell, unit) for cell in cells[:3])
        assert 0.0 < median <= late <= largest
        ratios = [number(cell) for cell in cells[3:5]]
        assert all(ratio > 0.0 for ratio in ratios)
        assert peer != base or ratios == [1.0, 1.0]
        assert len(cells) == 6
        number(cells[5])


def check_kill_switch(text):
    """The section is of the form that the command writes; how many requests it is of."""
    measured = rows(text)
    assert set(measured) == {(hop, peer) for hop in HOPS for peer in PEERS}
    assert text.count("\n|") == len(measured) + 2, "no other rows"
    check_times(measured, " ms", "bare relay")
    for peer in PEERS:
        medians = [number(measured[hop, peer][0], " ms") for hop in HOPS]
        assert medians[0] <= medians[1], "first the kill"
        assert medians[2] <= medians[3], "under load as well"
    assert re.search(
        r"Kills that came: chute_ros \d+, ROS alone \d+, bare relay \d+\.$", text, re.M
    )
    return int(re.search(r"^(\d+) requests to each, idle and as often under load,", text, re.M)[1])


def check_decoding(text):
    """The same; how many batches it is of."""
    measured = rows(text)
    assert set(measured) == {(layout, peer) for layout in LAYOUTS for peer in DECODERS}
    assert text.count("\n|") == len(measured) + 2, "no other rows"
    check_times(measured, " us", "bare split and float")
    return int(re.search(r"^(\d+) batches of 100 lines to each, taking turns", text, re.M)[1])


def check_vehicle(text):
    """The same; how many limits and deploys it is of."""
    times, cost = parts(text)
    assert set(rows(times)) == {(way, how) for way in WAYS for how in HOW}
    for cells in rows(times).values():
        median, late, largest = (number(cell, " ms") for cell in cells)
        assert 0.0 < median <= late <= largest
    nodes = re.findall(r"^\| (\w+) \| (\S+) % \| (\d+) MB \|$", cost, re.M)
    assert [name for name, _, _ in nodes] == ["mavlink_parachute", "safety_supervisor", "together"]
    assert all(float(share) > 0.0 and int(memory) > 10 for _, share, memory in nodes)
    assert re.search(r"From the start of both processes to READY: \d+\.\d s\.$", text, re.M)
    counts = re.search(r"frames/s\. (\d+) limits and (\d+) deploys of each, ", text)
    return tuple(int(count) for count in counts.groups())


def check_messages(text):
    """The same; how many batches it is of."""
    for (wire, peers), table in zip(WIRES.items(), parts(text), strict=True):
        assert set(rows(table)) == {(wire, peer) for peer in peers}
        check_times(rows(table), " us", peers[-1])
    return int(re.search(r"^(\d+) batches of 100 reads to each, taking turns", text, re.M)[1])


def check_telemetry(text):
    """The same; how many lines at the real rate it is of."""
    latency, cpu, highest = parts(text)
    assert set(rows(latency)) == {(RATES[0], peer) for peer in ENDS}
    check_times(rows(latency), " ms", "bare script")
    assert set(rows(cpu)) == {(rate, peer) for rate in RATES for peer in ENDS}
    for share, ratio in rows(cpu).values():
        number(share, " %")
        assert ratio == "-" or number(ratio) > 0.0
    assert set(rows(highest)) == {("without loss", peer) for peer in ENDS}
    for rate, ratio, share, above in rows(highest).values():
        assert rate == "-" or number(rate, " lines/s") >= 50.0
        assert ratio == "-" or number(ratio) > 0.0
        assert share == "-" or number(share, " %") >= 0.0
        assert above == "-" or re.match(r"\d+ of \d+ at \d+/s", above)
    return int(re.search(r"at 13 lines/s (\d+) lines to each\.$", text, re.M)[1])


def sections(text, names=KEPT):
    """The whole file is of the form that the command writes: these sections, in any order."""
    head, *found = re.split(rf"^##+ ({'|'.join(names)})$", text, flags=re.M)
    by_name = dict(zip(found[::2], found[1::2], strict=True))
    assert set(by_name) == set(names)
    assert re.search(r"^.+, \d+ cores; Linux \S+; Python 3\.\S+ of /\S+; ROS 2 \w+\.$", head, re.M)
    assert by_name["Decoding"].rstrip().endswith("## Umbilical telemetry")
    assert text.count("## Umbilical telemetry") == 1
    for section in by_name.values():
        assert re.match(r"\n\nLoad before the run: \d+\.\d ", section)
    return [by_name[name].replace("## Umbilical telemetry\n", "") for name in names]


def bench(module, *arguments):
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=240.0,
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.mark.long
def test_all_parts_are_measured_in_one_run(tmp_path):
    output = tmp_path / "bench.md"
    done = bench("bench", *FEW, "--output", str(output))
    found = sections(output.read_text(), (*KEPT, *ELSEWHERE))
    kill_switch, vehicle, messages, decoding, telemetry, executors, onlookers = found
    assert re.findall(r"^\| (\w+Executor) \| \d", executors, re.M) == EXECUTORS
    assert len(re.findall(r"^\| (?:kill|answer), .+ ms \|", onlookers, re.M)) == 2 * 2 * 3
    assert len(re.findall(r"^\| deploy, .+ ms \|", onlookers, re.M)) == 3
    assert check_kill_switch(kill_switch) == 5
    assert check_vehicle(vehicle) == (2, 2)
    assert check_messages(messages) == 3
    assert check_decoding(decoding) == 3
    assert check_telemetry(telemetry) == 6 * 6
    assert output.read_text() in done.stdout, "it prints what it writes"
    for said in ("5 of 5 rounds", "5 of 5 layouts", "6 of 6 turns"):
        assert said in done.stderr, "it says how far it is"


def test_a_part_alone_writes_nothing_but_where_it_is_told_to(tmp_path):
    before = (ROOT / "docs" / "evidence" / "bench.md").read_text()
    done = bench(DECODING, "--batches", "2")
    assert check_decoding(done.stdout.rstrip()) == 2
    assert (ROOT / "docs" / "evidence" / "bench.md").read_text() == before


def test_what_is_in_docs_is_what_the_command_writes():
    text = (ROOT / "docs" / "evidence" / "bench.md").read_text()
    kill_switch, vehicle, messages, decoding, telemetry = sections(text)
    # Of fewer the 99th percentile would be the largest.
    assert check_kill_switch(kill_switch) >= 200
    limits, deploys = check_vehicle(vehicle)
    assert limits >= 100
    assert deploys >= 30, "each takes 5 s: their 99th percentile is the largest"
    assert check_messages(messages) >= 100
    assert check_decoding(decoding) >= 100
    assert check_telemetry(telemetry) >= 200
    # All but the numbers and the machine's line is the command's own text.
    program = (
        "from types import SimpleNamespace as Some\n"
        "from bench import kill_switch as k, umbilical_decoding as d, umbilical_telemetry as t\n"
        "from bench import device_decoding as m, vehicle as v\n"
        "from bench.report import document, load\n"
        "from bench.umbilical_ends import Step\n"
        "from bench.wire_ends import Round\n"
        "names = (k.OURS, k.ROS, k.BARE)\n"
        "rounds = {how: [Round(1.0, 2.0)] for how in (k.IDLE, k.LOADED)}\n"
        "peers = [k.Peer(name, Some(kills=0), rounds) for name in names]\n"
        "times = {name: d.Times([1.0]) for name in (d.LINK, d.DECODER, d.BARE)}\n"
        "bare = {'MAVLink': m.PYMAVLINK, 'DroneCAN': m.DRONECAN}\n"
        "wires = {wire: {name: d.Times([1.0]) for name in (m.LINK, m.DECODER, one)}\n"
        "    for wire, one in bare.items()}\n"
        "ways = {how: [1.0] for how in (v.IDLE, v.LOADED)}\n"
        "result = v.Result(1.0, ways, ways, dict.fromkeys(v.NODES, (0.1, 1.0)), 1.0)\n"
        "few = Some(rounds=1, deploys=1, cost_seconds=1.0)\n"
        f"measured = dict.fromkeys({LAYOUTS}, times)\n"
        "step = Step(13.0, 1, [1.0], 0.1)\n"
        "ends = [t.Peer(n, None, t.Search(1.0, step, step)) for n in (t.OURS, t.BARE)]\n"
        "[turns.append(step) for end in ends for turns in end.turns.values()]\n"
        "print(document([(k.HEADING, k.report(peers, load())),\n"
        "    (v.HEADING, v.report(result, few, load())),\n"
        "    (m.HEADING, m.report(wires, 1, load())),\n"
        "    (d.HEADING, d.report(measured, load())),\n"
        "    (t.HEADING, t.report(ends, 4.0, load()))]), end='')\n"
    )
    made = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert words(made.stdout) == words(text)


def words(text):
    """A report without what differs from run to run: the machine's line and all numbers."""
    lines = [line for line in text.splitlines() if " cores; Linux " not in line]
    text = "\n".join(lines).replace(" (the writer did not reach it)", "")
    return re.sub(r"\d+(\.\d+)?", "N", text)


def test_the_bare_script_publishes_what_the_node_publishes():
    program = (
        "from contextlib import ExitStack\n"
        "from bench.command import with_children\n"
        "from bench.umbilical_telemetry import start_peers\n"
        "from chute_msgs.msg import Telem\n"
        "fields = Telem.get_fields_and_field_types()\n"
        "def measure(namespace, children):\n"
        "    with ExitStack() as stack:\n"
        "        told = []\n"
        "        for peer in start_peers(namespace, children, stack):\n"
        "            for _ in range(3):\n"
        "                peer.ends.lines.restart()\n"
        "                if not peer.ends.step(50.0, 4.0).lost:\n"
        "                    break\n"
        "            came = peer.ends.messages()\n"
        "            told.append([{name: getattr(m, name) for name in fields} for m in came])\n"
        "        return told\n"
        "ours, bare = with_children(measure)\n"
        "own = ('header', 'sequence', 'device_uptime')\n"
        "for told in (ours, bare):\n"
        "    assert all(m['device_uptime'] > 0.0 and m['header'].stamp.sec for m in told)\n"
        "    steps = {b['sequence'] - a['sequence'] for a, b in zip(told, told[1:])}\n"
        "    assert steps == {1}, steps\n"
        "    [m.pop(name) for m in told for name in own]\n"
        "ours, bare = ours[-199:], bare[-199:]  # without the first of a flight that begins anew\n"
        "assert len(ours) == 199, len(ours)\n"
        "assert {m['flight_mode'] for m in ours} >= {0, 1, 2, 3}\n"
        "assert repr(ours) == repr(bare)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("module", "processes", "number"),
    [
        (TELEMETRY, 3, signal.SIGINT),
        pytest.param(TELEMETRY, 3, signal.SIGTERM, marks=pytest.mark.long),
        (KILL_SWITCH, 11, signal.SIGTERM),
        pytest.param(KILL_SWITCH, 11, signal.SIGINT, marks=pytest.mark.long),
    ],
)
def test_its_children_end_with_it(tmp_path, module, processes, number):
    marker = f"CHUTE_ROS_BENCH_TEST_{os.getpid()}_{number.value}"
    child = subprocess.Popen(
        [sys.executable, "-m", module, "--output", str(tmp_path / "bench.md")],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, marker: "1"},
    )
    end = time.monotonic() + 30.0
    settled = 0
    while settled < 25:  # all there, and none is just being started
        settled = settled + 1 if len(running(marker)) >= processes else 0
        assert child.poll() is None, child.stderr.read()
        assert time.monotonic() < end, f"the peers are not all there: {running(marker)}"
        time.sleep(0.02)
    child.send_signal(number)
    _, said = child.communicate(timeout=60.0)
    assert child.returncode == 1, said
    assert "Traceback" not in said
    while left := running(marker):
        assert time.monotonic() < end + 30.0, f"still there: {left}"
        time.sleep(0.02)
    assert not (tmp_path / "bench.md").exists()


def running(marker):
    """Processes that have this in their environment: the bench and its children."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if marker.encode() in (folder / "environ").read_bytes():
                found.append(folder.name)
        except OSError:
            pass  # it has just ended, or is somebody else's
    return found


@pytest.mark.parametrize(
    "wrong",
    [
        ("--requests", "1"),
        ("--batches", "1"),
        ("--seconds", "0"),
        ("--top-rate", "nan"),
        ("--output", "/nowhere/at/all.md"),
    ],
)
def test_a_mistake_is_said_before_anything_is_started(wrong, monkeypatch, capsys):
    monkeypatch.setattr("bench.command.document", None)  # what measures raises
    monkeypatch.setattr(sys, "argv", ["bench", *wrong])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("bench", run_name="__main__")
    assert ended.value.code == 2
    assert wrong[0] in capsys.readouterr().err.splitlines()[-1]
