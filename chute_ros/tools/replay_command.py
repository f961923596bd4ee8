"""Decides a recorded flight again and compares decision by decision.

Without --config the settings are those of the recording, and every output must be the same,
bit for bit. With --config the settings are those of that ROS parameter file (a parameter that it
does not name has its default, as for the node); a table and a picture show the differences. The
vehicle's motion remains the recorded one: a recording does not show how a flight would have
continued after another decision.
"""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from typing import Any

from chute_ros.errors import ChuteError
from chute_ros.plain_text import plain
from chute_ros.supervisor.codec import CLASS
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.record import CODEC
from chute_ros.tools.page_file import SVG, write_page
from chute_ros.tools.parameter_file import NODE, other_from
from chute_ros.tools.progress import Progress
from chute_ros.tools.recording import Recording, read
from chute_ros.tools.recording_options import complain, recording_options, remark
from chute_ros.tools.recordings import chosen, listed
from chute_ros.tools.replay_picture import Track, picture
from chute_ros.tools.replaying import Other, Replayer, Row, require_replayable, rows

SAME, DIFFERS, UNREADABLE = 0, 1, 2
_PROFILE = "profile.name"


def main() -> None:
    """Exit code 0: the same decisions; 1: others; 2: the recording cannot be read, or which one
    of several is not known."""
    options = recording_options("replay", __doc__)
    options.add_argument(
        "--config", type=Path, metavar="YAML", help="decide with this ROS parameter file instead"
    )
    options.add_argument(
        "--picture",
        type=Path,
        metavar="SVG",
        help="output file of the timeline (default with --config: FILE.replay.svg)",
    )
    given = options.parse_args()
    try:
        code = _replay(_files(given.files, given.recording), given.config, given.picture)
    except ChuteError as error:
        complain("replay", error)
        code = UNREADABLE
    sys.exit(code)


def _files(paths: list[Path], number: int | None) -> list[Path]:
    found = chosen(paths, number, partial(remark, "replay"))
    if len(found) > 1:
        text = f"{len(found)} recordings: choose one with --recording NUMBER, or name its files"
        raise ChuteError(f"{text}\n{listed(found)}")
    return found[0].files


def _replay(files: list[Path], config: Path | None, wanted: Path | None) -> int:
    recording = read(files, {})
    require_replayable(recording.turns)
    other = other_from(config, f"{recording.namespace}/{NODE}") if config else None
    for one in recording.remarks:
        print(f"remark: {plain(one)}")
    if other is not None:
        _print_settings(recording, other)
    then, now = Replayer(), Replayer(other)
    before, after = Track("recorded"), Track("replayed")
    found: list[Row] = []
    progress = Progress("replaying", len(recording.turns))
    for number, turn in enumerate(recording.turns):
        progress.at(number)
        if other is not None:
            then.step(turn)
        outputs = now.step(turn)
        if outputs is None:
            continue
        seconds = recording.seconds(turn.wall)
        before.follow(seconds, then.state if other is not None else now.state, turn.turn.outputs)
        after.follow(seconds, now.state, outputs)
        found += rows(turn, outputs, exact=other is None)
    _print_rows(recording, found)
    if wanted is None and other is not None:
        wanted = files[0].with_name(f"{files[0].name}.replay.svg")
    if wanted is not None:
        read_here = [*files, *([config] if config else [])]
        write_page(wanted, picture(recording, before, after), SVG, read_here)
    return _print_end(recording, found, now, wanted)


def _print_settings(recording: Recording, other: Other) -> None:
    """What the other settings change."""
    old = next(one.config for one in recording.turns if one.config is not None)
    was, would_be = _settings(old), _settings(other.config)
    print("settings that differ:")
    different = [name for name in {**was, **would_be} if was.get(name) != would_be.get(name)]
    if _PROFILE in different:
        # Another set of rules differs in everything.
        different = [name for name in different if name == _PROFILE or "profile." not in name]
    for name in different:
        print(plain(f"  {name}: {was.get(name, 'none')} -> {would_be.get(name, 'none')}"))
    if other.mode is not None:
        print(f"  mode at the start: {other.mode.name}")
    if not different and other.mode is None:
        print("  none")


def _settings(config: SupervisorConfig) -> dict[str, str]:
    """Every single setting: where it is -> its value, to the last bit."""
    found: dict[str, str] = {}

    def collect(name: str, value: Any) -> None:
        if isinstance(value, dict):
            for key, one in value.items():
                if key != CLASS:
                    collect(f"{name}.{key}" if name else key, one)
        elif isinstance(value, list) and any(isinstance(one, (dict, list)) for one in value):
            for number, one in enumerate(value):
                collect(f"{name}[{number}]", one)
        else:
            found[name] = json.dumps(value)

    collect("", CODEC.plain(config, whole=True))
    return found


def _print_rows(recording: Recording, found: list[Row]) -> None:
    if found:
        print(f"\n{'time from start':>16}  decision")
    for row in found:
        when = f"{recording.seconds(row.wall):14.3f} s"
        if row.same:
            print(f"{when}  {plain(row.replayed)}")
            continue
        print(f"{when}  DIFFERENT")
        for name, text, reasons in (
            ("recorded", row.recorded, row.recorded_reasons),
            ("replayed", row.replayed, row.replayed_reasons),
        ):
            print(f"{'':18}{name}: {plain(text) or 'nothing'}")
            for reason in reasons:
                print(f"{'':28}{plain(reason)}")


def _print_end(recording: Recording, found: list[Row], now: Replayer, wrote: Path | None) -> int:
    different = sum(not row.same for row in found)
    replayed = len(recording.turns) - now.skipped
    print(f"\n{replayed} turns replayed, {len(found)} decisions and alarms, {different} different")
    if now.skipped:
        print(f"{now.skipped} turns could not be replayed: the state before them is missing")
    for wall in now.strayed:
        print(f"{recording.seconds(wall):.3f} s: the state differs from the recorded one")
    if wrote is not None:
        print(f"picture: {wrote}")
    if different or now.strayed:
        return DIFFERS
    print("the same decisions")
    return SAME
