"""Hosts on one machine: network namespaces, joined by a switch whose cables can be spoilt."""

from __future__ import annotations

import ctypes
import fcntl
import os
import secrets
import socket
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

#: <linux/ethtool.h>, <linux/sockios.h>: transmit checksums are left to a card that is not there.
_SIOCETHTOOL, _ETHTOOL_STXCSUM = 0x8946, 0x17
_CLONE_NEWNET = 0x40000000


class Network:
    """Hosts 10.77.0.1, .2, ...; this process moves to one with enter, and back at the end."""

    def __init__(self, hosts: Sequence[str]) -> None:
        self.hosts = tuple(hosts)
        # Several runs at once must not share names.
        self._tag = secrets.token_hex(2)
        self._switch: subprocess.Popen[str] | None = None

    def __enter__(self) -> Network:
        self._home = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
        try:
            for number, host in enumerate(self.hosts, start=1):
                self._add(host, number)
            ports = [f"{host}={self._near(host)}" for host in self.hosts]
            self._switch = subprocess.Popen(
                [sys.executable, "-m", "faults.switch", *ports],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            for host in self.hosts:
                self.cable(host, "heal")
        except BaseException:
            os.close(self._home)
            self._remove()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        _move_to(self._home)
        os.close(self._home)
        self._remove()

    def cable(self, host: str, *command: str) -> None:
        """Spoil or heal the cable of a host (faults.switch says how); done when it returns."""
        assert self._switch is not None
        assert self._switch.stdin is not None
        assert self._switch.stdout is not None
        print(host, *command, file=self._switch.stdin, flush=True)
        if self._switch.stdout.readline() != "ok\n":
            raise OSError(f"the switch has ended with code {self._switch.wait()}")

    def on(self, host: str) -> tuple[str, ...]:
        """What a command begins with that runs on this host."""
        return ("ip", "netns", "exec", self._space(host))

    def enter(self, host: str) -> None:
        """This thread, and the processes and threads that it starts from now on, are on host."""
        with open(f"/run/netns/{self._space(host)}") as space:
            _move_to(space.fileno())

    def address(self, host: str) -> str:
        """Of a host, on its cable."""
        return f"10.77.0.{self.hosts.index(host) + 1}"

    def carried(self, host: str) -> tuple[int, int]:
        """Bytes that have left the host, and that have reached it, since the beginning."""
        counters = Path("/sys/class/net") / self._near(host) / "statistics"
        sent, received = (int((counters / f"{way}_bytes").read_text()) for way in ("rx", "tx"))
        return sent, received

    def _space(self, host: str) -> str:
        return f"chute_{self._tag}_{host}"

    def _near(self, host: str) -> str:
        return f"ch{self._tag}{self.hosts.index(host)}"

    def _add(self, host: str, number: int) -> None:
        space, near, far = self._space(host), self._near(host), f"ch{self._tag}f{number}"
        _ip("netns", "add", space)
        _ip("link", "add", near, "type", "veth", "peer", "name", far)
        for interface in (near, far):
            _own_checksums(interface)
        _ip("link", "set", far, "netns", space)
        _ip("link", "set", near, "up")
        inside = ("-n", space)
        _ip(*inside, "link", "set", far, "name", "eth0")
        _ip(*inside, "address", "add", f"{self.address(host)}/24", "dev", "eth0")
        for interface in ("lo", "eth0"):
            _ip(*inside, "link", "set", interface, "up")
        _ip(*inside, "route", "add", "224.0.0.0/4", "dev", "eth0")

    def _remove(self) -> None:
        if self._switch is not None:
            assert self._switch.stdin is not None
            self._switch.stdin.close()
            self._switch.wait(timeout=5.0)
        for host in self.hosts:
            # With the namespace goes its end of the cable, and with that the other.
            command = ["ip", "netns", "delete", self._space(host)]
            subprocess.run(command, check=False, capture_output=True)


def why_not() -> str:
    """Why hosts cannot be made here; empty: they can."""
    if os.geteuid():
        return "needs root: network namespaces and raw sockets"
    done = subprocess.run(["ip", "netns", "list"], check=False, capture_output=True, text=True)
    return done.stderr.strip() if done.returncode else ""


def _move_to(space: int) -> None:
    if ctypes.CDLL(None, use_errno=True).setns(space, _CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "setns")


def _ip(*arguments: str) -> None:
    done = subprocess.run(["ip", *arguments], check=False, capture_output=True, text=True)
    if done.returncode:
        raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")


def _own_checksums(interface: str) -> None:
    value = bytearray(struct.pack("II", _ETHTOOL_STXCSUM, 0))
    pointer = ctypes.addressof(ctypes.c_char.from_buffer(value))
    request = struct.pack("16sP", interface.encode(), pointer)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, _SIOCETHTOOL, request.ljust(40, b"\0"))
