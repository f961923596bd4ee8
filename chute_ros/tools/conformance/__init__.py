"""Executable conformance: a real device on the bench, against each clause of its document."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "conformance", "conformance.command")
