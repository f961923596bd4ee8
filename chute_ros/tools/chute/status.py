"""`chute status`: the state of the vehicle, and why, once."""

from __future__ import annotations

from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.listening import Listening
from chute_ros.tools.chute.options import DONE, NOT_WELL, Chosen
from chute_ros.tools.chute.session import opened
from chute_ros.tools.chute.status_text import status_lines


def main(chosen: Chosen) -> int:
    """Exit code 0: the vehicle is well (view.WELL); 1: it is not, or was not received."""
    within = chosen.wait()
    with opened(chosen.namespace) as session:
        listening = Listening(session)
        if not session.until(listening.view, within):
            raise session.not_heard("no supervisor is received", within)
        picture = listening.whole(within)
    assert picture is not None
    if chosen.json:
        print(json_text(picture))
    else:
        print("\n".join(line.text for line in status_lines(picture)))
    return DONE if picture.well else NOT_WELL
