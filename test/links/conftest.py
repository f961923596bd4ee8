"""A bench for each test of a link's node."""

from node_bench import bench  # noqa: F401
