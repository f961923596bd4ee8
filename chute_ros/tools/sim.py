"""Executable sim: one simulated vehicle with its nodes, to play with."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "sim", "simulation")

if __name__ == "__main__":
    main()
