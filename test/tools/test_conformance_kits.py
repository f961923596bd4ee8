"""What holds for the kit of each device."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pytest

from chute_ros.conformance.clause import (
    ASKS,
    READS,
    SOAK,
    Clause,
    Packet,
    Result,
    Risk,
    Verdict,
)
from chute_ros.conformance.kit import Kit
from chute_ros.conformance.session import Allowed, Session
from chute_ros.conformance.virtual import VirtualLine
from chute_ros.links.api import load
from chute_ros.links.registered import links

KITS: dict[str, Kit] = {one.device: load(one.kit) for one in links().values() if one.kit}
ALONE = [(device, clause) for device, kit in KITS.items() for clause in kit.clauses]
IN_REACH = [(device, clause) for device, clause in ALONE if not clause.out_of_reach]


def tried(
    device: str, clauses: Sequence[Clause[object]], needs: str, broken: str = ""
) -> tuple[list[Result], Sequence[Packet]]:
    """Of a device that breaks this clause (empty: a sound one) with these options and all risks:
    results, and the whole traffic."""
    simulated, bench = KITS[device].simulated(broken, needs or SOAK)
    line = VirtualLine(Session(bench, clauses, Allowed(Risk.FIRES, needs.split())), simulated)
    line.run()
    return [one for one in line.events if isinstance(one, Result)], bench.traffic


#: Name and content of what asks a device for what it knows, or keeps the connection.
ASKING = {
    # MAV_CMD_REQUEST_MESSAGE, MAV_CMD_GET_MESSAGE_INTERVAL, and a number that is no command.
    "mavlink": r"COMMAND_(LONG|INT) .*\bcommand=(512|510|31999)\b.*",
    "upf": r"uavcan\.protocol\.(GetNodeInfo|GetTransportStats) request .*"
    r"|uavcan\.protocol\.param\.GetSet request .*value={'empty': {}}.*",
    "umbilical": r"write (<H>|<I>)",
}


@pytest.mark.parametrize(
    ("device", "clause"), ALONE, ids=[f"{device}-{one.name}" for device, one in ALONE]
)
def test_a_clause_that_is_tried_alone_does_not_fail_a_sound_device(
    device: str, clause: Clause[object]
) -> None:
    """Given --only and the options that the clause needs. One that does more than ask says what
    the device may do."""
    (result,), traffic = tried(device, [clause], clause.needs)
    assert result.verdict in (Verdict.PASSED, Verdict.NOT_TRIED), result.why
    assert result.proof or result.verdict is Verdict.NOT_TRIED
    if clause.does in (READS, ASKS):
        sent = [f"{one.name} {one.text}" for one in traffic if one.sent]
        assert [one for one in sent if not re.fullmatch(ASKING[device], one)] == []


@pytest.mark.parametrize(
    ("device", "clause"), IN_REACH, ids=[f"{device}-{one.name}" for device, one in IN_REACH]
)
def test_a_device_that_breaks_a_clause_fails_in_it(device: str, clause: Clause[object]) -> None:
    """By itself, or with all others where it takes what they have done."""
    results, _ = tried(device, [clause], clause.needs, clause.name)
    if [one.verdict for one in results] != [Verdict.FAILED]:
        results, _ = tried(device, KITS[device].clauses, clause.needs, clause.name)
    fails_in(clause, results)


@pytest.mark.long
@pytest.mark.parametrize("name", KITS)
def test_a_device_that_breaks_a_clause_fails_in_no_other(name: str) -> None:
    for device, clause in IN_REACH:
        if device == name:
            results, _ = tried(device, KITS[device].clauses, clause.needs, clause.name)
            fails_in(clause, results)


def fails_in(clause: Clause[object], results: Sequence[Result]) -> None:
    """In this clause alone, and it is shown."""
    failed = [one for one in results if one.verdict is Verdict.FAILED]
    assert [one.clause.name for one in failed] == [clause.name]
    assert failed[0].why
    assert failed[0].proof, "packets that show it"


@pytest.mark.parametrize(
    ("device", "needs"),
    [
        *((device, SOAK) for device in KITS),
        *(
            ("upf", needs)
            for needs in ("--dna", "--deploy-force", "--trigger --soak", "--trigger --dna")
        ),
        *(("umbilical", needs) for needs in ("--reboot", "--wipe")),
        ("mavlink", "--signing-key-file"),
    ],
)
def test_each_clause_that_passes_has_packets_that_prove_it(device: str, needs: str) -> None:
    results, _ = tried(device, KITS[device].clauses, needs)
    passed = [one for one in results if one.verdict is Verdict.PASSED]
    assert len(passed) > 20
    assert [one.clause.name for one in passed if not one.proof] == []


def test_each_clause_has_a_name_of_its_own() -> None:
    for kit in KITS.values():
        names = [one.name for one in kit.clauses]
        assert len(set(names)) == len(names)
