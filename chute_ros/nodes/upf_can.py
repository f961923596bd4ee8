"""Executable upf_can: a Flyfire UPF parachute on a DroneCAN bus."""

from chute_ros.nodes.entry import run


def main() -> None:
    """Run the node."""
    run("upf_can", "chute_ros.links.upf.node", "UpfCanNode")


if __name__ == "__main__":
    main()
