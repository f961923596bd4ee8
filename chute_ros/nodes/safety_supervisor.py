"""Executable safety_supervisor: decides when to block flight, kill and deploy."""

from chute_ros.nodes.entry import run


def main() -> None:
    """Run the node."""
    run("safety_supervisor", "chute_ros.nodes.safety_supervisor_node:SafetySupervisorNode")


if __name__ == "__main__":
    main()
