"""Frames that a bus loses, doubles, reorders or damages, and those that are for others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from chute_ros.conformance.clause import Trial, failed, not_tried
from chute_ros.links.upf.conformance.bench import ANSWER, TRIES, UpfBench
from chute_ros.links.upf.conformance.standard import UpfClause
from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack
from chute_ros.protocol.dronecan.transfer import TransferKind, frames_of, head_of

_DOCUMENT, _SECTION = "DroneCAN specification", "CAN bus transport layer"
#: What is set by frames that are spoilt, ms: other than as delivered.
_SPOILT = 650
#: Numbers of standard messages (below 20000) that stand for none.
_NOBODYS_TYPES = (19_000, 19_001)
_DOES = "a parameter is changed by frames that are spoilt, and set back"


def _lost(frames: list[bytes]) -> list[bytes]:
    return [frames[0], *frames[2:]]


def _reordered(frames: list[bytes]) -> list[bytes]:
    return [frames[0], frames[2], frames[1], *frames[3:]]


def _doubled(frames: list[bytes]) -> list[bytes]:
    return [one for one in frames for _ in range(2)]


def _cut(frames: list[bytes]) -> list[bytes]:
    return frames[:2]


def _first(frames: list[bytes]) -> CanFrame:
    first = unpack(frames[0])
    assert first is not None  # it is ours
    return first


def _damaged(frames: list[bytes]) -> list[bytes]:
    """One bit of the CRC, with which the first frame begins."""
    first = _first(frames)
    data = bytes((first.data[0] ^ 0x01, *first.data[1:]))
    return [pack(CanFrame(first.identifier, data)), *frames[1:]]


def _foreign(frames: list[bytes]) -> list[bytes]:
    """Of types that nobody has, of another protocol, and without a tail byte, in their place."""
    first = _first(frames)
    message = replace(head_of(first), kind=TransferKind.MESSAGE, destination=0, payload=bytes(3))
    messages = [frames_of(replace(message, type_id=one), 0)[0] for one in _NOBODYS_TYPES]
    others = [CanFrame(0x123, bytes(8), extended=False), CanFrame(first.identifier, b"")]
    return [pack(one) for one in (*messages, *others)]


def _spoilt(
    bench: UpfBench, what: str, spoils: Callable[[list[bytes]], list[bytes]], taken: bool
) -> Trial:
    """A parameter is set by a request whose frames are spoilt so. taken: it may be set by it."""
    name = p.NODE_STATUS_INTERVAL
    before = yield from bench.value(name)
    if before is None:
        raise not_tried(f"{name} is not reported")
    bench.send_spoilt(name, _SPOILT, before, spoils)
    yield from bench.watch_on(ANSWER)
    after = yield from bench.value(name)
    if after is None:
        raise failed(f"after {what} a request is not answered, 3 times")
    if after == _SPOILT != before and not taken:
        yield from bench.put_back(name)
        raise failed(f"{what} is carried out: {name} is {after}")
    if not (yield from bench.put_back(name)):
        raise failed(f"after {what} {name} cannot be set to {before}")
    return "the next request is answered" + (f"; it is {after}" if taken else ", and nothing set")


def _other_node(bench: UpfBench) -> Trial:
    other = bench.nobody()
    since = len(bench.heard)
    yield from bench.call(bus_requests.GET_NODE_INFO, {}, 1, node=other)
    for one in bench.heard[since:]:
        if one.transfer.kind is TransferKind.RESPONSE:
            raise failed(f"a request to node {other} is answered", [one.packet])
    return f"a request to node {other} is not answered"


def _two_senders(bench: UpfBench) -> Trial:
    asked = bench.device.parameters[0], bench.device.parameters[-1]
    for _ in range(TRIES):
        answers = yield from bench.get_twice(*asked)
        if None not in answers:
            break
    else:
        raise failed(f"two nodes ask at once, and not both are answered, {TRIES} times")
    for name, answer in zip(asked, answers, strict=True):
        told = bytes(answer["name"]).decode("utf-8", "replace")
        # It need not have the parameter.
        if told not in (name, ""):
            raise failed(f"two nodes ask at once, and {name} is answered with {told}")
    return "each is answered"


def _clause(
    name: str,
    text: str,
    what: str,
    spoils: Callable[[list[bytes]], list[bytes]],
    taken: bool = False,
) -> UpfClause:
    trial = partial(_spoilt, what=what, spoils=spoils, taken=taken)
    return UpfClause(_DOCUMENT, _SECTION, name, text, trial, _DOES)


CLAUSES: tuple[UpfClause, ...] = (
    _clause(
        "lost-frame",
        "a transfer of which a frame is lost is not taken, and does the next no harm",
        "a transfer without its second frame",
        _lost,
    ),
    _clause(
        "reordered-frames",
        "a transfer whose frames overtook each other is not taken, and does the next no harm",
        "a transfer whose second and third frame overtook each other",
        _reordered,
    ),
    _clause(
        "doubled-frames",
        "frames that come twice do no harm",
        "a transfer whose frames came twice",
        _doubled,
        taken=True,
    ),
    _clause("cut-transfer", "half a transfer does the next no harm", "half a transfer", _cut),
    _clause(
        "wrong-crc",
        "a transfer with a wrong CRC is not taken",
        "a transfer with a wrong CRC",
        _damaged,
    ),
    _clause(
        "foreign-frames",
        "frames of unknown types and of other protocols do no harm",
        "frames of unknown types and of other protocols",
        _foreign,
    ),
    UpfClause(
        _DOCUMENT, _SECTION, "other-node", "a request to another node is not its own", _other_node
    ),
    UpfClause(
        _DOCUMENT,
        _SECTION,
        "two-senders",
        "several nodes may ask at once, and each is answered",
        _two_senders,
    ),
)
