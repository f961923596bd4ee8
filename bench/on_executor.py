"""Start a node on another executor: python -m bench.on_executor EXECUTOR MODULE ARGUMENT ..."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from typing import Any

import chute_ros.nodes.node_executor as ours


def _single_threaded() -> type[Any]:
    from rclpy.executors import SingleThreadedExecutor

    return SingleThreadedExecutor


#: Name -> its class. rclpy's EventsExecutor runs no node with a guard condition, as ours are.
EXECUTORS: dict[str, Callable[[], type[Any]]] = {
    "NodeExecutor": lambda: ours.NodeExecutor,
    "SingleThreadedExecutor": _single_threaded,
}


if __name__ == "__main__":
    name, module, *arguments = sys.argv[1:]
    ours.NodeExecutor = EXECUTORS[name]()  # type: ignore[misc]
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
