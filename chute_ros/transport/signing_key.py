"""A MAVLink signing key from its file: refused if others can read it."""

from __future__ import annotations

import stat
import time
from pathlib import Path

from chute_ros.errors import SigningKeyError
from chute_ros.protocol.mavlink.signing import Signer, SigningClock, Verifier, key_from_text


def signing_from_file(name: str, link_id: int, option: str) -> tuple[Signer, Verifier]:
    """Signer and verifier for the key in file name; SigningKeyError if it cannot be used.

    option: how the user gave the file, for the error's text. The Unix time of signing is taken
    from the wall clock once, here, and then goes by monotonic time.
    """
    path = Path(name)
    try:
        text, mode = path.read_bytes(), path.stat().st_mode
    except OSError as error:
        raise SigningKeyError(f"{option}: {name}: {error.strerror}") from None
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise SigningKeyError(f"{option}: {name} may be read by others: chmod 600 {name}")
    key = key_from_text(text, f"{option}: {name}")
    clock = SigningClock(time.time() - time.monotonic())
    return Signer(key, clock, link_id), Verifier(key, clock)
