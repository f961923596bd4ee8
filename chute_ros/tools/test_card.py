"""Executable test_card: the card of a deployment that was tried, from its black box."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "test_card", "test_card_command")

if __name__ == "__main__":
    main()
