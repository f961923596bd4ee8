"""A wire that can be cut and restored, as by somebody who pulls a plug."""

from __future__ import annotations

from collections.abc import Hashable

from chute_ros.sim.acting import NotNowError
from chute_ros.transport.wire import ServingWire, Wire


class SwitchedWire:
    """Cut, nothing passes either way. pulled: cut, it is also not there any more for who has it
    open at the other end, as a USB cable is; restored, it is there again under its name."""

    def __init__(self, wire: Wire, pulled: bool = False) -> None:
        self._wire, self._pulled = wire, pulled
        self.is_cut = False

    @property
    def is_open(self) -> bool:
        return self.is_cut or self._wire.is_open

    def open(self) -> None:
        if not self.is_cut:
            self._wire.open()

    def close(self) -> None:
        self._wire.close()

    def files(self) -> list[int]:
        return self._wire.files()

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        chunks = self._wire.read(file)
        # The end of a stream is no data: the link must know of it all the same.
        return [(data, stream) for data, stream in chunks if not (self.is_cut and data)]

    def data_heard(self, stream: Hashable, framed: bool, now: float) -> None:
        if isinstance(self._wire, ServingWire):
            self._wire.data_heard(stream, framed, now)

    def write(self, data: bytes) -> None:
        if not self.is_cut:
            self._wire.write(data)

    def describe(self) -> str:
        return self._wire.describe()

    def cut(self) -> None:
        """From now on nothing passes."""
        self.is_cut = True
        if self._pulled:
            self._wire.close()

    def restore(self) -> None:
        """All passes again. NotNowError: it cannot be opened again."""
        try:
            if not self._wire.is_open:
                self._wire.open()
        except OSError as error:
            raise NotNowError(f"{self._wire.describe()} cannot be opened: {error}") from None
        self.is_cut = False
