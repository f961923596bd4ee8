"""The states, what moves them, and what fires."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise

from chute_ros.conformance.bench import first_of
from chute_ros.conformance.clause import (
    READS,
    OutOfReach,
    Risk,
    Trial,
    Wait,
    failed,
    not_tried,
)
from chute_ros.links.upf.conformance.bench import DEPLOY_FORCE, TransferPacket, UpfBench
from chute_ros.links.upf.conformance.standard import (
    READY_WITHIN,
    UNDER_WAY,
    UpfClause,
    clause,
)
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.machine import DEPLOYED, REST_TIME
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.transfer import TransferKind

_S = ParachuteState
_MOVES = "it moves through its states, up to ARMED: its APS may fire if it is shaken or dropped"
MAY_FIRE = "it must not, but it may FIRE"
#: A state is told so soon after what moves it, s; it fires after so long at most.
_TOLD_WITHIN, FIRES_WITHIN = 1.5, 4.0
#: What is rejected and done all the same is seen within this, s.
_MOVES_WITHIN = 0.5
#: What moves it by itself on a bench does so within this, s.
_WAITS = 3.0
#: At rest for 5 s, and a while to tell.
_RESTS = (REST_TIME - 0.5, REST_TIME + 5.0)
_UNKNOWN_TYPE = 200
#: Of a switch, neither on nor off.
_NO_SWITCH = 2
#: The switch of the resistor is left alone: another resistor may disturb the bus.
_SWITCHES = tuple(
    one.name for one in p.PARAMETERS if one.kind is bool and one.name != p.CANBUS_RESISTER
)


def _switch_range(bench: UpfBench) -> Trial:
    became = set()
    for name in _SWITCHES:
        if p.as_switch((yield from bench.value(name))) is None:
            # Which is another clause's matter.
            continue
        told = yield from bench.set(name, _NO_SWITCH)
        yield from bench.put_back(name)
        if told not in (False, True):
            what = p.words(told) or "not reported"
            raise failed(f"{name} is a switch; it was set to {_NO_SWITCH}, and is {what}")
        became.add("on" if told else "off")
    return f"each set to {_NO_SWITCH}, and {' or '.join(sorted(became))}"


def _bad_magic(bench: UpfBench) -> Trial:
    yield from _by_hand(bench)
    before = yield from bench.state()
    service = names.PARACHUTE_SERVICE
    values = bench.definitions.request(service, "TYPE_TAKEOFF")
    answer = yield from bench.call(service, {**values, "magic_number": 1})
    if answer is not None and bench.definitions.result_name(service, answer) == "SUCCESS":
        raise failed("a request with a wrong magic number is answered with SUCCESS")
    after = yield from bench.state()
    if after is not before:
        raise failed(f"a request with a wrong magic number moved it from {before} to {after}")
    return "refused" if answer is not None else "not answered"


def _unknown_type(bench: UpfBench) -> Trial:
    service = names.PARACHUTE_SERVICE
    values = {**bench.definitions.request(service, "TYPE_LAND"), "type": _UNKNOWN_TYPE}
    answer = yield from bench.call(service, values)
    if answer is None:
        raise failed(f"type {_UNKNOWN_TYPE}, which is none, is not answered")
    if (result := bench.definitions.result_name(service, answer)) == "SUCCESS":
        raise failed(f"type {_UNKNOWN_TYPE}, which is none, is answered with SUCCESS")
    return result


def _excludes(type_name: str) -> UpfClause:
    parameter = p.EXCLUDES[type_name]
    word = type_name.removeprefix("TYPE_").lower()

    def trial(bench: UpfBench) -> Trial:
        if (yield from bench.set(parameter, True)) is not True:
            raise failed(f"{parameter} cannot be switched on")
        if (before := (yield from bench.state())) is _S.NOT_READY:
            yield from bench.is_up(READY_WITHIN)
            before = yield from bench.state()
        result = yield from bench.ask(type_name)
        if result != "REJECTED":
            raise failed(f"{parameter} is on, and the answer is {result or 'none'}")
        yield from bench.watch_on(_MOVES_WITHIN)
        if (after := (yield from bench.state())) is not before:
            raise failed(f"{type_name} is REJECTED, and it went from {before} to {after}")
        return "REJECTED"

    return clause(
        _STATES,
        f"exclude-{word}",
        f"with {parameter} on {type_name} is rejected",
        trial,
        _MOVES,
        Risk.ARMS,
    )


def _by_hand(bench: UpfBench) -> Trial:
    """Nothing moves by itself, and it is READY."""
    for name in p.AUTOMATIC:
        if (yield from bench.set(name, False)) is not False:
            raise failed(f"{name} cannot be switched off")
    for request in ("TYPE_DISARM", "TYPE_LAND"):
        if (yield from bench.state()) in (_S.ARMED, _S.TAKEOFF):
            yield from bench.ask(request)
    state = yield from bench.state()
    if state is not _S.READY:
        raise not_tried(f"it is {'in no state' if state is None else state.name} (need READY)")
    return ""


def _moved(bench: UpfBench, request: str, to: ParachuteState) -> Trial:
    result = yield from bench.ask(request)
    if result != "SUCCESS":
        raise failed(f"{request}: {result or 'not answered'}")
    if not (yield from bench.reaches(to, _TOLD_WITHIN)):
        state = yield from bench.state()
        raise failed(f"{request}: SUCCESS, and it is {state} (need {to.name})")
    return to.name


def _reached(bench: UpfBench, *requests: str) -> Trial:
    """Whatever it answers, which is another clause's matter."""
    state = _S.READY
    for request in requests:
        yield from bench.ask(request)
        state = _AFTER[request]
        if not (yield from bench.reaches(state, _TOLD_WITHIN)):
            raise not_tried(f"it did not become {state.name}")
    return state.name


_AFTER = {"TYPE_TAKEOFF": _S.TAKEOFF, "TYPE_ARM": _S.ARMED}


def _moves(request: str, to: ParachuteState, *before: str) -> UpfClause:
    """After these requests, this one moves it to that state."""

    def trial(bench: UpfBench) -> Trial:
        yield from _by_hand(bench)
        yield from _reached(bench, *before)
        return (yield from _moved(bench, request, to))

    word = request.removeprefix("TYPE_").lower()
    return clause(_STATES, word, f"{request}: {to.name}", trial, _MOVES, Risk.ARMS)


def _order(bench: UpfBench) -> Trial:
    yield from _by_hand(bench)
    result = yield from bench.ask("TYPE_ARM")
    if result == "SUCCESS" or (yield from bench.state()) is _S.ARMED:
        raise failed("it is READY, and TYPE_ARM arms it without a take-off")
    return f"{result or 'not answered'}, still READY"


def _stays(name: str, parameter: str, to: ParachuteState, *requests: str) -> UpfClause:
    """After these requests it does not go on to that state by itself."""
    state = _AFTER[requests[-1]] if requests else _S.READY

    def trial(bench: UpfBench) -> Trial:
        yield from _by_hand(bench)
        yield from _reached(bench, *requests)
        if (yield from bench.reaches(to, _WAITS)):
            raise failed(f"{parameter} is off, and it becomes {to.name} by itself")
        return f"not {to.name} after {_WAITS:g} s"

    text = f"with {parameter} off it stays {state.name}, and is not {to.name} by itself"
    return clause(_PARAMETERS, name, text, trial, _MOVES, Risk.ARMS)


def _disabled(bench: UpfBench) -> Trial:
    yield from _by_hand(bench)
    if (yield from bench.set(p.ENABLE_PARACHUTE, False)) is not False:
        raise failed(f"{p.ENABLE_PARACHUTE} cannot be switched off")
    results = []
    for request in ("TYPE_DEPLOY", "TYPE_DEPLOY_FORCE"):
        since = len(bench.every)
        results.append((yield from bench.ask(request)) or "not answered")
        yield from bench.watch_on(FIRES_WITHIN)
        if _launches(bench, since) or (yield from bench.state()) in DEPLOYED:
            yield from bench.set(p.ENABLE_PARACHUTE, True)
            raise failed(f"{p.ENABLE_PARACHUTE} is off: IT FIRED by {request}")
    yield from bench.set(p.ENABLE_PARACHUTE, True)
    if "SUCCESS" in results:
        answers = " and ".join(results)
        raise failed(f"{p.ENABLE_PARACHUTE} is off, and TYPE_DEPLOY* are answered with {answers}")
    return " and ".join(results)


def _launches(bench: UpfBench, since: int) -> list[float]:
    """When it told a trigger to fire, from this place on."""
    return [one.at for one in bench.every[since:] if _orders_trigger(bench, one)]


def _tells_launched(bench: UpfBench, one: TransferPacket) -> bool:
    """Of the controller, that it is LAUNCHED."""
    if one.kind != names.PARACHUTE_STATUS or one.transfer.source != bench.node:
        return False
    return bench.state_in(one) is _S.LAUNCHED


def _deploys(bench: UpfBench, request: str) -> Trial:
    """In the air and armed. Without its APS it is for TYPE_DEPLOY* alone to fire it."""
    yield from _by_hand(bench)
    yield from bench.set(p.ENABLE_PARACHUTE, True)
    yield from _reached(bench, "TYPE_TAKEOFF", "TYPE_ARM")
    yield from bench.set(p.ENABLE_APS, False)
    began = bench.now
    bench.deployed_from = len(bench.every)
    result = yield from bench.ask(request)
    if result != "SUCCESS":
        bench.deployed_from = -1
        answer = result or "not answered"
        raise failed(f"it was ARMED, {p.ENABLE_APS} is off, and {request}: {answer}")

    out = first_of(bench.every, bench.deployed_from, partial(_tells_launched, bench))
    yield Wait(began + FIRES_WITHIN, out)
    if not out():
        bench.deployed_from = -1
        raise failed(f"SUCCESS, and it is not LAUNCHED within {FIRES_WITHIN:g} s")
    return f"LAUNCHED after {bench.now - began:.2f} s"


def _kill_first(bench: UpfBench) -> Trial:
    yield from ()
    if bench.deployed_from < 0:
        raise not_tried("it was not deployed")
    for one in bench.every[bench.deployed_from :]:
        bench.look_at([one])
        asks = one.kind == names.VEHICLE_SERVICE
        if asks and bench.definitions.type_name(one.kind, one.values) == "TYPE_KILLSWITCH":
            return "asked before"
        if _tells_launched(bench, one) or _orders_trigger(bench, one):
            raise failed("it fired before it asked for TYPE_KILLSWITCH", [one.packet])
    raise failed("it never asked for TYPE_KILLSWITCH")


def _orders_trigger(bench: UpfBench, one: TransferPacket) -> bool:
    """Of the controller, that a trigger is to fire."""
    if one.transfer.source != bench.node or one.transfer.kind is TransferKind.RESPONSE:
        return False
    if one.kind != names.TRIGGER_SERVICE:
        return one.kind == names.TRIGGER_LAUNCH
    return bench.definitions.type_name(one.kind, one.values) == "TYPE_LAUNCH"


def _launched_after(bench: UpfBench) -> Trial:
    """Only a trigger that is heard shows what it has reported, and when."""
    yield from ()
    if bench.deployed_from < 0:
        raise not_tried("it was not deployed")
    if not any(one.kind == names.TRIGGER_STATUS for one in bench.every):
        raise not_tried("no TriggerStatus is received")
    for one in bench.every[bench.deployed_from :]:
        bench.look_at([one])
        if _tells_launched(bench, one):
            raise failed("it is LAUNCHED before its trigger has reported anything", [one.packet])
        if _trigger_reports(bench, one):
            break
    return "its trigger reported first"


def _trigger_reports(bench: UpfBench, one: TransferPacket) -> bool:
    """Of a trigger, that it has fired: in its status, or in its answer."""
    if one.kind == names.TRIGGER_STATUS:
        state = bench.definitions.state_name(one.kind, one.values)
        return bool(one.values.get("is_launched")) or state == "LAUNCHED"
    if one.kind != names.TRIGGER_SERVICE or one.transfer.kind is not TransferKind.RESPONSE:
        return False
    return bench.definitions.result_name(one.kind, one.values) == "SUCCESS"


def _touchdown(bench: UpfBench) -> Trial:
    if (yield from bench.state()) not in DEPLOYED:
        raise not_tried("it was not deployed")
    if not (yield from bench.reaches(_S.TOUCHDOWN, _RESTS[1])):
        raise failed(f"at rest, and it is not TOUCHDOWN after {_RESTS[1]:g} s")
    first = next((one.at for one in bench.heard if _tells_launched(bench, one)), math.nan)
    if math.isnan(first):
        raise not_tried("it was LAUNCHED before it was looked at")
    if (passed := bench.now - first) < _RESTS[0]:
        raise failed(f"TOUCHDOWN {passed:.1f} s after LAUNCHED (need 5 s at rest)")
    return f"{passed:.1f} s after LAUNCHED"


def _blocks_when_abnormal(bench: UpfBench) -> Trial:
    """The document names no fault, so that none is caused here. All that was received counts."""
    yield from bench.watch_on(UNDER_WAY)
    asked = [
        one
        for one in bench.heard
        if one.kind == names.VEHICLE_SERVICE
        and bench.definitions.type_name(one.kind, one.values) == "TYPE_FLIGHT_BLOCK"
    ]
    statuses = [one for one in bench.heard if one.kind == names.PARACHUTE_STATUS]
    became = [
        (before, after)
        for before, after in pairwise(statuses)
        if bench.state_in(after) is _S.ABNORMAL is not bench.state_in(before)
    ]
    if not became:
        raise not_tried("it did not become ABNORMAL: cause a fault while the kit listens")
    for before, after in became:
        first, last = before.at - UNDER_WAY, after.at + UNDER_WAY
        its = [one for one in asked if first <= one.at <= last]
        if not its:
            raise failed("it became ABNORMAL without TYPE_FLIGHT_BLOCK", [after.packet])
        bench.look_at([after, its[0]])
    return f"asked each time it became ABNORMAL ({len(became)})"


_STATES, _PARAMETERS = "Global working state", "Parameters"
_SERVICE = "ParachuteService"
_NO_FLIGHT = "the document names no condition, and a device on a bench does not fly"
_NO_FALL = "a device on a bench does not fall"


def _by_itself(parameter: str, before: ParachuteState, to: ParachuteState) -> UpfClause:
    """What it does while this is on."""
    name = parameter.removeprefix("Enable ").lower()
    text = f"{before.name}, and {parameter} is on: it becomes {to.name} by itself"
    return clause(_PARAMETERS, name, text, OutOfReach(_NO_FLIGHT), READS)


CLAUSES: tuple[UpfClause, ...] = (
    clause(
        _PARAMETERS,
        "switch-range",
        "a switch is on or off: another number is refused, or counts as one of them",
        _switch_range,
        "its switches are set to what is neither, and set back",
        Risk.ARMS,
    ),
    clause(
        _SERVICE, "bad-magic", "a wrong magic number is refused", _bad_magic, _MOVES, Risk.ARMS
    ),
    clause(
        _SERVICE,
        "unknown-type",
        "a type that is none is refused",
        _unknown_type,
        _MOVES,
        Risk.ARMS,
    ),
    *(_excludes(one) for one in p.EXCLUDES),
    _stays("no-auto-takeoff", p.AUTO_TAKEOFF, _S.TAKEOFF),
    clause(_STATES, "arm-order", "it is armed only after a take-off", _order, _MOVES, Risk.ARMS),
    _moves("TYPE_TAKEOFF", _S.TAKEOFF),
    _stays("no-auto-arm", p.AUTO_ARM, _S.ARMED, "TYPE_TAKEOFF"),
    _stays("no-auto-land", p.AUTO_LAND, _S.READY, "TYPE_TAKEOFF"),
    _moves("TYPE_ARM", _S.ARMED, "TYPE_TAKEOFF"),
    _stays("no-auto-disarm", p.AUTO_DISARM, _S.TAKEOFF, "TYPE_TAKEOFF", "TYPE_ARM"),
    _moves("TYPE_DISARM", _S.TAKEOFF, "TYPE_TAKEOFF", "TYPE_ARM"),
    _moves("TYPE_LAND", _S.READY, "TYPE_TAKEOFF"),
    clause(
        _PARAMETERS,
        "disabled",
        "with Enable Parachute off nothing deploys, neither TYPE_DEPLOY nor TYPE_DEPLOY_FORCE",
        _disabled,
        MAY_FIRE,
        Risk.FIRES,
    ),
    clause(
        _STATES,
        "deploy-force",
        "TYPE_DEPLOY_FORCE: LAUNCHED, also with Enable APS off",
        partial(_deploys, request="TYPE_DEPLOY_FORCE"),
        "IT FIRES",
        Risk.FIRES,
        DEPLOY_FORCE,
    ),
    clause(
        _STATES,
        "deploy",
        "TYPE_DEPLOY: LAUNCHED, also with Enable APS off",
        partial(_deploys, request="TYPE_DEPLOY"),
        "IT FIRES",
        Risk.FIRES,
    ),
    clause(
        _STATES,
        "kill-first",
        "before it fires it asks the vehicle for TYPE_KILLSWITCH",
        _kill_first,
        "it has fired",
        Risk.FIRES,
    ),
    clause(
        _STATES,
        "launched-after-trigger",
        "it is LAUNCHED once its trigger has reported that it has fired",
        _launched_after,
        "it has fired",
        Risk.FIRES,
    ),
    clause(
        _STATES,
        "touchdown",
        "LAUNCHED and at rest for 5 s: TOUCHDOWN",
        _touchdown,
        "it has fired",
        Risk.FIRES,
    ),
    clause(
        _STATES,
        "block-when-abnormal",
        "as it becomes ABNORMAL, which is a fault, it asks the vehicle for TYPE_FLIGHT_BLOCK",
        _blocks_when_abnormal,
        READS,
    ),
    _by_itself(p.AUTO_TAKEOFF, _S.READY, _S.TAKEOFF),
    _by_itself(p.AUTO_ARM, _S.TAKEOFF, _S.ARMED),
    _by_itself(p.AUTO_DISARM, _S.ARMED, _S.TAKEOFF),
    _by_itself(p.AUTO_LAND, _S.TAKEOFF, _S.READY),
    clause(
        _STATES,
        "aps",
        "ARMED, and its APS detects an accident: it deploys by itself",
        OutOfReach(_NO_FALL),
        READS,
    ),
    clause(
        _PARAMETERS,
        "no-aps",
        "with Enable APS off it never deploys by itself",
        OutOfReach(_NO_FALL),
        READS,
    ),
)
