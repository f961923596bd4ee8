"""Much that cannot be read on a link that works is a warning in diagnostics, and then over."""

from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

import chute_ros
from chute_ros.links.mavlink import diagnostics as mavlink
from chute_ros.links.umbilical import diagnostics as umbilical
from chute_ros.links.upf import diagnostics as upf
from chute_ros.ros.diagnostics import RecentDrops, WirePicture, wire_task


class Line:
    """A wire that is looked at once a second."""

    def __init__(self) -> None:
        self.drops, self.now, self.received = RecentDrops(), 100.0, 0
        self.dropped: dict[str, int] = {}

    def second(self, received: int, for_others: tuple[str, ...] = (), **dropped: int):
        self.now += 1.0
        self.received += received
        for reason, count in dropped.items():
            self.dropped[reason] = self.dropped.get(reason, 0) + count
        wire = WirePicture(True, "open", "udp", self.now, self.drops)
        return wire_task("node", wire, (), self.received, {}, self.dropped, for_others)


def test_garbage_beside_what_works_is_a_warning_until_it_is_over():
    line = Line()
    assert line.second(50).level == DiagnosticStatus.OK
    for _ in range(20):
        told = line.second(50, noise=500, checksum=1)
    assert told.level == DiagnosticStatus.WARN
    assert told.message == "open; in the last 10 s much could not be read, mostly: noise (5000)"
    for _ in range(9):
        assert line.second(50).level == DiagnosticStatus.WARN
    assert line.second(50).level == DiagnosticStatus.OK
    assert line.dropped["noise"] == 10000, "the count stays"


def test_what_was_dropped_before_the_first_look_is_not_recent():
    line = Line()
    line.dropped = {"noise": 5000}
    assert line.second(5).level == DiagnosticStatus.OK
    assert line.second(50).level == DiagnosticStatus.OK


def test_a_line_that_loses_some_is_none():
    line = Line()
    for _ in range(30):
        assert line.second(50, checksum=12).level == DiagnosticStatus.OK
    for _ in range(30):
        told = line.second(50, checksum=13)
    assert told.level == DiagnosticStatus.WARN
    few = Line()
    for _ in range(30):
        assert few.second(1, checksum=2).level == DiagnosticStatus.OK
    assert few.second(1, checksum=3).level == DiagnosticStatus.WARN, "21 in ten seconds"


def test_what_is_for_others_can_be_read():
    line = Line()
    for _ in range(12):
        assert line.second(5, ("foreign",), foreign=500).level == DiagnosticStatus.OK
    assert line.second(5, ("foreign",), foreign=500, noise=50).level == DiagnosticStatus.WARN


@pytest.mark.parametrize("link", [mavlink, umbilical, upf])
def test_the_reasons_that_count_as_read_are_those_that_are_counted(link):
    package = Path(chute_ros.__path__[0])
    folders = (Path(link.__file__).parent / "protocol", package / "protocol")
    sources = "".join(path.read_text() for one in folders for path in one.rglob("*.py"))
    assert [reason for reason in link.READABLE if f'"{reason}"' not in sources] == []
