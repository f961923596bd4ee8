"""The control socket of a running simulator: one datagram is one action, as --at takes it.

Linux alone gives a socket's file the mode that the socket had before it was bound, which leaves no
moment at which others may write to it.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import stat
import threading
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from chute_ros.errors import ParameterError
from chute_ros.plain_text import plain
from chute_ros.sim.acting import Argument
from chute_ros.transport.loop import ProtocolLink, WireLoop

#: The answer to an action that is done.
DONE = "ok"
#: More than any action has, bytes.
_LARGEST = 1024
_LARGEST_ANSWER = 65536


class Acting(ProtocolLink, Protocol):
    """A simulated device with actions: see MavlinkDevice and UpfBus."""

    @property
    def actions(self) -> Mapping[str, Callable[[str], None]]:
        """What it can be told to do."""

    @property
    def arguments(self) -> Mapping[str, Argument]:
        """What its actions take."""

    def act(self, action: str) -> str:
        """Do it; why it cannot be done now, empty: it is done."""

    def add_action(self, name: str, function: Callable[[str], None]) -> None:
        """One more, of what is around the device."""


def check_action(device: Acting, action: str) -> None:
    """ParameterError: the device has no such action, or it takes no such argument."""
    name, equals, argument = action.partition("=")
    if name not in device.actions:
        known = ", ".join(sorted(device.actions))
        raise ParameterError(f"action {name!r} is not known: need one of {known}")
    taken = device.arguments.get(name)
    if taken is None and equals:
        raise ParameterError(f"action {action!r}: {name} takes no argument")
    if taken is None:
        return
    try:
        taken.convert(argument)
    except (KeyError, ValueError):
        text = f"action {action!r}: {argument!r} is no argument of {name}"
        raise ParameterError(f"{text}: need {name}={taken.need}") from None


def order(path: str, action: str, within: float = 2.0) -> str:
    """Tell the simulator at this control socket to do an action. Returns DONE, or why it is not
    done; it is waited for so long, s."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.settimeout(within)
        try:
            end.bind("")  # Linux finds a name for the answer, of no file.
            end.connect(path)
            end.send(action.encode())
            return end.recv(_LARGEST_ANSWER).decode()
        except TimeoutError:
            return f"no answer within {within:g} s: the simulator hangs"
        except OSError as error:
            return f"the simulator does not run ({path}: {error.strerror or error})"


@contextlib.contextmanager
def controlled(path: str, device: Acting, loop: WireLoop[Any]) -> Iterator[None]:
    """Meanwhile the device does what comes to the socket at path; empty: there is none.
    ParameterError: the socket cannot be made."""
    if not path:
        yield
        return
    with contextlib.closing(_bound(path)) as end:
        control = _Control(end, device, loop)
        control.start()
        try:
            yield
        finally:
            control.stop()
            Path(path).unlink(missing_ok=True)


def _bound(path: str) -> socket.socket:
    end = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        _remove_left(path)
        os.fchmod(end.fileno(), 0o600)
        end.bind(path)
    except OSError as error:
        end.close()
        why = error.strerror or error
        raise ParameterError(
            f"--control {path!r}: {why}: need a path of at most 107 bytes in a folder that "
            "exists, and no file there"
        ) from None
    end.setblocking(False)
    return end


def _remove_left(path: str) -> None:
    """What a simulator that was killed has left: a socket at which nobody listens."""
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISSOCK(os.lstat(path).st_mode):
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
            try:
                probe.connect(path)
            except ConnectionRefusedError:
                os.unlink(path)


class _Control:
    """Reads the socket in a thread of its own; the device is touched as the loop says."""

    def __init__(self, end: socket.socket, device: Acting, loop: WireLoop[Any]) -> None:
        self._end, self._device, self._loop = end, device, loop
        self._stop_in, self._stop_out = socket.socketpair()
        self._thread = threading.Thread(target=self._run, name="control")

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stop_out.close()
        self._thread.join()
        self._stop_in.close()

    def _run(self) -> None:
        poll = select.poll()
        poll.register(self._end, select.POLLIN)
        poll.register(self._stop_in, select.POLLIN)
        while all(file == self._end.fileno() for file, _ in poll.poll()):
            data, sender = self._end.recvfrom(_LARGEST)
            self._loop.call(partial(self._act, data, sender))

    def _act(self, data: bytes, sender: str | bytes | None, _: ProtocolLink, now: float) -> None:
        answer = self._done(data, now)
        if not sender:
            return
        # One who has gone, or does not read, must not hold up the device.
        with contextlib.suppress(OSError):
            self._end.sendto(answer.encode(), sender)

    def _done(self, data: bytes, now: float) -> str:
        """What becomes of a datagram: DONE, or why it is not done."""
        try:
            action = data.decode().strip()
            check_action(self._device, action)
        except UnicodeDecodeError:
            return f"{data[:40]!r} is no text: need an action, for example reboot"
        except ParameterError as error:
            return plain(str(error))
        # It may have slept since it last looked at the clock.
        self._device.update(now)
        return plain(self._device.act(action)) or DONE
