"""The kit on the simulated parachute, sound and broken in each clause, in virtual time."""

import math
from itertools import cycle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit_run import KitRun

from chute_ros.conformance.bench import NotAllowedError
from chute_ros.conformance.clause import Risk, Verdict
from chute_ros.conformance.session import Allowed, DeviceFound, Session
from chute_ros.links.mavlink.conformance import CLAUSES
from chute_ros.links.mavlink.conformance.bench import MavlinkBench
from chute_ros.links.mavlink.kit import KIT
from chute_ros.links.mavlink.simulator.broken import BREAKS
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.model import DeploymentTrigger, TriggerFlags
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame, FrameDecoder
from chute_ros.protocol.mavlink.signing import Signer, SigningClock, Verifier

NAMES = [one.name for one in CLAUSES]
IN_REACH = [one.name for one in CLAUSES if not one.out_of_reach]
OF_SIGNING = ["unsigned-refused", "wrong-key-refused", "replay-refused", "signed-answers"]


def key():
    """The key of the simulated bench."""
    clock = SigningClock(1_790_000_000.0)
    return Signer(bytes(range(32)), clock), Verifier(bytes(range(32)), clock)


class Run(KitRun):
    """Kit and device on one line."""

    def __init__(self, device, risk=Risk.FIRES, session=None):
        super().__init__(session or Session(MavlinkBench(risk), CLAUSES, Allowed(risk)), device)


def sound(**settings):
    return ParachuteDevice(ParachuteSettings(**settings), [])


def simulated(broken):
    """As the kit has it for its evidence."""
    line = KIT.virtual(broken)
    return Run(line.device, session=line.session).to()


# -- what it finds ------------------------------------------------------------------------------


def test_a_sound_device_passes_all_that_can_be_tried():
    run = simulated("")
    assert run.of(Verdict.FAILED) == run.of(Verdict.NOT_SUPPORTED) == []
    unseen = {*NAMES} - {*IN_REACH}
    assert {*run.of(Verdict.NOT_TRIED)} == {*OF_SIGNING, "release-near-ground"} | unseen
    assert [*run.results] == NAMES
    assert run.problem == ""
    assert run.device.deployment is DeploymentTrigger.DRONE
    assert run.device.armed == TriggerFlags(0)


def test_what_needs_a_key_or_the_ground_passes_with_it():
    device = sound()
    device.sign(*key())
    session = KIT.virtual("signed-answers").session
    signed = Run(device, session=session).to()
    assert signed.of(Verdict.FAILED) == []
    assert {*OF_SIGNING} <= {*signed.of(Verdict.PASSED)}
    low = Run(sound(ground_cleared="no")).to()
    assert low.of(Verdict.FAILED) == []
    assert "release-near-ground" in low.of(Verdict.PASSED)
    assert low.results["release"].verdict is Verdict.NOT_TRIED


def test_each_clause_has_a_way_to_be_broken():
    assert {*BREAKS} == {*IN_REACH}


def test_a_device_that_leaves_out_what_it_may_is_not_blamed():
    """Given one without intervals, information and MAV_CMD_DO_PARACHUTE."""
    device = sound()
    for command in (dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAV_CMD_DO_PARACHUTE):
        del device.commands[command]
    del device.streams[dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC]
    del device.default_intervals[dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC]
    run = Run(device).to()
    lacks = ["request-information", "information-texts", "information-serial"]
    lacks += ["information-date", "information-time", "set-interval", "interval-told"]
    lacks += ["interval-default", "interval-stop", "heartbeat-constant"]
    lacks += ["automatic-release", "release"]
    assert run.of(Verdict.NOT_SUPPORTED) == lacks
    assert run.of(Verdict.FAILED) == []


class SlowParachute(ParachuteDevice):
    """Answers each command with IN_PROGRESS, and carries it out so much later (s). at_once: the
    result comes together with that first answer."""

    takes = 0.3

    def __init__(self, settings):
        super().__init__(settings, [])
        self._waiting: list[tuple[float, Frame]] = []

    def _command(self, frame):
        self.acknowledge(frame, int(dialect.MAV_RESULT_IN_PROGRESS))
        self._waiting.append((self.now + self.takes, frame))
        self.step(self.now)

    def step(self, now):
        super().step(now)
        due = [frame for at, frame in self._waiting if at <= now]
        self._waiting = [(at, frame) for at, frame in self._waiting if at > now]
        for frame in due:
            super()._command(frame)

    def next_step(self):
        return min((at for at, _ in self._waiting), default=math.inf)


@pytest.mark.parametrize("takes", [0.0, 0.3, 2.5])
def test_a_device_that_is_in_progress_first_is_judged_by_its_result(takes):
    device = SlowParachute(ParachuteSettings())
    device.takes = takes
    run = Run(device).to()
    assert run.of(Verdict.FAILED) == []
    assert {"release", "released-stays", "arm-sources"} <= {*run.of(Verdict.PASSED)}


def test_a_device_that_stays_in_progress_has_no_result():
    device = sound()
    device.commands[dialect.MAV_CMD_DO_PARACHUTE] = lambda _: int(dialect.MAV_RESULT_IN_PROGRESS)
    run = Run(device).to()
    assert run.results["release"].verdict is Verdict.FAILED
    assert run.results["release"].why.endswith("IN_PROGRESS, and no result within 5 s")
    assert "release-disarmed" in run.of(Verdict.FAILED)


# -- what shows only at a second look -------------------------------------------------------------


class SlyParachute(ParachuteDevice):
    """Wrong in a way that no first answer and no first status shows. does: in which."""

    def __init__(self, does):
        super().__init__(ParachuteSettings(), [])
        self.does, self._at = does, math.inf
        right = self.commands[dialect.MAV_CMD_DO_PARACHUTE]
        self.commands[dialect.MAV_CMD_DO_PARACHUTE] = lambda params: self._do(params, right)

    def _do(self, params, right):
        result = right(params)
        late = {
            "releases after its refusal": dialect.MAV_RESULT_FAILED,
            "takes its release back": dialect.MAV_RESULT_ACCEPTED,
            "names another trigger": dialect.MAV_RESULT_ACCEPTED,
        }
        if params[0] == dialect.PARACHUTE_RELEASE and result == late.get(self.does):
            self._at = self.now + 1.0
        if params[0] == dialect.PARACHUTE_ENABLE and self.does == "arms all by action 1":
            self.armed = TriggerFlags(255)
        if params[0] == dialect.PARACHUTE_DISABLE and self.does == "disarms all by action 0":
            self.armed = TriggerFlags(0)
        return result

    def carry_out(self, command):
        if command.get_type() != "COMMAND_INT":
            return super().carry_out(command)
        params = (command.param1, command.param2, *[0.0] * 5)
        number = command.command
        if number == dialect.MAV_CMD_SET_PARACHUTE_ARM and self.does == "arms without the mask":
            self.armed = TriggerFlags(int(params[0]))
            return int(dialect.MAV_RESULT_ACCEPTED)
        if number == dialect.MAV_CMD_DO_PARACHUTE and self.does == "releases by COMMAND_INT":
            self.deploy(DeploymentTrigger.MAVLINK)
            return int(dialect.MAV_RESULT_FAILED)
        return self.commands[number](params)

    def step(self, now):
        super().step(now)
        if now >= self._at:
            self._at = math.inf
            self.deployment = {
                "takes its release back": DeploymentTrigger.NONE,
                "names another trigger": DeploymentTrigger.ATS,
            }.get(self.does, DeploymentTrigger.MAVLINK)
        if self.deployment is not DeploymentTrigger.NONE and self.does == "reports no more":
            self._due.pop(dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS, None)

    def next_step(self):
        return self._at


@pytest.mark.parametrize(
    ("does", "clause"),
    [
        ("releases after its refusal", "release-disarmed"),
        ("releases by COMMAND_INT", "release-disarmed"),
        ("arms without the mask", "arm-mask"),
        ("arms all by action 1", "automatic-release"),
        ("disarms all by action 0", "automatic-release"),
        ("takes its release back", "released-stays"),
        ("names another trigger", "released-stays"),
        ("reports no more", "released-stays"),
    ],
)
def test_what_shows_at_a_second_look_fails(does, clause):
    assert Run(SlyParachute(does)).to().of(Verdict.FAILED) == [clause]


def test_a_device_that_obeys_command_int_as_well_passes():
    assert Run(SlyParachute("")).to().of(Verdict.FAILED) == []


# -- whatever it is told -------------------------------------------------------------------------

STREAMS = [*sound().streams]
COMMANDS = [*sound().commands]


@pytest.mark.parametrize("stream", STREAMS)
def test_a_device_that_sends_one_message_never_is_tried_to_the_end(stream):
    device = sound()
    del device.streams[stream]
    device.default_intervals.pop(stream, None)
    run = Run(device).to()
    assert [*run.results] == NAMES
    passed = [name for name, one in run.results.items() if one.verdict is Verdict.PASSED]
    assert [name for name in passed if not run.results[name].proof] == []


#: No answer; accepted, denied, unsupported, in progress, and a result that has no name.
RESULTS = [None, 0, 2, 3, 5, 200]


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("result", RESULTS)
def test_a_device_that_answers_one_command_with_anything_is_tried_to_the_end(command, result):
    device = sound()
    if result is None:
        del device.commands[command]
    else:
        device.commands[command] = lambda _: result
    assert [*Run(device).to().results] == NAMES


RANGES = {"uint8_t": 2**8, "uint16_t": 2**16, "uint32_t": 2**32, "uint64_t": 2**64}


@settings(max_examples=60)
@given(data=st.data())
def test_a_device_with_any_value_in_a_field_is_tried_to_the_end(data):
    device = sound()
    stream = data.draw(st.sampled_from(STREAMS))
    kind = dialect.mavlink_map[stream]
    field = data.draw(st.sampled_from(kind.fieldnames))
    place = kind.fieldnames.index(field)
    if kind.fieldtypes[place] == "char":
        values: st.SearchStrategy[object] = st.binary(max_size=kind.array_lengths[0] or 1)
        field = f"_{field}_raw"
    else:
        values = st.integers(0, RANGES[kind.fieldtypes[place]] - 1)
    told = cycle(data.draw(st.lists(values, min_size=1, max_size=4)))
    make = device.streams[stream]

    def changed():
        message = make()
        setattr(message, field, next(told))
        return message

    device.streams[stream] = changed
    run = Run(device).to()
    # What says that it is no parachute may not be found.
    assert [*run.results] in (NAMES, [])


# -- what it must not do ------------------------------------------------------------------------


def commands_in(sent):
    """(command, first parameter) of all that a device could take from these bytes."""
    decoder = FrameDecoder()
    frames = [frame for data in sent for frame in decoder.feed_datagram(data, 0.0)]
    long = [one.message for one in frames if one.message.get_type() == "COMMAND_LONG"]
    return {(one.command, one.param1) for one in long}


@pytest.mark.parametrize("risk", [Risk.NONE, Risk.ARMS])
def test_what_was_not_allowed_is_never_sent(risk):
    run = Run(sound(), risk).to()
    sent = commands_in(run.line.sent)
    arms = {one for one in sent if one[0] == dialect.MAV_CMD_SET_PARACHUTE_ARM}
    fires = {
        one for one in sent if one[0] == dialect.MAV_CMD_DO_PARACHUTE and one[1] not in (0, 1)
    }
    assert bool(arms) == (risk is Risk.ARMS)
    assert not fires
    tried = [one for one in CLAUSES if run.results[one.name].verdict is not Verdict.NOT_TRIED]
    assert max(one.risk for one in tried) == risk
    assert run.device.deployment is DeploymentTrigger.NONE
    assert run.device.armed == TriggerFlags(0)


@pytest.mark.parametrize("action", [dialect.PARACHUTE_RELEASE, 9.0, -1.0, math.nan, 1.5])
def test_a_trial_that_would_fire_unasked_ends_in_our_own_error(action):
    bench = MavlinkBench(Risk.ARMS)
    with pytest.raises(NotAllowedError):
        bench.send(bench.command_long(dialect.MAV_CMD_DO_PARACHUTE, action))
    assert bench.take_output() == []


def test_an_abort_leaves_the_device_disarmed():
    """Given a Ctrl-C while sources are armed."""
    run = Run(sound())
    run.to(lambda: bool(run.device.armed))
    run.session.abort("aborted by Ctrl-C", run.line.now)
    run.to()
    assert run.device.armed == TriggerFlags(0)
    assert run.problem == "aborted by Ctrl-C"
    run.session.abort("again", run.line.now)
    assert run.session.take_events() == []


@pytest.mark.parametrize("name", ["set-interval", "interval-stop"])
def test_a_status_that_was_set_otherwise_comes_as_before_in_the_end(name):
    """Given a Ctrl-C as it is tried, and a device that takes no default interval."""
    device = sound()
    command = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
    right = device.commands[command]
    device.commands[command] = lambda params: (
        right(params) if params[1] else int(dialect.MAV_RESULT_DENIED)
    )
    (clause,) = (one for one in CLAUSES if one.name == name)
    session = Session(MavlinkBench(), [clause], Allowed())
    run = Run(device, session=session)
    answer = f"command={command}, result={dialect.MAV_RESULT_ACCEPTED}"
    run.to(lambda: any(answer in one.text for one in session.bench.traffic))
    session.abort("aborted by Ctrl-C", run.line.now)
    run.to()
    assert run.problem == "aborted by Ctrl-C"
    told = dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS, *[0.0] * 6
    device.commands[dialect.MAV_CMD_GET_MESSAGE_INTERVAL](told)
    assert device.after_acknowledgement[-1].interval_us == 1_000_000


def test_a_device_that_was_sent_nothing_that_arms_is_not_disarmed():
    """Given one that falls silent before the first such command, though it is allowed."""
    run = Run(sound()).silenced()
    assert "PARACHUTE_STATUS" not in run.problem
    sent = [one.text for one in run.session.bench.traffic if one.sent]
    assert not any(f"command={dialect.MAV_CMD_SET_PARACHUTE_ARM}" in one for one in sent)


def test_a_device_that_cannot_be_disarmed_is_named():
    """Given one that stops to answer, armed."""
    run = Run(sound())
    run.to(lambda: bool(run.device.armed))
    del run.device.commands[dialect.MAV_CMD_SET_PARACHUTE_ARM]
    armed = int(run.device.armed)
    run.session.abort("aborted by Ctrl-C", run.line.now)
    run.to()
    left = f"the device is LEFT ARMED: arm_status is {armed} after all was disarmed"
    assert run.problem == f"aborted by Ctrl-C; {left}"


def test_a_device_that_vanishes_armed_may_be_left_armed():
    run = Run(sound())
    run.to(lambda: bool(run.device.armed))
    run.device.act("silent")
    run.to()
    assert run.problem.endswith("the device: it may be LEFT ARMED: no PARACHUTE_STATUS shows it")


def test_a_device_that_falls_silent_is_not_blamed_for_what_follows():
    """Given one that dies of the last bytes that are no frame."""
    device = sound()
    run = Run(device)
    run.to(lambda: "noise" in run.results)
    device.act("silent")
    run.to()
    # What is listened to, or must not be answered, cannot tell.
    assert run.of(Verdict.FAILED) == ["cut-frame"]
    told = "the device fell silent as cut-frame was tried"
    after = NAMES[NAMES.index("cut-frame") + 1 :]
    assert [name for name in NAMES if run.results[name].why == told] == after
    assert run.problem.startswith(told)


def test_a_device_that_starts_anew_in_the_middle_fails_the_clause_that_was_tried():
    """Given one that is switched off and on while it is listened to."""
    device = sound()
    run = Run(device, Risk.NONE)
    run.to(lambda: "noise" in run.results)
    device.act("reboot")
    run.to()
    (failed,) = run.of(Verdict.FAILED)
    assert run.results[failed].why.startswith("it restarted meanwhile (")
    assert run.problem == ""


def test_where_no_parachute_is_heard_it_tells_who_is():
    device = sound(component_id=42)
    device.streams[dialect.MAVLINK_MSG_ID_HEARTBEAT] = lambda: dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_GIMBAL, 8, 0, 0, 4, 3
    )
    del device.streams[dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS]
    del device.default_intervals[dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS]
    run = Run(device).to()
    assert run.problem.startswith("no parachute is received within 10 s (received from: 1/42)")
    assert run.results == {}
    assert not any(isinstance(one, DeviceFound) for one in run.line.events)
