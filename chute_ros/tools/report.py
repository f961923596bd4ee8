"""Executable report: one HTML page of a recorded flight."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "report", "report_command")

if __name__ == "__main__":
    main()
