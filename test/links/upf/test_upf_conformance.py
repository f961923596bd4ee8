"""The kit on the simulated UPF controller, sound and broken in each clause, in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import cycle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit_run import KitRun, of, problem, results

from chute_ros.conformance.bench import NotAllowedError
from chute_ros.conformance.clause import SOAK, Risk, Verdict
from chute_ros.conformance.session import Allowed, Session
from chute_ros.conformance.virtual import VirtualLine
from chute_ros.links.upf.conformance import CLAUSES
from chute_ros.links.upf.conformance.bench import DNA, UpfBench
from chute_ros.links.upf.kit import KIT
from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import CONTROLLER_NODE_ID
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.simulator.broken import BREAKS
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import UpfController
from chute_ros.links.upf.simulator.memory import CONTROLLER_PARAMETERS
from chute_ros.links.upf.simulator.node import NODE_STATUS
from chute_ros.links.upf.simulator.trigger import UpfTrigger
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.endpoint import Heard
from chute_ros.transport.data_types import load_data_types

NAMES = [one.name for one in CLAUSES]
DEFINITIONS = Definitions(load_data_types("", ""))


class Run(KitRun):
    """A controller, a trigger and the kit on one bus."""

    def __init__(self, risk: Risk) -> None:
        self.controller, self.trigger = UpfController(DEFINITIONS), UpfTrigger(DEFINITIONS)
        self.bench = UpfBench(DEFINITIONS, risk)
        bus = UpfBus([self.controller, self.trigger])
        super().__init__(Session(self.bench, CLAUSES, Allowed(risk)), bus)


def simulated(broken: str) -> VirtualLine:
    """As the kit has it for its evidence."""
    line = KIT.virtual(broken)
    line.run()
    return line


@pytest.mark.parametrize("needs", [SOAK, DNA])
def test_a_sound_controller_passes_all_that_is_allowed(needs: str) -> None:
    device, bench = KIT.simulated("", needs)
    line = VirtualLine(Session(bench, CLAUSES, Allowed(Risk.FIRES, (needs,))), device)
    line.run()
    assert of(line, Verdict.PASSED) == [one.name for one in CLAUSES if one.needs in ("", needs)]
    assert problem(line) == ""


def test_each_clause_has_a_way_to_be_broken() -> None:
    assert sorted(BREAKS) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_controller_that_breaks_a_clause_fails_exactly_that(name: str) -> None:
    line = simulated(name)
    assert of(line, Verdict.FAILED) == [name]
    assert results(line)[name].why


# -- whatever it is told -------------------------------------------------------------------------


def whole(line: VirtualLine) -> None:
    """Each clause has its verdict: whatever a device says, or does not, is no mistake of ours."""
    line.run()
    assert [*results(line)] == NAMES
    assert of(line, Verdict.FAILED)


@pytest.mark.parametrize("service", [*UpfController(DEFINITIONS).services])
def test_a_controller_that_answers_one_service_never_is_tried_to_the_end(service: str) -> None:
    run = Run(Risk.FIRES)
    del run.controller.services[service]
    whole(run.line)


def test_a_controller_without_node_status_is_tried_to_the_end() -> None:
    run = Run(Risk.FIRES)
    del run.controller.broadcasts[NODE_STATUS]
    whole(run.line)


def test_a_touchdown_of_a_launch_that_nobody_saw_proves_nothing() -> None:
    """Given a controller that is TOUCHDOWN already as the kit comes."""
    run = Run(Risk.FIRES)
    run.line.run(lambda: run.controller.state is ParachuteState.TOUCHDOWN)
    touchdown = [one for one in CLAUSES if one.name == "touchdown"]
    bench = UpfBench(DEFINITIONS, Risk.FIRES)
    late = VirtualLine(Session(bench, touchdown, Allowed(Risk.FIRES)), run.line.device)  # type: ignore[arg-type]
    late.now = run.line.now
    late.run()
    assert of(late, Verdict.NOT_TRIED) == ["touchdown"]


VALUES: st.SearchStrategy[p.Value | None] = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**31), 2**31),
    st.floats(width=32, allow_nan=False, allow_infinity=False),
    st.text(max_size=9),
)


@settings(max_examples=10)
@given(told=st.dictionaries(st.sampled_from([one.name for one in p.PARAMETERS]), VALUES))
def test_a_controller_with_any_values_is_tried_to_the_end(told: dict[str, p.Value | None]) -> None:
    run = Run(Risk.NONE)
    right = run.controller.services[bus_requests.GET_SET]

    def answer(request: Heard) -> dict[str, object] | None:
        name = bytes(request.values["name"]).decode()
        if name not in told:
            return right(request)
        value = {"empty": {}} if told[name] is None else p.union_of(told[name])
        return {"value": value, "default_value": value, "name": name.encode()}

    run.controller.services[bus_requests.GET_SET] = answer
    run.line.run()
    assert [*results(run.line)] == NAMES


@settings(max_examples=10)
@given(
    states=st.lists(st.integers(0, 7), min_size=1),
    uptimes=st.lists(st.integers(0, 2**32 - 1), min_size=1),
)
def test_a_controller_with_any_states_is_tried_to_the_end(
    states: list[int], uptimes: list[int]
) -> None:
    run = Run(Risk.FIRES)
    for message, field, every in (
        (names.PARACHUTE_STATUS, "state", cycle(states)),
        (NODE_STATUS, "uptime_sec", cycle(uptimes)),
    ):
        interval, make = run.controller.broadcasts[message]
        told = partial(_changed, make, field, every)
        run.controller.broadcasts[message] = (interval, told)
    run.line.run()
    assert [*results(run.line)] == NAMES


def _changed(
    make: Callable[[], dict[str, object]], field: str, every: Iterator[int]
) -> dict[str, object]:
    return {**make(), field: next(every)}


def _clamps(controller: UpfController, low: int, high: int) -> None:
    """It takes the nearest value in place of one that is out of its range."""
    right = controller.memory.set

    def clamp(name: str, wanted: p.Value) -> bool:
        if name == p.NODE_STATUS_INTERVAL and isinstance(wanted, (int, float)):
            wanted = min(max(wanted, low), high)
        return right(name, wanted)

    controller.memory.set = clamp  # type: ignore[method-assign]


def test_a_controller_that_takes_the_nearest_value_is_as_good_as_one_that_refuses() -> None:
    run = Run(Risk.NONE)
    _clamps(run.controller, 2, 1000)
    run.line.run()
    result = results(run.line)["parameter-range"]
    assert result.verdict is Verdict.PASSED
    assert result.why.endswith("is 2 and 1000")
    assert run.controller.values == CONTROLLER_PARAMETERS


def test_a_value_beyond_the_limits_that_it_tells_fails_and_is_set_back() -> None:
    """Given a controller that takes 1 where it tells that 2 is the least."""
    run = Run(Risk.NONE)
    right = run.controller.services[bus_requests.GET_SET]

    def answer(request: Heard) -> dict[str, object] | None:
        wanted = p.value_of(request.values["value"])
        if isinstance(wanted, int) and wanted < 0:
            run.controller.memory.values[p.NODE_STATUS_INTERVAL] = 1
            return run.controller.memory.answer(p.NODE_STATUS_INTERVAL)
        return right(request)

    run.controller.services[bus_requests.GET_SET] = answer
    run.line.run()
    assert results(run.line)["parameter-range"].verdict is Verdict.FAILED
    assert run.controller.values == CONTROLLER_PARAMETERS
    assert run.problem == ""


def test_one_that_says_yes_to_a_restart_and_goes_on_fails_soon_after_its_start() -> None:
    run = Run(Risk.NONE)
    run.controller.services[bus_requests.RESTART_NODE] = lambda _: None
    (restart,) = (one for one in CLAUSES if one.name == "restart")
    line = VirtualLine(Session(run.bench, [restart], Allowed()), run.device)
    line.run()
    assert of(line, Verdict.FAILED) == ["restart"]


# -- what it must not do -------------------------------------------------------------------------


@pytest.mark.parametrize("risk", list(Risk))
def test_it_is_left_as_it_was_found_and_did_no_more_than_was_allowed(risk: Risk) -> None:
    run = Run(risk)
    run.line.run()
    assert run.controller.values == run.controller.saved == CONTROLLER_PARAMETERS
    assert run.trigger.fired == (risk is Risk.FIRES)
    if risk is Risk.NONE:
        assert run.controller.requests_heard == []
    if risk is not Risk.FIRES:
        assert run.controller.state is ParachuteState.READY
        deploys = [one for one in run.controller.requests_heard if "DEPLOY" in one]
        assert deploys == []
    tried = [one for one in CLAUSES if results(run.line)[one.name].verdict is Verdict.PASSED]
    assert max(one.risk for one in tried) == risk


@pytest.mark.parametrize("risk", list(Risk))
def test_a_device_that_was_sent_nothing_that_arms_is_not_said_to_be_left_armed(risk: Risk) -> None:
    """Given one that vanishes with a harmless parameter changed."""
    run = Run(risk)
    run.line.run(lambda: bool(run.bench.changed))
    run.controller.act("silent")
    run.line.run()
    assert f"{p.NODE_STATUS_INTERVAL} is not" in problem(run.line)
    assert "ARMED" not in problem(run.line)
    asked = [one for one in run.bench.traffic if one.sent and names.PARACHUTE_SERVICE in one.name]
    assert asked == []


def test_a_device_that_vanishes_armed_may_be_left_armed() -> None:
    run = Run(Risk.ARMS)
    run.line.run(lambda: run.controller.state is ParachuteState.ARMED)
    run.controller.act("silent")
    run.line.run()
    assert "it may be LEFT ARMED: no ParachuteStatus shows it" in problem(run.line)


def test_an_abort_leaves_it_disarmed_with_its_parameters_as_they_were() -> None:
    run = Run(Risk.ARMS)
    run.line.run(lambda: run.controller.state is ParachuteState.ARMED)
    run.session.abort("aborted by Ctrl-C", run.line.now)
    run.line.run()
    assert run.controller.state is ParachuteState.READY
    assert run.controller.values == CONTROLLER_PARAMETERS
    assert problem(run.line) == "aborted by Ctrl-C"


@pytest.mark.parametrize("after", [0.0, 0.3, 0.7, 1.1])
@pytest.mark.parametrize("name", ["dna", "dna-forgets"])
def test_an_abort_gives_it_its_own_node_id_again(name: str, after: float) -> None:
    """Given a Ctrl-C so long after its static node id became 0."""
    device, bench = KIT.simulated("", DNA)
    clauses = [one for one in CLAUSES if one.name == name]
    line = VirtualLine(Session(bench, clauses, Allowed(options=(DNA,))), device)
    assert isinstance(device, UpfBus)
    controller = device.nodes[0]
    line.run(lambda: controller.values[p.STATIC_NODE_ID] == 0)
    until = line.now + after
    line.run(lambda: line.now >= until)
    line.session.abort("aborted by Ctrl-C", line.now)
    line.run()
    assert problem(line) == "aborted by Ctrl-C"
    assert controller.node_id == controller.values[p.STATIC_NODE_ID] == CONTROLLER_NODE_ID


def test_a_device_that_comes_back_without_a_node_id_is_named() -> None:
    """Given one that dies while it has none."""
    device, bench = KIT.simulated("", DNA)
    clauses = [one for one in CLAUSES if one.name == "dna"]
    line = VirtualLine(Session(bench, clauses, Allowed(options=(DNA,))), device)
    assert isinstance(device, UpfBus)
    line.run(lambda: device.nodes[0].values[p.STATIC_NODE_ID] == 0)
    device.nodes[0].act("silent")
    line.run()
    assert f"{p.STATIC_NODE_ID} is LEFT 0" in problem(line)


@pytest.mark.parametrize("risk", list(Risk))
def test_its_node_id_is_not_taken_unasked(risk: Risk) -> None:
    bench = UpfBench(DEFINITIONS, risk)
    bench.at(1.0)
    values = {"index": 0, "value": p.union_of(0), "name": p.STATIC_NODE_ID.encode()}
    with pytest.raises(NotAllowedError):
        next(bench.call(bus_requests.GET_SET, values))


@pytest.mark.parametrize(
    ("service", "type_name"),
    [
        (names.PARACHUTE_SERVICE, "TYPE_DEPLOY"),
        (names.PARACHUTE_SERVICE, "TYPE_DEPLOY_FORCE"),
        (names.TRIGGER_SERVICE, "TYPE_LAUNCH"),
    ],
)
def test_a_trial_that_would_fire_unasked_ends_in_our_own_error(
    service: str, type_name: str
) -> None:
    bench = UpfBench(DEFINITIONS, Risk.ARMS)
    bench.at(1.0)
    for magic in ({}, {"magic_number": 1}):
        values = {**DEFINITIONS.request(service, type_name), **magic}
        with pytest.raises(NotAllowedError):
            next(bench.call(service, values))
    aps = {"index": 0, "value": p.union_of(True), "name": p.ENABLE_APS.encode()}
    with pytest.raises(NotAllowedError):
        next(UpfBench(DEFINITIONS).call(bus_requests.GET_SET, aps))
    assert bench.take_output() == []
