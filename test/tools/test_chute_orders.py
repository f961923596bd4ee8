"""What an order of a person asks for, and what its answer means."""

from __future__ import annotations

import pytest

from chute_ros.tools.chute.options import parse
from chute_ros.tools.chute.order import ServiceAnswer, answer_text, not_answered, order_of

WHO = "ann@ground"


def order(*arguments):
    return order_of(parse([*arguments]), WHO)


@pytest.mark.parametrize(
    ("arguments", "kind", "service", "fields"),
    [
        (["arm"], "Arm", "safety/arm", {"arm": True, "triggers": 0}),
        (["disarm"], "Arm", "safety/arm", {"arm": False, "triggers": 0}),
        (["arm", "--link", "upf_can"], "Arm", "upf_can/arm", {"arm": True, "triggers": 0}),
        (
            ["deploy", "--reason", "it falls"],
            "Deploy",
            "safety/deploy",
            {"force": False, "reason": "ann@ground: it falls"},
        ),
        (
            ["deploy", "--force", "--link", "umbilical"],
            "Deploy",
            "umbilical/deploy",
            {"force": True, "reason": "ann@ground: no reason given"},
        ),
        (
            ["kill", "--only", "--reason", "smoke"],
            "Kill",
            "safety/kill",
            {"force": False, "kill_only": True, "reason": "ann@ground: smoke"},
        ),
        (["reset"], "Trigger", "safety/reset", {}),
        (
            ["mode", "shadow", "--force"],
            "SetMode",
            "safety/set_mode",
            {"mode": 1, "force": True, "reason": "ann@ground: no reason given"},
        ),
    ],
)
def test_each_order_is_one_call(arguments, kind, service, fields):
    made = order(*arguments)
    assert (made.kind, made.service, dict(made.fields)) == (kind, service, fields)


def test_only_what_cannot_be_taken_back_asks_for_a_word():
    orders = [("arm",), ("disarm",), ("deploy",), ("kill",), ("reset",), ("mode", "ACTIVE")]
    assert [order(*one).word for one in orders] == ["", "", "DEPLOY", "KILL", "", ""]


VEHICLE = (
    "RELEASES the parachute of the vehicle, with a kill before it where the supervisor does so"
)
LINK = (
    "RELEASES the parachute of upf_can, past the supervisor, also where a check forbids it "
    "(--force)"
)
KILL = "STOPS the motors, on the ground and in the air"


@pytest.mark.parametrize(
    ("arguments", "does"),
    [
        (["deploy"], VEHICLE),
        (["deploy", "--link", "upf_can", "--force"], LINK),
        (["kill"], f"{KILL}, and deploys after it where that helps"),
        (["kill", "--only"], f"{KILL}, and nothing else (--only)"),
    ],
)
def test_a_person_reads_what_will_be_done(arguments, does):
    assert order(*arguments).does == does


@pytest.mark.parametrize(
    ("answer", "text", "code"),
    [
        (ServiceAnswer(True, "confirmed", True), "deploy: done: confirmed", 0),
        (
            ServiceAnswer(False, "no status", True),
            "deploy: ACCEPTED, NOT CONFIRMED: no status",
            1,
        ),
        (ServiceAnswer(False, "mode is SHADOW", False), "deploy: NOT DONE: mode is SHADOW", 1),
        (ServiceAnswer(False, ""), "deploy: NOT DONE: no message", 1),
    ],
)
def test_an_answer_tells_done_accepted_and_refused_apart(answer, text, code):
    assert (answer_text(order("deploy"), answer), answer.code) == (text, code)


def test_a_message_is_shown_whole():
    long = "; ".join(f"reason {number}" for number in range(200))
    assert answer_text(order("arm"), ServiceAnswer(False, long)).endswith(long)


def test_without_an_answer_nobody_knows_whether_it_was_carried_out():
    assert not_answered(order("kill"), "within 30 s") == (
        "kill: safety/kill did not answer within 30 s: it is NOT known whether it was carried "
        "out. `chute status` shows what the vehicle reports. Giving the order again is safe: a "
        "parachute is released once."
    )
    for other in (("arm",), ("deploy", "--force"), ("deploy", "--link", "upf_can")):
        assert "again is safe" not in not_answered(order(*other), "within 30 s")


# The command line


@pytest.mark.parametrize(
    ("arguments", "namespace"),
    [
        (["--namespace", "drone1", "status"], "/drone1"),
        (["status", "--namespace", "/drone1/"], "/drone1"),
        (["--namespace", "/fleet/drone1", "status"], "/fleet/drone1"),
        (["--namespace", "/", "status"], "/"),
        (["status"], "/"),
    ],
)
def test_the_namespace_stands_before_the_command_or_after_it(monkeypatch, arguments, namespace):
    monkeypatch.delenv("CHUTE_NAMESPACE", raising=False)
    assert parse(arguments).namespace == namespace


def test_the_environment_names_the_vehicle_unless_the_command_line_does(monkeypatch):
    monkeypatch.setenv("CHUTE_NAMESPACE", "drone7")
    assert parse(["status"]).namespace == "/drone7"
    assert parse(["status", "--namespace", "drone8"]).namespace == "/drone8"


def test_options_before_the_command_are_not_lost():
    chosen = parse(["--json", "--timeout", "3", "kill", "--yes"])
    assert (chosen.json, chosen.timeout, chosen.more.yes) == (True, 3.0, True)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "COMMAND"),
        (["launch"], "invalid choice: 'launch'"),
        (["status", "--namespace", "a b"], "'a b' is no namespace"),
        (["status", "--namespace", "/a//b"], "'/a//b' is no namespace"),
        (["status", "--namespace", "\x1b[31m"], r"is no namespace"),
        (["status", "--timeout", "0"], "'0' is no time"),
        (["status", "--timeout", "-1"], "'-1' is no time"),
        (["status", "--timeout", "nan"], "'nan' is no time"),
        (["status", "--timeout", "inf"], "'inf' is no time"),
        (["status", "--timeout", "soon"], "'soon' is no time"),
        (["arm", "--link", "../x"], "'../x' is no name of a node"),
        (["kill", "--link", "upf_can"], "unrecognized arguments"),
        # An option that is only begun might mean another.
        (["deploy", "--forc"], "unrecognized arguments: --forc"),
        (["mode"], "mode"),
        (["mode", "OFF"], "invalid choice: 'OFF'"),
        (["parameters", "a/b"], "'a/b' is no name of a node"),
    ],
)
def test_a_mistake_in_the_command_line_ends_with_2(arguments, told, capsys):
    with pytest.raises(SystemExit) as ended:
        parse(arguments)
    assert ended.value.code == 2
    out, err = capsys.readouterr()
    assert told in err
    assert out == ""
    assert "\x1b" not in err
