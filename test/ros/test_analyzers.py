"""config/analyzers.yaml groups what running nodes report: each task once, no group empty."""

import re
from pathlib import Path

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from whole_vehicle import NODES, start_whole_vehicle

FILE = Path(__file__).parents[2] / "config" / "analyzers.yaml"
#: What diagnostic_aggregator names its node, and so the parameters.
AGGREGATOR = "analyzers"
#: Tasks that come last: all devices are received by then.
LAST = {"parachute 1/161", "autopilot", "controller 33", "trigger 34"}


@pytest.fixture
def names(bench):
    """Of every status of a vehicle with everything on it, with its namespace and without."""
    found = set()
    heard = bench.follow(DiagnosticArray, "/diagnostics")
    start_whole_vehicle(bench)

    def all_there():
        found.update(one.name for array in heard for one in array.status)
        nodes = {name.partition(":")[0] for name in found}
        return len(nodes) == len(NODES) and {name.partition(": ")[2] for name in found} >= LAST

    bench.until(all_there, "every node and every device is reported")
    prefix = bench.namespace.lstrip("/") + "/"
    assert all(name.startswith(prefix) for name in found)
    return found | {name.removeprefix(prefix) for name in found}


def groups():
    """Path of each analyzer -> its patterns."""
    vehicle = yaml.safe_load(FILE.read_text())[AGGREGATOR]["ros__parameters"]["vehicle"]
    assert vehicle["type"] == "diagnostic_aggregator/AnalyzerGroup"
    found = {}
    for one in vehicle["analyzers"].values():
        assert one["type"] == "diagnostic_aggregator/GenericAnalyzer"
        assert set(one) == {"type", "path", "regex"}
        found[one["path"]] = one["regex"]
    return found


def matches(patterns, name):
    # As std::regex_match: the whole name.
    return any(re.fullmatch(one, name) for one in patterns)


def test_each_task_is_in_one_group_and_each_pattern_finds_one(names):
    for name in names:
        found = [path for path, each in groups().items() if matches(each, name)]
        assert len(found) == 1, (name, found)
    for path, each in groups().items():
        for pattern in each:
            assert any(re.fullmatch(pattern, name) for name in names), f"{path}: {pattern}"
