"""The command chute, as a process, against a real supervisor with a stub link."""

from __future__ import annotations

import itertools
import json
import re
import signal
import sys
import threading

import pytest
from chute_bench import CONTROL, AtTerminal, Command, run, run_together
from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, PersonRequest, SafetyState
from chute_msgs.srv import Kill
from command_bench import ended, tool
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from node_bench import bench, stamped  # noqa: F401
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from supervisor_bench import Scene

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.ros import qos

HOSTILE = "\x1b[2J\x1b]0;title\x07\u202eevil\r\n"


@pytest.fixture
def scene(bench):  # noqa: F811
    return Scene(bench)


@pytest.fixture
def ready(scene):
    scene.link.offer_arming()
    scene.await_stage(SafetyState.READY)
    return scene


@pytest.fixture
def flying(ready):
    ready.link.flying = True
    ready.await_stage(SafetyState.IN_FLIGHT)
    return ready


@pytest.fixture
def terminal(bench):  # noqa: F811
    """terminal(arguments): the command at a terminal."""
    opened = []

    def start(*arguments, **how):
        opened.append(AtTerminal(bench, *arguments, **how))
        return opened[-1]

    yield start
    for one in opened:
        one.close()


def ordered(scene):
    """The decisions that stop motors or release a parachute."""
    return [*scene.decided(Action.KILL), *scene.decided(Action.DEPLOY)]


# status


def soon(text):
    """On a busy machine a word is a little older; from 2 s on it is OLD."""
    return re.sub(r"(?<=[ (])1 s ago", "<1 s ago", text)


def test_a_ready_vehicle_is_well_and_its_json_is_one_object(ready):
    shown, as_json = run_together(ready.bench, ("status",), ("status", "--json"))
    code, out, err = shown
    assert (code, err) == (0, "")
    lines = soon(out).splitlines()
    assert lines[0] == "READY"
    assert "  mavlink_parachute  OK, device healthy, device <1 s ago, node <1 s ago" in lines
    assert "  arming state       DISARMED, <1 s ago" in lines
    assert "  height             never received" in lines
    code, out, _ = as_json
    told = json.loads(out)
    assert (code, out.count("\n")) == (0, 1)
    assert (told["state"], told["well"]) == ("READY", True)
    assert told["namespace"] == ready.bench.namespace
    assert told["vehicle"]["height"] is None
    assert [one["name"] for one in told["links"]] == ["mavlink_parachute"]


def test_a_blocked_vehicle_tells_why(ready):
    ready.link.healthy = False
    ready.await_stage(SafetyState.BLOCKED)
    code, out, _ = run(ready.bench, "status")
    assert code == 1
    assert out.startswith("BLOCKED\n")
    assert "  flight             BLOCKED\n" in out
    assert "mavlink_parachute  OK, device NOT healthy" in out


def test_each_parachute_of_a_link_is_shown_though_each_tells_of_itself_once_a_second(ready):
    publisher = ready.link.create_publisher(ParachuteStatus, "parachute/status", qos.STATUS)
    devices = itertools.cycle(["1/161", "1/162", "1/163"])

    def tell():
        status = ParachuteStatus(link="mavlink_parachute", device=next(devices), link_state=1)
        publisher.publish(stamped(ready.link, status))

    ready.link.create_timer(1.0 / 3.0, tell)
    _, out, _ = run(ready.bench, "status", "--json")
    told = [one["device"] for one in json.loads(out)["parachutes"]]
    assert told == ["1/161", "1/162", "1/163"]


def test_its_json_is_alone_where_the_middleware_complains_too(ready, monkeypatch):
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", "/nowhere.xml")
    code, out, err = run(ready.bench, "status", "--json")
    assert (code, json.loads(out)["state"]) == (0, "READY")
    assert "XMLPARSER" in err


def test_where_nothing_is_heard_it_says_where_it_looked_and_what_there_is(ready):
    status = ("status", "--timeout", "5")
    alone, as_json = run_together(
        ready.bench, status, (*status, "--json"), namespace="/nobody/here"
    )
    code, out, err = alone
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert err.startswith(
        "chute: no supervisor is received in /nobody/here within 5 s (ROS domain "
    )
    assert "discovery range LOCALHOST, rmw_fastrtps_cpp" in err
    assert f"vehicles found: {ready.bench.namespace}; name one" in err
    code, out, _ = as_json
    told = json.loads(out)
    assert (code, told["namespace"]) == (1, "/nobody/here")
    assert told["vehicles"] == [ready.bench.namespace]
    assert told["error"].startswith("no supervisor is received")


# arm, disarm, mode, reset


def test_arm_and_disarm_by_the_supervisor(ready):
    code, out, _ = run(ready.bench, "arm")
    assert (code, out) == (0, "arm: done: mavlink_parachute: as told\n")
    code, out, _ = run(ready.bench, "disarm", "--json")
    assert (code, json.loads(out)) == (
        0,
        {
            "order": "disarm",
            "namespace": ready.bench.namespace,
            "service": "safety/arm",
            "sent": True,
            "answered": True,
            "success": True,
            "message": "mavlink_parachute: as told",
        },
    )
    assert [arm for arm, _ in ready.link.arm_requests] == [True, False]


def test_who_ordered_it_and_what_came_of_it_is_on_the_record(ready):
    """Given orders that have no reason, in which its giver could stand."""
    heard = ready.bench.follow(PersonRequest, "safety/person")
    for succeeds, expected, said in ((True, 0, "arm: done: "), (False, 1, "arm: NOT DONE: ")):
        heard.clear()
        ready.link.arm_succeeds = succeeds
        code, out, _ = run(ready.bench, "arm")
        assert code == expected
        assert out.startswith(said)
        assert "as told" in out
        ready.bench.until(lambda: any(one.answered for one in heard), "the answer is recorded")
        told = heard[-1]
        assert (told.link, told.service) == ("chute", "safety/arm")
        assert re.fullmatch(r"arm=True, triggers=0, by='\S+@\S+'", told.request)
        assert (told.success, told.message) == (succeeds, "mavlink_parachute: as told")
        assert told.after > 0.0
        assert told.header.stamp == heard[0].header.stamp


def test_without_a_supervisor_its_nodes_are_named_and_one_takes_the_order_itself(ready):
    ready.bench.remove(ready.supervisor)
    status, arm = run_together(
        ready.bench, ("status", "--timeout", "5"), ("arm", "--timeout", "5")
    )
    code, _, err = status
    assert code == 1
    assert "; nodes there: mavlink_parachute; " in err
    code, out, err = arm
    assert (code, out) == (1, "")
    assert err.endswith("; mavlink_parachute takes the order itself: --link mavlink_parachute\n")
    code, out, _ = run(ready.bench, "arm", "--link", "mavlink_parachute")
    assert (code, out) == (0, "arm: done: as told\n")
    assert ready.link.arm_requests == [(True, 0)]


def test_the_mode_is_set_and_seen(ready):
    code, out, _ = run(ready.bench, "mode", "inhibited", "--reason", "maintenance")
    assert (code, out) == (0, "mode: done: mode INHIBITED\n")
    code, out, _ = run(ready.bench, "status")
    assert (code, "  mode               INHIBITED" in out) == (1, True)


def test_reset_after_a_kill(ready):
    assert run(ready.bench, "kill", "--yes")[0] == 0
    ready.await_decision(Action.KILL)
    code, out, _ = run(ready.bench, "reset")
    assert code == 0
    assert out.startswith("reset: done: ")
    ready.await_stage(SafetyState.READY)


def test_an_order_is_sent_though_every_stream_is_closed(ready):
    code, _, err = run(ready.bench, "arm", redirected="<&- >&- 2>&-")
    assert (code, err, ready.link.arm_requests) == (0, "", [(True, 0)])
    ready.link.arm_requests.clear()
    # Where its answer cannot be printed, standard error tells it.
    code, _, err = run(ready.bench, "arm", redirected=">/dev/full")
    assert (code, ready.link.arm_requests) == (74, [(True, 0)])
    answer, why = err.splitlines()
    assert answer == "chute: arm: done: mavlink_parachute: as told"
    assert why == "chute: standard output cannot be written: No space left on device"


# deploy and kill


def test_a_deploy_that_is_accepted_and_not_confirmed(flying):
    flying.link.outcomes = [Outcome.SENT, Outcome.ACCEPTED]
    code, out, _ = run(flying.bench, "deploy", "--yes")
    assert code == 1
    assert out.startswith("deploy: ACCEPTED, NOT CONFIRMED: ")


def test_a_deploy_that_is_refused(ready):
    code, out, _ = run(ready.bench, "deploy", "--yes", "--json")
    told = json.loads(out)
    assert (code, told["success"], told["accepted"]) == (1, False, False)
    assert "not in flight" in told["message"]
    assert ordered(ready) == []


UNREACHED = "NO PARACHUTE CAN BE REACHED (mavlink_parachute LOST): the motors will STOP"


@pytest.fixture
def cut_off(flying):
    """In flight, and the only parachute is lost."""
    flying.link.state, flying.link.healthy = LinkState.LOST, False

    def lost():
        return flying.states[-1].link_states[0] == LinkState.LOST

    flying.bench.until(lost, "the supervisor takes it for lost")
    return flying


def test_that_no_parachute_can_be_reached_is_told_before_the_word_is_typed(cut_off, terminal):
    for asked in [terminal(order) for order in ("deploy", "kill")]:
        asked.reads("anything else to leave it: ")
        assert UNREACHED in " ".join(asked.shown.split())
        asked.types("no\n")
        assert asked.end() == 1
    assert ordered(cut_off) == []


def test_and_with_yes_it_is_told_although_it_is_ordered(cut_off):
    cut_off.link.outcomes = [Outcome.SENT, Outcome.ACCEPTED, Outcome.FAILED]
    code, out, err = run(cut_off.bench, "deploy", "--yes", "--json")
    assert (code, json.loads(out)["success"]) == (1, False)
    (line,) = err.splitlines()
    assert line.startswith(f"chute: deploy: {UNREACHED} all the same")


def test_a_kill_alone_needs_no_parachute(cut_off):
    code, out, err = run(cut_off.bench, "kill", "--only", "--yes", "--reason", "smoke")
    assert (code, err) == (0, "")
    assert out.startswith("kill: done: ")
    kill = cut_off.await_decision(Action.KILL)
    assert any("smoke" in reason for reason in kill.reasons)


def test_without_a_terminal_and_without_yes_nothing_is_sent(flying):
    orders = ("deploy", "kill")
    for stdin in ("", "<&-"):
        lines = [(order, "--reason", "anything") for order in orders]
        told = run_together(flying.bench, *lines, redirected=stdin)
        for order, (code, out, err) in zip(orders, told, strict=True):
            assert (code, out) == (2, "")
            assert err == (
                f"chute: {order}: no terminal to ask at: nothing was sent; --yes does not ask\n"
            )
    assert ordered(flying) == []


def test_another_word_sends_nothing(flying, terminal):
    words = [("deploy", "yes\n"), ("deploy", "deploy\n"), ("deploy", "KILL\n"), ("kill", "\n")]
    terminals = [terminal(order) for order, _ in words]
    for asked, (order, typed) in zip(terminals, words, strict=True):
        asked.reads("anything else to leave it: ")
        asked.types(typed)
        assert asked.end() == 1
        assert f"chute: {order}: not confirmed, nothing was sent" in asked.shown
    assert ordered(flying) == []


def test_the_word_is_asked_for_after_the_state_was_shown(flying, terminal):
    asked = terminal("deploy", "--reason", "it falls")
    asked.reads("type DEPLOY to deploy, anything else to leave it: ")
    for told in (": IN_FLIGHT", "height", "this RELEASES the parachute of the vehicle"):
        assert told in asked.shown
    assert ordered(flying) == []
    asked.types("DEPLOY\n")
    assert asked.end() == 0
    assert "deploy: done: " in asked.shown
    deploy = flying.await_decision(Action.DEPLOY)
    assert any("it falls" in reason for reason in deploy.reasons)


def test_what_was_typed_before_the_question_is_no_answer(flying, terminal):
    asked = terminal("kill")
    asked.types("KILL\n")
    asked.reads("type KILL to kill")
    asked.types("no\n")
    assert asked.end() == 1
    assert ordered(flying) == []


def test_ctrl_c_and_ctrl_d_at_the_question_send_nothing(flying, terminal):
    keys = {"\x03": 130, "\x04": 1}
    terminals = [terminal("deploy") for _ in keys]
    for asked, (key, code) in zip(terminals, keys.items(), strict=True):
        asked.reads("leave it: ")
        asked.types(key)
        assert asked.end() == code
        assert "Traceback" not in asked.shown
    assert ordered(flying) == []


@pytest.fixture
def silent(bench):  # noqa: F811
    """A supervisor's kill that takes each call and answers none."""
    calls = []

    async def never(request, response):
        calls.append(request)
        return await Future()

    group = ReentrantCallbackGroup()
    bench.client.create_service(Kill, "safety/kill", never, callback_group=group)
    return calls


def test_without_an_answer_it_says_that_nobody_knows(bench, silent):  # noqa: F811
    order = ("kill", "--yes", "--timeout", "5")
    as_text, as_json = run_together(bench, order, (*order, "--json"))
    code, out, err = as_text
    assert (code, out, len(silent)) == (1, "", 2)
    assert err.startswith("chute: kill: safety/kill did not answer within 5 s: it is NOT known ")
    told = json.loads(as_json[1])
    assert (told["sent"], told["answered"]) == (True, False)
    # The same after a Ctrl-C.
    command = Command("--namespace", bench.namespace, "kill", "--yes")
    bench.until(lambda: len(silent) == 3, "the kill is received")
    command.process.send_signal(signal.SIGINT)
    bench.until(lambda: command.process.poll() is not None, "it ends")
    code, _, err = command.ended()
    assert code == 130
    assert "did not answer before it was interrupted: it is NOT known" in err
    assert err.endswith("chute: interrupted\n")


# watch


def test_watch_shows_the_state_in_large_until_it_is_ended(ready, terminal):
    """By q, or by Ctrl-C."""
    keys = {"q": 0, "\x03": 130}
    terminals = [terminal("watch") for _ in keys]
    for watching in terminals:
        watching.reads("R E A D Y")
    ready.link.flying = True
    for watching, (key, code) in zip(terminals, keys.items(), strict=True):
        watching.reads("I N   F L I G H T")
        watching.types(key)
        assert watching.end() == code
        assert watching.is_as_before()


def test_watch_waits_for_a_vehicle_and_turns_grey_when_it_is_silent(bench, terminal):  # noqa: F811
    watching = terminal("watch")
    watching.reads("NOTHING RECEIVED YET")
    scene = Scene(bench)
    watching.reads("R E A D Y")
    bench.remove(scene.supervisor)
    watching.reads("LAST WORD 2 s AGO (WAS R E A D Y)")
    watching.process.send_signal(signal.SIGTERM)
    assert watching.end() == 128 + signal.SIGTERM
    assert watching.is_as_before()


def test_watch_gives_up_after_its_timeout(terminal):
    watching = terminal("watch", "--timeout", "1")
    assert watching.end() == 1
    assert "chute: no supervisor is received in " in watching.shown
    assert watching.is_as_before()


def test_watch_needs_a_terminal_but_for_its_json(ready):
    code, out, err = run(ready.bench, "watch")
    assert (code, out) == (2, "")
    assert err == "chute: watch: needs a terminal; `chute status` and --json do not\n"
    command = Command("--namespace", ready.bench.namespace, "watch", "--json")
    heard = Reader(command.process.stdout)
    ready.bench.until(lambda: heard.has("READY"), "READY is told")
    ready.link.flying = True
    ready.bench.until(lambda: heard.has("IN_FLIGHT"), "IN_FLIGHT is told")
    command.process.send_signal(signal.SIGINT)
    ready.bench.until(lambda: command.process.poll() is not None, "it ends")
    assert command.process.returncode == 130


class Reader:
    """The lines of JSON that a process has printed so far."""

    def __init__(self, stream):
        self._lines, self._stream = [], stream
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self._stream:
            self._lines.append(json.loads(line))

    def has(self, state):
        return any(one["state"] == state for one in self._lines)


# diagnostics, parameters, record


def test_diagnostics_are_worst_first_and_of_this_vehicle_alone(ready):
    levels = {"bad": b"\x02", "stale": b"\x03", "doubtful": b"\x01", "good": b"\x00"}
    tasks = [
        DiagnosticStatus(
            level=level,
            name=f"mine: {name}",
            message="told",
            values=[KeyValue(key="height (m)", value="3")],
        )
        for name, level in levels.items()
    ]
    ready.bench.client.create_timer(
        0.2, publisher_of(ready, DiagnosticArray, "diagnostics", DiagnosticArray(status=tasks))
    )
    code, out, _ = run(ready.bench, "diagnostics", "--all")
    mine = [line for line in soon(out).splitlines() if "mine: " in line]
    assert mine == [
        "ERROR  mine: bad: told (<1 s ago)",
        "STALE  mine: stale: told (<1 s ago)",
        "WARN   mine: doubtful: told (<1 s ago)",
        "OK     mine: good: told (<1 s ago)",
    ]
    assert code == 1
    assert "           height (m): 3\n" in out
    assert "safety_supervisor: decisions: READY" in out


def publisher_of(scene, kind, topic, message, profile=qos.STATUS):
    """What publishes message, stamped, whenever it is called."""
    publisher = scene.bench.client.create_publisher(kind, topic, profile)
    return lambda: publisher.publish(stamped(scene.bench.client, message))


def test_healthy_diagnostics_are_well(ready):
    def well():
        code, out, _ = run(ready.bench, "diagnostics", "--json")
        assert (code == 0) == (
            {one["level"] for one in json.loads(out)["tasks"]} <= {"OK", "WARN"}
        )
        return code == 0

    # Words that a busy machine held up look like another clock, for some seconds.
    ready.bench.until(well, "all is well")


@pytest.mark.parametrize("beating", [True, False])
def test_a_node_that_sends_no_diagnostics_is_told(ready, beating):
    """It hangs, or hung before this command began: then the supervisor alone says it should be."""
    ready.link.diagnosing, ready.link.beating = False, beating
    ready.bench.until(lambda: beating or ready.states[-1].link_states[0] == LinkState.LOST, "lost")
    diagnostics, doctor = run_together(
        ready.bench, ("diagnostics", "--timeout", "4"), ("doctor", "--timeout", "4")
    )
    code, out, _ = diagnostics
    assert code == 1
    place = f"{ready.bench.namespace}/mavlink_parachute".lstrip("/")
    told = f"STALE  {place}: diagnostics: nothing received within 4 s (never received)"
    assert told in out.splitlines()
    code, out, _ = doctor
    assert code == 1
    assert "WRONG  mavlink_parachute: no diagnostics: nothing received within 4 s -> " in out


@pytest.mark.parametrize(
    ("gone", "left", "told"),
    [
        ("link", "safety_supervisor", "mavlink_parachute"),
        # Nothing else names it: the list was shorter, and all was said to be well.
        ("supervisor", "mavlink_parachute", "a supervisor"),
    ],
)
def test_a_node_that_is_gone_is_told_with_the_parameters(ready, gone, left, told):
    ready.bench.remove(getattr(ready, gone))
    code, out, err = run(ready.bench, "parameters", "--timeout", "4")
    assert (code, out.splitlines()[0]) == (1, left)
    assert err == f"chute: {told} did not answer within 4 s\n"


def test_parameters_show_what_differs_from_the_default_and_a_node_that_is_not_there(ready):
    of_one, all_changed, not_there = run_together(
        ready.bench,
        ("parameters", "safety_supervisor"),
        ("parameters", "--changed", "--json"),
        ("parameters", "upf_can"),
    )
    code, out, _ = of_one
    lines = out.splitlines()
    assert (code, lines[0]) == (0, "safety_supervisor")
    assert [line.split() for line in lines if line.startswith("  *")] == [
        ["*", "startup_grace", "0.3", "(default:", "10.0)"],
        ["*", "deploy_timeout", "2.0", "(default:", "8.0)"],
        ["*", "kill_timeout", "2.0", "(default:", "6.0)"],
    ]
    assert any(line.split() == ["profile", '"multirotor"'] for line in lines)
    code, out, _ = all_changed
    told = json.loads(out)
    assert (code, told["silent"]) == (0, [])
    assert told["nodes"]["mavlink_parachute"] == []
    assert told["nodes"]["safety_supervisor"][0] == {
        "name": "startup_grace",
        "value": 0.3,
        "default": 10.0,
        "differs": True,
    }
    code, _, err = not_there
    assert code == 1
    assert err.startswith("chute: no node upf_can is found in ")
    assert "nodes there: mavlink_parachute, safety_supervisor" in err


def test_the_black_box_is_found_with_its_files(bench):  # noqa: F811
    folder = bench.folder / "box"
    scene = Scene(bench, black_box_folder=str(folder))
    scene.await_stage(SafetyState.READY)
    bench.until(lambda: [*folder.glob("*.mcap")], "a file begins")
    code, out, _ = run(bench, "record")
    assert code == 0
    lines = out.splitlines()
    assert soon(lines[0]) == "safety_supervisor: recording, <1 s ago"
    assert lines[1] == f"  folder  {folder}"
    assert lines[2].endswith(str(next(folder.glob("*.mcap"))))


def test_without_a_black_box_it_says_so(bench):  # noqa: F811
    Scene(bench, black_box=False).await_stage(SafetyState.READY)
    code, out, err = run(bench, "record")
    assert (code, out) == (1, "")
    assert (
        "its parameter black_box is false (nodes received: mavlink_parachute, safety_supervisor)"
        in err
    )


# What others may send, and what a shell may do


def test_no_control_character_reaches_the_terminal(ready):
    client = ready.bench.client
    client.declare_parameter("evil", HOSTILE)
    senders = [
        publisher_of(ready, kind, topic, message, profile)
        for kind, topic, message, profile in (
            (
                SafetyState,
                "safety/state",
                SafetyState(
                    supervisor=HOSTILE,
                    epoch=2**32 - 1,
                    state=4,
                    state_text=HOSTILE,
                    links=[HOSTILE],
                    link_states=[1],
                    link_ages=[0.0],
                    devices_healthy=[False],
                    alarms=[HOSTILE],
                ),
                qos.LATCHED,
            ),
            (
                LinkHeartbeat,
                "safety/heartbeat",
                LinkHeartbeat(link=HOSTILE, reasons=[HOSTILE]),
                qos.STATUS,
            ),
            (
                ParachuteStatus,
                "parachute/status",
                ParachuteStatus(link=HOSTILE, device=HOSTILE, faults=[HOSTILE]),
                qos.STATUS,
            ),
            (
                DiagnosticArray,
                "diagnostics",
                DiagnosticArray(
                    status=[DiagnosticStatus(name=HOSTILE, message=HOSTILE, level=b"\x07")]
                ),
                qos.STATUS,
            ),
        )
    ]
    client.create_timer(0.1, lambda: [send() for send in senders])
    commands = [("status",), ("diagnostics",), ("parameters",)]
    told = run_together(ready.bench, *commands)
    for command, (code, out, err) in zip(commands, told, strict=True):
        assert "evil" in out, (command, code, out, err)
        assert CONTROL.findall(out + err) == []


def test_a_reader_that_has_seen_enough(ready):
    command = Command("--namespace", ready.bench.namespace, "status")
    command.process.stdout.close()
    ready.bench.until(lambda: command.process.poll() is not None, "it ends")
    assert command.process.stderr.read() == ""


def test_a_mistake_is_told_without_ros():
    code, out, err = tool("chute", "arm", "--link", "no name")
    assert (code, out) == (2, "")
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("variable", "given"),
    [
        ("ROS_DOMAIN_ID", "233"),
        # ROS would take another one.
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "localhost"),
        # ROS itself would end the process.
        ("RMW_IMPLEMENTATION", "rmw_nothing"),
    ],
)
def test_an_environment_that_cannot_be_is_a_mistake(monkeypatch, variable, given):
    monkeypatch.setenv(variable, given)
    code, out, err = tool("chute", "status")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"chute: {variable} is {given!r}: need ")


# doctor


def test_the_doctor_finds_nothing_wrong_with_a_sound_vehicle(ready):
    code, out, err = run(ready.bench, "doctor")
    lines = out.splitlines()
    assert (code, err, [line for line in lines if line.startswith("WRONG")]) == (0, "", []), out
    assert f"OK     supervisor of {ready.bench.namespace}: safety_supervisor" in lines
    # The stub of a link does not tell its version.
    silent = "NOTE   no version of chute_ros is received of mavlink_parachute -> "
    assert [line for line in lines if line.startswith(silent)]
    assert any(line.startswith("OK     versions: chute_ros ") for line in lines)


def test_the_doctor_finds_a_port_that_is_not_there_and_a_node_of_another_version(ready):
    ready.link.declare_parameter("connection", "serial:/dev/nothing:57600")
    name = f"{ready.bench.namespace.lstrip('/')}/mavlink_parachute: middleware"
    old = DiagnosticStatus(name=name, values=[KeyValue(key="chute_ros", value="0.0.9")])
    ready.bench.client.create_timer(
        0.2, publisher_of(ready, DiagnosticArray, "diagnostics", DiagnosticArray(status=[old]))
    )
    code, out, _ = run(ready.bench, "doctor", "--json")
    told = json.loads(out)
    assert (code, told["well"]) == (1, False)
    own = told["versions"]["chute_ros"]
    version, port = [one for one in told["findings"] if one["level"] == "WRONG"]
    assert version["what"] == (
        f"versions of chute_ros differ: 0.0.9 of mavlink_parachute; {own} of safety_supervisor"
    )
    assert "start its nodes again" in version["remedy"]
    connection = "connection serial:/dev/nothing:57600 of mavlink_parachute"
    assert port["what"].startswith(f"{connection}: /dev/nothing: no such port")
    assert {"ROS", "Python", "middleware", "rclpy", "pymavlink"} < told["versions"].keys()


def test_the_doctor_where_nothing_is_received(bench):  # noqa: F811
    code, out, _ = run(bench, "doctor", "--timeout", "1")
    first = out.splitlines()[0]
    assert code == 1
    assert first.startswith(f"WRONG  no node is received in {bench.namespace} within 1 s (ROS ")
    assert " -> start the vehicle with the same ROS_DOMAIN_ID" in first


def test_the_doctor_without_chute_msgs_and_in_a_domain_that_cannot_be(tmp_path):
    (tmp_path / "chute_msgs.py").write_text("raise ImportError('gone', name='chute_msgs')\n")
    script = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.argv = ['chute', 'doctor']\n"
    script += "from chute_ros.tools.chute.__main__ import main; main()"
    for domain, told in (
        ("1", "WRONG  cannot be imported: gone -> "),
        ("one", "WRONG  ROS_DOMAIN_ID is 'one'"),
    ):
        code, out, err = ended([sys.executable, "-c", script], ROS_DOMAIN_ID=domain)
        assert (code, err) == (1, "")
        assert out.startswith(told)
