"""Executable demo: one simulated flight with the real nodes, told as it happens."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "demo", "demo_command")

if __name__ == "__main__":
    main()
