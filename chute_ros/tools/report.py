"""Executable report: one HTML page of a recorded flight."""

from chute_ros.tools.entry import run


def main() -> None:
    """Run the tool."""
    run("report", "report_command")


if __name__ == "__main__":
    main()
