"""A network of this process alone, only loopback: a simulator opens ports to everyone."""

from __future__ import annotations

import ctypes
import fcntl
import os
import socket
import struct
from pathlib import Path

_CLONE_NEWUSER, _CLONE_NEWNET = 0x10000000, 0x40000000
#: <linux/sockios.h>, <linux/if.h>, <linux/route.h>
_SIOCSIFFLAGS, _SIOCADDRT, _IFF_UP, _IFF_MULTICAST, _RTF_UP = 0x8914, 0x890B, 0x1, 0x1000, 0x1


class _Route(ctypes.Structure):
    """struct rtentry."""

    _fields_ = (
        ("pad1", ctypes.c_ulong), ("destination", ctypes.c_byte * 16),
        ("gateway", ctypes.c_byte * 16), ("mask", ctypes.c_byte * 16), ("flags", ctypes.c_ushort),
        ("pad2", ctypes.c_short), ("pad3", ctypes.c_ulong), ("pad4", ctypes.c_void_p),
        ("metric", ctypes.c_short), ("device", ctypes.c_char_p), ("mtu", ctypes.c_ulong),
        ("window", ctypes.c_ulong), ("irtt", ctypes.c_ushort),
    )  # fmt: skip


def enter_own_network() -> str:
    """Leave the machine's network, with all children that follow; why not, or empty.

    Before any thread is started: only the calling thread moves.
    """
    user, group = os.geteuid(), os.getegid()
    spaces = _CLONE_NEWNET | (_CLONE_NEWUSER if user else 0)
    if ctypes.CDLL(None, use_errno=True).unshare(spaces):
        return os.strerror(ctypes.get_errno())
    if user:
        # Without them a new user namespace has no rights, not even over its own network.
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        flags = _IFF_UP | _IFF_MULTICAST
        fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sH14x", b"lo", flags))
        # An autopilot's simulator has its CAN bus there.
        groups, mask = _address("224.0.0.0"), _address("240.0.0.0")
        route = _Route(destination=groups, mask=mask, flags=_RTF_UP, device=b"lo")
        route.gateway = _address("0.0.0.0")
        fcntl.ioctl(any_socket, _SIOCADDRT, route)
    return ""


def _address(text: str) -> ctypes.Array[ctypes.c_byte]:
    """struct sockaddr_in."""
    packed = struct.pack("=HH4s8x", socket.AF_INET, 0, socket.inet_aton(text))
    return (ctypes.c_byte * 16).from_buffer_copy(packed)
