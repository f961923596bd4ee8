"""Faults of a CAN bus between a device and its wire: what can happen to frames of a transfer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.can_frame import SIZE, CanFrame, pack, unpack
from chute_ros.sim.faults import FaultKnobs, FaultyLink

_TOGGLE, _START, _END = 0x20, 0x80, 0x40
#: A frame that is overtaken comes this much later, s.
_OVERTAKEN = 0.002


@dataclass(frozen=True)
class CanFaultKnobs(FaultKnobs):
    """Probabilities, 0 to 1 a frame and direction; half: a transfer."""

    reorder: float = 0.0
    toggle: float = 0.0
    half: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("reorder", "toggle", "half"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ParameterError(f"{name} is {getattr(self, name)}: need 0 to 1")


class CanFaultyLink(FaultyLink):
    """Stands between a loop and a device's link, and spoils the frames in both directions."""

    def __init__(self, link: Any, knobs: CanFaultKnobs, seed: int) -> None:
        super().__init__(link, knobs, seed)
        self._can_knobs = knobs
        #: Identifiers whose transfer is not finished.
        self._cut: set[int] = set()

    def _spoil(self, data: bytes, now: float) -> list[tuple[float, bytes]]:
        frame = unpack(data) if len(data) == SIZE else None
        if frame is None or not frame.data:
            return super()._spoil(data, now)
        knobs, chance = self._can_knobs, self._random.random
        tail = frame.data[-1]
        if tail & _START:
            self._cut.discard(frame.identifier)
            if not tail & _END and chance() < knobs.half:
                self._cut.add(frame.identifier)
        elif frame.identifier in self._cut:
            return []
        if chance() < knobs.toggle:
            frame = CanFrame(frame.identifier, frame.data[:-1] + bytes((tail ^ _TOGGLE,)))
        later = _OVERTAKEN if chance() < knobs.reorder else 0.0
        return [(when + later, one) for when, one in super()._spoil(pack(frame), now)]
