"""Executable mavlink_parachute: a parachute on a MAVLink network."""

from chute_ros.nodes.entry import run


def main() -> None:
    """Run the node."""
    run("mavlink_parachute", "chute_ros.links.mavlink.node", "MavlinkParachuteNode")


if __name__ == "__main__":
    main()
