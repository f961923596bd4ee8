"""Commands: called here, or in processes of their own."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


def ended(command: Iterable[object], **environment: str) -> tuple[int, str, str]:
    """The exit code, output and errors of a process."""
    done = subprocess.run(
        [*map(str, command)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120.0,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def tool(name: str, *arguments: object, **environment: str) -> tuple[int, str, str]:
    """The same of a tool."""
    return ended([sys.executable, "-m", f"chute_ros.tools.{name}", *arguments], **environment)


def call(command: ModuleType, monkeypatch, *arguments: str) -> None:
    """With these arguments, as from a terminal."""
    monkeypatch.setattr(sys, "argv", [command.__name__, *arguments])
    command.main()


def refused(command: ModuleType, monkeypatch, capsys, *arguments: str) -> tuple[str, str]:
    """Called with a mistake: output and errors as it ends with 2."""
    with pytest.raises(SystemExit) as ended:
        call(command, monkeypatch, *arguments)
    assert ended.value.code == 2
    out, errors = capsys.readouterr()
    return out, errors


def assert_refused(command: ModuleType, monkeypatch, capsys, arguments, words: str) -> None:
    """A mistake is said at once, and nothing is begun."""
    out, errors = refused(command, monkeypatch, capsys, *arguments)
    assert words in errors
    assert out == ""


#: As its executable, but it tells how far it is from the first flight on. orjson crashes by a
#: Ctrl-C in the middle of its import, which a flight of a rocket would begin.
#: A Ctrl-C ends it also where whoever runs the tests ignores one (a script's background job).
_TELLS_AT_ONCE = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
import orjson
from chute_ros.tools import {name}_command as command
{changed}
command._TELL_EVERY = 0.0
from chute_ros.tools.entry import run
run("{name}", "{name}_command")
"""


@contextlib.contextmanager
def flying(name: str, *arguments: str, changed: str = "") -> Iterator[subprocess.Popen[str]]:
    """A campaign of hours that has begun, in processes of its own; none of them is left. changed:
    code that it runs first."""
    code = _TELLS_AT_ONCE.format(name=name, changed=changed)
    with subprocess.Popen(
        [sys.executable, "-X", "faulthandler", "-c", code, "--flights", "100000", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def interrupted(process: subprocess.Popen[str]) -> tuple[str, str, str]:
    """Its first line of progress, and all that it wrote after a Ctrl-C: out and err. As in a
    terminal, where every process of the command gets the signal."""
    assert process.stderr is not None
    first = process.stderr.readline()
    os.killpg(process.pid, signal.SIGINT)
    try:
        out, err = process.communicate(timeout=120.0)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGABRT)  # it tells where it hangs
        out, err = process.communicate()
    assert process.returncode == 130, err
    assert "Traceback" not in err
    return first, out, err
