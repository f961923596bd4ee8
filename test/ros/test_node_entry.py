"""A node ends by Ctrl-C between two callbacks, and where one never returns all the same."""

import re
import signal
import subprocess
import sys

import pytest

NODE = """
import signal
import sys
import types

import rclpy
from rclpy.node import Node

from chute_ros.ros import entry


class Itself(Node):
    settings_taken = "none"

    def __init__(self, started_with):
        super().__init__("itself")
        self.create_timer(0.01, self.due)

    def due(self):
        signal.raise_signal(signal.SIGINT)
        print("begun", flush=True)
        while {hangs}:
            pass
        print("kept", flush=True)


module = types.ModuleType("itself")
module.Itself = Itself
sys.modules[module.__name__] = module
entry._ENDS_WITHIN = 1
entry.run("itself", "itself:Itself")
"""


@pytest.mark.parametrize(
    ("hangs", "code", "told"),
    # ROS shuts down in a thread of its own: meanwhile the callback may come again.
    [(False, 0, "(begun\nkept\n)+"), (True, -signal.SIGALRM, "begun\n")],
    ids=["one that returns", "one that never returns"],
)
def test_a_callback_in_which_ctrl_c_comes_is_not_cut_in_two(hangs, code, told, namespace):
    command = [sys.executable, "-c", NODE.format(hangs=hangs)]
    arguments = ["--ros-args", "-r", f"__ns:={namespace}"]
    done = subprocess.run(
        [*command, *arguments], capture_output=True, text=True, timeout=60.0, check=False
    )
    assert done.returncode == code, done.stderr
    assert re.fullmatch(told, done.stdout), done.stdout
    assert "Traceback" not in done.stderr
