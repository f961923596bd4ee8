"""Readers and links that are broken on purpose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from chute_ros.links.umbilical.protocol.stream import Item, StreamReader
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.effect import NO_ANSWER, EffectFinished
from chute_ros.protocol.events import RequestFinished
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.supervisor.inputs import Input
from fuzz.target import MOST_ENTRIES, Subject
from fuzz.targets import (
    handover,
    mavlink_frames,
    mavlink_link,
    umbilical_lines,
    umbilical_link,
    upf_link,
)
from fuzz.targets.upf_frames import US, data_types

#: Programs: half a second goes by; the motors are to be stopped.
WAIT, KILL = b"\0\3", b"\7"
#: One piece of bytes comes over MAVLink, DroneCAN, the umbilical.
NOISE, FRAME, LINE = b"\5\0\0\3abc", b"\7" + bytes(16), b"\2\2\5[LOG]"
#: A leader tells of a deploy that waits for its kill.
WAITS = b"\1\4"


class Reader:
    """Reads text."""

    def __init__(self) -> None:
        self.kept: list[str] = []
        self.inputs = 0

    def held(self) -> object:
        return self

    def feed(self, data: bytes) -> None:
        self.inputs += 1
        data.decode("ascii", "replace")


class Raises(Reader):
    """It raises on what is no ASCII."""

    def feed(self, data: bytes) -> None:
        data.decode("ascii")


class Hangs(Reader):
    """It looks for an end that never comes, and swallows every error."""

    def feed(self, data: bytes) -> None:
        while data.startswith(b"\xff"):
            try:
                data.index(b"the end")
            except Exception:  # noqa: BLE001
                continue


class Grows(Reader):
    """It keeps a name for each input that it has not seen."""

    def feed(self, data: bytes) -> None:
        if data.hex() not in self.kept:
            self.kept.append(data.hex())


class Fills(Grows):
    """It keeps so many names and no more."""

    MOST = 30

    def feed(self, data: bytes) -> None:
        if len(self.kept) < self.MOST:
            super().feed(data)


def loses_bytes() -> Subject:
    """A decoder that forgets bytes without counting them."""
    raw = mavlink_frames.Raw()
    raw.decoder.feed_datagram = lambda data, now: []  # type: ignore[method-assign]
    return raw


def cuts_pieces() -> Subject:
    """A reader of lines to which it matters where a stream is cut."""
    stream = umbilical_lines.Stream()

    def loses_what_ends_a_piece(reader: StreamReader, data: bytes, piece: int) -> list[Item]:
        pieces = [data[at : at + piece] for at in range(0, len(data), piece)]
        return [one for part in pieces for one in reader.feed(part.removesuffix(b","))]

    stream._cut = loses_what_ends_a_piece  # type: ignore[method-assign,assignment]
    return stream


def _release(now: float) -> bytes:
    fires = d.MAVLink_command_long_message(
        1, 161, d.MAV_CMD_DO_PARACHUTE, 0, float(d.PARACHUTE_RELEASE), 0, 0, 0, 0, 0, 0
    )
    return FrameEncoder(1, 191).encode(fires, now)


def _launch() -> list[bytes]:
    us = Endpoint(data_types(), US)
    constants = data_types().message(names.TRIGGER_LAUNCH).constants
    us.broadcast(names.TRIGGER_LAUNCH, {"magic_number": constants[names.MAGIC]})
    return us.take_output()


def with_link(subject: Any, **methods: Callable[..., Any]) -> Subject:
    """A link of which these methods are others."""
    for name, method in methods.items():
        setattr(subject._link, name, method)
    done: Subject = subject
    return done


def keeps_pieces(subject: Any) -> Subject:
    """A link that keeps each piece of bytes that it hears, for ever."""
    hears = subject._link.receive
    kept = subject._link.kept = []

    def keeps(data: bytes, *rest: Any) -> None:
        kept.append(data)
        hears(data, *rest)

    return with_link(subject, receive=keeps)


class Overflows(handover.Follower):
    """A supervisor that counts its decisions further than a message can hold."""

    def _update(self, new: tuple[Input, ...]) -> None:
        self._state = replace(self._state, next_id=2**64)
        super()._update(new)


def _ended() -> list[Any]:
    return [RequestFinished(EffectFinished(1, True, True, NO_ANSWER, "it ended"))]


@dataclass(frozen=True)
class Broken:
    """One of them, the same in good health, an input that tells them apart, and as what. most:
    entries that a store may have, 0: that is not looked at."""

    make: Callable[[], Subject]
    healthy: Callable[[], Subject]
    data: bytes
    told: str
    most: int = 0


BROKEN = {
    "raises": Broken(Raises, Reader, b"b\xe4d", "UnicodeDecodeError"),
    "hangs": Broken(Hangs, Reader, b"\xff\xff", "HangError: hangs: it is not done after"),
    "loses bytes": Broken(
        loses_bytes, mavlink_frames.Raw, b"\0lost", "4 bytes are neither decoded nor counted"
    ),
    "minds pieces": Broken(
        cuts_pieces, umbilical_lines.Stream, b"\0\2\4a,b\n", "in pieces of 1 it says"
    ),
    "fires over MAVLink": Broken(
        lambda: with_link(mavlink_link.MavlinkLinked(), take_output=lambda: [_release(1000.0)]),
        mavlink_link.MavlinkLinked,
        WAIT,
        "left the link, and nobody had ordered it",
    ),
    "fires over DroneCAN": Broken(
        lambda: with_link(upf_link.UpfLinked(), take_output=_launch),
        upf_link.UpfLinked,
        WAIT,
        "flyfire.TriggerLaunch left the link, and nobody had ordered it",
    ),
    "fires over the umbilical": Broken(
        lambda: with_link(umbilical_link.UmbilicalLinked(), take_output=lambda: [b"<D>"]),
        umbilical_link.UmbilicalLinked,
        WAIT,
        "<D> left the link, and nobody had ordered it",
    ),
    "ends what never began": Broken(
        lambda: with_link(mavlink_link.MavlinkLinked(), take_events=_ended),
        mavlink_link.MavlinkLinked,
        WAIT,
        "request 1 ended that was not under way",
    ),
    "never ends": Broken(
        lambda: with_link(mavlink_link.MavlinkLinked(), take_events=list),
        mavlink_link.MavlinkLinked,
        KILL,
        "never ended: kill",
    ),
    "decides what cannot be told": Broken(
        Overflows,
        handover.Follower,
        WAITS,
        "no device can be told decision (9, 18446744073709551616)",
    ),
    "spins": Broken(
        lambda: with_link(mavlink_link.MavlinkLinked(), next_deadline=lambda: 0.0),
        mavlink_link.MavlinkLinked,
        WAIT,
        "spins: ",
    ),
    "grows over MAVLink": Broken(
        lambda: keeps_pieces(mavlink_link.MavlinkLinked()),
        mavlink_link.MavlinkLinked,
        NOISE,
        "grows: MavlinkLink.kept has ",
        MOST_ENTRIES,
    ),
    "grows over DroneCAN": Broken(
        lambda: keeps_pieces(upf_link.UpfLinked()),
        upf_link.UpfLinked,
        FRAME,
        "grows: UpfLink.kept has ",
        MOST_ENTRIES,
    ),
    "grows over the umbilical": Broken(
        lambda: keeps_pieces(umbilical_link.UmbilicalLinked()),
        umbilical_link.UmbilicalLinked,
        LINE,
        "grows: UmbilicalLink.kept has ",
        MOST_ENTRIES,
    ),
}
