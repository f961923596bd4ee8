"""Executable replay: decides a recorded flight once more and compares."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "replay", "replay_command")

if __name__ == "__main__":
    main()
