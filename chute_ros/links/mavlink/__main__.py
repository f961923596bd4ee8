"""Executable mavlink_parachute."""

from chute_ros.links.mavlink import LINK
from chute_ros.ros.entry import run


def main() -> None:
    """Run the node."""
    run(LINK.name, LINK.node)


if __name__ == "__main__":
    main()
