"""What the commands of bench share: options, children, and the file that is written."""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from bench.report import document
from chute_ros.errors import ChuteError
from chute_ros.tools.isolation import isolated_ros
from chute_ros.tools.processes import Processes

T = TypeVar("T")
Number = TypeVar("Number", int, float)


class Part(Protocol):
    """A module that measures something."""

    #: Of its section; parts that follow each other under one heading share the section.
    HEADING: str

    def add_options(self, options: argparse.ArgumentParser) -> None:
        """How much is measured."""

    def section(self, chosen: argparse.Namespace) -> str:
        """Measure; the section without its heading."""


def at_least(kind: Callable[[str], Number], lowest: Number) -> Callable[[str], Number]:
    """The type of an option."""

    def value(text: str) -> Number:
        given = kind(text)
        if not given >= lowest:
            raise argparse.ArgumentTypeError(f"need {lowest} or more")
        return given

    return value


def run(program: str, description: str, parts: Sequence[Part], output: Path | None = None) -> None:
    """Measure, print, and write if there is a file to write to. output: where else not said."""
    options = argparse.ArgumentParser(program, description=description)
    for part in parts:
        part.add_options(options)
    where = f"default: {output}" if output else "default: only print"
    options.add_argument("--output", type=Path, default=output, help=where)
    chosen = options.parse_args()
    if chosen.output and not chosen.output.parent.is_dir():
        options.error(f"--output: there is no folder {chosen.output.parent}")
    # The children must end however this ends.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("bench: terminated"))
    try:
        text = document([(part.HEADING, part.section(chosen)) for part in parts])
    except KeyboardInterrupt:
        sys.exit("bench: interrupted")
    except ChuteError as error:
        sys.exit(f"bench failed: {error}")
    if chosen.output:
        chosen.output.write_text(text)
    print(text)


def with_children(measure: Callable[[str, Processes], T]) -> T:
    """measure(namespace, children) in a ROS of its own; all children end with it."""
    with tempfile.TemporaryDirectory(prefix="chute_ros_bench_") as folder:
        children = Processes(Path(folder))
        try:
            with isolated_ros() as namespace:
                return measure(namespace, children)
        except (ChuteError, OSError) as error:
            logs = "\n".join(children.tail(name) for name in children.names())
            sys.exit(f"bench failed: {error}\n{logs}")
        finally:
            children.end()
