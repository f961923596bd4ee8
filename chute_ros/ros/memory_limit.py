"""Memory limit of a node: a node that is made to take more ends, not the computer.

Fast DDS before 2.6.11, 2.14.6, 3.2.4, 3.3.1 and 3.4.1 takes all memory for one packet of 68 bytes
(CVE-2025-64438, docs/guide/security.md). Ended by its limit, the process is started again by
its launch file, and its flight goes on.
"""

from __future__ import annotations

import os
import resource

from chute_ros.errors import ParameterError

VARIABLE = "CHUTE_ROS_MEMORY_LIMIT"
#: MB. Twice what a node has after its start (225 to 250 MB, of which it uses 80 to 95: the rest is
#: room for its threads' stacks).
_DEFAULT = 512
_LEAST, _MOST = 300, 1_000_000


def limit_memory() -> None:
    """For this process, as the environment says; ParameterError if that is no limit."""
    text = os.environ.get(VARIABLE, str(_DEFAULT))
    megabytes = int(text) if text.isascii() and text.isdigit() else -1
    if not (megabytes == 0 or _LEAST <= megabytes <= _MOST):
        raise ParameterError(
            f"{VARIABLE} is {text[:40]!r}: need {_LEAST} to {_MOST} MB, or 0 for no limit"
        )
    if megabytes:
        # What it can write to: addresses that are only set aside are a gigabyte in each node.
        soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
        outer = [one for one in (soft, hard) if one != resource.RLIM_INFINITY]
        resource.setrlimit(resource.RLIMIT_DATA, (min([megabytes << 20, *outer]), hard))
