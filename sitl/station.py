"""One end of a MAVLink network that a story speaks from: a ground station, or the bench."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Sequence
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame, FrameDecoder, FrameEncoder
from chute_ros.protocol.mavlink.signing import Signer
from sitl.routing import message_id

GROUND_STATION = (255, 190)
_MOST = 65536
#: What a story may ask for.
_HEEDED = frozenset(
    getattr(dialect, f"MAVLINK_MSG_ID_{name}")
    for name in ("HEARTBEAT", "SYS_STATUS", "PARAM_VALUE", "MISSION_REQUEST_INT",
                 "MISSION_REQUEST", "MISSION_ACK", "COMMAND_ACK", "SIM_STATE",
                 "HIL_STATE_QUATERNION", "STATUSTEXT",
                 "AUTOPILOT_VERSION", "HOME_POSITION")
)  # fmt: skip


class Station:
    """At a port of the router on loopback. ids: its own."""

    def __init__(
        self, port: int, ids: tuple[int, int] = GROUND_STATION, signer: Signer | None = None
    ) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.setblocking(False)
        self._encoder = FrameEncoder(*ids, signer)
        self._decoder = FrameDecoder()
        self._beat_at = -math.inf
        self._streams: dict[str, tuple[float, float, Callable[[], Any]]] = {}
        #: The newest message of each name that the autopilot (component 1) sent.
        self.newest: dict[str, Any] = {}
        self.heard_at: dict[str, float] = {}
        #: Parameters by name, as the autopilot told them.
        self.parameters: dict[str, float] = {}
        #: (command, result) of each acknowledgement for us.
        self.results: dict[int, int] = {}
        #: Mission item that is asked for; None: none is.
        self.wanted_item: int | None = None
        self.mission_ack: int | None = None
        #: What the autopilot said (STATUSTEXT), with the time.
        self.said: list[tuple[float, str]] = []

    def close(self) -> None:
        """Leave."""
        self._socket.close()

    def turn(self) -> None:
        """Take what came, send what is due."""
        now = time.monotonic()
        if now - self._beat_at >= 1.0:
            self._beat_at = now
            gcs, none = dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID
            self.send(dialect.MAVLink_heartbeat_message(gcs, none, 0, 0, 4, 3))
        for name, (interval, due, make) in self._streams.items():
            if now >= due:
                self._streams[name] = (interval, now + interval, make)
                self.send(make())
        while True:
            try:
                data = self._socket.recv(_MOST)
            except (BlockingIOError, ConnectionError):
                return
            # The router sends one frame a datagram. PX4 sends a thousand a second.
            if message_id(data) not in _HEEDED:
                continue
            for frame in self._decoder.feed_datagram(data, now):
                if frame.component_id == 1:
                    self._take(frame, now)

    def send(self, message: Any) -> None:
        """One message; its loss is a story's own business."""
        try:
            self._socket.send(self._encoder.encode(message, time.monotonic()))
        except ConnectionError:
            pass  # the router is not there yet

    def command(self, number: int, *params: float, component: int = 1) -> float:
        """COMMAND_LONG to the autopilot; when it was sent."""
        self.results.pop(number, None)
        values = [*params, *[0.0] * (7 - len(params))]
        self.send(dialect.MAVLink_command_long_message(1, component, number, 0, *values))
        return time.monotonic()

    def accepted(self, number: int) -> bool:
        """Its acknowledgement came and says so."""
        return bool(self.results.get(number) == dialect.MAV_RESULT_ACCEPTED)

    def ask_for(self, number: int, rate: float) -> None:
        """A message at this rate, Hz."""
        self.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / rate)

    def set_parameter(self, name: str, value: float, kind: int) -> float:
        """PARAM_SET, and ask what became of it; when it was sent."""
        self.parameters.pop(name, None)
        self.send(dialect.MAVLink_param_set_message(1, 1, name.encode(), value, kind))
        sent = time.monotonic()
        self.request(name)
        return sent

    def request(self, name: str) -> None:
        """PARAM_REQUEST_READ."""
        self.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))

    def stream(self, name: str, rate: float, make: Callable[[], Any]) -> None:
        """Send what make gives at this rate, Hz, until it is stopped."""
        self._streams[name] = (1.0 / rate, 0.0, make)

    def stop(self, name: str) -> None:
        """End a stream."""
        self._streams.pop(name, None)

    def get(self, name: str, attribute: str, otherwise: float = math.nan) -> float:
        """A field of the newest message of this name."""
        message = self.newest.get(name)
        return otherwise if message is None else float(getattr(message, attribute))

    def armed(self) -> bool:
        """The newest heartbeat says so."""
        return bool(
            int(self.get("HEARTBEAT", "base_mode", 0)) & dialect.MAV_MODE_FLAG_SAFETY_ARMED
        )

    def upload(self, items: Sequence[Any]) -> None:
        """Begin to upload a mission; turn_mission goes on with it."""
        self.wanted_item = self.mission_ack = None
        self.send(dialect.MAVLink_mission_count_message(1, 1, len(items)))

    def _take(self, frame: Frame, now: float) -> None:
        message = frame.message
        name = message.get_type()
        self.newest[name], self.heard_at[name] = message, now
        if name == "COMMAND_ACK":
            self.results[message.command] = message.result
        elif name == "PARAM_VALUE":
            self.parameters[message.param_id] = message.param_value
        elif name in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            self.wanted_item = message.seq
        elif name == "MISSION_ACK":
            self.mission_ack = message.type
        elif name == "STATUSTEXT":
            self.said.append((now, message.text))
