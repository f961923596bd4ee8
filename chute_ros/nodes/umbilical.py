"""Executable umbilical: the ground side of a rocket's serial umbilical."""

from chute_ros.nodes.entry import run


def main() -> None:
    """Run the node."""
    run("umbilical", "chute_ros.links.umbilical.node", "UmbilicalNode")


if __name__ == "__main__":
    main()
