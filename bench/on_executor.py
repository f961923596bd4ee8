"""Start a node on another executor: python -m bench.on_executor EXECUTOR MODULE ARGUMENT ..."""

from __future__ import annotations

import runpy
import sys

from rclpy.executors import SingleThreadedExecutor

import chute_ros.ros.node_executor as ours

#: rclpy's EventsExecutor runs no node with a guard condition, as ours are.
EXECUTORS: dict[str, type[SingleThreadedExecutor]] = {
    one.__name__: one for one in (ours.NodeExecutor, SingleThreadedExecutor)
}


if __name__ == "__main__":
    name, module, *arguments = sys.argv[1:]
    ours.new_executor = EXECUTORS[name]
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
