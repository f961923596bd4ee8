"""What was found: each kept in a file that replays it, with what was wrong beside it."""

from __future__ import annotations

import hashlib
import time
import traceback
from pathlib import Path

from fuzz.target import Target, attempt, live_long


class Findings:
    """Those of one run of a target. The same mistake is kept once, by where it was raised."""

    def __init__(self, target: Target, folder: Path) -> None:
        self._target = target
        self._folder = folder
        self._places: set[tuple[str, ...]] = set()
        self.slowest = 0.0
        self.largest = 0
        #: What went into single inputs and into long lives, s of the processor: each half of it.
        self._single = self._long = 0.0

    def try_input(self, data: bytes) -> str:
        """Try one; the file that replays it if it is a new finding, or empty."""
        try:
            seconds = attempt(self._target, data)
            self.slowest = max(self.slowest, seconds)
            self._single += seconds
            if self._target.most and self._long <= self._single:
                self._live_long(data)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001
            # Whatever it is, it is the finding.
            return self._keep(data, error)
        return ""

    def _live_long(self, data: bytes) -> None:
        began = time.process_time()
        try:
            self.largest = max(self.largest, live_long(self._target, data))
        finally:
            self._long += time.process_time() - began

    def _keep(self, data: bytes, error: BaseException) -> str:
        place = place_of(error)
        if place in self._places:
            return ""
        self._places.add(place)
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"found-{hashlib.sha256(data).hexdigest()[:12]}"
        path.write_bytes(data)
        path.with_suffix(".txt").write_text("".join(traceback.format_exception(error)))
        return str(path)


def place_of(error: BaseException) -> tuple[str, ...]:
    """What it is, and the innermost places in the repository where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [one for one in frames if "chute_ros/" in one.filename or "fuzz/" in one.filename]
    kind = type(error).__name__
    if kind == "HangError":
        return (kind,)  # it may be interrupted anywhere
    return (kind, *(f"{one.filename}:{one.lineno}" for one in ours[-2:]))


def told(error: BaseException) -> str:
    """A finding in one line."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return text if len(text) <= 200 else f"{text[:197]}..."
