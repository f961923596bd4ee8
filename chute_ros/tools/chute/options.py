"""The command line of chute: its commands, and what all of them take."""

from __future__ import annotations

import argparse
import math
import os
import re
from dataclasses import dataclass
from typing import Any

from chute_ros.plain_text import plain

DONE, NOT_WELL, MISTAKE = 0, 1, 2
NAMESPACE = "CHUTE_NAMESPACE"
#: Waits if --timeout does not say otherwise, s: for the vehicle's first word, and for an answer: a
#: deploy with a kill before it takes 14 s at most by the supervisor's defaults.
HEARING, ANSWER = 5.0, 30.0
_LONGEST = 3600.0
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")

EPILOG = """exit codes: 0 done, or the vehicle is well; 1 refused, failed, not well or not
received; 2 a mistake in the command line, nothing was sent; 74 standard output
cannot be written; 130 ended by Ctrl-C; 141 nobody reads on (docs/guide/command.md)"""


@dataclass(frozen=True)
class Chosen:
    """What was chosen. timeout: s, None: the defaults. more: of this command."""

    command: str
    namespace: str
    timeout: float | None
    json: bool
    more: argparse.Namespace

    def wait(self, default: float = HEARING) -> float:
        """How long something may take, s."""
        return default if self.timeout is None else self.timeout


def parse(arguments: list[str] | None = None) -> Chosen:
    """From the command line; a mistake in it ends the process with code 2."""
    chosen = _parser().parse_args(arguments)
    return Chosen(chosen.command, chosen.namespace, chosen.timeout, chosen.json, chosen)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "chute",
        description="The state of a vehicle and its parachutes, orders to it, and its set-up.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    _common(parser, os.environ.get(NAMESPACE) or "/", None, False)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def add(name: str, told: str) -> argparse.ArgumentParser:
        one = commands.add_parser(
            name,
            help=told,
            description=f"{told[0].upper()}{told[1:]}.",
            epilog=EPILOG,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        # Also after the command; what was given before it stays.
        _common(one, *[argparse.SUPPRESS] * 3)
        return one

    add("status", "show the state of the vehicle and why, once")
    add("watch", "show the same on a full screen until q is pressed; --json: a line per change")
    for name in ("arm", "disarm"):
        _link(add(name, f"{name} the parachutes of the vehicle"))
    deploy = add("deploy", "RELEASE the parachute; asks for the typed word DEPLOY")
    _link(deploy)
    _fires(deploy)
    deploy.add_argument(
        "--force", action="store_true", help="overrule the checks that a person may overrule"
    )
    kill = add("kill", "STOP the motors, then deploy where that helps; asks for the word KILL")
    _fires(kill)
    kill.add_argument("--only", action="store_true", help="the motors alone, no deploy after it")
    add("reset", "back to the start after landing or a test")
    mode = add("mode", "set the mode of the supervisor")
    mode.add_argument("mode", choices=["ACTIVE", "SHADOW", "INHIBITED"], type=str.upper)
    mode.add_argument("--force", action="store_true", help="although the vehicle is in flight")
    _reason(mode)
    add("diagnostics", "show the diagnostics of the vehicle's nodes, worst first").add_argument(
        "--all", action="store_true", help="with every value"
    )
    parameters = add("parameters", "show the parameters of the nodes; * differs from the default")
    parameters.add_argument("node", nargs="?", type=_name, help="of this node alone")
    parameters.add_argument("--changed", action="store_true", help="only those that differ")
    add("record", "show where the black box is, whether it records, and its newest files")
    add("doctor", "look for what goes wrong in the field, each finding with its remedy")
    return parser


def _common(parser: argparse.ArgumentParser, namespace: Any, timeout: Any, json: Any) -> None:
    parser.add_argument(
        "--namespace",
        type=_namespace,
        default=namespace,
        metavar="NS",
        help=f"of the vehicle (default: the environment variable {NAMESPACE}, else /)",
    )
    parser.add_argument(
        "--timeout",
        type=_seconds,
        default=timeout,
        metavar="SECONDS",
        help=f"longest wait for the vehicle's first word (default: {HEARING:g}; watch: no limit) "
        f"and for the answer of an order (default: {ANSWER:g})",
    )
    parser.add_argument(
        "--json", action="store_true", default=json, help="print one JSON object instead of text"
    )


def _link(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--link",
        type=_name,
        metavar="NAME",
        help="by this device node, past the supervisor",
    )


def _fires(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--yes", action="store_true", help="do not ask")
    _reason(parser)


def _reason(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--reason", default="", metavar="TEXT", help="goes into the record")


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= _LONGEST:
        raise argparse.ArgumentTypeError(
            f"{plain(text)[:40]!r} is no time: need seconds above 0, up to {_LONGEST:g}"
        )
    return value


def _namespace(text: str) -> str:
    names = text.strip("/").split("/") if text.strip("/") else []
    if not text or not all(map(_NAME.fullmatch, names)):
        raise argparse.ArgumentTypeError(
            f"{plain(text)[:80]!r} is no namespace: need / or names of letters, digits and _, "
            "such as /drone1"
        )
    return "/" + "/".join(names)


def _name(text: str) -> str:
    if not _NAME.fullmatch(text):
        raise argparse.ArgumentTypeError(
            f"{plain(text)[:80]!r} is no name of a node: need letters, digits and _, such as "
            "mavlink_parachute"
        )
    return text
