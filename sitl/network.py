"""A network of this process alone, only loopback: a simulator opens ports to everyone."""

from __future__ import annotations

import ctypes
import fcntl
import os
import socket
import struct
from pathlib import Path

_CLONE_NEWUSER, _CLONE_NEWNET = 0x10000000, 0x40000000
#: <linux/sockios.h>, <linux/if.h>
_SIOCSIFFLAGS, _IFF_UP = 0x8914, 0x1


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
        fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sH14x", b"lo", _IFF_UP))
    return ""
