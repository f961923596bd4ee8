"""Explores the supervisor's core: every story of so many steps (make explore)."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "explore", "explorer")

if __name__ == "__main__":
    main()
