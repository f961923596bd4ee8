"""Flies the same flights with this product and with what people use today, and compares them."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "compare", "compare_command")

if __name__ == "__main__":
    main()
