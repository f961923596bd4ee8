"""A trigger, whose protocol is open to vehicles without a controller. It fires once in a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

from chute_ros.conformance.bench import first_of
from chute_ros.conformance.clause import READS, Risk, Trial, Wait, failed, not_supported, not_tried
from chute_ros.links.upf.conformance import node_id, standard, wire
from chute_ros.links.upf.conformance.bench import (
    STATUS_WITHIN,
    TRIGGER,
    TransferPacket,
    UpfBench,
)
from chute_ros.links.upf.conformance.flying import FIRES_WITHIN, MAY_FIRE
from chute_ros.links.upf.conformance.standard import UpfClause, clause
from chute_ros.links.upf.protocol import definitions as names

#: The option with which it is fired by the broadcast, in place of the service.
BROADCAST = "--broadcast"
#: What holds for a trigger as for a controller, beside frames and node ids.
SHARED = (
    *("node-status", "node-mode", "uptime", "node-info", "transport-stats", "parameter-list"),
    *("parameter-unknown", "opcode-save", "restart-magic", "restart", "time-sync", "soak"),
)
_EVERY = "every trigger on the bus"


def _fired(bench: UpfBench, status: TransferPacket) -> bool:
    """It tells that it has fired."""
    state = bench.definitions.state_name(status.kind, status.values)
    return bool(status.values.get("is_launched")) or state == "LAUNCHED"


def _statuses(bench: UpfBench, since: int) -> list[TransferPacket]:
    """From this place of heard on."""
    return [one for one in bench.heard[since:] if one.kind == names.TRIGGER_STATUS]


def _can_fire(bench: UpfBench) -> Trial:
    """It can be seen to fire, and nothing else fires along."""
    since = len(bench.heard)
    yield from bench.watch_on(STATUS_WITHIN)
    if others := bench.others():
        several = ", ".join(map(str, sorted({bench.node, *others})))
        raise not_tried(f"there are several triggers on the bus (nodes {several}; need one)")
    told = _statuses(bench, since)
    if not told:
        raise not_tried("no TriggerStatus is received")
    if not {"state", "is_launched"} & set(told[-1].values):
        raise not_tried("the data types do not report whether it has fired")
    if _fired(bench, told[-1]):
        if bench.deployed_from < 0 and not _fired(bench, _statuses(bench, 0)[0]):
            bench.deployed_from = len(bench.every)
            raise failed("IT HAS FIRED, and nothing told it to", [told[-1].packet])
        raise not_tried("it has fired already: pack it again")
    if (name := bench.definitions.state_name(told[-1].kind, told[-1].values)) not in ("", "READY"):
        raise not_tried(f"it is {name} (need READY)")
    return ""


def _fires(bench: UpfBench, since: int) -> Any:
    """The first status from this place of heard on that tells it; None: none does in time."""

    def fits(one: TransferPacket) -> bool:
        return one.kind == names.TRIGGER_STATUS and _fired(bench, one)

    told = first_of(bench.heard, since, fits)
    yield Wait(bench.now + FIRES_WITHIN, told)
    if told():
        bench.deployed_from = len(bench.every)
    return told()


def _service(bench: UpfBench, what: str, **changed: int) -> Any:
    """The name of the result of TYPE_LAUNCH that is changed so that it fires nothing; None: not
    answered."""
    yield from _can_fire(bench)
    service, since = names.TRIGGER_SERVICE, len(bench.heard)
    values = {**bench.definitions.request(service, "TYPE_LAUNCH"), **changed}
    answer = yield from bench.call(service, values)
    yield from _stays(bench, since, what)
    return None if answer is None else bench.definitions.result_name(service, answer)


def _stays(bench: UpfBench, since: int, what: str) -> Trial:
    if status := (yield from _fires(bench, since)):
        raise failed(f"IT FIRED by {what}", [status.packet])
    told = _statuses(bench, since)
    if not told or bench.now - told[-1].at > STATUS_WITHIN:
        raise failed(f"after {what} no TriggerStatus shows whether it has fired")
    return f"{what} fires nothing"


def _status(bench: UpfBench) -> Trial:
    """The document gives no interval."""
    for _ in range(2):
        if (yield from bench.wait_for(names.TRIGGER_STATUS, STATUS_WITHIN)) is None:
            raise failed(f"no TriggerStatus within {STATUS_WITHIN:g} s")
    return "reported again and again"


def _wrong(magic: Any) -> int:
    """As wide as the right one, and surely another, whatever the data types have."""
    return int(magic) ^ 1


def _bad_magic(bench: UpfBench) -> Trial:
    constants = bench.definitions.types.request(names.TRIGGER_SERVICE).constants
    magic = _wrong(constants[names.MAGIC])
    result = yield from _service(bench, "a request with a wrong magic number", magic_number=magic)
    if result == "SUCCESS":
        raise failed("a request with a wrong magic number is answered with SUCCESS")
    return result or "not answered"


def _unknown_type(bench: UpfBench) -> Trial:
    constants = bench.definitions.types.request(names.TRIGGER_SERVICE).constants
    known = {value for name, value in constants.items() if name.startswith("TYPE_")}
    # A high number may not fit the field, and be sent as one that fires.
    number = next(one for one in count() if one not in known)
    what = f"type {number}, which is none,"
    result = yield from _service(bench, what, type=number)
    if result in (None, "SUCCESS"):
        raise failed(f"{what} is {'answered with SUCCESS' if result else 'not answered'}")
    return str(result)


def _self_test(bench: UpfBench) -> Trial:
    constants = bench.definitions.types.request(names.TRIGGER_SERVICE).constants
    if (number := constants.get("TYPE_SELF_TEST")) is None:
        raise not_tried("the data types have no TYPE_SELF_TEST")
    result = yield from _service(bench, "TYPE_SELF_TEST", type=number)
    if result is None:
        raise failed("TYPE_SELF_TEST is not answered")
    if result == "REJECTED":
        raise not_supported(f"TYPE_SELF_TEST: {result}")
    return str(result)


def _broadcast_magic(bench: UpfBench) -> Trial:
    yield from _can_fire(bench)
    since = len(bench.heard)
    magic = bench.definitions.constant(names.TRIGGER_LAUNCH, names.MAGIC)
    bench.launch(magic_number=_wrong(magic))
    return (yield from _stays(bench, since, "a TriggerLaunch with a wrong magic number"))


def _broadcast_other(bench: UpfBench) -> Trial:
    if "node_id" not in bench.definitions.types.message(names.TRIGGER_LAUNCH).fields:
        raise not_tried("the data types have no node id in TriggerLaunch")
    yield from _can_fire(bench)
    since, other = len(bench.heard), bench.nobody()
    bench.launch(node_id=other)
    return (yield from _stays(bench, since, f"a TriggerLaunch for node {other}"))


def _broadcast(bench: UpfBench) -> Trial:
    yield from _can_fire(bench)
    since, began = len(bench.heard), bench.now
    bench.deployed_from = len(bench.every)
    bench.launch()
    if not (yield from _fires(bench, since)):
        raise failed(f"it has not fired {FIRES_WITHIN:g} s after TriggerLaunch")
    return f"fired after {bench.now - began:.2f} s"


def _launch(bench: UpfBench) -> Trial:
    """Asked for once: what has fired may refuse to do it again."""
    yield from _can_fire(bench)
    service, since, began = names.TRIGGER_SERVICE, len(bench.heard), bench.now
    request = bench.definitions.request(service, "TYPE_LAUNCH")
    bench.deployed_from = len(bench.every)
    answer = yield from bench.call(service, request, 1)
    fired = yield from _fires(bench, since)
    result = "not answered" if answer is None else bench.definitions.result_name(service, answer)
    if result != "SUCCESS":
        raise failed(f"TYPE_LAUNCH: {result}{', and IT FIRED' if fired else ''}")
    if not fired:
        raise failed(f"SUCCESS, and it has not fired after {FIRES_WITHIN:g} s")
    return f"fired after {fired.at - began:.2f} s"


def _is_launched(bench: UpfBench) -> Trial:
    """Not the other way: it has fired, whatever its state is."""
    told = [one for one in _statuses(bench, 0) if _fired(bench, one)]
    if not told:
        raise not_tried("it was not seen to fire")
    since = len(bench.heard)
    yield from bench.watch_on(STATUS_WITHIN)
    if (yield from bench.wait_for(names.TRIGGER_STATUS, STATUS_WITHIN)) is None:
        raise failed(f"it has fired, and no TriggerStatus comes for {STATUS_WITHIN:g} s")
    later = _statuses(bench, since)
    if forgot := [one.packet for one in later if not _fired(bench, one)]:
        raise failed("it reported that it has fired, and then that it has not", forgot[:1])
    bench.look_at([*told, *later])
    if "is_launched" not in told[0].values:
        raise not_tried("the data types have no is_launched")
    if wrong := [one.packet for one in told if not one.values["is_launched"]]:
        raise failed("its state is LAUNCHED, and is_launched is false", wrong[:1])
    return "is_launched is true"


def _of_trigger(one: UpfClause) -> UpfClause:
    return replace(
        one,
        name=f"trigger-{one.name}",
        text=f"trigger: {one.text}",
        needs=f"{TRIGGER} {one.needs}".strip(),
    )


_of: Callable[..., UpfClause] = partial(clause, needs=TRIGGER)
_may_fire: Callable[..., UpfClause] = partial(_of, risk=Risk.FIRES)
_MAY_ALL = f"{MAY_FIRE}, and so may {_EVERY}"
_NODE, _TYPES = "Node discovery", "UPF protocols"
CLAUSES: tuple[UpfClause, ...] = (
    _of(_TYPES, "trigger-status", "TriggerStatus is broadcast", _status, READS),
    _of(
        _TYPES,
        "trigger-state-known",
        "its state is one of TriggerStatus",
        standard.state_known,
        READS,
    ),
    _of(
        _NODE,
        "trigger-node-id",
        "the static node id of a trigger as delivered is 34",
        standard.node_id,
    ),
    *(_of_trigger(one) for one in standard.CLAUSES if one.name in SHARED),
    *map(_of_trigger, (*wire.CLAUSES, *node_id.CLAUSES)),
    _may_fire(
        _TYPES,
        "trigger-bad-magic",
        "TriggerService: a wrong magic number is refused, and fires nothing",
        _bad_magic,
        MAY_FIRE,
    ),
    _may_fire(
        _TYPES,
        "trigger-unknown-type",
        "TriggerService: a type that is none is refused, and fires nothing",
        _unknown_type,
        MAY_FIRE,
    ),
    _may_fire(
        _TYPES,
        "trigger-self-test",
        "TriggerService: TYPE_SELF_TEST is answered, and fires nothing",
        _self_test,
        MAY_FIRE,
    ),
    _may_fire(
        _TYPES,
        "trigger-broadcast-magic",
        "TriggerLaunch with a wrong magic number fires nothing",
        _broadcast_magic,
        _MAY_ALL,
    ),
    _may_fire(
        _TYPES,
        "trigger-broadcast-other",
        "TriggerLaunch for another node fires nothing",
        _broadcast_other,
        _MAY_ALL,
    ),
    _may_fire(
        _TYPES,
        "trigger-broadcast",
        "TriggerLaunch fires it, and TriggerStatus reports it",
        _broadcast,
        f"IT FIRES, and so does {_EVERY}",
        needs=f"{TRIGGER} {BROADCAST}",
    ),
    _may_fire(
        _TYPES,
        "trigger-launch",
        "TriggerService: TYPE_LAUNCH fires it, and TriggerStatus reports it",
        _launch,
        "IT FIRES",
    ),
    _may_fire(
        _TYPES,
        "trigger-is-launched",
        "what has fired goes on to report so; in the state LAUNCHED is_launched is true",
        _is_launched,
        "it has fired",
    ),
)
