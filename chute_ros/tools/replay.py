"""Executable replay: decides a recorded flight once more and compares."""

from chute_ros.tools.entry import run


def main() -> None:
    """Run the tool."""
    run("replay", "replay_command")


if __name__ == "__main__":
    main()
