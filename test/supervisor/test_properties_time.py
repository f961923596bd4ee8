"""What holds for any time: no deadline passes unserved; several inputs may come at once."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
from story import FLYING, IDLING, LINK, STANDING, START
from test_properties import EVIDENCE, RELEASED, REQUESTS

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.state import State
from chute_ros.supervisor.wakes import next_deadline

CONFIG = SupervisorConfig(deploy_links=(LINK, "upf_can"))
WAITS = st.floats(0.0, 9.0, allow_nan=False)
HEALTHY = st.builds(
    i.LinkHeartbeat, st.just(LINK), st.just(LinkState.OK), st.just(True), st.integers(0, 99)
)
#: Reports that meet the decisions that are really on their way.
REPORTS = st.builds(
    i.ActionReport,
    st.just(7),
    st.integers(1, 8),
    st.sampled_from([LINK, "upf_can"]),
    st.sampled_from(Outcome),
    st.just("told"),
    st.sampled_from([0, 7, 7, 7, 8, 2**32 - 1]),
    st.integers(0, 12),
)
VEHICLE = st.builds(i.VehicleReport, st.sampled_from([FLYING, IDLING, STANDING]))
DONE = st.builds(i.ArmDone, st.just(0), st.booleans(), st.booleans(), st.just("done"))
ANY = st.one_of(EVIDENCE, RELEASED, REQUESTS, HEALTHY, REPORTS, VEHICLE, DONE)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(WAITS, st.lists(ANY, max_size=5).map(tuple)), max_size=25))
def test_a_deadline_is_served_when_it_comes_whatever_the_rounding(sequence):
    now, state = START, State(epoch=7, started_at=START)
    for wait, inputs in sequence:
        end = now + wait
        while (wake := next_deadline(CONFIG, state, now)) < end:
            assert wake > now
            now = wake
            state, _ = update(CONFIG, state, (), now)
            # All that this moment brings is done: the next instant has nothing to add.
            instant = math.nextafter(now, math.inf)
            if next_deadline(CONFIG, state, now) > instant:
                assert update(CONFIG, state, (), instant)[1] == ()
        now = end
        state, _ = update(CONFIG, state, inputs, now)


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-5.0, 9.0), st.lists(ANY, max_size=6).map(tuple)), max_size=25),
    st.sampled_from(i.Mode),
)
def test_any_number_of_inputs_at_once_and_a_time_that_jumps_raise_nothing(sequence, mode):
    now, state = START, State(epoch=7, started_at=START, mode=mode)
    killed, order = False, (0, 0)
    for wait, inputs in sequence:
        now += wait
        state, outputs = update(CONFIG, state, inputs, now)
        for output in outputs:
            if not isinstance(output, i.Decide):
                continue
            decision = output.decision
            if not output.again:
                assert (decision.epoch, decision.id) > order
                order = (decision.epoch, decision.id)
            killed |= decision.action is Action.KILL and not decision.shadow
            if decision.action is Action.DEPLOY and not decision.shadow:
                assert killed


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(WAITS, st.one_of(EVIDENCE, HEALTHY, REPORTS, VEHICLE)), max_size=40))
def test_a_heartbeat_that_fails_alone_never_fires(sequence):
    now, state = START, State(epoch=7, started_at=START)
    for wait, one in sequence:
        now += wait
        for inputs in ((), (one,)):
            state, outputs = update(CONFIG, state, inputs, now)
            actions = {o.decision.action for o in outputs if isinstance(o, i.Decide)}
            assert not actions & {Action.KILL, Action.DEPLOY}
