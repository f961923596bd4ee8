"""A MAVLink signing key from its file: refused if others can read it."""

from __future__ import annotations

import os
import stat
import time
from pathlib import Path

from chute_ros.errors import SigningKeyError
from chute_ros.protocol.mavlink.signing import (
    EPOCH_2015,
    UNITS_PER_SECOND,
    Signer,
    SigningClock,
    Times,
    Verifier,
    key_from_text,
)

#: Where the wall clock was set back, signing goes on so far after the newest time that was kept:
#: the last ones before a crash were not. s
_NOT_KEPT = 10.0


def signing_from_file(
    name: str, link_id: int, option: str, before: Times | None = None
) -> tuple[Signer, Verifier]:
    """Signer and verifier for the key in file name; SigningKeyError if it cannot be used.

    option: how the user gave the file, for the error's text; before: the times before a restart.
    The Unix time of signing is taken from the wall clock once, here, and then goes by monotonic
    time.
    """
    before = before or Times()
    try:
        with Path(name).open("rb") as file:
            about, text = os.fstat(file.fileno()), file.read()
    except OSError as error:
        raise SigningKeyError(f"{option}: {name}: {error.strerror}") from None
    if about.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise SigningKeyError(f"{option}: {name} may be read by others: chmod 600 {name}")
    if about.st_uid not in (0, os.geteuid()):
        raise SigningKeyError(f"{option}: {name} belongs to another user: chown it")
    key = key_from_text(text, f"{option}: {name}")
    start = time.time()
    newest = EPOCH_2015 + before.newest / UNITS_PER_SECOND
    if start <= newest:
        start = newest + _NOT_KEPT
    clock = SigningClock(start - time.monotonic())
    return Signer(key, clock, link_id), Verifier(key, clock, before.streams)
