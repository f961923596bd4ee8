"""How commands are answered, and what of the frames counts."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from chute_ros.conformance.clause import READS, SOAK, Trial, Wait, failed, not_supported, not_tried
from chute_ros.links.mavlink.conformance.bench import (
    RESULT_WITHIN,
    US,
    MavlinkBench,
    in_progress,
    result_of,
)
from chute_ros.links.mavlink.conformance.connection import WATCHED, nominal
from chute_ros.links.mavlink.conformance.document import (
    COMMAND,
    FRAMES,
    SIGNING,
    MavlinkClause,
    of,
)
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.signing import KEY_BYTES, SIGNATURE_BYTES, signature_of

_REQUEST, _STATUS = dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS
#: A number of MAV_CMD that nobody gave away.
_UNKNOWN = 31_999
#: Whoever is not meant stays silent for so long, s.
_SILENCE = 0.6
#: A second ground station, and components that are not there.
_OTHER_SENDER, _NOBODY = 190, 77
#: Bytes without a start of a frame.
_NOISE = bytes(byte for byte in range(256) if byte not in (0xFD, 0xFE)) * 4
#: So many frames of ours are lost in a row: the number of a frame is one byte.
_LOST = (1, 7, 128)
_SPOILT = "it gets bytes that it must leave alone"
#: That of nobody.
_ANOTHER_KEY = bytes(KEY_BYTES)
KEY = "--signing-key-file"


def _unknown_command(bench: MavlinkBench) -> Trial:
    answer = yield from bench.command(_UNKNOWN)
    if answer is None:
        raise failed("a command that nobody knows is not answered")
    if answer.message.result != dialect.MAV_RESULT_UNSUPPORTED:
        raise failed(f"it is answered with {result_of(answer)} (need MAV_RESULT_UNSUPPORTED)")
    return "MAV_RESULT_UNSUPPORTED"


def _silence(bench: MavlinkBench, otherwise: str) -> Trial:
    """It does not answer what was just sent."""
    if (yield from bench.answer(_REQUEST, _SILENCE)) is not None:
        raise failed(otherwise)
    return "not answered"


def _not_meant(bench: MavlinkBench, target: tuple[int, int]) -> Trial:
    bench.send(bench.command_long(_REQUEST, _STATUS, target=target))
    return (yield from _silence(bench, f"a command to {target[0]}/{target[1]} is answered"))


def _other_component(bench: MavlinkBench) -> Trial:
    return (yield from _not_meant(bench, (bench.system, _NOBODY)))


def _other_system(bench: MavlinkBench) -> Trial:
    return (yield from _not_meant(bench, (bench.system % 250 + 5, bench.component)))


def _to_all(bench: MavlinkBench) -> Trial:
    for target in ((bench.system, 0), (0, 0)):
        bench.send(bench.command_long(_REQUEST, _STATUS, target=target))
        if (yield from bench.answer(_REQUEST)) is None:
            raise failed(f"a command to {target[0]}/{target[1]}, which is all, is not answered")
    return "answered"


def _answer_addressed(bench: MavlinkBench) -> Trial:
    answer = yield from bench.command(_REQUEST, _STATUS)
    if answer is None:
        raise failed("a command is not answered")
    got = answer.message.target_system, answer.message.target_component
    if got != (bench.system, US):
        raise failed(f"its answer is for {got[0]}/{got[1]} (need {bench.system}/{US})")
    return f"for {got[0]}/{got[1]}"


def _two_senders(bench: MavlinkBench) -> Trial:
    for sender in (US, _OTHER_SENDER, US):
        bench.send(bench.command_long(_REQUEST, _STATUS), sender)
        if (yield from bench.answer(_REQUEST)) is None:
            raise failed(f"a command of {bench.system}/{sender} is not answered")
    return "each is answered"


def _command_int(bench: MavlinkBench) -> Trial:
    bench.send(bench.command_int(_REQUEST, _STATUS))
    answer = yield from bench.answer(_REQUEST)
    if answer is None:
        raise failed("a COMMAND_INT is not answered")
    return f"answered with {result_of(answer)}"


def _one_answer(bench: MavlinkBench) -> Trial:
    since = len(bench.heard)
    if (yield from bench.command(_REQUEST, _STATUS, tries=1)) is None:
        raise failed("a command is not answered")
    yield from bench.watch_on(_SILENCE)
    answers = (one for one in bench.heard[since:] if one.kind == "COMMAND_ACK")
    told = [one for one in answers if not in_progress(one)]
    if len(told) > 1:
        names = ", ".join(map(result_of, told))
        raise failed(f"one command has {len(told)} results: {names}", [one.packet for one in told])
    return result_of(told[0]) if told else "no result"


def _sent_again(bench: MavlinkBench) -> Trial:
    for confirmation in range(3):
        if (
            yield from bench.command(_REQUEST, _STATUS, tries=1, confirmation=confirmation)
        ) is None:
            raise failed(f"the same command with confirmation {confirmation} is not answered")
    return "answered each time"


def _doubled(bench: MavlinkBench) -> Trial:
    bench.send(bench.command_long(_REQUEST, _STATUS), change=lambda frame: (frame, frame))
    if (yield from bench.answer(_REQUEST)) is None:
        raise failed("a frame that comes twice is not answered")
    # The other one's answer is none to the next command.
    yield from bench.watch_on(0.3)
    if (yield from bench.command(_REQUEST, _STATUS, tries=1)) is None:
        raise failed("after a frame that came twice the next is not answered")
    return "answered, and the next one, too"


def _lost(bench: MavlinkBench) -> Trial:
    for count in _LOST:
        for _ in range(count):
            bench.send(bench.command_long(_REQUEST, _STATUS), change=lambda frame: ())
        if (yield from bench.command(_REQUEST, _STATUS)) is None:
            raise failed(f"after {count} frames that were lost a command is not answered, 3 times")
    return "answered after each gap"


def _reordered(bench: MavlinkBench) -> Trial:
    if bench.signs:
        raise not_tried("with a key a frame that was overtaken is a copy, and refused")
    held: list[bytes] = []

    def hold(frame: bytes) -> Iterable[bytes]:
        held.append(frame)
        return ()

    bench.send(bench.command_long(_REQUEST, _STATUS), change=hold)
    bench.send(bench.command_long(_UNKNOWN), change=lambda frame: (frame, *held))
    until = bench.now + RESULT_WITHIN
    since, both = len(bench.heard), {_REQUEST, _UNKNOWN}
    yield Wait(until, lambda: both <= _answered(bench, since))
    if left := both - _answered(bench, since):
        raise failed(f"{len(left)} of two frames that overtook each other are not answered")
    return "both are answered"


def _answered(bench: MavlinkBench, since: int) -> set[int]:
    """The commands whose results came."""
    answers = (one for one in bench.heard[since:] if one.kind == "COMMAND_ACK")
    return {one.message.command for one in answers if not in_progress(one)}


def _noise(bench: MavlinkBench) -> Trial:
    for _ in range(3):
        bench.send_bytes(_NOISE, "noise")
        yield from bench.watch_on(0.05)
    if (yield from bench.command(_REQUEST, _STATUS)) is None:
        raise failed("after bytes that are no frame a command is not answered, 3 times")
    return "answered after it"


def _damaged(bench: MavlinkBench) -> Trial:
    def damage(frame: bytes) -> Iterable[bytes]:
        return (frame[:12] + bytes([frame[12] ^ 0x55]) + frame[13:],)

    bench.send(bench.command_long(_REQUEST, _STATUS), change=damage)
    return (yield from _silence(bench, "a command with a wrong checksum is carried out"))


def _cut(bench: MavlinkBench) -> Trial:
    bench.send(bench.command_long(_REQUEST, _STATUS), change=lambda frame: (frame[:20],))
    yield from bench.watch_on(0.4)
    if (yield from bench.command(_REQUEST, _STATUS)) is None:
        raise failed("after half a frame a command is not answered, 3 times")
    return "answered after it"


def _mavlink_2(bench: MavlinkBench) -> Trial:
    yield from bench.watch_once(WATCHED)
    for one in bench.watched:
        if one.frame.version != 2:
            raise failed(f"{one.kind} came as MAVLink {one.frame.version}", [one.packet])
    return "all that was watched"


def _mavlink_1(bench: MavlinkBench) -> Trial:
    bench.send(bench.command_long(_REQUEST, _STATUS), version=1)
    answer = yield from bench.answer(_REQUEST)
    if (yield from bench.wait_for("PARACHUTE_STATUS", 3.0)) is None:
        raise failed("after a MAVLink 1 frame no PARACHUTE_STATUS comes any more")
    if (yield from bench.command(_REQUEST, _STATUS)) is None:
        raise failed("after a MAVLink 1 frame commands in MAVLink 2 are not answered, 3 times")
    if answer is None:
        raise not_supported("a command in MAVLink 1 is not answered; MAVLink 2 goes on")
    return "answered; MAVLink 2 goes on"


def _sequence(bench: MavlinkBench) -> Trial:
    yield from bench.watch_once(WATCHED)
    for before, after in pairwise(bench.watched):
        if after.frame.sequence != (before.frame.sequence + 1) % 256:
            numbers = f"{before.frame.sequence} is followed by {after.frame.sequence}"
            raise failed(
                f"{numbers}: a receiver cannot count losses (or the line loses frames)",
                [before.packet, after.packet],
            )
    return f"{len(bench.watched)} frames in a row"


def _unsigned(bench: MavlinkBench) -> Trial:
    bench.send(bench.command_long(_REQUEST, _STATUS), signed=False)
    return (yield from _silence(bench, "an unsigned command is carried out although it has a key"))


def _wrong_key(bench: MavlinkBench) -> Trial:
    def sign_otherwise(frame: bytes) -> Iterable[bytes]:
        unsigned = frame[:-SIGNATURE_BYTES]
        return (unsigned + signature_of(_ANOTHER_KEY, unsigned),)

    bench.send(bench.command_long(_REQUEST, _STATUS), change=sign_otherwise)
    return (yield from _silence(bench, "a command that is signed with another key is carried out"))


def _replayed(bench: MavlinkBench) -> Trial:
    frames: list[bytes] = []

    def keep(frame: bytes) -> Iterable[bytes]:
        frames.append(frame)
        return (frame,)

    command = bench.command_long(_REQUEST, _STATUS)
    bench.send(command, change=keep)
    if (yield from bench.answer(_REQUEST)) is None:
        raise not_tried("a signed command is not answered")
    bench.send(command, change=lambda frame: frames)
    return (yield from _silence(bench, "a signed command that was recorded is carried out again"))


def _signed(bench: MavlinkBench) -> Trial:
    since = len(bench.heard)
    if (yield from bench.command(_REQUEST, _STATUS)) is None:
        raise failed("a signed command is not answered, 3 times")
    for one in bench.heard[since:]:
        if one.refused:
            raise failed(f"its {one.kind} is no frame of this key: {one.refused}", [one.packet])
    return "answered, signed with the key"


def _soak(bench: MavlinkBench) -> Trial:
    yield from bench.watch(bench.soak)
    for kind in ("HEARTBEAT", "PARACHUTE_STATUS"):
        nominal(bench, kind)
    clocks = [one for one in bench.watched if one.kind == "PARACHUTE_STATUS"]
    for earlier, later in pairwise(clocks):
        if later.message.time_boot_ms < earlier.message.time_boot_ms:
            raise failed("it restarted meanwhile", [earlier.packet, later.packet])
    return f"{bench.soak:g} s"


_commands = of(COMMAND, "Commands and acknowledgements")
_frames = of(FRAMES, "Frames")
CLAUSES: tuple[MavlinkClause, ...] = (
    _commands(
        "unknown-command",
        "a command that it does not know is answered with MAV_RESULT_UNSUPPORTED",
        _unknown_command,
    ),
    _commands(
        "other-component", "a command to another component is not its own", _other_component
    ),
    _commands("other-system", "a command to another system is not its own", _other_system),
    _commands("to-all", "a command to component 0, or to 0/0, is for it as well", _to_all),
    _commands("answer-addressed", "an answer is for who gave the command", _answer_addressed),
    _commands("two-senders", "several may give commands, and each is answered", _two_senders),
    _commands("command-int", "a COMMAND_INT is answered, if only by a refusal", _command_int),
    _commands("one-answer", "a command has one result", _one_answer),
    _commands(
        "sent-again",
        "a command that is sent again (confirmation) is answered again: the answer was lost",
        _sent_again,
    ),
    _frames("doubled-frame", "a frame that comes twice does no harm", _doubled),
    _frames("lost-frames", "frames that are lost before it do no harm", _lost),
    _frames("reordered-frames", "frames that overtake each other are both taken", _reordered),
    _frames("noise", "bytes that are no frame do no harm", _noise, _SPOILT),
    _frames("damaged-frame", "a frame with a wrong checksum is not taken", _damaged, _SPOILT),
    _frames("cut-frame", "half a frame does no harm to the next one", _cut, _SPOILT),
    _frames(
        "mavlink-2",
        "it sends MAVLink 2: PARACHUTE_STATUS has no number in MAVLink 1",
        _mavlink_2,
        READS,
    ),
    _frames("mavlink-1", "a MAVLink 1 frame does no harm, and may be answered", _mavlink_1),
    _frames("sequence", "its frames are numbered one after the other", _sequence, READS),
    of(SIGNING, "Accepting signed packets")(
        "unsigned-refused", "with a key unsigned commands are refused", _unsigned, needs=KEY
    ),
    of(SIGNING, "Accepting signed packets")(
        "wrong-key-refused",
        "a command that is signed with another key is refused",
        _wrong_key,
        needs=KEY,
    ),
    of(SIGNING, "Accepting signed packets")(
        "replay-refused",
        "a signed command whose timestamp is not newer than the last one's is refused",
        _replayed,
        needs=KEY,
    ),
    of(SIGNING, "Signing packets")(
        "signed-answers", "with a key its answers are signed", _signed, needs=KEY
    ),
    of(FRAMES, "Over hours")(
        "soak",
        "heartbeats and statuses go on without a pause or a restart",
        _soak,
        READS,
        needs=SOAK,
    ),
)
