"""A process, and the lines that it has printed."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading


class PrintingProcess:
    """A module with its arguments. errors: where its standard error goes, with the lines if not
    given; before: is called in the new process."""

    def __init__(
        self, module, *arguments, environment=None, errors=subprocess.STDOUT, before=None
    ):
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            preexec_fn=before,  # noqa: PLW1509
        )
        self.lines = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip())

    def said(self, text):
        """The first line with this text; None: there is none."""
        return next((line for line in self.lines if text in line), None)

    def end(self, number=signal.SIGINT, seconds=20.0):
        """Its exit code after this signal, or of its own end."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        code = self.process.wait(seconds)
        self._reader.join()
        self.process.stdout.close()
        return code
