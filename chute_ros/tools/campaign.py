"""Executable campaign: many flights in virtual time with faults at every layer, counted."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "campaign", "campaign_command")

if __name__ == "__main__":
    main()
