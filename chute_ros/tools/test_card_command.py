"""Writes the card of a deployment that was tried: an HTML page to be printed and signed.

It has the files and their hashes, the settings and their hash, the versions of the nodes, what was
measured of each release and of the descent, and lines for what a person must fill in by hand.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from chute_msgs.msg import PersonRequest, SafetyDecision
from diagnostic_msgs.msg import DiagnosticArray

from chute_ros.tools.flight_story import DECISION, PERSON, tell
from chute_ros.tools.recording import read
from chute_ros.tools.recording_options import write_pages
from chute_ros.tools.releases import releases
from chute_ros.tools.test_card_page import DIAGNOSTICS, card
from chute_ros.transport.regular_file import open_regular


def main() -> None:
    """Exit code 0: written; 2: a recording cannot be read, or a page cannot be written."""
    write_pages("test_card", __doc__, ".card.html", test_card)


def test_card(files: list[Path]) -> str:
    """The card of these files; RecordError if they cannot be read."""
    kinds = {DECISION: SafetyDecision, PERSON: PersonRequest, DIAGNOSTICS: DiagnosticArray}
    recording = read(files, kinds)
    story = tell(recording)
    hashes = [(path.name, _hash(path)) for path in files]
    end = recording.seconds(recording.turns[-1].wall)
    return card(recording, story, releases(story, end), hashes)


def _hash(path: Path) -> str:
    with open_regular(path) as file:
        return hashlib.sha256(file.read()).hexdigest()
