"""A MAVLink signing key from its file: refused if others can read it."""

from __future__ import annotations

import os
import time

from chute_ros.errors import SigningKeyError
from chute_ros.protocol.mavlink.signing import (
    EPOCH_2015,
    KEY_BYTES,
    UNITS_PER_SECOND,
    Signer,
    SigningClock,
    Times,
    Verifier,
    key_from_text,
)
from chute_ros.transport.given_path import given_path
from chute_ros.transport.regular_file import (
    NotRegularError,
    TooLongError,
    read_regular,
    why_not_secret,
)

#: Where the wall clock was set back, signing goes on so far after the newest time that was kept:
#: the last ones before a crash were not. s
_NOT_KEPT = 10.0
#: No key file is longer: two digits a byte, and blanks around them.
_LONGEST = 2 * KEY_BYTES + 64


def signing_from_file(
    name: str, link_id: int, option: str, before: Times | None = None
) -> tuple[Signer, Verifier]:
    """Signer and verifier for the key in file name; SigningKeyError if it cannot be used.

    option: how the user gave the file, for the error's text; before: the times before a restart.
    The Unix time of signing is taken from the wall clock once, here, and then goes by monotonic
    time.
    """
    before = before or Times()
    about, text = _read(name, option)
    if why := why_not_secret(name, about):
        raise SigningKeyError(f"{option}: {why}")
    key = key_from_text(text, f"{option}: {name}")
    start = time.time()
    newest = EPOCH_2015 + before.newest / UNITS_PER_SECOND
    if start <= newest:
        start = newest + _NOT_KEPT
    clock = SigningClock(start - time.monotonic())
    return Signer(key, clock, link_id), Verifier(key, clock, before.streams)


def _read(name: str, option: str) -> tuple[os.stat_result, bytes]:
    """What file name is, and what is in it; SigningKeyError if no key can be."""
    try:
        return read_regular(given_path(name, option), _LONGEST)
    except TooLongError:
        raise SigningKeyError(
            f"{option}: {name} is no key, it holds more than {_LONGEST} bytes: need "
            f"{KEY_BYTES} raw bytes or {2 * KEY_BYTES} hexadecimal digits"
        ) from None
    except NotRegularError as error:
        raise SigningKeyError(f"{option}: {name} is {error}: name a file with a key") from None
    except OSError as error:
        raise SigningKeyError(f"{option}: {name}: {error.strerror}") from None
