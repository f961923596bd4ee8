"""Several wires as one: a simulated device that is on two networks at once."""

from __future__ import annotations

from collections.abc import Hashable

from chute_ros.transport.wire import ServingWire, Wire


class WireBundle:
    """Reads from all its wires and writes to all."""

    def __init__(self, wires: list[Wire]) -> None:
        self._wires = wires
        self._read_last: object = None

    @property
    def is_open(self) -> bool:
        return all(wire.is_open for wire in self._wires)

    def open(self) -> None:
        for wire in self._wires:
            if not wire.is_open:
                wire.open()

    def close(self) -> None:
        for wire in self._wires:
            wire.close()

    def files(self) -> list[int]:
        return [file for wire in self._wires for file in wire.files()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        for wire in self._wires:
            if file in wire.files():
                self._read_last = wire
                return wire.read(file)
        return []

    def data_heard(self, stream: Hashable, framed: bool, now: float) -> None:
        if isinstance(self._read_last, ServingWire):
            self._read_last.data_heard(stream, framed, now)

    def write(self, data: bytes) -> None:
        failure: OSError | None = None
        for wire in self._wires:
            try:
                wire.write(data)
            except OSError as error:
                # One network that is down must not keep the frame from the others.
                failure = error
        if failure is not None:
            raise failure

    def describe(self) -> str:
        return " + ".join(wire.describe() for wire in self._wires)
