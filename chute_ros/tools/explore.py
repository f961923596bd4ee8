"""Explores the supervisor's core: every story of so many steps (make explore)."""

from chute_ros.tools.entry import run


def main() -> None:
    """Run the tool."""
    run("explore", "explorer")


if __name__ == "__main__":
    main()
