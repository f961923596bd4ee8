"""Readers and links that are broken on purpose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.effect import NO_ANSWER, EffectFinished
from chute_ros.protocol.events import RequestFinished
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.protocol.umbilical.stream import Item, StreamReader
from chute_ros.protocol.upf import definitions as names
from fuzz.target import Subject
from fuzz.targets import mavlink_frames, mavlink_link, umbilical_lines, umbilical_link, upf_link
from fuzz.targets.upf_frames import US, data_types

#: Programs: half a second goes by; the motors are to be stopped.
WAIT, KILL = b"\0\3", b"\7"


class Reader:
    """Reads text."""

    def __init__(self) -> None:
        self.kept: list[str] = []

    def held(self) -> object:
        return self

    def feed(self, data: bytes) -> None:
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


def _ended() -> list[Any]:
    return [RequestFinished(EffectFinished(1, True, True, NO_ANSWER, "it ended"))]


@dataclass(frozen=True)
class Broken:
    """One of them, the same in good health, an input that tells them apart, and as what."""

    make: Callable[[], Subject]
    healthy: Callable[[], Subject]
    data: bytes
    told: str


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
    "spins": Broken(
        lambda: with_link(mavlink_link.MavlinkLinked(), next_deadline=lambda: 0.0),
        mavlink_link.MavlinkLinked,
        WAIT,
        "spins: ",
    ),
}
