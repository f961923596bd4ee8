"""What all tests share: deadlines instead of sleeps, and a ROS of their own.

No test may reach a real vehicle, nor another run: the ROS domain is reserved among all runs on
this host, discovery stays on this host, and each test has a namespace of its own.
"""

from __future__ import annotations

import itertools
import os
import signal
import time
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint, entry_points

import pytest
from hypothesis import settings

from chute_ros.links import registered

# The gate tries the same examples each time: what it says of a commit can be repeated. New ones
# are looked for with HYPOTHESIS_PROFILE=search.
settings.register_profile("gate", derandomize=True, deadline=None)
settings.register_profile("search", deadline=None, max_examples=2000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "gate"))

#: How long anything that must happen may take on a busy machine, s.
PATIENCE = 20.0

# A run in the background of a script ignores Ctrl-C, and so would all that the tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def signals_as_before() -> Iterator[None]:
    """A program that a test runs in its own process gives back what it did to signals: what later
    tests start would inherit it, and never end with Ctrl-C."""
    signals = (signal.SIGINT, signal.SIGTERM)
    mask, handlers = _blocked(), [signal.getsignal(one) for one in signals]
    yield
    assert (_blocked(), [signal.getsignal(one) for one in signals]) == (mask, handlers)


def _blocked() -> set[int]:
    return signal.pthread_sigmask(signal.SIG_BLOCK, ())


def _of_ours(group: str) -> list[EntryPoint]:
    """The entries of this repository."""
    return [one for one in entry_points(group=group) if one.value.startswith("chute_ros.")]


# The tests are of our links and vehicles, and of flights drawn from these, whichever links are
# installed beside them.
pytest.MonkeyPatch().setattr(registered, "entry_points", _of_ours)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes long begins first, so that no worker ends with it alone."""
    items.sort(key=lambda item: item.get_closest_marker("xdist_group") is None)


@pytest.fixture(scope="session")
def await_until() -> Callable[..., None]:
    """await_until(condition, what): returns once condition() holds, fails after PATIENCE."""

    def wait(condition: Callable[[], object], what: str, seconds: float = PATIENCE) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"not within {seconds:g} s: {what}"
            time.sleep(0.002)

    return wait


@pytest.fixture(scope="session")
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """rclpy in a domain of this run; yields the run's namespace."""
    # Not at the top: the pure tests run without ROS.
    import rclpy

    from chute_ros.tools.isolation import isolated_ros

    # What nodes keep, black boxes above all, goes with the run.
    os.environ["ROS_HOME"] = str(tmp_path_factory.mktemp("ros_home"))
    with isolated_ros() as namespace:
        rclpy.init(args=[])
        yield namespace
        rclpy.shutdown()


_numbers = itertools.count(1)


@pytest.fixture
def namespace(ros: str) -> str:
    """A namespace for one test."""
    return f"{ros}/test_{next(_numbers)}"
