"""The machine that numbers were measured on."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path


def machine() -> str:
    """What the numbers depend on, in one line."""
    about = Path("/proc/cpuinfo").read_text().splitlines()
    names = [line.partition(":")[2].strip() for line in about if line.startswith("model name")]
    model = names[0] if names else "unknown processor"
    interpreter = platform.python_implementation().removeprefix("C")
    distribution = os.environ.get("ROS_DISTRO", "?")
    return (
        f"{model}, {os.cpu_count()} cores; Linux {platform.release()}; "
        # Whose: one that was built without the compiler's profile is a fifth slower.
        f"{interpreter} {platform.python_version()} of {sys.base_prefix}; "
        f"ROS 2 {distribution}"
    )
