"""Starting a node from the command line: one clear line for every mistake that a user can make."""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import signal
import sys
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from chute_ros.errors import ChuteError
from chute_ros.interrupts import CtrlC, at_ctrl_c
from chute_ros.not_installed import remedy
from chute_ros.plain_text import plain
from chute_ros.ros.memory_limit import limit_memory
from chute_ros.ros.middleware import set_up_middleware
from chute_ros.transport.regular_file import NotRegularError, open_regular

#: A thread that waits for the interpreter gets it after so long, s: the link's thread and the
#: executor hand a kill to each other, and Python's own 5 ms would be most of its way.
_SWITCH_INTERVAL = 0.0002
#: A node that is to end is gone after this at the latest, s (Fast DDS issue 6513: as it takes its
#: participant down it may wait for a callback for ever).
_ENDS_WITHIN = 10
#: What ROS reads such an argument as; of one that it cannot read it tells the place alone.
_READ_AS = {
    "remap rule": "OLD:=NEW, names of letters, digits and _ alone, a namespace with / before it",
    "parameter override rule": "PARAMETER:=VALUE, an empty text as \"PARAMETER:=''\"",
    "log level": "debug, info, warn, error or fatal",
}


def run(name: str, place: str, actions: bool = False) -> None:
    """Make the node name, whose class is at place (module:class), and spin it until the end; exit
    with 2 on a user's mistake. actions: it serves actions, which our own executor does not."""
    with at_ctrl_c(signal.SIG_DFL):
        node_class = _imported(*place.split(":"))
    set_up_middleware()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from chute_ros.ros.node_executor import new_executor

    node = executor = None
    # Before ROS, whose own handler calls it.
    ctrl_c = CtrlC((_ENDS_WITHIN, partial(signal.raise_signal, signal.SIGALRM)))
    ctrl_c.install()
    try:
        limit_memory()
        _check_arguments(name)
        _init(name)
        # Before the node: a Ctrl-C in the middle of it leaves half an executor, which complains.
        executor = SingleThreadedExecutor() if actions else new_executor()
        with ctrl_c.held():
            node = node_class(started_with=sys.argv[1:])
        node.get_logger().info(node.settings_taken)
        executor.add_node(node)
        # What is there now stays; to go over all of it once more would hold up a decision by
        # 30 ms.
        gc.collect()
        gc.freeze()
        # ROS, which it shuts down as well, ends this between two callbacks: what keeps a state or
        # writes a black box is not cut in two.
        with ctrl_c.held():
            executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # the usual ways to end a node
    except RuntimeError as error:
        if node is None and _security():
            _refused(name, error)  # the node or one of its topics
        # What a publish raises once a signal has shut ROS down; otherwise a mistake of ours.
        if rclpy.ok():
            raise
    except ChuteError as error:
        # Of several lines, where it lists several mistakes.
        lines = [plain(line) for line in f"{name}: {error}".splitlines()]
        print("\n".join(lines), file=sys.stderr)
        sys.exit(2)
    finally:
        # A second Ctrl-C must not cut the ending short: the link's thread is being joined.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        # The middleware may never come to its end, and holds the interpreter meanwhile.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(_ENDS_WITHIN)
        if node is not None:
            node.destroy_node()
        elif executor is not None:
            # One that is collected after ROS has ended complains.
            executor.shutdown()
        # The signal's own handler may be shutting down at this very moment.
        with contextlib.suppress(RuntimeError):
            rclpy.try_shutdown()


def _imported(module: str, class_name: str) -> Any:
    try:
        return getattr(importlib.import_module(module), class_name)
    except ImportError as error:
        if text := remedy(error):
            sys.exit(text)
        raise


def _check_arguments(name: str) -> None:
    """What is not for ROS is for nobody: a node has parameters alone."""
    from rclpy.utilities import remove_ros_args

    from chute_ros.ros.parameter_file import files_of, not_for_ros

    others = not_for_ros(sys.argv[1:])
    usage = f"{name} --ros-args [-p PARAMETER:=VALUE] [--params-file FILE] [-r OLD:=NEW] ..."
    if "--help" in others or "-h" in others:
        print(f"usage: {usage}\nIts parameters, topics and services: docs/reference/")
        sys.exit(0)
    if others:
        text = f"unknown argument {others[0]}: the settings of a node follow --ros-args"
        _end(name, f"{text}\nusage: {usage}")
    for path in files_of(sys.argv[1:]):
        # ROS would wait for ever for what comes out of a FIFO; what it cannot open it says itself.
        with contextlib.suppress(OSError):
            _require_regular(name, path)
    try:
        # As it starts it would say the same in two lines.
        remove_ros_args(sys.argv)
    except RuntimeError as error:
        _refused(name, error)


def _require_regular(name: str, path: Path) -> None:
    try:
        open_regular(path).close()
    except NotRegularError as error:
        _end(name, f"--params-file {path}: {error}")


def _init(name: str) -> None:
    import rclpy

    try:
        rclpy.init()
    except RuntimeError as error:
        # Arguments and parameter files that cannot be read; ROS names them before its own code.
        _refused(name, error)


def _security() -> bool:
    return os.environ.get("ROS_SECURITY_ENABLE") == "true"


def _refused(name: str, error: RuntimeError) -> NoReturn:
    """In one line why ROS did not let it start."""
    text = " ".join(str(error).partition(", at /")[0].split())
    if text.startswith("["):
        # Of arguments that it does not know ROS tells the list alone.
        text = f"ROS has no argument {text.strip('[]')}: a parameter is set by -p NAME:=VALUE"
    for kind, needed in _READ_AS.items():
        if f"parse {kind}: " in text:
            text = f"{text.partition('. Error: ')[0]}: need {needed}"
    if _security():
        text += (
            " (ROS_SECURITY_ENABLE is true: docs/guide/security.md lists the needed keystore, "
            "enclave and middleware)"
        )
    _end(name, text)


def _end(name: str, text: str) -> NoReturn:
    print(f"{name}: {text}", file=sys.stderr)
    sys.exit(2)
