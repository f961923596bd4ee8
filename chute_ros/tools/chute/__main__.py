"""Executable chute: the state of a vehicle, its orders, and what is wrong with its set-up."""

from chute_ros.tools.entry import run


def main() -> None:
    """Run the tool."""
    run("chute", "chute.command")


if __name__ == "__main__":
    main()
