"""Any CAN interface of python-can as a wire."""

from __future__ import annotations

import contextlib
import logging
import select
import socket
import threading
import time
from collections import Counter, deque
from collections.abc import Hashable
from typing import Any

from chute_ros.protocol.dronecan.can_frame import SIZE, CanFrame, pack, unpack
from chute_ros.transport.can_address import CanAddress

#: Interfaces whose descriptor is their whole queue: they are read directly. All others have
#: buffers of their own, or no descriptor: a thread waits for them.
_DIRECT = ("socketcan", "udp_multicast")
_BURST = 64
#: A frame that comes back later than this is not our echo, s.
_ECHO_WINDOW = 1.0
#: How long the reading thread waits at once, s: it ends when the wire is closed.
_WAIT = 0.2


class CanBusWire:
    """INTERFACE:CHANNEL."""

    def __init__(self, address: CanAddress) -> None:
        self._address = address
        self._bus: Any = None
        self._reader: _Reader | None = None
        #: Frames sent, with their time: this interface hears itself.
        self._echoes: deque[tuple[float, bytes]] | None = None
        #: Why a frame was dropped -> how often.
        self.counts: Counter[str] = Counter()

    @property
    def is_open(self) -> bool:
        return self._bus is not None

    def open(self) -> None:
        # Here: the import takes longer than all other wires need to open.
        import can

        # What it has to say comes as exceptions; its log would repeat it at every try.
        logging.getLogger("can").setLevel(logging.CRITICAL)
        address = self._address
        options: dict[str, Any] = {"interface": address.interface, "channel": address.channel}
        if address.bitrate:
            options["bitrate"] = address.bitrate
        if address.interface == "udp_multicast":
            options |= {"port": address.port, "hop_limit": 0, "fd": False}
        try:
            bus = can.Bus(**options)
        except (can.CanError, OSError, ImportError, ValueError, AttributeError) as error:
            raise OSError(f"{_reason(error)}{self._advice()}") from None
        self._bus = bus
        self._echoes = deque() if address.interface == "udp_multicast" else None
        if address.interface not in _DIRECT:
            self._reader = _Reader(bus, self._convert)

    def close(self) -> None:
        bus, self._bus = self._bus, None
        reader, self._reader = self._reader, None
        if reader is not None:
            reader.stop()
        if bus is not None:
            with contextlib.suppress(Exception):
                bus.shutdown()
        if reader is not None:
            reader.join()

    def files(self) -> list[int]:
        if self._bus is None:
            return []
        return [self._bus.fileno() if self._reader is None else self._reader.fileno()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        if self._reader is not None:
            return [(frame, None) for frame in self._reader.take()]
        frames: list[tuple[bytes, Hashable]] = []
        for _ in range(_BURST):
            if not select.select([file], [], [], 0)[0]:
                break
            frame = _receive(self._bus, 0.0, self.counts)
            converted = None if frame is None else self._convert(frame)
            if converted is not None:
                frames.append((converted, None))
        return frames

    def write(self, data: bytes) -> None:
        import can

        frame = unpack(data)
        assert frame is not None  # the protocol makes them
        message = can.Message(
            arbitration_id=frame.identifier, data=frame.data, is_extended_id=frame.extended
        )
        if self._echoes is not None:
            self._echoes.append((time.monotonic(), data))
        try:
            # socketcan tells a full queue apart by its time-out; others send or block a moment.
            self._bus.send(message, timeout=0.0 if self._address.interface in _DIRECT else 0.1)
        except can.CanError as error:
            if _is_medium(error):
                raise ConnectionError(f"{_reason(error)}") from None
            raise BlockingIOError(f"{_reason(error)}") from None
        except OSError as error:
            raise ConnectionError(f"{error}") from None

    def describe(self) -> str:
        address = self._address
        port = f":{address.port}" if address.port else ""
        rate = f" at {address.bitrate} bit/s" if address.bitrate else ""
        return f"{address.interface}:{address.channel}{port}{rate}"

    def _convert(self, message: Any) -> bytes | None:
        """The sixteen bytes of a message of the library; None, and counted, if it has none."""
        if message.is_fd or len(message.data) > 8:
            self.counts["CAN FD frames"] += 1
            return None
        if message.is_error_frame:
            return pack(CanFrame(message.arbitration_id, b"", False, error=True))
        remote = message.is_remote_frame
        data = b"" if remote else bytes(message.data)
        highest = 0x1FFFFFFF if message.is_extended_id else 0x7FF
        if not 0 <= message.arbitration_id <= highest:
            self.counts["identifiers that no CAN frame has"] += 1
            return None
        frame = pack(CanFrame(message.arbitration_id, data, message.is_extended_id, remote))
        return None if self._is_echo(frame) else frame

    def _is_echo(self, frame: bytes) -> bool:
        echoes = self._echoes
        if echoes is None:
            return False
        now = time.monotonic()
        while echoes and now - echoes[0][0] > _ECHO_WINDOW:
            echoes.popleft()
        for index, (_, sent) in enumerate(echoes):
            if sent == frame:
                del echoes[index]
                return True
        return False

    def _advice(self) -> str:
        address = self._address
        if address.interface == "socketcan":
            rate = address.bitrate or 1000000
            return (
                f"; is it there and up? ip link set {address.channel} up type can bitrate {rate}"
            )
        return ""


class _Reader:
    """A thread that waits for frames and makes a descriptor readable with each."""

    def __init__(self, bus: Any, convert: Any) -> None:
        self._bus, self._convert = bus, convert
        self._ours, self._theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._ours.setblocking(False)
        self._counts: Counter[str] = convert.__self__.counts
        self._failure = ""
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="CAN reader", daemon=True)
        self._thread.start()

    def fileno(self) -> int:
        """Readable when a frame has come, or the interface is gone."""
        return self._ours.fileno()

    def take(self) -> list[bytes]:
        """Frames that came; OSError: the interface is gone."""
        frames = []
        for _ in range(_BURST):
            try:
                data = self._ours.recv(SIZE)
            except BlockingIOError:
                break
            if not data:
                raise OSError(self._failure or "the interface was closed")
            frames.append(data)
        return frames

    def stop(self) -> None:
        """End soon; whoever closes the bus wakes the thread."""
        self._stopping = True

    def join(self) -> None:
        """Wait for the end."""
        self._thread.join()
        self._ours.close()
        self._theirs.close()

    def _run(self) -> None:
        while not self._stopping:
            try:
                message = _receive(self._bus, _WAIT, self._counts)
                frame = None if message is None else self._convert(message)
                if frame is not None:
                    self._theirs.send(frame)
            except Exception as error:  # noqa: BLE001
                # Drivers raise whatever their vendor's library does; the loop reopens the wire.
                self._failure = _reason(error)
                with contextlib.suppress(OSError):
                    self._theirs.send(b"")
                return


def _receive(bus: Any, timeout: float, counts: Counter[str]) -> Any:
    """The next message, or None. OSError: the interface is gone; what is only a bad frame is
    counted."""
    import can

    try:
        return bus.recv(timeout)
    except can.CanError as error:
        if _is_medium(error):
            raise OSError(_reason(error)) from None
        counts[f"bad frames: {str(error).partition(' [')[0]}"] += 1
    except ValueError as error:
        # How drivers show a line or a packet that is none.
        counts[f"bad frames: {type(error).__name__}"] += 1
    return None


def _is_medium(error: BaseException) -> bool:
    """An error of the library that comes from the operating system's."""
    cause = error.__cause__ or error.__context__
    full = isinstance(cause, (TimeoutError, BlockingIOError))
    return isinstance(cause, OSError) and not full


def _reason(error: BaseException) -> str:
    text = str(error) or type(error).__name__
    cause = error.__cause__
    return f"{text} ({cause})" if cause is not None and str(cause) not in text else text
