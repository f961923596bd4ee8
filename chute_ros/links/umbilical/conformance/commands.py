"""The key, which arms; and what moves valves, fires canopies and launches."""

from __future__ import annotations

from itertools import dropwhile

from chute_ros.conformance.clause import Risk, Trial, failed, not_tried
from chute_ros.links.umbilical.conformance.bench import (
    SETTLES,
    ReceivedLine,
    UmbilicalBench,
    closed,
    mode_name,
)
from chute_ros.links.umbilical.conformance.document import CORE, PAYLOAD, UmbilicalClause, of
from chute_ros.links.umbilical.protocol.canopies import CANOPIES
from chute_ros.links.umbilical.protocol.commands import KINDS
from chute_ros.links.umbilical.protocol.line_parser import ArmingBlocked
from chute_ros.links.umbilical.protocol.modes import IN_FLIGHT, FlightMode

_ARMS = "it is key armed, and disarmed again"
_MAY_ARM, _MAY = "it must not, but it may be ARMED", "it must not, but it may FIRE"
#: Close to a command, and none: by their case, brackets or number. No two of them join to one.
_NEARLY_ARMS = (
    *(b"KA", b"(KA)", b"<ka>", b"<kA>", b"<K>", b"<A>", b"<KAA>", b"< KA>"),
    *(b"<KA\n", b"<KA"),
)
_NEARLY_FIRES = (
    *(b"D", b"(D)", b"[d]", b"<DD>", b"< D>", b"<l>", b"(L)", b"L", b"<MS>", b"{M}", b"<v>"),
    *(b"<0>", b"<5>", b"<A0>", b"<A4>", b"<a1>", b"1", b"<D\n", b"<D"),
)
#: What a command has moved stays for so long at least, s. A payload's flag may be a pulse.
_KEEPS = 1.5
_MOVED_FOR_GOOD = ("mav_open", "sv_open")
_VALVES = {"mav": "MAV", "sv": "SV"}


def _startup(line: ReceivedLine) -> bool:
    return line.values.get("flight_mode") == FlightMode.STARTUP


def _standby(line: ReceivedLine) -> bool:
    return line.values.get("flight_mode") == FlightMode.STANDBY


def _flies(line: ReceivedLine) -> bool:
    return line.values.get("flight_mode") in IN_FLIGHT


def _disarmed(bench: UmbilicalBench) -> Trial:
    """It is in Startup."""
    if not (yield from bench.order("key_disarm", _startup)):
        raise not_tried(f"it is in {mode_name(bench.last('flight_mode'))} (need Startup)")
    return ""


def _key_arm(bench: UmbilicalBench) -> Trial:
    yield from _disarmed(bench)
    since = len(bench.heard)
    took = yield from bench.order("key_arm", _standby)
    if took:
        return f"Standby after {took}"
    blocked = [one for one in bench.heard[since:] if isinstance(one.said, ArmingBlocked)]
    if blocked:
        raise not_tried(f"it says: {blocked[0].packet.text:.60}")
    raise failed(f"<KA>: it stays in {mode_name(bench.last('flight_mode'))} (need Standby)")


def _armed(bench: UmbilicalBench) -> Trial:
    if not (yield from bench.order("key_arm", _standby)):
        raise not_tried(f"it is in {mode_name(bench.last('flight_mode'))} (need Standby)")
    return ""


def _key_disarm(bench: UmbilicalBench) -> Trial:
    yield from _armed(bench)
    took = yield from bench.order("key_disarm", _startup)
    if not took:
        raise failed(f"<KD>: it stays in {mode_name(bench.last('flight_mode'))} (need Startup)")
    return f"Startup after {took}"


def _nearly(bench: UmbilicalBench, writes: tuple[bytes, ...]) -> Trial:
    yield from _disarmed(bench)
    return (yield from bench.nothing(*writes))


def _nearly_arms(bench: UmbilicalBench) -> Trial:
    return (yield from _nearly(bench, _NEARLY_ARMS))


def _nearly_fires(bench: UmbilicalBench) -> Trial:
    return (yield from _nearly(bench, _NEARLY_FIRES))


# -- what moves something ---------------------------------------------------------------------


def _moves(bench: UmbilicalBench, order: str, field: str, value: int) -> Trial:
    """A command moves this field to that value, and no other."""
    token = KINDS[order].command.token.decode()
    before = yield from bench.record()
    since = len(bench.heard)
    took = yield from bench.order(order, lambda one: one.values.get(field) == value)
    yield from bench.watch_on(SETTLES)
    bench.unchanged(before, since, f"after {token}", (field,))
    if not took:
        raise failed(f"{token}: {field} is {bench.last(field)} (need {value})")
    if field in _MOVED_FOR_GOOD:
        yield from _stays(bench, since, token, field, value)
    return f"{field} {value} after {took}"


def _stays(bench: UmbilicalBench, since: int, token: str, field: str, value: int) -> Trial:
    """From this place of heard on the field became this value, and keeps it."""
    yield from bench.watch_on(_KEEPS)
    told = (one for one in bench.heard[since:] if field in one.values)
    kept = dropwhile(lambda one: one.values[field] != value, told)
    for one in kept:
        if (now := one.values[field]) != value:
            raise failed(f"{token}: {field} became {value}, and then {now}", [one.packet])
    return ""


def _opened(bench: UmbilicalBench, valve: str, is_open: int) -> Trial:
    """The valve is open, or closed, before something is tried; whatever that takes."""
    order = f"{'open' if is_open else 'close'}_{valve}"
    field = f"{valve}_open"
    if (yield from bench.record()).values.get(field) == is_open:
        return ""
    if not (yield from bench.order(order, lambda one: one.values.get(field) == is_open)):
        raise not_tried(f"{field} is {bench.last(field)} (need {is_open})")
    return ""


def _valve(valve: str, is_open: int) -> UmbilicalClause:
    word = "open" if is_open else "close"
    order = f"{word}_{valve}"

    def trial(bench: UmbilicalBench) -> Trial:
        yield from _opened(bench, valve, 1 - is_open)
        return (yield from _moves(bench, order, f"{valve}_open", is_open))

    token, name = KINDS[order].command.token.decode(), _VALVES[valve]
    does = f"IT OPENS THE {name}" + ("" if is_open else ", and closes it")
    text = f"{token} {word}s the {name}, and nothing else"
    return _core(f"{word}-{valve}", text, trial, does, Risk.FIRES)


def _safe(bench: UmbilicalBench) -> Trial:
    for valve in _VALVES:
        yield from _opened(bench, valve, 1)
    before = yield from bench.record()
    since = len(bench.heard)
    took = yield from bench.order("safe", closed)
    bench.unchanged(before, since, "after <V>", [f"{valve}_open" for valve in _VALVES])
    if not took:
        told = ", ".join(f"{one}_open {bench.last(f'{one}_open')}" for one in _VALVES)
        raise failed(f"<V>: {told} (need 0)")
    return f"both are closed after {took}"


def _payload(event: str) -> UmbilicalClause:
    order, field = f"payload_{event}", f"cmd_{event}"

    def trial(bench: UmbilicalBench) -> Trial:
        if (yield from bench.record()).values.get(field) != 0:
            raise not_tried(f"{field} is not 0: restart it")
        return (yield from _moves(bench, order, field, 1))

    token = KINDS[order].command.token.decode()
    text = f"{token} is payload event {event.upper()}, which {field} shows"
    return of(PAYLOAD)(f"payload-{event}", text, trial, "THE PAYLOAD ACTS", Risk.FIRES)


def _canopy(name: str) -> UmbilicalClause:
    flag, _ = CANOPIES[name]
    token = KINDS[name].command.token.decode()

    def trial(bench: UmbilicalBench) -> Trial:
        if (yield from bench.record()).values.get(flag) != 0:
            raise not_tried(f"{flag} is not 0: it is out already")
        before = yield from bench.record()
        since = len(bench.heard)
        took = yield from bench.order(name, lambda one: one.values.get(flag) == 1)
        bench.unchanged(before, since, f"after {token}", (flag, "flight_mode"))
        if not took:
            raise failed(f"{token}: {flag} stays 0, whatever has fired")
        yield from _stays(bench, since, token, flag, 1)
        return f"{flag} 1 after {took}"

    text = f"{token} triggers the {name}, which {flag} shows"
    return _core(name, text, trial, f"IT FIRES THE {name.upper()}", Risk.FIRES)


def _launch_disarmed(bench: UmbilicalBench) -> Trial:
    yield from _disarmed(bench)
    yield from bench.nothing(KINDS["launch"].command.token)
    return "it stays in Startup"


def _launch(bench: UmbilicalBench) -> Trial:
    yield from _armed(bench)
    took = yield from bench.order("launch", _flies)
    if not took:
        raise failed(f"<L>: it stays in {mode_name(bench.last('flight_mode'))}")
    return f"{mode_name(bench.last('flight_mode'))} after {took}"


_core = of(CORE)
ARMING: tuple[UmbilicalClause, ...] = (
    _core("key-arm", "<KA> takes it from Startup to Standby", _key_arm, _ARMS, Risk.ARMS),
    _core("key-disarm", "<KD> takes it back to Startup", _key_disarm, _ARMS, Risk.ARMS),
    _core(
        "nearly-arms",
        "what is nearly <KA> does nothing",
        _nearly_arms,
        _MAY_ARM,
        Risk.ARMS,
    ),
)
FIRING: tuple[UmbilicalClause, ...] = (
    _core(
        "nearly-fires",
        "what is nearly a command that fires, opens or launches does nothing",
        _nearly_fires,
        _MAY,
        Risk.FIRES,
    ),
    *(_valve(valve, is_open) for valve in _VALVES for is_open in (1, 0)),
    _core(
        "safe",
        "<V> closes MAV and SV, and does nothing else",
        _safe,
        "IT OPENS BOTH VALVES, and closes them",
        Risk.FIRES,
    ),
    *(_payload(event) for event in ("n1", "n2", "n3", "n4", "a1", "a2", "a3")),
    *(_canopy(name) for name in CANOPIES),
    _core(
        "launch-disarmed",
        "without the key <L> does nothing",
        _launch_disarmed,
        "it must not, but it may LAUNCH",
        Risk.FIRES,
    ),
    _core(
        "launch",
        "armed and in Standby, <L> launches",
        _launch,
        "IT LAUNCHES; in the end it is restarted",
        Risk.FIRES,
    ),
)
