"""What must always hold, for any order and timing of inputs."""

from hypothesis import given, settings
from hypothesis import strategies as st
from story import FLYING, LINK, STANDING, START, parachute

from chute_ros.model import Action, LinkState, Outcome, VehicleState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.requests import MOST_DEVICE_BLOCKS
from chute_ros.supervisor.state import State
from chute_ros.supervisor.wakes import next_deadline

LINKS = st.sampled_from([LINK, "upf_can", "stranger"])
CONFIG = SupervisorConfig(deploy_links=(LINK, "upf_can"))

EVIDENCE = st.one_of(
    st.builds(
        i.LinkHeartbeat, LINKS, st.sampled_from(LinkState), st.booleans(), st.integers(0, 5)
    ),
    st.builds(i.VehicleReport, st.sampled_from([FLYING, STANDING, VehicleState()])),
    st.builds(
        i.ActionReport,
        st.integers(6, 9),
        st.integers(0, 12),
        LINKS,
        st.sampled_from(Outcome),
        st.just("told"),
        st.integers(6, 9),
    ),
    st.builds(parachute, LINKS, st.sampled_from(["1/161", "33"]), st.just(False), st.just(())),
    st.builds(
        i.BlockRequest,
        LINKS,
        st.sampled_from(["33", "34"]),
        st.booleans(),
        st.sampled_from(["", "ABNORMAL"]),
    ),
)
RELEASED = st.builds(parachute, LINKS, st.just("1/161"), st.just(True), st.just(()))
# Tokens are given by position later, so that each is used once.
REQUESTS = st.one_of(
    st.builds(i.ArmRequest, st.just(1), st.booleans(), st.just(0)),
    st.builds(i.KillRequest, st.just(1), st.just("operator"), st.just("stop")),
    st.builds(i.DeployRequest, st.just(1), st.booleans(), st.just("it falls")),
    st.builds(i.ResetRequest, st.just(1)),
    st.builds(i.ModeRequest, st.just(1), st.sampled_from(i.Mode), st.booleans()),
)
ArmAnswer = st.tuples(st.just("arm"), st.booleans())
TIMES = st.sampled_from([0.0, 0.001, 0.05, 0.1, 0.3, 0.5, 1.0, 7.0, 20.0])


def steps(*inputs: st.SearchStrategy) -> st.SearchStrategy:
    return st.lists(st.tuples(TIMES, st.one_of(*inputs)), max_size=40)


class Run:
    """Feeds a sequence to the core and keeps what came out."""

    def __init__(self, sequence: list, mode: i.Mode = i.Mode.ACTIVE) -> None:
        self.now = START
        self.state = State(epoch=7, started_at=START, mode=mode)
        #: With the modes before and after the update.
        self.decisions: list[tuple[set[i.Mode], i.Decide]] = []
        self.answers: list[int] = []
        self.asked: list[int] = []
        self.arming: list[i.ArmDevices] = []
        for number, (wait, one) in enumerate(sequence, start=1):
            self.now += wait
            if isinstance(one, tuple):
                self.answer_arming(one[1])
                continue
            if hasattr(one, "token") and one.token:
                one = type(one)(number, *list(vars(one).values())[1:])
                self.asked.append(number)
            self.update((one,))

    def update(self, inputs: tuple) -> tuple:
        mode = self.state.mode
        self.state, outputs = update(CONFIG, self.state, inputs, self.now)
        modes = {mode, self.state.mode}
        for output in outputs:
            if isinstance(output, i.Decide):
                self.decisions.append((modes, output))
            elif isinstance(output, i.Finish):
                self.answers.append(output.token)
            elif isinstance(output, i.ArmDevices):
                self.arming.append(output)
        assert next_deadline(CONFIG, self.state, self.now) > self.now
        if self.state.stage in (Stage.READY, Stage.ARMED, Stage.LANDED):
            assert not self.state.device_blocks, "a device that asks blocks flight on the ground"
        return outputs

    def answer_arming(self, success: bool) -> None:
        while self.arming:
            order = self.arming.pop()
            self.update((i.ArmDone(order.token, order.arm, success, "done"),))

    def actions(self) -> list[Action]:
        return [output.decision.action for _, output in self.decisions]


@settings(max_examples=300, deadline=None)
@given(steps(EVIDENCE))
def test_without_a_request_or_a_released_parachute_nothing_ever_fires(sequence):
    run = Run(sequence)
    assert Action.KILL not in run.actions()
    assert Action.DEPLOY not in run.actions()


@settings(max_examples=300, deadline=None)
@given(steps(EVIDENCE, RELEASED, REQUESTS, ArmAnswer), st.sampled_from(i.Mode))
def test_what_always_holds(sequence, mode):
    run = Run(sequence, mode)
    killed = False
    order = (0, 0)
    for modes, output in run.decisions:
        decision = output.decision
        if not output.again:
            assert (decision.epoch, decision.id) > order, "numbers rise"
            order = (decision.epoch, decision.id)
        if decision.action is Action.DEPLOY:
            assert killed, "every deploy is preceded by a kill"
        killed = killed or decision.action is Action.KILL
        if decision.rule == "mode":
            # Leaving ACTIVE takes the flight block back; that goes on until it has arrived.
            assert decision.action is Action.FLIGHT_BLOCK_RELEASE
            continue
        assert modes != {i.Mode.INHIBITED}, "INHIBITED decides nothing"
        if modes == {i.Mode.SHADOW}:
            assert decision.shadow


@settings(max_examples=300, deadline=None)
@given(steps(EVIDENCE, RELEASED, REQUESTS, ArmAnswer))
def test_each_request_is_answered_exactly_once(sequence):
    run = Run(sequence)
    run.answer_arming(True)
    run.update(())
    end = run.now + 60.0  # longer than every limit; an alarm that does not stop goes on
    while (deadline := next_deadline(CONFIG, run.state, run.now)) < end:
        run.now = deadline
        run.update(())
    # What waits for a kill or a deploy has an answer in the end; nothing has two.
    assert sorted(run.answers) == sorted(run.asked)


@settings(max_examples=100, deadline=None)
@given(steps(EVIDENCE, RELEASED, REQUESTS, ArmAnswer))
def test_looking_twice_at_the_same_moment_decides_nothing_more(sequence):
    run = Run(sequence)
    run.update(())
    assert run.update(()) == ()


@settings(max_examples=100, deadline=None)
@given(steps(EVIDENCE, RELEASED, REQUESTS, ArmAnswer))
def test_the_same_inputs_give_the_same_decisions(sequence):
    first, second = Run(sequence), Run(sequence)
    assert CODEC.to_json(first.state) == CODEC.to_json(second.state)
    assert first.decisions == second.decisions


@settings(max_examples=50, deadline=None)
@given(
    st.lists(
        st.builds(i.BlockRequest, LINKS, st.text(max_size=3), st.booleans(), st.text(max_size=3)),
        max_size=200,
    ),
    st.integers(0, 2 * MOST_DEVICE_BLOCKS),
)
def test_made_up_names_do_not_grow_it_and_releases_leave_nothing(asked, more):
    asked += [i.BlockRequest("stranger", f"made up {n}", True, "") for n in range(more)]
    run = Run([(0.001, one) for one in asked])
    assert len(run.state.device_blocks) <= MOST_DEVICE_BLOCKS
    releases = [i.BlockRequest(one.link, one.device, False, "") for one in asked]
    run.update(tuple(releases))
    assert dict(run.state.device_blocks) == {}
