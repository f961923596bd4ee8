"""The bench of the nodes' tests, for attacks on running nodes."""

from node_bench import bench  # noqa: F401
