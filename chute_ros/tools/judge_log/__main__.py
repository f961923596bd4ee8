"""Executable judge_log: recorded flights judged."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "judge_log", "judge_log.command")

if __name__ == "__main__":
    main()
