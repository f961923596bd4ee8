"""Executable safety_supervisor: decides when to block flight, kill and deploy."""

from chute_ros.ros.entry import run


def main() -> None:
    """Run the node."""
    run("safety_supervisor", "chute_ros.ros.safety_supervisor_node:SafetySupervisorNode")


if __name__ == "__main__":
    main()
