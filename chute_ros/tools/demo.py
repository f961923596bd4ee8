"""Executable demo: one simulated flight with the real nodes, told as it happens."""

from chute_ros.tools.entry import run


def main() -> None:
    """Run the tool."""
    run("demo", "demo_command")


if __name__ == "__main__":
    main()
