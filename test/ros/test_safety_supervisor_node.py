"""The supervisor's node among stub device nodes: what it publishes, serves and calls.

The words in which its core explains itself are the business of test/supervisor.
"""

import pytest
from chute_msgs.msg import LinkHeartbeat, SafetyDecision, SafetyRequest, SafetyState
from chute_msgs.srv import Arm, Deploy, Kill, SetMode
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_srvs.srv import Trigger
from supervisor_bench import QUICK, Scene

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.ros import qos
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode
from chute_ros.runtime import supervisor as runtime


@pytest.fixture
def scene(bench):
    return Scene(bench)


@pytest.fixture
def ready(scene):
    scene.link.offer_arming()
    scene.await_stage(SafetyState.READY)
    return scene


# Block and release


def test_healthy_links_release_flight_and_the_state_says_why(ready):
    release = ready.await_decision(Action.FLIGHT_BLOCK_RELEASE)
    assert release.targets == ["mavlink_parachute"]
    assert release.reasons
    state = ready.states[-1]
    assert not state.flight_blocked
    assert list(state.block_reasons) == []
    assert list(state.links) == ["mavlink_parachute"]
    assert list(state.link_states) == [LinkState.OK]
    assert list(state.devices_healthy) == [True]
    assert state.link_ages[0] < 20.0


def test_one_that_hears_nobody_beats_by_itself_and_blocks_flight(bench):
    states = bench.follow(SafetyState, "safety/state", qos.LATCHED)
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    bench.add(SafetySupervisorNode, **QUICK)
    bench.until(lambda: states and states[-1].state == SafetyState.BLOCKED, "flight is blocked")
    assert states[-1].flight_blocked
    assert "mavlink_parachute" in states[-1].block_reasons[0]
    assert states[-1].link_ages[0] != states[-1].link_ages[0], "never heard is NaN"
    bench.until(lambda: len(beats) >= 10, "it beats")
    assert all(beat.supervisor for beat in beats)
    assert {beat.link for beat in beats} == {"safety_supervisor"}
    numbers = [beat.seq for beat in beats]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_what_becomes_unhealthy_blocks_and_what_recovers_releases(ready):
    """And its diagnostics follow."""
    said, link = ready.bench.follow(DiagnosticArray, "/diagnostics"), ready.link

    def level():
        own = [s for s in said[-1].status if "/safety_supervisor: " in s.name] if said else []
        # That others can reach a middleware that is not cured is no matter of its health.
        return {s.level for s in own if not s.name.endswith(": middleware")}

    for name, wrong in (("healthy", False), ("state", LinkState.LOST), ("beating", False)):
        ready.bench.until(lambda: level() == {DiagnosticStatus.OK}, "it is well")
        decided, well = len(ready.decided(Action.FLIGHT_BLOCK)), getattr(link, name)
        setattr(link, name, wrong)
        state = ready.await_stage(SafetyState.BLOCKED)
        assert state.flight_blocked, name
        assert state.block_reasons, name
        ready.bench.until(
            lambda known=decided: len(ready.decided(Action.FLIGHT_BLOCK)) > known, "it is decided"
        )
        ready.bench.until(lambda: level() and level() != {DiagnosticStatus.OK}, "it is not well")
        setattr(link, name, well)
        ready.await_stage(SafetyState.READY)


# For whoever comes late


def test_a_kill_and_a_deploy_are_found_later_with_their_reasons_and_their_time(ready):
    answer = ready.call(Deploy, "deploy", force=True, reason="smoke")
    assert answer.accepted
    made = [ready.await_decision(action) for action in (Action.KILL, Action.DEPLOY)]
    found = ready.bench.follow(SafetyDecision, "safety/history", qos.HISTORY)
    ready.bench.until(lambda: len(found) == 2, "both are found")
    for then, now in zip(made, found, strict=True):
        assert (now.epoch, now.id, now.action) == (then.epoch, then.id, then.action)
        assert list(now.reasons) == list(then.reasons)
        late = (now.header.stamp.sec - then.header.stamp.sec) * 1e9
        late += now.header.stamp.nanosec - then.header.stamp.nanosec
        assert abs(late) < 0.5e9, "stamped when it was decided"
    newest = found[-1].id
    ready.bench.until(lambda: ready.states[-1].fired_id == newest, "it tells which is the newest")


# What devices ask for


def request(scene, number, link="upf_can", reason="ABNORMAL"):
    """A device asks through its node."""
    message = SafetyRequest(link=link, device="33", request=number, reason=reason)
    scene.bench.publish(message, "safety/request")


def test_a_device_that_asks_blocks_flight_until_it_lets_go(ready):
    released = len(ready.decided(Action.FLIGHT_BLOCK_RELEASE))
    request(ready, SafetyRequest.FLIGHT_BLOCK)
    state = ready.await_stage(SafetyState.BLOCKED)
    assert list(state.device_blocks) == ["upf_can 33"]
    assert state.flight_blocked
    assert list(state.block_reasons) == ["upf_can 33 asks to block flight: ABNORMAL"]

    def decided():
        newest = ready.await_decision(Action.FLIGHT_BLOCK)
        return list(newest.reasons) == list(state.block_reasons)

    ready.bench.until(decided, "its reason is decided upon")
    answer = ready.call(Arm, "arm", arm=True)
    assert not answer.success
    assert "upf_can 33 asks to block flight: ABNORMAL" in answer.message
    assert ready.link.arm_requests == []
    request(ready, SafetyRequest.FLIGHT_BLOCK_RELEASE, reason="READY")
    state = ready.await_stage(SafetyState.READY)
    assert list(state.device_blocks) == []
    assert not state.flight_blocked
    ready.bench.until(
        lambda: len(ready.decided(Action.FLIGHT_BLOCK_RELEASE)) > released, "it is released"
    )


def test_whom_it_remembers_is_published_at_once_though_nothing_else_changes(ready, monkeypatch):
    request(ready, SafetyRequest.FLIGHT_BLOCK)
    before = ready.await_stage(SafetyState.BLOCKED)
    # After one more, no state comes but for a change.
    monkeypatch.setattr(runtime, "STATE_INTERVAL", 3600.0)
    ready.states.clear()
    ready.bench.until(lambda: ready.states, "the last regular state")
    request(ready, SafetyRequest.FLIGHT_BLOCK, link="another")
    ready.bench.until(lambda: len(ready.states[-1].device_blocks) == 2, "it is published")
    after = ready.states[-1]
    assert list(after.device_blocks) == ["another 33", "upf_can 33"]
    assert (after.state, after.decision_id) == (before.state, before.decision_id)


def test_a_device_that_asks_for_a_kill_gets_it(ready):
    request(ready, SafetyRequest.KILL, reason="about to launch")
    kill = ready.await_decision(Action.KILL)
    assert kill.rule == "device asks for a kill"
    assert "upf_can 33: about to launch" in kill.reasons
    assert "about to launch" in kill.reasons[0]


def test_what_no_device_may_ask_for_is_logged_once_for_each_link_and_nothing_else(ready, capfd):
    before = ready.states[-1].decision_id
    for number in (SafetyRequest.NONE, 200, 200):
        request(ready, number)
    request(ready, 4, link="another")
    # Comes after all of them.
    request(ready, SafetyRequest.FLIGHT_BLOCK, link="last")
    state = ready.await_stage(SafetyState.BLOCKED)
    assert list(state.device_blocks) == ["last 33"]
    assert state.decision_id == before + 1, "nothing but the block was decided"
    said = [line for line in capfd.readouterr().err.splitlines() if "need KILL 1" in line]
    assert len(said) == 2
    assert "upf_can 33 requests 0: " in said[0]
    assert "another 33 requests 4: " in said[1]


# Arm


def test_arm_goes_to_the_device_node_and_back_and_fails_where_it_fails(scene):
    scene.await_stage(SafetyState.READY)
    answer = scene.call(Arm, "arm", arm=True)
    assert not answer.success
    assert "mavlink_parachute/arm is not there" in answer.message
    scene.link.offer_arming()
    client = scene.supervisor._arm_clients["mavlink_parachute"]
    scene.bench.until(client.service_is_ready, "its service is there")
    scene.link.arm_succeeds = False
    answer = scene.call(Arm, "arm", arm=True)
    assert not answer.success
    assert "mavlink_parachute: as told" in answer.message
    assert scene.states[-1].state == SafetyState.READY
    scene.link.arm_succeeds = True
    answer = scene.call(Arm, "arm", arm=True, triggers=4)
    assert answer.success, answer.message
    scene.await_stage(SafetyState.ARMED)
    assert scene.call(Arm, "arm", arm=False).success
    assert scene.link.arm_requests[1:] == [(True, 4), (False, 0)]
    scene.await_stage(SafetyState.READY)


def test_arm_is_refused_while_flight_is_blocked(ready):
    ready.link.healthy = False
    ready.await_stage(SafetyState.BLOCKED)
    answer = ready.call(Arm, "arm", arm=True)
    assert not answer.success
    assert answer.message
    assert ready.link.arm_requests == []


# Kill and deploy


def test_a_kill_is_answered_as_it_ends_and_sent_again_until_somebody_reports(ready):
    ready.link.outcomes = [Outcome.SENT, Outcome.FAILED]
    answer = ready.call(Kill, "kill", reason="a test")
    assert not answer.success
    assert answer.message
    ready.link.outcomes = []
    future = ready.bench.ask(Kill, "safety/kill", reason="another test")

    def sent():
        found = ready.decided(Action.KILL)[1:]
        return found and sum(d.id == found[0].id for d in ready.decisions) >= 3 and found

    (kill,) = ready.bench.until(sent, "it is sent again with its number")
    assert kill.targets == ["mavlink_parachute"]
    assert any("another test" in reason for reason in kill.reasons)
    ready.link.report_newest(Action.KILL, Outcome.CONFIRMED)
    ready.bench.until(future.done, "it is answered")
    answer = future.result()
    assert (answer.success, answer.accepted) == (True, True), answer.message


def test_a_deploy_goes_after_the_kill_on_the_ground_only_with_force_until_a_reset(ready):
    answer = ready.call(Deploy, "deploy", reason="a slip")
    assert not answer.success
    assert answer.message
    assert ready.decided(Action.KILL) == ready.decided(Action.DEPLOY) == []
    answer = ready.call(Deploy, "deploy", force=True, reason="a test")
    assert (answer.success, answer.accepted) == (True, True), answer.message
    (kill,), (deploy,) = ready.decided(Action.KILL), ready.decided(Action.DEPLOY)
    assert kill.id < deploy.id
    # Each may be sent again until a report of it comes.
    assert ready.decisions.index(kill) < ready.decisions.index(deploy)
    ready.await_stage(SafetyState.DEPLOYED)
    answer = ready.call(Trigger, "reset")
    assert answer.success, answer.message
    ready.await_stage(SafetyState.READY)


def test_a_deploy_that_nobody_confirms_is_answered_so(ready):
    ready.link.outcomes = [Outcome.SENT, Outcome.FAILED]
    answer = ready.call(Deploy, "deploy", force=True, reason="a test")
    assert not answer.success
    ready.await_stage(SafetyState.FAULT)
    assert ready.states[-1].alarms


def test_after_a_restart_of_the_supervisor_its_epoch_is_higher(ready):
    before = ready.states[-1].epoch
    ready.bench.remove(ready.supervisor)
    ready.states.clear()
    again = ready.bench.add(SafetySupervisorNode, **QUICK)
    ready.bench.until(lambda: ready.states, "it speaks")
    assert ready.states[-1].epoch >= before
    assert again.runtime.state.epoch > 0


# Modes


def test_in_shadow_it_says_and_does_not_do_and_inhibited_neither(ready, capfd):
    """What a person asks for is in the log, whatever came of it."""
    capfd.readouterr()
    answer = ready.call(SetMode, "set_mode", mode=9)
    assert not answer.success
    assert "mode 9: need ACTIVE 0, SHADOW 1 or INHIBITED 2" in answer.message
    assert ready.states[-1].mode == SafetyState.ACTIVE
    assert ready.call(SetMode, "set_mode", mode=1, reason="a test").success
    assert not ready.call(Kill, "kill", reason="a test").success
    assert all(d.shadow for d in ready.decided(Action.KILL))
    ready.bench.until(lambda: ready.states[-1].mode == SafetyState.SHADOW, "it says its mode")
    assert ready.call(SetMode, "set_mode", mode=0).success
    assert ready.call(SetMode, "set_mode", mode=2, reason="a test").success
    ready.decisions.clear()
    assert not ready.call(Deploy, "deploy", force=True, reason="it looks odd").success
    assert ready.decided(Action.KILL) == ready.decided(Action.DEPLOY) == []
    log = capfd.readouterr().err
    assert "safety/deploy(force=True, reason='it looks odd') answered: refused: " in log
    assert "safety/set_mode(mode=2, force=False, reason='a test') answered: mode INHIBITED" in log


@pytest.mark.parametrize(
    ("mode", "meaning"),
    [
        ("SHADOW", "SHADOW: reports its decisions and sends none"),
        ("INHIBITED", "INHIBITED: decides nothing"),
    ],
)
def test_a_mode_in_which_nobody_is_protected_does_not_look_well(bench, capfd, mode, meaning):
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    scene = Scene(bench, mode=mode)
    assert scene.await_stage(SafetyState.READY).state_text == f"{meaning}; READY"
    assert f"mode is {meaning} (parameter mode)" in capfd.readouterr().err

    def decisions():
        every = [one for array in diagnostics for one in array.status]
        return [one for one in every if one.name.endswith("safety_supervisor: decisions")]

    bench.until(lambda: decisions() and decisions()[-1].message == f"{meaning}; READY", "it says")
    assert decisions()[-1].level == DiagnosticStatus.WARN
