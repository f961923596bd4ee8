"""What a node on a DroneCAN bus can be told to be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.allocation import UNIQUE_ID_LENGTH
from chute_ros.protocol.dronecan.calls import CallLimits
from chute_ros.protocol.dronecan.transfer import HIGHEST_NODE_ID

#: Bytes of a node's name (uavcan.protocol.GetNodeInfo).
_LONGEST_NAME = 80


@dataclass(frozen=True)
class BusNodeConfig:
    """Who we are on the bus, and which of its offices we hold."""

    node_id: int
    name: str
    unique_id: bytes
    calls: CallLimits = field(default=CallLimits())
    allocator: bool = True
    #: To another allocator, and until it is known that there is none.
    allocator_yields: bool = False
    table: Mapping[bytes, int] = field(default_factory=dict)
    #: Node ids that are never given out, besides our own.
    never: tuple[int, ...] = ()
    time_master: bool = True
    utc_offset: float = 0.0

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= HIGHEST_NODE_ID:
            raise ParameterError(f"node_id is {self.node_id}: need 1 to {HIGHEST_NODE_ID}")
        if not 1 <= len(self.name.encode()) <= _LONGEST_NAME:
            raise ParameterError(f"name is {self.name!r}: need 1 to {_LONGEST_NAME} bytes")
        if len(self.unique_id) != UNIQUE_ID_LENGTH:
            raise ParameterError(
                f"unique_id has {len(self.unique_id)} bytes: need {UNIQUE_ID_LENGTH}"
            )
        if not math.isfinite(self.utc_offset):
            raise ParameterError(f"utc_offset is {self.utc_offset}: need a number of seconds")
