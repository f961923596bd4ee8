"""The cable under the operator's chair: starts a ground station on a host, orders, reads along."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from chute_ros.errors import ChuteError

_END_TIMEOUT = 5.0  # s
_CHUNK = 1 << 16
Told = dict[str, Any]


class StationEndedError(ChuteError):
    """The ground station's process has ended by itself. The text shows what it wrote."""


class GroundStationLink:
    """on: what the command begins with on its host; more: of its command line; environment: beside
    that of this process; a value of None takes the name out."""

    def __init__(
        self,
        log: Path,
        vehicles: Sequence[str],
        *more: str,
        on: Sequence[str] = (),
        environment: Mapping[str, str | None] | None = None,
    ) -> None:
        self._log = log
        self._tokens = itertools.count(1)
        self._rest = b""
        #: All that it has told, in order.
        self.told: list[Told] = []
        every = {**os.environ, **(environment or {})}
        with log.open("wb") as errors:
            self.process = subprocess.Popen(
                [*on, sys.executable, "-m", "faults.ground_station", *more, *vehicles],
                env={name: value for name, value in every.items() if value is not None},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
            )
        assert self.process.stdout is not None
        os.set_blocking(self.process.stdout.fileno(), False)

    def close(self) -> None:
        """It ends."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(_END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def call(self, vehicle: str, service: str, **fields: Any) -> int:
        """Call a service; the token of this call."""
        token = next(self._tokens)
        self._order(call=token, vehicle=vehicle, service=service, fields=fields)
        return token

    def give_up(self, token: int) -> None:
        """The caller goes; there is no way back for its client."""
        self._order(give_up=token)

    def ask_diagnostics(self) -> None:
        """Have it tell the newest status of each task."""
        self._order(diagnostics=True)

    def ask_topics(self) -> None:
        """Have it tell all topics that it knows of."""
        self._order(topics=True)

    def read(self) -> None:
        """Take in what it has told since."""
        assert self.process.stdout is not None
        while chunk := self.process.stdout.read(_CHUNK):
            *lines, self._rest = (self._rest + chunk).split(b"\n")
            self.told += [json.loads(line) for line in lines]
        if self.process.poll() is not None:
            raise StationEndedError(
                f"the ground station ended with code {self.process.returncode}:\n"
                + self._log.read_text(errors="replace")[-2000:]
            )

    def find(self, since: float = 0.0, **wanted: Any) -> Iterator[Told]:
        """What it has told since then that has these fields; a field of ... only has to be
        there."""
        self.read()
        for one in self.told:
            if one["at"] >= since and all(
                name in one and (value is ... or one[name] == value)
                for name, value in wanted.items()
            ):
                yield one

    def first(self, since: float = 0.0, **wanted: Any) -> Told | None:
        """The first of find."""
        return next(self.find(since, **wanted), None)

    def _order(self, **order: Any) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(order).encode() + b"\n")
        self.process.stdin.flush()
