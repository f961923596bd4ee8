"""The packet of CVE-2025-64438 in flight: the limit ends the process, and its flight goes on."""

import signal

import pytest
from chute_msgs.msg import SafetyState

from chute_ros.ros.middleware import fast_dds
from chute_ros.tools.processes import ProcessEndedError
from faults.gap_packet import Stranger, gap_packet

#: Of each line the first version that does not take all memory for it.
GAP_IS_FIXED = {(2, 6): (2, 6, 11), (2, 14): (2, 14, 6), (3, 2): (3, 2, 4)}


@pytest.fixture
def stranger(bench):
    """Of the same computer: nobody else's must be reached by a test."""
    one = Stranger("127.0.0.1", bench.client.context.get_domain_id())
    yield one
    one.close()


def process_number(pair, name):
    """Of a supervisor, as its lock tells."""
    folder = pair.processes.ros_home / "chute_ros" / "resume"
    return int(next(folder.glob(f"*.{name}@*.lock")).read_text())


def ended(pair):
    try:
        pair.processes.check()
    except ProcessEndedError as error:
        return str(error)
    return ""


def test_a_supervisor_that_one_packet_ended_goes_on_with_its_flight(pair, stranger, monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("CHUTE_ROS_MEMORY_LIMIT", "512")
    pair.start("a", 0, hot_standby=False)
    pair.await_stage(SafetyState.READY)
    pair.link.flying = True
    pair.await_stage(SafetyState.IN_FLIGHT)
    # In the name of another participant, whom the victim knows.
    names = ("-r", f"__ns:={pair.bench.namespace}/elsewhere", "-r", "__node:=b")
    pair.processes.start("b", "chute_ros.ros.safety_supervisor", "--ros-args", *names)

    def both_heard():
        stranger.listen(0.1)
        return all(stranger.prefix_of(process_number(pair, name)) for name in "ab")

    folder = pair.processes.ros_home / "chute_ros" / "resume"
    pair.bench.until(lambda: list(folder.glob("*.b@*.lock")), "another one starts")
    pair.bench.until(both_heard, "both announce themselves")
    victim, other = (stranger.prefix_of(process_number(pair, name)) for name in "ab")
    # They know each other: whoever is new is greeted at once, and answers.
    pair.bench.turns(1.0)
    crafted = gap_packet(other, victim)
    epoch = pair.epoch("a")
    stranger.send(crafted, "127.0.0.1")
    version = fast_dds()
    if version >= GAP_IS_FIXED.get(version[:2], (3, 4, 1)):
        pair.bench.turns(3.0)
        assert not ended(pair)
        assert pair.states[-1].state == SafetyState.IN_FLIGHT
        return
    said = pair.bench.until(lambda: ended(pair), "its limit ends it")
    assert f"a ended with code {-signal.SIGABRT}" in said
    pair.claims.clear()
    pair.processes.end()
    pair.start("a", 0, hot_standby=False)
    assert pair.epoch("a") > epoch
    pair.await_stage(SafetyState.IN_FLIGHT)
    assert "continuing the interrupted flight: IN_FLIGHT" in pair.processes.tail("a", 40)
