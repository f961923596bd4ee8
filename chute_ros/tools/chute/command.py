"""Runs one command of chute, and turns whatever ends it into one line and an exit code."""

from __future__ import annotations

import importlib
import os
import sys

from chute_ros.errors import ChuteError
from chute_ros.not_installed import remedy
from chute_ros.plain_text import plain
from chute_ros.tools.chute.errors import CommandError, MistakeError
from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.options import MISTAKE, NOT_WELL, Chosen, parse
from chute_ros.tools.chute.surroundings import installed_middlewares, surroundings

#: Command -> its module here.
_PLACES = {
    **dict.fromkeys(("arm", "disarm", "deploy", "kill", "reset", "mode"), "orders"),
}
#: It tells that mistake among its findings.
_DOCTOR = "doctor"


def main() -> None:
    """Exit codes: options.EPILOG."""
    # A name from the network may not be in the terminal's alphabet.
    sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    sys.stderr.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    chosen = parse()
    sys.exit(_run(chosen))


def _run(chosen: Chosen) -> int:
    try:
        around = surroundings(os.environ, installed_middlewares())
        if chosen.command != _DOCTOR and (mistake := around.mistake()):
            # ROS would end the process as soon as it is imported.
            raise MistakeError(mistake)
        # Here: a mistake in the command line is told without ROS, and doctor runs without it.
        place = _PLACES.get(chosen.command, chosen.command)
        module = importlib.import_module(f"chute_ros.tools.chute.{place}")
        return int(module.main(chosen))
    except ImportError as error:
        return _complain(chosen, CommandError(remedy(error) or str(error)))
    except ChuteError as error:
        return _complain(chosen, error)


def _complain(chosen: Chosen, error: ChuteError) -> int:
    for line in f"chute: {error}".splitlines():
        print(plain(line), file=sys.stderr)
    if chosen.json:
        details = error.details if isinstance(error, CommandError) else {}
        print(json_text({"error": str(error), **details}))
    return MISTAKE if isinstance(error, MistakeError) else NOT_WELL
