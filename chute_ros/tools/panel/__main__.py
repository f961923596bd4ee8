"""Executable panel: a web page of all vehicles that are received."""

from chute_ros.ros.entry import run


def main() -> None:
    """Run the node."""
    run("panel", "chute_ros.tools.panel.node:PanelNode")


if __name__ == "__main__":
    main()
