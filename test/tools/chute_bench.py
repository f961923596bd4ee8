"""The command chute as a process of its own, at a terminal or not."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import tty
from pathlib import Path

ROOT = Path(__file__).parents[2]
COMMAND = [sys.executable, "-m", "chute_ros.tools.chute"]
#: What a text from the network must never bring to a terminal.
CONTROL = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e]")


class Command:
    """One run. Its output is read when it has ended."""

    def __init__(self, *arguments, redirected=""):
        self.process = subprocess.Popen(
            # A shell, which it replaces, opens and closes its streams.
            ["bash", "-c", f'exec "$@" {redirected}', "bash", *COMMAND, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )

    def ended(self):
        """(exit code, standard output, standard error), once it has ended."""
        out, err = self.process.communicate(timeout=60.0)
        return self.process.returncode, out, err


def run(bench, *arguments, namespace=None, redirected=""):
    """Run it for the vehicle of this bench, which lives on meanwhile. redirected: its streams, as
    in a shell."""
    (told,) = run_together(bench, arguments, namespace=namespace, redirected=redirected)
    return told


def run_together(bench, *lines, namespace=None, redirected=""):
    """The same for several commands that begin at once: what each of them made of it."""
    named = ("--namespace", namespace or bench.namespace)
    commands = [Command(*named, *line, redirected=redirected) for line in lines]
    for line, command in zip(lines, commands, strict=True):
        ended = command.process.poll
        bench.until(lambda ended=ended: ended() is not None, f"chute {line[0]} ends", 60.0)
    return [command.ended() for command in commands]


class AtTerminal:
    """One run at a terminal of so many rows."""

    def __init__(self, bench, *arguments, rows=40, columns=100):
        self._bench = bench
        self.shown = ""
        ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        os.set_blocking(ours, False)
        self._ours, self._theirs = ours, theirs
        self.settings = termios.tcgetattr(theirs)
        self.process = subprocess.Popen(
            [*COMMAND, "--namespace", bench.namespace, *arguments],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            # Ctrl-C is a signal to whoever has the terminal.
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # noqa: PLW1509
            cwd=ROOT,
            env={**os.environ, "TERM": "xterm-256color"},
        )

    def reads(self, text):
        """Wait until this is shown."""
        self._bench.until(lambda: text in self._read(), f"{text!r} is shown")

    def types(self, text):
        """A person types."""
        os.write(self._ours, text.encode())

    def end(self):
        """Wait for its end; the exit code."""
        self._bench.until(
            lambda: self._read() and self.process.poll() is not None, "it ends", 60.0
        )
        self._read()
        return self.process.returncode

    def is_as_before(self):
        """The terminal echoes and takes lines again, its own screen is back, with a cursor."""
        modes = termios.tcgetattr(self._theirs)[tty.LFLAG] == self.settings[tty.LFLAG]
        return modes and self.shown.rindex("\x1b[?1049l") > self.shown.rindex("\x1b[?1049h")

    def close(self):
        """Whatever happened."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        os.close(self._ours)
        os.close(self._theirs)

    def _read(self):
        try:
            while data := os.read(self._ours, 65536):
                self.shown += data.decode()
        except BlockingIOError:
            pass
        return self.shown
