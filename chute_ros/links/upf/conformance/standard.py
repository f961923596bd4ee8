"""Node, status and parameters: what needs nothing to be armed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from itertools import pairwise
from typing import Any

from chute_ros.conformance.clause import (
    READS,
    SOAK,
    Clause,
    DecidedError,
    OutOfReach,
    Trial,
    Wait,
    failed,
    not_supported,
    not_tried,
)
from chute_ros.links.upf.conformance.bench import (
    LONGEST_STATUS,
    NODE_STATUS,
    TransferPacket,
    UpfBench,
)
from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.devices import OPERATIONAL, mode_name
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan import time_sync
from chute_ros.protocol.dronecan.transfer import HIGHEST_NODE_ID

DOCUMENT = "Flyfire UPF UAVCAN protocol V1.0"
WATCHED = 5.0
_SETS, _RESTARTS = "a parameter is changed, and set back", "it restarts"
_SETS_AND_RESTARTS = f"{_SETS}; it may be restarted for that"
#: An interval may be off by this share, and this much, s.
_SHARE, _LEAST = 0.25, 0.02
#: What no interval can be, ms: less than none, and more than DroneCAN's second for a NodeStatus.
_BELOW, _ABOVE = -5, 10**9
#: Set for a trial, ms.
_NODE_INTERVAL, _STATUS_INTERVAL = 400, 250
_UNKNOWN = "No Such Parameter"
#: State and request, which one change makes, are at most so far apart, s.
UNDER_WAY = 0.3
#: It is ready so long after a restart at the latest, s.
READY_WITHIN = 15.0
#: Microseconds since 1970.
_SOME_TIME = 1_790_000_000_000_000

UpfClause = Clause[UpfBench]
clause: Callable[..., UpfClause] = partial(Clause, DOCUMENT)


def _mean(bench: UpfBench, kind: str) -> float:
    """Between two of what was watched, s."""
    times = [one.at for one in bench.watched if one.kind == kind]
    if len(times) < 2:
        raise failed(f"{len(times)} {kind} while it was watched", bench.packets(kind))
    return (times[-1] - times[0]) / (len(times) - 1)


def _node_statuses(bench: UpfBench) -> list[TransferPacket]:
    """Of what was watched."""
    return [one for one in bench.watched if one.kind == NODE_STATUS]


def _longest_pause(bench: UpfBench, watched: float) -> float:
    """Between two NodeStatus of what was watched for so long, s."""
    gaps = (later.at - earlier.at for earlier, later in pairwise(_node_statuses(bench)))
    return max(gaps, default=watched)


def _begins_anew(statuses: Iterable[TransferPacket]) -> bool:
    """The time since its start goes back in one of these NodeStatus."""
    uptimes = [one.values["uptime_sec"] for one in statuses]
    return any(later < earlier for earlier, later in pairwise(uptimes))


def _node_status(bench: UpfBench) -> Trial:
    yield from bench.watch(WATCHED)
    longest = _longest_pause(bench, WATCHED)
    if longest > LONGEST_STATUS * (1.0 + _SHARE):
        raise failed(
            f"NodeStatus pauses for {longest:.2f} s (need at most 1)", bench.packets(NODE_STATUS)
        )
    return f"each {_mean(bench, NODE_STATUS):.2f} s"


def _node_mode(bench: UpfBench) -> Trial:
    if not (told := (yield from bench.watch_once(WATCHED, NODE_STATUS))):
        raise not_tried("no NodeStatus came")
    # It may tell its state before the NodeStatus that goes with it.
    since = told[-1].at - LONGEST_STATUS * (1.0 + _SHARE)
    states = (one for one in bench.heard if one.kind == bench.device.status and one.at >= since)
    if any(bench.state_in(one) is ParachuteState.NOT_READY for one in states):
        raise not_tried("it was NOT_READY a moment before")
    if (mode := told[-1].values["mode"]) != OPERATIONAL:
        raise failed(f"NodeStatus reports mode {mode_name(mode)}", [told[-1].packet])
    return mode_name(mode)


def node_id(bench: UpfBench) -> Trial:
    """That of the document, as it is delivered."""
    default = yield from bench.value(p.STATIC_NODE_ID, "default_value")
    if default != bench.device.node_id:
        raise failed(f"its static node id as delivered is {p.words(default) or 'not reported'}")
    most = yield from bench.value(p.STATIC_NODE_ID, "max_value")
    if isinstance(most, int) and most > HIGHEST_NODE_ID:
        raise failed(f"its static node id may be {most} (need at most {HIGHEST_NODE_ID})")
    return f"as delivered {default}; it is {bench.node}"


def _information(bench: UpfBench) -> Trial:
    answer = yield from bench.call(bus_requests.GET_NODE_INFO, {})
    if answer is None:
        raise failed("GetNodeInfo is not answered")
    if not bytes(answer["name"]):
        raise failed("GetNodeInfo has no name")
    if not any(bytes(answer["hardware_version"]["unique_id"])):
        raise failed("its unique id is 0, so that nobody can tell it from another")
    return bytes(answer["name"]).decode("utf-8", "replace")


def _statistics(bench: UpfBench) -> Trial:
    if (yield from bench.call(bus_requests.TRANSPORT_STATS, {})) is None:
        raise failed("GetTransportStats is not answered")
    return "answered"


def _uptime(bench: UpfBench) -> Trial:
    told = yield from bench.watch_once(WATCHED, NODE_STATUS)
    if len(told) < 2:
        raise not_tried("NodeStatus came too seldom")
    first, last = told[0], told[-1]
    passed = last.at - first.at
    went = last.values["uptime_sec"] - first.values["uptime_sec"]
    if abs(went - passed) > 1.5:
        both = [first.packet, last.packet]
        raise failed(f"in {passed:.1f} s uptime_sec went on by {went}", both)
    return f"{went} s in {passed:.1f} s"


def _status_interval(bench: UpfBench) -> Trial:
    told = yield from bench.value(p.PARACHUTE_STATUS_INTERVAL)
    if not isinstance(told, (int, float)) or isinstance(told, bool):
        raise failed(f"{p.PARACHUTE_STATUS_INTERVAL} is {p.words(told) or 'not reported'}")
    yield from bench.watch_once(WATCHED, names.PARACHUTE_STATUS)
    mean = _mean(bench, names.PARACHUTE_STATUS)
    if not _comes_each(bench, names.PARACHUTE_STATUS, told / 1000.0):
        packets = bench.packets(names.PARACHUTE_STATUS)
        raise failed(f"each {mean:.3f} s, and its parameter says {told} ms", packets)
    return f"each {mean:.3f} s, as its parameter says"


def state_known(bench: UpfBench) -> Trial:
    """All that it has told so far."""
    yield from ()
    told = bench.look_at(one for one in bench.heard if one.kind == bench.device.status)
    if any("state" not in one.values for one in told):
        raise not_tried("the data types have no state of it")
    named = {bench.definitions.state_name(one.kind, one.values): one for one in told}
    if wrong := named.get(""):
        raise failed(f"state is {wrong.values['state']}, which is none", [wrong.packet])
    return ", ".join(named)


def _present(bench: UpfBench) -> Trial:
    missing = []
    for one in p.PARAMETERS:
        answer = yield from bench.get(one.name)
        if answer is None:
            raise failed(f"GetSet of {one.name} is not answered")
        if p.value_of(answer["value"]) is None:
            missing.append(one.name)
    if missing:
        raise failed(f"it has no {', '.join(missing)}")
    return f"all {len(p.PARAMETERS)}"


def _kinds(bench: UpfBench) -> Trial:
    for one in p.PARAMETERS:
        answer = yield from bench.get(one.name)
        kind = "" if answer is None else p.kind_of(answer["value"])
        # A device may keep a switch as a number.
        allowed = ("boolean", "integer") if one.kind is bool else ("integer",)
        if kind and kind not in allowed:
            raise failed(f"{one.name} is of kind {kind} (need {' or '.join(allowed)})")
    return "switches and numbers"


def _in_order(bench: UpfBench) -> Trial:
    found: list[str] = []
    for index in range(bus_requests.MOST_PARAMETERS):
        answer = yield from bench.get(index=index)
        if answer is None:
            raise failed(f"GetSet of index {index} is not answered")
        if not bytes(answer["name"]):
            break
        found.append(bytes(answer["name"]).decode("utf-8", "replace"))
    else:
        raise failed(f"its list does not end after {len(found)} parameters")
    if missing := [one for one in bench.device.parameters if one not in found]:
        raise failed(f"by index there is no {', '.join(missing)}")
    return f"{len(found)} parameters"


def _unknown(bench: UpfBench) -> Trial:
    answer = yield from bench.get(_UNKNOWN)
    if answer is None:
        raise failed("GetSet of a name that it does not have is not answered")
    if bytes(answer["name"]) or p.value_of(answer["value"]) is not None:
        raise failed("GetSet of a name that it does not have names a value")
    return "answered without name and value"


def _resistor(bench: UpfBench) -> Trial:
    default = yield from bench.value(p.CANBUS_RESISTER, "default_value")
    if default is None or p.as_switch(default):
        raise failed(f"as delivered it is {p.words(default) or 'not reported'} (need off)")
    return "off"


def _light(bench: UpfBench) -> Trial:
    name = p.LIGHT
    before = p.as_switch((yield from bench.value(name)))
    if before is None:
        raise not_tried(f"{name} is not reported as a switch")
    for wanted in (not before, before):
        if (told := (yield from bench.set(name, wanted))) is not wanted:
            yield from bench.put_back(name)
            what = p.words(told) or "not reported"
            raise failed(f"{name} was set to {p.words(wanted)}, and is {what}")
    yield from bench.put_back(name)
    return "off and on; nothing on the bus shows the light itself"


def _set_node_interval(bench: UpfBench) -> Trial:
    return (yield from _set_interval(bench, p.NODE_STATUS_INTERVAL, _NODE_INTERVAL, NODE_STATUS))


def _set_status_interval(bench: UpfBench) -> Trial:
    name, wanted = p.PARACHUTE_STATUS_INTERVAL, _STATUS_INTERVAL
    return (yield from _set_interval(bench, name, wanted, names.PARACHUTE_STATUS))


def _set_interval(bench: UpfBench, name: str, wanted: int, kind: str) -> Trial:
    """DroneCAN advises against another interval at run time: it may take a restart."""
    if (told := (yield from bench.set(name, wanted))) != wanted:
        yield from bench.put_back(name)
        raise failed(f"{name} was set to {wanted}, and is {p.words(told) or 'not reported'}")
    seconds, when = wanted / 1000.0, ""
    yield from bench.watch(8.0 * seconds)
    if not _comes_each(bench, kind, seconds):
        packets = bench.packets(kind)
        yield from bench.save()
        if (yield from _restarted(bench)):
            when = " after a restart"
            yield from bench.watch(8.0 * seconds)
            packets = bench.packets(kind)
    took = _comes_each(bench, kind, seconds)
    mean = _mean(bench, kind)
    yield from bench.put_back(name)
    if when:
        yield from bench.save()
        yield from _restarted(bench)
    if not took:
        raise failed(f"{wanted} ms were set, and it comes each {mean:.3f} s{when}", packets)
    return f"{wanted} ms were set, it comes each {mean:.3f} s{when}"


def _comes_each(bench: UpfBench, kind: str, seconds: float) -> bool:
    """Of what was watched this comes so often."""
    return abs(_mean(bench, kind) - seconds) <= max(_SHARE * seconds, _LEAST)


def _range(bench: UpfBench) -> Trial:
    """The document has no longest interval of a ParachuteStatus; a device may have one."""
    node = yield from _refuses(bench, p.NODE_STATUS_INTERVAL, _BELOW, _ABOVE)
    name = p.PARACHUTE_STATUS_INTERVAL
    answer = yield from bench.get(name)
    most = None if answer is None else p.value_of(answer["max_value"])
    above = [most + 1] if isinstance(most, int) and 0 < most < _ABOVE else []
    return f"{node}; {(yield from _refuses(bench, name, _BELOW, *above))}"


def _refuses(bench: UpfBench, name: str, *wrongs: int) -> Trial:
    """A device may keep what it has, or take the nearest that can be."""
    answer = yield from bench.get(name)
    before = None if answer is None else p.value_of(answer["value"])
    if before is None:
        raise failed(f"{name} is not reported")
    low, high = p.value_of(answer["min_value"]), p.value_of(answer["max_value"])
    became = []
    for wrong in wrongs:
        told = yield from bench.set(name, wrong)
        yield from bench.put_back(name)
        if told == wrong:
            raise failed(f"{name} takes {wrong}")
        if told != before and not _within(told, low, high):
            raise failed(
                f"{name} was set to {wrong}, and {before} became {p.words(told) or 'not reported'}"
            )
        became.append(p.words(told))
    return f"{name} set to {' and '.join(map(str, wrongs))} is {' and '.join(became)}"


def _within(value: p.Value | None, low: p.Value | None, high: p.Value | None) -> bool:
    """Within the limits that a device tells; one that tells none has none to take."""
    numbers = [one for one in (low, value, high) if isinstance(one, (int, float))]
    return len(numbers) == 3 and numbers[0] <= numbers[1] <= numbers[2]


def _opcode(bench: UpfBench) -> Trial:
    if (answer := (yield from bench.save())) is None:
        raise failed("ExecuteOpcode is not answered")
    if not answer["ok"]:
        raise failed("ExecuteOpcode save is not ok")
    return "ok"


def _restart_refused(bench: UpfBench) -> Trial:
    before = [one for one in bench.heard if one.kind == NODE_STATUS][-1:]
    yield from bench.call(bus_requests.RESTART_NODE, {"magic_number": 1})
    yield from bench.watch(2.5)
    if _begins_anew([*before, *_node_statuses(bench)]):
        raise failed("it restarts by a wrong magic number", bench.packets(NODE_STATUS))
    return "it goes on"


def _restart(bench: UpfBench) -> Trial:
    """What it does then is watched."""
    # Of one that has only started a second start could not be told from the first.
    yield from bench.wait_for(NODE_STATUS, WATCHED, lambda one: one.values["uptime_sec"] > 1)
    starts, since = bench.starts, len(bench.heard)
    if not (yield from bench.restart()):
        raise failed("RestartNode is not ok")
    is_up = yield from bench.is_up(READY_WITHIN)
    up = bench.device.up or "received"
    yield from bench.watch_on(1.0)
    yield Wait(bench.now + LONGEST_STATUS, lambda: bench.starts > starts)
    bench.watched = bench.heard[since:]
    if not is_up:
        raise failed(f"it is not {up} within {READY_WITHIN:g} s")
    if bench.starts == starts:
        raise failed("uptime_sec does not begin at 0 again", bench.packets(NODE_STATUS)[:2])
    return f"it restarts, and is {up}"


def _blocks_at_start(bench: UpfBench) -> Trial:
    yield from ()
    return _asked(bench, "TYPE_FLIGHT_BLOCK", ParachuteState.NOT_READY)


def _releases_when_ready(bench: UpfBench) -> Trial:
    yield from ()
    text = _asked(bench, "TYPE_FLIGHT_BLOCK_RELEASE", ParachuteState.READY)
    is_ready = released = math.inf
    starting = False
    for one in bench.watched:
        if one.kind == names.PARACHUTE_STATUS:
            state = bench.state_in(one)
            starting = starting or state is ParachuteState.NOT_READY
            if state is ParachuteState.READY and starting:
                is_ready = min(is_ready, one.at)
            if state is ParachuteState.NOT_READY and one.at > released + UNDER_WAY:
                raise failed("it released the block, and is still NOT_READY", [one.packet])
        elif one.kind == names.VEHICLE_SERVICE and starting:
            asked = bench.definitions.type_name(one.kind, one.values)
            if asked == "TYPE_FLIGHT_BLOCK_RELEASE":
                released = min(released, one.at)
            elif asked == "TYPE_FLIGHT_BLOCK" and one.at > is_ready + UNDER_WAY:
                raise failed(f"it is READY, and asks for {asked}", [one.packet])
    return text


def _asked(bench: UpfBench, what: str, state: ParachuteState) -> str:
    service = names.VEHICLE_SERVICE
    number = bench.definitions.state_number(ParachuteState.NOT_READY)
    kinds = (service, names.PARACHUTE_STATUS)
    told = bench.look_at(one for one in bench.watched if one.kind in kinds)
    if not any(one.values["state"] == number for one in told if one.kind != service):
        raise not_tried("it was not seen to restart")
    asked = [
        bench.definitions.type_name(service, one.values) for one in told if one.kind == service
    ]
    if what not in asked:
        things = ", ".join(asked) or "nothing"
        raise failed(f"as it became {state.name} it asked the vehicle for {things}")
    return f"asked as it became {state.name}"


def _kept_by_opcode(bench: UpfBench) -> Trial:
    """With Auto-Save off only what was saved is left after a restart."""
    name, auto = p.NODE_STATUS_INTERVAL, p.AUTO_SAVE
    before = yield from bench.value(name)
    if (yield from bench.set(auto, False)) is not False:
        raise not_supported(f"{auto} cannot be switched off")
    yield from bench.set(name, _NODE_INTERVAL)
    try:
        forgotten = yield from _after_restart(bench, name)
    except DecidedError:
        yield from bench.put_back(auto)
        yield from bench.put_back(name)
        raise
    # It need not keep that the switch is off.
    yield from bench.set(auto, False)
    yield from bench.set(name, _NODE_INTERVAL)
    yield from bench.save()
    kept = yield from _after_restart(bench, name)
    yield from bench.put_back(auto)
    yield from bench.put_back(name)
    if forgotten != p.words(before):
        raise failed(f"{auto} is off, and {name} is {forgotten} after a restart (was {before})")
    if kept != str(_NODE_INTERVAL):
        raise failed(f"it was saved, and {name} is {kept} after a restart")
    return "kept only when it is saved"


def _restarted(bench: UpfBench) -> Any:
    """Whether it is told to, and does not refuse; then it is up again."""
    if not (yield from bench.restart()):
        return False
    yield from bench.is_back(READY_WITHIN)
    return True


def _after_restart(bench: UpfBench, name: str) -> Trial:
    if not (yield from _restarted(bench)):
        raise not_tried("it does not restart")
    return p.words((yield from bench.value(name)))


def _time_sync(bench: UpfBench) -> Trial:
    yield from bench.is_up(READY_WITHIN)
    before = yield from bench.state()
    bench.tell_time(0)
    for number in range(3):
        yield from bench.watch_on(time_sync.INTERVAL)
        bench.tell_time(_SOME_TIME + number * int(time_sync.INTERVAL * 1e6))
    after = yield from bench.state()
    if after is not before:
        raise failed(f"the time of the bus moved it from {before} to {after}")
    return "it goes on; nothing that it reports shows the time that it has"


def _soak(bench: UpfBench) -> Trial:
    yield from bench.watch(bench.soak)
    longest = _longest_pause(bench, bench.soak)
    if longest > LONGEST_STATUS * (1.0 + _SHARE):
        raise failed(f"NodeStatus paused for {longest:.1f} s", bench.packets(NODE_STATUS)[-5:])
    if _begins_anew(_node_statuses(bench)):
        raise failed("it restarted meanwhile", bench.packets(NODE_STATUS)[-5:])
    return f"{bench.soak:g} s"


_NODE, _STANDARD = "Node discovery", "Standard UAVCAN protocols"
_PARAMETERS, _STATES = "Parameters", "Global working state"
CLAUSES: tuple[UpfClause, ...] = (
    clause(_STANDARD, "node-status", "NodeStatus is broadcast", _node_status, READS),
    clause(
        _STANDARD,
        "node-mode",
        "NodeStatus has mode OPERATIONAL while it is not NOT_READY",
        _node_mode,
        READS,
    ),
    clause(_STANDARD, "uptime", "NodeStatus reports the time since its start", _uptime, READS),
    clause(
        "UPF protocols",
        "status-interval",
        "ParachuteStatus is broadcast, as often as its parameter says",
        _status_interval,
    ),
    clause(_STATES, "state-known", "its state is one of the seven", state_known, READS),
    clause(_NODE, "node-id", "the static node id as delivered is 33", node_id),
    clause(_STANDARD, "node-info", "GetNodeInfo reports who it is", _information),
    clause(_STANDARD, "transport-stats", "GetTransportStats is answered", _statistics),
    clause(_PARAMETERS, "parameters", "it has each parameter of the document", _present),
    clause(_PARAMETERS, "parameter-kinds", "each is of its kind", _kinds),
    clause(_PARAMETERS, "parameter-list", "by index all can be read, to an end", _in_order),
    clause(_PARAMETERS, "parameter-unknown", "another name has no value", _unknown),
    clause(_PARAMETERS, "resister-off", "the resistor is off as delivered", _resistor),
    clause(
        _PARAMETERS,
        "node-interval",
        "Node Status Interval(ms) sets the interval of NodeStatus",
        _set_node_interval,
        _SETS_AND_RESTARTS,
        restarts=True,
    ),
    clause(
        _PARAMETERS,
        "parachute-interval",
        "Parachute Status Interval(ms) sets the interval of ParachuteStatus",
        _set_status_interval,
        _SETS_AND_RESTARTS,
        restarts=True,
    ),
    clause(_PARAMETERS, "parameter-range", "what cannot be is refused", _range, _SETS),
    clause(_PARAMETERS, "light", "Enable Light can be switched off and on", _light, _SETS),
    clause(
        _PARAMETERS,
        "resister",
        "Enable CANBUS resister connects the 120 ohm of the bus",
        OutOfReach("no message shows the resistor, and switching it may disturb the bus"),
        READS,
    ),
    clause(_STANDARD, "opcode-save", "ExecuteOpcode saves", _opcode, "it saves its parameters"),
    clause(
        _STANDARD,
        "opcode-erase",
        "ExecuteOpcode erases: its parameters are as delivered",
        OutOfReach("the owner's settings would be lost"),
        READS,
    ),
    clause(
        _STANDARD,
        "restart-magic",
        "without its magic number RestartNode does nothing",
        _restart_refused,
        "it must not, but it may restart",
    ),
    clause(_STANDARD, "restart", "RestartNode restarts it", _restart, _RESTARTS, restarts=True),
    clause(
        _STATES,
        "block-at-start",
        "as it becomes NOT_READY it asks the vehicle for TYPE_FLIGHT_BLOCK",
        _blocks_at_start,
        READS,
    ),
    clause(
        _STATES,
        "release-when-ready",
        "as it becomes READY it asks for TYPE_FLIGHT_BLOCK_RELEASE",
        _releases_when_ready,
        READS,
    ),
    clause(
        _PARAMETERS,
        "auto-save",
        "with Enable Auto-Save off only ExecuteOpcode keeps a change",
        _kept_by_opcode,
        "a parameter is changed, it restarts twice, and it is set back",
        restarts=True,
    ),
    clause(
        _STANDARD, "time-sync", "GlobalTimeSync does it no harm", _time_sync, "it is sent a time"
    ),
    clause(
        "Over hours",
        "soak",
        "NodeStatus goes on without a pause or a restart",
        _soak,
        READS,
        needs=SOAK,
    ),
)
