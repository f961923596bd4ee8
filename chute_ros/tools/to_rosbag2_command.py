"""Writes each recorded flight as a folder that `ros2 bag info`, `play` and PlotJuggler take.

Messages, times and quality of service remain the recorded ones. What a file has before a power cut
or beside damage is converted, and the rest is named on standard error.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.plain_text import plain
from chute_ros.tools.mcap_entries import Entry, McapEntries
from chute_ros.tools.progress import Progress
from chute_ros.tools.recording import utc
from chute_ros.tools.recording_options import make_each, recording_options
from chute_ros.tools.rosbag2_folder import Rosbag2Folder

#: A pause so long (s) is no pause of a supervisor, which records several times a second.
_PAUSE = 10.0


def main() -> None:
    """Exit code 0: written; 2: a recording cannot be read, or a folder cannot be written."""
    options = recording_options("to_rosbag2", __doc__)
    options.add_argument(
        "--output", type=Path, metavar="FOLDER", help="folder to make (default: FILE.rosbag2)"
    )
    given = options.parse_args()
    made = make_each("to_rosbag2", given, "one folder", _convert)
    if made:
        _tell(
            "play where no vehicle receives it: a recorded request or heartbeat is one to every "
            "node in the same domain"
        )
    sys.exit(0 if made else 2)


def _convert(files: list[Path], given: Path | None) -> None:
    output = given or files[0].with_suffix(".rosbag2")
    for remark in convert(files, output):
        _tell(remark)
    print(output, flush=True)


def convert(files: list[Path], output: Path) -> list[str]:
    """Make the folder output of these files in their order; what was not in order, one line each.
    ChuteError: nothing was made."""
    try:
        output.mkdir()
    except FileExistsError:
        raise ChuteError(f"{output} exists: remove it, or name another with --output") from None
    except OSError as error:
        raise ChuteError(f"{output}: {error.strerror or error}") from None
    remarks: list[str] = []
    try:
        with closing(Rosbag2Folder(output)) as bag:
            last = 0
            for entry in _entries(files, remarks):
                if last and not 0 <= entry.time - last < _PAUSE * 1e9:
                    remarks.append(_jump(last, entry.time))
                last = entry.time
                bag.write(entry)
            bag.finish()
    except BaseException as error:
        shutil.rmtree(output, ignore_errors=True)
        if isinstance(error, OSError):
            raise ChuteError(f"{output}: {error.strerror or error}") from None
        raise
    return remarks


def _entries(files: list[Path], remarks: list[str]) -> Iterator[Entry]:
    """All messages of all files."""
    for path in files:
        entries = McapEntries(path)
        progress = Progress(f"converting {path.name}", path.stat().st_size)
        for entry in entries:
            progress.at(entries.position)
            yield entry
        remarks += entries.remarks


def _jump(last: int, time: int) -> str:
    """Times of two successive messages (Unix ns), in words."""
    seconds = (time - last) / 1e9
    if seconds < 0.0:
        return f"the clock was set back by {-seconds:.3f} s after {utc(last)} UTC: played by clock"
    return f"no message for {seconds:.0f} s after {utc(last)} UTC: `ros2 bag play` waits as long"


def _tell(text: str) -> None:
    print(plain(f"to_rosbag2: {text}"), file=sys.stderr)
