"""Executable campaign: many flights in virtual time with faults at every layer, counted."""

from chute_ros.tools.entry import run


def main() -> None:
    """Run the tool."""
    run("campaign", "campaign_command")


if __name__ == "__main__":
    main()
