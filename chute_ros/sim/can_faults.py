"""Faults of a CAN bus between a device and its wire: what can happen to frames of a transfer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack
from chute_ros.sim.faults import FaultKnobs, FaultyLink, flip_a_byte

_TOGGLE, _START, _END = 0x20, 0x80, 0x40
#: A frame that is overtaken comes this much later, s.
OVERTAKEN = 0.002


@dataclass(frozen=True)
class CanFaultKnobs(FaultKnobs):
    """Probabilities, 0 to 1 a frame and direction; half: a transfer of several frames."""

    #: A frame comes after those of the next 2 ms.
    reorder: float = 0.0
    #: A frame's toggle bit is wrong.
    toggle: float = 0.0
    #: Only the first frame of a transfer comes.
    half: float = 0.0


class CanFaultyLink(FaultyLink):
    """Stands between a loop and a device's link, and spoils the frames in both directions.

    Corrupt spoils a byte of a frame's data: a frame with another identifier or length would be
    none that somebody has sent. What is no frame of DroneCAN passes untouched.
    """

    def __init__(self, link: Any, knobs: CanFaultKnobs, seed: int) -> None:
        super().__init__(link, replace(knobs, corrupt=0.0), seed)
        self._can_knobs = knobs
        #: Identifiers whose transfer is not finished.
        self._cut: set[int] = set()

    def _spoil(self, data: bytes, now: float) -> list[tuple[float, bytes]]:
        frame = unpack(data)
        if frame is None or frame.error or frame.remote or not frame.extended or not frame.data:
            return [(now, data)]
        knobs, chance = self._can_knobs, self._random.random
        tail = frame.data[-1]
        if tail & _START:
            self._cut.discard(frame.identifier)
            if not tail & _END and chance() < knobs.half:
                self._cut.add(frame.identifier)
        elif frame.identifier in self._cut:
            return []
        if chance() < knobs.toggle:
            frame = replace(frame, data=frame.data[:-1] + bytes((tail ^ _TOGGLE,)))
        later = OVERTAKEN if chance() < knobs.reorder else 0.0
        return [
            (when + later, pack(self._corrupted(frame))) for when, _ in super()._spoil(data, now)
        ]

    def _corrupted(self, frame: CanFrame) -> CanFrame:
        """The frame with one byte of its data wrong, if it is its turn."""
        if self._random.random() >= self._can_knobs.corrupt:
            return frame
        return replace(frame, data=flip_a_byte(frame.data, self._random))
