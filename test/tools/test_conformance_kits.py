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


def tried(
    device: str, clauses: Sequence[Clause[object]], needs: str
) -> tuple[list[Result], Sequence[Packet]]:
    """Of a sound device with these options and all risks: results, and the whole traffic."""
    sound, bench = KITS[device].simulated("", needs or SOAK)
    line = VirtualLine(Session(bench, clauses, Allowed(Risk.FIRES, needs.split())), sound)
    line.run()
    return [one for one in line.events if isinstance(one, Result)], bench.traffic


@pytest.mark.parametrize(
    ("device", "clause"), ALONE, ids=[f"{device}-{one.name}" for device, one in ALONE]
)
def test_a_clause_that_is_tried_alone_does_not_fail_a_sound_device(
    device: str, clause: Clause[object]
) -> None:
    """Given --only and the options that the clause needs."""
    (result,), _ = tried(device, [clause], clause.needs)
    assert result.verdict in (Verdict.PASSED, Verdict.NOT_TRIED), result.why
    assert result.proof or result.verdict is Verdict.NOT_TRIED


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


#: Name and content of what asks a device for what it knows, or keeps the connection.
ASKING = {
    # MAV_CMD_REQUEST_MESSAGE, MAV_CMD_GET_MESSAGE_INTERVAL, and a number that is no command.
    "mavlink": r"COMMAND_(LONG|INT) .*\bcommand=(512|510|31999)\b.*",
    "upf": r"uavcan\.protocol\.(GetNodeInfo|GetTransportStats) request .*"
    r"|uavcan\.protocol\.param\.GetSet request .*value={'empty': {}}.*",
    "umbilical": r"write (<H>|<I>)",
}


@pytest.mark.parametrize(
    ("device", "clause"),
    [(device, one) for device, one in ALONE if one.does in (READS, ASKS)],
    ids=lambda one: one if isinstance(one, str) else one.name,
)
def test_a_clause_that_does_more_than_ask_says_what_the_device_may_do(
    device: str, clause: Clause[object]
) -> None:
    _, traffic = tried(device, [clause], clause.needs)
    sent = [f"{one.name} {one.text}" for one in traffic if one.sent]
    assert [one for one in sent if not re.fullmatch(ASKING[device], one)] == []
