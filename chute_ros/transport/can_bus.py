"""Any CAN interface of python-can as a wire."""

from __future__ import annotations

import errno
import gc
import logging
import socket
import time
from collections import Counter, deque
from collections.abc import Hashable
from operator import index
from typing import Any

from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack
from chute_ros.transport.can_address import CanAddress
from chute_ros.transport.can_failures import bad_frame, is_full, reason, taken_by_another
from chute_ros.transport.can_reader import BURST, WAIT, FrameReader
from chute_ros.transport.serial_users import PortUsers, hung_up

#: Interfaces whose descriptor is their whole queue: they are read directly. All others have
#: buffers of their own, or no descriptor: a thread waits for them.
_DIRECT = ("socketcan", "udp_multicast")
#: How long an adapter may take to accept a frame, s.
_WRITE_TIMEOUT = 0.005
#: So many failures, and neither a frame nor a pause between them: not bad frames, a broken driver.
_MOST_FAILURES = 100
_MOST_DATA = 8


class CanBusWire:
    """INTERFACE:CHANNEL."""

    def __init__(self, address: CanAddress) -> None:
        self._address = address
        self._bus: Any = None
        self._reader: FrameReader | None = None
        self._echoes: Echoes | None = None
        #: Of the serial port of an adapter.
        self._users: PortUsers | None = None
        self._failures = 0
        #: Why a frame was dropped -> how often.
        self.counts: Counter[str] = Counter()

    @property
    def is_open(self) -> bool:
        return self._bus is not None

    def open(self) -> None:
        # Here: the import takes longer than all other wires need to open.
        import can

        _quieten()
        try:
            # The user's own configuration file of the library could make it hear itself.
            bus = can.Bus(ignore_config=True, **self._options())
            if self._address.interface == "socketcan":
                _check_is_up(bus)
        except Exception as error:  # noqa: BLE001
            # Drivers raise whatever their vendor's library does, and if there is none.
            failure = f"{reason(error)}{self._advice(error)}"
        else:
            failure = ""
        if failure:
            # A driver that failed half-way has opened its port; what is left of it is kept alive
            # by its own exception, at each try one more.
            gc.collect()
            raise OSError(failure)
        self._bus = bus
        if self._address.interface == "udp_multicast":
            self._echoes = Echoes()
        port = _serial_port(bus)
        if port is not None:
            self._users = PortUsers(self._address.channel, port.fileno())
        if self._address.interface not in _DIRECT:
            self._reader = FrameReader(self._take_one, self.describe())

    def close(self) -> None:
        # The thread first: it must not use a descriptor that is somebody else's by then.
        reader, self._reader = self._reader, None
        if reader is not None:
            reader.stop()
        users, self._users = self._users, None
        if users is not None:
            users.stop()
        bus, self._bus = self._bus, None
        if bus is not None:
            _shut_down(bus)

    def files(self) -> list[int]:
        if self._bus is None:
            return []
        return [self._bus.fileno() if self._reader is None else self._reader.fileno()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        if self._reader is not None:
            return [(frame, None) for frame in self._reader.take()]
        frames: list[tuple[bytes, Hashable]] = []
        for _ in range(BURST):
            found = self._take_one(0.0)
            if found is None:
                break
            # Nothing: a bad frame, or one that is not for us.
            frames += [(found, None)] if found else []
        return frames

    def write(self, data: bytes) -> None:
        import can

        frame = unpack(data)
        assert frame is not None  # the protocol makes them
        message = can.Message(
            arbitration_id=frame.identifier,
            is_extended_id=frame.extended,
            is_remote_frame=frame.remote,
            data=None if frame.remote else frame.data,
            dlc=len(frame.data),
        )
        try:
            # No time at all would let pyserial send half a line; the direct ones need none.
            direct = self._address.interface in _DIRECT
            self._bus.send(message, timeout=0.0 if direct else _WRITE_TIMEOUT)
        except Exception as error:  # noqa: BLE001
            # Drivers raise whatever their vendor's library does.
            kind = BlockingIOError if is_full(error) else ConnectionError
            raise kind(f"{reason(error)}{self._advice(error)}") from None
        if self._echoes is not None:
            self._echoes.sent(data, time.monotonic())

    def look(self, now: float) -> str:
        """Other readers of the adapter's serial port; empty: none known."""
        return "" if self._users is None else self._users.trouble(now)

    def describe(self) -> str:
        address = self._address
        # The port stands behind IPv4 groups only: it could not be told from the last part of
        # others, which take none.
        port = f":{address.port}" if address.port and ":" not in address.channel else ""
        rate = f" at {address.bitrate} bit/s" if address.bitrate else ""
        return f"{address.interface}:{address.channel}{port}{rate}"

    def _options(self) -> dict[str, Any]:
        address = self._address
        options: dict[str, Any] = {"interface": address.interface, "channel": address.channel}
        if address.bitrate:
            options["bitrate"] = address.bitrate
        if address.interface == "udp_multicast":
            # Not beyond this host: a simulated parachute must not meet somebody else's vehicle.
            options |= {"port": address.port, "hop_limit": 0}
        if address.interface == "slcan":
            # By default two seconds, for boards that start anew when they are opened: the loop
            # would stand still. And a time-out of a millisecond, which is polling.
            options |= {"sleep_after_open": 0.0, "timeout": WAIT}
        return options

    def _take_one(self, timeout: float) -> bytes | None:
        """The next frame that comes within timeout (s), None if none does; b"" if it was dropped.
        OSError: the interface is gone."""
        try:
            message = self._bus.recv(timeout)
            self._failures = 0
            return None if message is None else self._frame(message)
        except Exception as error:  # noqa: BLE001
            # Drivers raise whatever their vendor's library does; what is not the frame's own
            # fault ends the wire, and the loop opens it again.
            if self._users is not None and taken_by_another(error):
                port = _serial_port(self._bus)
                if port is not None and not hung_up(port.fileno()):
                    self._users.ready_without_data(time.monotonic())
                    return self._drop("reads that another program took first")
            kind = bad_frame(error)
            if not kind:
                raise OSError(f"{reason(error)}{self._advice(error)}") from None
            return self._stumble(kind, error)

    def _stumble(self, kind: str, error: Exception) -> bytes:
        """Count a bad frame, and go on behind it."""
        self._failures += 1
        if self._failures > _MOST_FAILURES and self._address.interface not in _DIRECT:
            raise OSError(f"only failures, the last one: {reason(error)}") from None
        undecoded = getattr(self._bus, "_buffer", None)
        if isinstance(error.__cause__, UnicodeError) and isinstance(undecoded, bytearray):
            # slcan would keep what it cannot decode, and stumble over it for ever. Its own flush
            # would throw away the frames that wait behind it as well.
            undecoded.clear()
        return self._drop(kind)

    def _frame(self, message: Any) -> bytes:
        """The sixteen bytes of a message of the library; none, and counted, if it has none."""
        if message.is_fd:
            return self._drop("CAN FD frames")
        data = b"" if message.is_remote_frame else bytes(message.data)
        cut = not message.is_remote_frame and message.dlc != len(data)
        if cut or len(data) > _MOST_DATA:
            return self._drop("frames of a wrong length")
        number = index(message.arbitration_id)
        if message.is_error_frame:
            # Only Linux's identifier says what is wrong.
            number = number if self._address.interface == "socketcan" else 0
            return pack(CanFrame(number, data, extended=False, error=True))
        if not 0 <= number <= (0x1FFFFFFF if message.is_extended_id else 0x7FF):
            return self._drop("impossible CAN identifiers")
        remote = bool(message.is_remote_frame)
        frame = pack(CanFrame(number, data, bool(message.is_extended_id), remote))
        own = self._echoes is not None and self._echoes.take(frame, time.monotonic())
        return b"" if own else frame

    def _drop(self, kind: str) -> bytes:
        self.counts[kind] += 1
        return b""

    def _advice(self, error: BaseException) -> str:
        """Advice for the user, with a semicolon before."""
        address = self._address
        if address.interface == "udp_multicast":
            return "; is there a route for multicast? ip route add 224.0.0.0/4 dev lo"
        if address.interface != "socketcan":
            return ""
        if getattr(error, "errno", 0) == errno.EAFNOSUPPORT:
            return "; this kernel has no CAN: modprobe can-raw"
        rate = address.bitrate or "BITRATE"
        return f"; is it up? ip link set {address.channel} up type can bitrate {rate}"


class Echoes:
    """Frames sent that are still to come back, as python-can's multicast hears itself."""

    #: A frame that comes back later than this is another node's, s.
    WINDOW = 1.0
    _MOST = 4096

    def __init__(self) -> None:
        self._sent: deque[tuple[float, bytes]] = deque(maxlen=self._MOST)

    def sent(self, frame: bytes, now: float) -> None:
        """It will come back once."""
        self._sent.append((now, frame))

    def take(self, frame: bytes, now: float) -> bool:
        """That frame is one that was sent, and has not come back before."""
        while self._sent and now - self._sent[0][0] > self.WINDOW:
            self._sent.popleft()
        for place, (_, one) in enumerate(self._sent):
            if one == frame:
                del self._sent[place]
                return True
        return False


def _check_is_up(bus: Any) -> None:
    """Binding to an interface that is down succeeds; the error waits in the socket."""
    code = bus.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    if code:
        _shut_down(bus)
        raise OSError(code, "the interface is down")


def _shut_down(bus: Any) -> None:
    try:
        bus.shutdown()
    except Exception:  # noqa: BLE001
        # The device is gone: slcan fails in saying goodbye, and leaves its port open.
        port = _serial_port(bus)
        if port is not None:
            port.close()


def _serial_port(bus: Any) -> Any:
    """The port of an adapter on a serial line, of pyserial; None: the interface has none."""
    return getattr(bus, "serialPortOrig", None)


def _quieten() -> None:
    """What the library has to say comes as exceptions; its log would repeat it at every try."""
    log = logging.getLogger("can")
    if log.level == logging.NOTSET:
        log.setLevel(logging.CRITICAL)
