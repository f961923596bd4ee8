"""Executable sim_bench: the actions of a simulated vehicle as services."""

from chute_ros.ros.entry import run


def main() -> None:
    """Run the node."""
    run("sim_bench", "chute_ros.tools.bench_node:BenchNode")


if __name__ == "__main__":
    main()
