"""What was recorded before a restart of the node is not believed after it."""

from __future__ import annotations

import json
import stat
import time

import pytest
from chute_msgs.srv import Arm
from diagnostic_msgs.msg import DiagnosticStatus
from mavlink_attack import KEY, Attacked, healthy, overheard
from mavlink_bench import Network

from chute_ros.model import LinkState
from chute_ros.protocol.mavlink.signing import REPLAYED


@pytest.fixture
def attacked(bench):
    return Attacked(bench)


def test_what_was_recorded_before_a_restart_is_not_believed_after_it(attacked, bench):
    beats = healthy(attacked)
    recorded = overheard()
    attacked.send(*recorded)
    for loop in (attacked.modules_loop, attacked.autopilots_loop):
        bench.unplug(loop)
    beats.clear()
    attacked.restart()
    attacked.send(*recorded)
    assert attacked.counts()[REPLAYED] == 2

    def its_own():
        """Without the last words of the node before, which are still on their way."""
        first = next((at for at, one in enumerate(beats) if one.seq == 0), len(beats))
        return beats[first:]

    bench.until(lambda: len(its_own()) > 3, "it beats again")
    assert {one.link_state for one in its_own()} == {LinkState.NEVER_SEEN}
    attacked.plug_devices()
    bench.until(lambda: beats[-1].device_healthy, "the true module is heard at once")


def test_a_clock_that_was_set_back_by_years_makes_no_old_frame_young(attacked, bench, monkeypatch):
    beats = healthy(attacked)
    recorded = overheard()
    attacked.send(*recorded)
    for loop in (attacked.modules_loop, attacked.autopilots_loop):
        bench.unplug(loop)
    years_ago = time.time() - 1e8
    with monkeypatch.context() as patch:
        patch.setattr("chute_ros.transport.signing_key.time.time", lambda: years_ago)
        attacked.restart()
    attacked.send(*recorded)
    assert attacked.counts()[REPLAYED] == 2
    attacked.plug_devices()
    beats.clear()
    bench.until(lambda: beats and beats[-1].device_healthy, "the true module is heard")
    assert bench.call(Arm, "mavlink_parachute/arm", arm=True).success, "and hears us"


def the_times(attacked):
    return attacked.network.node._signing._file.path


def test_the_times_of_signing_are_for_the_owner_alone_and_hold_no_key(attacked, bench):
    healthy(attacked)
    path = the_times(attacked)
    bench.until(path.exists, "they are written")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    bench.until(lambda: "1/161/3" in json.loads(path.read_text())["streams"], "the module's too")
    assert KEY.hex() not in path.read_text()


@pytest.mark.parametrize(
    "text",
    ["", "{}", '{"newest": -1, "streams": {}}', '{"newest": 1, "streams": {"a": 1}}', "[" * 9],
)
def test_damaged_times_are_said_and_the_node_works_all_the_same(attacked, bench, text, capfd):
    healthy(attacked)
    path = the_times(attacked)
    bench.until(path.exists, "they are written")
    bench.remove(attacked.network.node)
    path.write_text(text)
    attacked.network = Network(bench, **attacked.parameters)
    told = f"ignoring {path} (it holds no signing times)"
    bench.until(lambda: told in capfd.readouterr().err, "it is said")


def test_times_that_cannot_be_kept_are_a_warning(bench, monkeypatch):
    nowhere = bench.folder / "a_file"
    nowhere.write_text("no folder")
    monkeypatch.setenv("ROS_HOME", str(nowhere))
    attacked = Attacked(bench)
    bench.until(
        lambda: (task := attacked.task("signing")) and task.level == DiagnosticStatus.WARN,
        "diagnostics say so",
    )
    assert str(nowhere) in attacked.task("signing").message
