"""A node id that is given out: dynamic node id allocation (DNA)."""

from __future__ import annotations

from typing import Any

from chute_ros.conformance.bench import first_of
from chute_ros.conformance.clause import Trial, Wait, failed, not_tried
from chute_ros.links.upf.conformance.bench import DNA, TransferPacket, UpfBench
from chute_ros.links.upf.conformance.standard import UpfClause, clause
from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.protocol.dronecan.allocation import MESSAGE as ALLOCATION
from chute_ros.protocol.dronecan.transfer import HIGHEST_NODE_ID

_DOES = "its static node id is 0 for a while; it restarts twice, and is set back"
_SETS = "its static node id is set to what is none, and set back"
#: A device asks each 0.6 to 1 s, three parts one after the other, and then starts to tell, s.
_COMES_WITHIN, _ASKS_WITHIN = 15.0, 5.0
#: An allocator answers within this, s (FOLLOWUP_TIMEOUT is half of it).
_ALLOCATES_WITHIN = 1.0


def _unique_id(bench: UpfBench) -> Any:
    answer = yield from bench.call(bus_requests.GET_NODE_INFO, {})
    return None if answer is None else bytes(answer["hardware_version"]["unique_id"])


def _becomes_dynamic(bench: UpfBench) -> Any:
    """Its unique id, once it has started anew without a node id of its own."""
    unique_id = yield from _unique_id(bench)
    if unique_id is None:
        raise not_tried("GetNodeInfo is not answered")
    if (yield from bench.set(p.STATIC_NODE_ID, 0)) != 0:
        raise failed(f"{p.STATIC_NODE_ID} 0 is not taken")
    yield from bench.save_and_restart()
    return unique_id


def _given(bench: UpfBench) -> Trial:
    unique_id = yield from _becomes_dynamic(bench)
    yield from bench.comes_back(_COMES_WITHIN)
    given, node = bench.allocator.table.get(unique_id), bench.node
    other, units = bench.allocator.other, len(bench.allocator.table)
    yield from bench.static_again()
    if other:
        raise not_tried(f"node {other} gives out node ids as well")
    if given is None:
        raise failed(f"unit {unique_id.hex()} asked for no node id ({units} others did)")
    if given != node:
        raise failed(f"it was given node id {given}, and it was node {node}")
    return f"node {given}, as given"


def _forgets(bench: UpfBench) -> Trial:
    unique_id = yield from _becomes_dynamic(bench)
    yield from bench.comes_back(_COMES_WITHIN)
    since = len(bench.every)
    bench.gives_out = False
    yield from bench.save_and_restart()

    def asks(one: TransferPacket) -> bool:
        return one.kind == ALLOCATION and unique_id.startswith(bytes(one.values["unique_id"]))

    asked = first_of(bench.every, since, asks)
    yield Wait(bench.now + _ASKS_WITHIN, asked)
    bench.gives_out = True
    yield from bench.comes_back(_COMES_WITHIN)
    yield from bench.static_again()
    if not asked():
        raise failed("after a restart it goes on with the node id that it was given before")
    return "after a restart it asks again"


def _range(bench: UpfBench) -> Trial:
    name = p.STATIC_NODE_ID
    for wrong in (-1, HIGHEST_NODE_ID + 1):
        told = yield from bench.set(name, wrong)
        yield from bench.put_back(name)
        if told is None:
            raise failed(f"{name} is set to {wrong}, and is not reported")
        if told == wrong:
            raise failed(f"{name} takes {wrong} (need 0 to {HIGHEST_NODE_ID})")
    return f"it takes neither -1 nor {HIGHEST_NODE_ID + 1}"


def _client(bench: UpfBench) -> Trial:
    since = len(bench.heard)
    bench.ask_for_node_id()
    yield from bench.watch_on(_ALLOCATES_WITHIN)
    if answers := [one.packet for one in bench.heard[since:] if one.kind == ALLOCATION]:
        raise failed("it answers a node that asks for a node id, as an allocator", answers)
    return "it answers no node that asks for a node id"


_NODE = "Node discovery"
CLAUSES: tuple[UpfClause, ...] = (
    clause(
        _NODE,
        "dna",
        "with Static Node ID 0 it asks for a node id (DNA), and has the one that it is given",
        _given,
        _DOES,
        needs=DNA,
        restarts=True,
    ),
    clause(
        _NODE,
        "dna-forgets",
        "it does not keep that node id: it asks at each start",
        _forgets,
        _DOES,
        needs=DNA,
        restarts=True,
    ),
    clause(_NODE, "node-id-range", "what is no node id is refused", _range, _SETS, needs=DNA),
    clause(
        _NODE,
        "dna-client",
        "it only asks for node ids, and gives none out",
        _client,
        "a node without a node id asks on its bus",
        needs=DNA,
    ),
)
