"""Which autopilot a simulator binary is, by words that it holds, and which version, by its own."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chute_ros.errors import ChuteError

ARDUCOPTER, ARDUPLANE, PX4 = "ArduCopter", "ArduPlane", "PX4"
KINDS = (ARDUCOPTER, ARDUPLANE, PX4)
#: ArduPilot's firmware string, as each of its vehicles has one ("ArduCopter V4.6.0").
_ARDUPILOT = re.compile(rb"(Ardu[A-Z][a-z]+|Rover|Blimp|AntennaTracker) V\d+\.\d+\.\d+[-\w]*")
#: A line of the POSIX server of PX4.
_PX4 = b"PX4 server already running for instance"
WHAT_TO_GIVE = """\
sitl: no autopilot to fly. Give the simulator binary of one, or of several:

    make sitl AUTOPILOT="/path/to/arducopter /path/to/arduplane /path/to/px4"

ArduCopter, ArduPlane (flown as a quadplane): the executable for the board SITL, as ArduPilot's
documentation of its simulator has it (build/sitl/bin/arducopter). PX4: bin/px4 in the folder of a
POSIX build with the SIH simulator (its etc/ folder lies beside bin/), as PX4's documentation of
SIH has it. Nothing of them is part of this project. What comes of it:
docs/evidence/real_autopilots.md."""


class AutopilotError(ChuteError):
    """The file is no simulator that can be flown. The text says what would be."""


@dataclass(frozen=True)
class Autopilot:
    """A simulator binary. kind: one of KINDS."""

    kind: str
    path: Path
    #: As the binary's own words say; "": only the running autopilot does.
    version: str = ""

    @property
    def ardupilot(self) -> bool:
        """Of the ArduPilot family."""
        return self.kind != PX4


def recognise(path: Path) -> Autopilot:
    """The autopilot in this file; AutopilotError if it is none that can be flown."""
    if not path.is_file() or not os.access(path, os.X_OK):
        raise AutopilotError(f"sitl: {path}: no file that can be executed\n\n{WHAT_TO_GIVE}")
    path = path.resolve()
    words = path.read_bytes()
    if found := _ARDUPILOT.search(words):
        kind, _, version = found[0].decode().partition(" ")
        if kind in KINDS:
            return Autopilot(kind, path, version.removeprefix("V"))
        raise AutopilotError(
            f"sitl: {path} is {found[0].decode()}: need one of {', '.join(KINDS)}"
        )
    if _PX4 in words:
        if not (path.parent.parent / "etc" / "init.d-posix" / "rcS").is_file():
            raise AutopilotError(
                f"sitl: {path} is PX4, but its start-up files are not beside it: need "
                f"{path.parent.parent}/etc, so give the binary in PX4's build folder"
            )
        return Autopilot(PX4, path)
    raise AutopilotError(f"sitl: {path} is no simulator known here\n\n{WHAT_TO_GIVE}")


def version_text(message: Any) -> str:
    """AUTOPILOT_VERSION in words: "4.7.0-dev (0123abcd)"."""
    number = message.flight_sw_version
    release = ".".join(str(number >> shift & 0xFF) for shift in (24, 16, 8))
    stage = _STAGES.get(number & 0xFF, "")
    commit = bytes(message.flight_custom_version)
    # ArduPilot's are letters, PX4's a number of eight bytes, the least first.
    text = commit.decode("ascii", "replace") if commit.isalnum() else commit[::-1].hex()
    return f"{release}{stage} ({text[:8]})"


#: FIRMWARE_VERSION_TYPE of MAVLink; a release has no word.
_STAGES = {0: "-dev", 64: "-alpha", 128: "-beta", 192: "-rc"}
