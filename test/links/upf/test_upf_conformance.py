"""The kit on the simulated UPF controller and trigger, sound and broken in each clause, in virtual
time."""

import math
from dataclasses import replace
from functools import partial
from itertools import cycle
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit_run import KitRun

from chute_ros.conformance.bench import NotAllowedError
from chute_ros.conformance.clause import SOAK, Risk, Verdict
from chute_ros.conformance.session import Allowed, Session
from chute_ros.links.upf.conformance import CLAUSES
from chute_ros.links.upf.conformance.bench import (
    A_CONTROLLER,
    A_TRIGGER,
    DEPLOY_FORCE,
    DNA,
    TRIGGER,
    VEHICLE,
    UpfBench,
)
from chute_ros.links.upf.conformance.trigger import BROADCAST
from chute_ros.links.upf.kit import KIT
from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import CONTROLLER_NODE_ID, TRIGGER_NODE_ID
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.machine import ControllerEvent
from chute_ros.links.upf.simulator.broken import BREAKS, simulated_controller
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import ControllerSettings, UpfController
from chute_ros.links.upf.simulator.memory import CONTROLLER_PARAMETERS
from chute_ros.links.upf.simulator.node import NODE_STATUS, NodeSettings, UpfNode
from chute_ros.links.upf.simulator.trigger import TRIGGER_PARAMETERS, UpfTrigger
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.calls import Call
from chute_ros.protocol.dronecan.can_frame import pack, unpack
from chute_ros.transport.data_types import load_data_types

NAMES = [one.name for one in CLAUSES]
IN_REACH = [one.name for one in CLAUSES if not one.out_of_reach]
DEFINITIONS = Definitions(load_data_types("", ""))
OTHER_TYPES = Path(__file__).parents[2] / "dsdl_other" / "flyfire"


class Run(KitRun):
    """A controller, a trigger and the kit on one bus. options: what is given."""

    def __init__(self, risk, *options, definitions=DEFINITIONS):
        self.controller, self.trigger = UpfController(definitions), UpfTrigger(definitions)
        device = A_TRIGGER if TRIGGER in options else A_CONTROLLER
        self.bench = UpfBench(definitions, risk, device=device)
        self.bus = UpfBus([self.controller, self.trigger])
        super().__init__(Session(self.bench, CLAUSES, Allowed(risk, options)), self.bus)


def tried(
    *nodes,
    options=(),
    clauses=CLAUSES,
    **bench,
):
    """The kit on these nodes, to its end; it may do all."""
    session = Session(
        UpfBench(DEFINITIONS, Risk.FIRES, **bench), clauses, Allowed(Risk.FIRES, options)
    )
    return KitRun(session, UpfBus([*nodes])).to()


@pytest.mark.parametrize("given", [(SOAK,), (DNA,), (TRIGGER, SOAK), (TRIGGER, DNA)])
def test_a_sound_device_passes_all_that_is_allowed(given):
    device, bench = KIT.simulated("", " ".join(given))
    run = KitRun(Session(bench, CLAUSES, Allowed(Risk.FIRES, given)), device).to()
    met = [one for one in CLAUSES if {*one.needs.split()} <= {*given} and not one.out_of_reach]
    passes = [one.name for one in met if one.without not in given]
    # Nothing is wrong with it.
    assert run.of(Verdict.PASSED) == [one for one in passes if one != "block-when-abnormal"]
    assert run.problem == ""


def test_each_clause_has_a_way_to_be_broken():
    assert sorted(BREAKS) == sorted(IN_REACH)


def test_what_no_bench_can_show_is_not_tried_and_has_a_reason():
    line = KIT.virtual("")
    told = KitRun(line.session, line.device).to().results
    rows = [told[one] for one in NAMES if one not in IN_REACH]
    assert {one.verdict for one in rows} == {Verdict.NOT_TRIED}
    assert all(one.why for one in rows)


def test_a_fault_that_comes_while_it_is_tried_has_it_ask_for_a_flight_block():
    run = Run(Risk.NONE)
    run.to(lambda: run.controller.state is ParachuteState.READY)
    ready = run.line.now
    run.to(lambda: run.line.now > ready + 1.0)
    run.controller.act("error=IMU")
    run.to(lambda: run.line.now > ready + 2.0)
    run.controller.act("clear-errors")
    run.to()
    assert run.of(Verdict.FAILED) == []
    assert run.results["block-when-abnormal"].verdict is Verdict.PASSED


def test_one_that_is_fired_by_force_is_not_fired_by_the_other_request_as_well():
    run = Run(Risk.FIRES, DEPLOY_FORCE)
    run.to()
    assert run.of(Verdict.FAILED) == []
    for name in ("deploy-force", "kill-first", "launched-after-trigger", "touchdown"):
        assert run.results[name].verdict is Verdict.PASSED
    assert run.results["deploy"].why == "it is LAUNCHED (need READY)"


# -- what shows only at a second look -------------------------------------------------------------

_S = ParachuteState


class SlyController(UpfController):
    """Wrong in a way that no first answer shows. does: in which."""

    def __init__(self, does):
        super().__init__(DEFINITIONS, ControllerSettings(self_test=2.0))
        self.does, self._asks_at = does, math.inf
        if does == "says that it saves":
            self.services[bus_requests.EXECUTE_OPCODE] = lambda _: {"ok": True}
            right = self.memory.set

            def keep(name, wanted):
                saved = dict(self.memory.saved)
                done = right(name, wanted)
                if name == p.AUTO_SAVE and not wanted:
                    self.memory.saved = saved
                return done

            self.memory.set = keep
        if does == "takes node id 200":
            answer, most = self.memory.answer, {"max_value": {"integer_value": 200}}
            self.memory.answer = lambda name: {
                **answer(name),
                **(most if name == p.STATIC_NODE_ID else {}),
            }

    def reboot(self):
        super().reboot()
        self._asks_at = self.now + 0.5

    def receive(self, data, now):
        frame = unpack(data)
        if (
            self.does == "takes two nodes for one"
            and frame is not None
            and frame.identifier & 0x80
        ):
            data = pack(replace(frame, identifier=frame.identifier & ~0x7F | VEHICLE))
        super().receive(data, now)

    def decide(self, name):
        if self.does == "forces without the kill switch" and name == "TYPE_DEPLOY_FORCE":
            self._fire(self.now)
            return "SUCCESS"
        result = super().decide(name)
        if self.does == "does what it rejects" and name == "TYPE_TAKEOFF" and result == "REJECTED":
            self._move(ControllerEvent.TAKEOFF)
        if name == "TYPE_DEPLOY":
            if self.does == "fires though disabled" and not self.switch(p.ENABLE_PARACHUTE):
                self._fire(self.now)
            if self.does == "needs its APS" and not self.switch(p.ENABLE_APS):
                self._launch_at = math.nan
                return "REJECTED"
        return result

    def launch(self, cause, by_aps=False):
        if self.does == "commands its trigger first":
            values = self.definitions.request(names.TRIGGER_SERVICE, "TYPE_LAUNCH")
            for node_id in self._peers.triggers:
                self._start(Call(node_id, names.TRIGGER_SERVICE, values, 2))
        super().launch(cause, by_aps)

    def step(self, now):
        super().step(now)
        early = self.does == "releases the block early" and self.state is _S.NOT_READY
        again = self.does == "blocks while READY" and self.state is _S.READY
        if now >= self._asks_at and (early or again):
            self._asks_at = now + 0.4
            self._ask_vehicle("TYPE_FLIGHT_BLOCK" if again else "TYPE_FLIGHT_BLOCK_RELEASE")


@pytest.mark.parametrize(
    ("does", "clause"),
    [
        ("says that it saves", "auto-save"),
        ("takes node id 200", "node-id"),
        ("does what it rejects", "exclude-takeoff"),
        ("fires though disabled", "disabled"),
        ("needs its APS", "deploy"),
        ("commands its trigger first", "kill-first"),
        ("releases the block early", "release-when-ready"),
        ("blocks while READY", "release-when-ready"),
        ("takes two nodes for one", "two-senders"),
    ],
)
def test_what_shows_at_a_second_look_fails(does, clause):
    run = tried(SlyController(does), UpfTrigger(DEFINITIONS))
    assert run.of(Verdict.FAILED) == [clause]


def test_a_forced_deploy_without_the_kill_switch_fails():
    controller = SlyController("forces without the kill switch")
    clauses = [one for one in CLAUSES if one.name != "disabled"]
    run = tried(controller, UpfTrigger(DEFINITIONS), options=(DEPLOY_FORCE,), clauses=clauses)
    assert run.of(Verdict.FAILED) == ["kill-first"]


def test_a_launch_before_a_trigger_that_seldom_reports_fails():
    trigger = UpfTrigger(DEFINITIONS)
    trigger.status_interval = 1.0
    controller = simulated_controller(DEFINITIONS, ControllerSettings(), "launched-after-trigger")
    assert tried(controller, trigger).of(Verdict.FAILED) == ["launched-after-trigger"]


class ForgetfulTrigger(UpfTrigger):
    """Says for a second that it has fired. then: what it does then."""

    then = ""
    _fired_at = math.inf

    def fire(self, cause):
        super().fire(cause)
        self._fired_at = min(self._fired_at, self.now)

    def step(self, now):
        super().step(now)
        if now >= self._fired_at + 1.0 and self.fired:
            if self.then == "says no more":
                self.broadcasts.pop(names.TRIGGER_STATUS, None)
            else:
                self.fired = False


@pytest.mark.parametrize("then", ["says no more", "says that it has not"])
def test_a_trigger_that_forgets_that_it_has_fired_fails(then):
    device = ForgetfulTrigger(DEFINITIONS)
    device.then = then
    run = tried(device, options=(TRIGGER,), device=A_TRIGGER)
    assert run.of(Verdict.FAILED) == ["trigger-is-launched"]


# -- whatever it is told -------------------------------------------------------------------------


def whole(run):
    """Each clause has its verdict: whatever a device says, or does not, is no mistake of ours."""
    assert [*run.to().results] == NAMES
    assert run.of(Verdict.FAILED)


@pytest.mark.parametrize("service", [*UpfController(DEFINITIONS).services])
def test_a_controller_that_answers_one_service_never_is_tried_to_the_end(service):
    run = Run(Risk.FIRES)
    del run.controller.services[service]
    whole(run)


def test_a_controller_without_node_status_is_tried_to_the_end():
    run = Run(Risk.FIRES)
    del run.controller.broadcasts[NODE_STATUS]
    whole(run)


def test_a_touchdown_of_a_launch_that_nobody_saw_proves_nothing():
    """Given a controller that is TOUCHDOWN already as the kit comes."""
    run = Run(Risk.FIRES)
    run.to(lambda: run.controller.state is ParachuteState.TOUCHDOWN)
    touchdown = [one for one in CLAUSES if one.name == "touchdown"]
    bench = UpfBench(DEFINITIONS, Risk.FIRES)
    late = KitRun(Session(bench, touchdown, Allowed(Risk.FIRES)), run.bus)
    late.line.now = run.line.now
    assert late.to().of(Verdict.NOT_TRIED) == ["touchdown"]


VALUES: st.SearchStrategy[p.Value | None] = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**31), 2**31),
    st.floats(width=32, allow_nan=False, allow_infinity=False),
    st.text(max_size=9),
)


@settings(max_examples=5)
@given(told=st.fixed_dictionaries({one.name: VALUES for one in p.PARAMETERS}))
def test_a_controller_with_any_values_is_tried_to_the_end(told):
    run = Run(Risk.NONE)
    right = run.controller.services[bus_requests.GET_SET]

    def answer(request):
        name = bytes(request.values["name"]).decode()
        if name not in told:
            return right(request)
        value = {"empty": {}} if told[name] is None else p.union_of(told[name])
        return {"value": value, "default_value": value, "name": name.encode()}

    run.controller.services[bus_requests.GET_SET] = answer
    run.to()
    assert [*run.results] == NAMES


@settings(max_examples=4)
@given(
    states=st.lists(st.integers(0, 7), min_size=1),
    uptimes=st.lists(st.integers(0, 2**32 - 1), min_size=1),
)
def test_a_controller_with_any_states_is_tried_to_the_end(states, uptimes):
    run = Run(Risk.FIRES)
    for message, field, every in (
        (names.PARACHUTE_STATUS, "state", cycle(states)),
        (NODE_STATUS, "uptime_sec", cycle(uptimes)),
    ):
        interval, make = run.controller.broadcasts[message]
        told = partial(_changed, make, field, every)
        run.controller.broadcasts[message] = (interval, told)
    run.to()
    assert [*run.results] == NAMES


def _changed(make, field, every):
    return {**make(), field: next(every)}


def _clamps(controller, low, high):
    """It takes the nearest value in place of one that is out of its range."""
    right = controller.memory.set

    def clamp(name, wanted):
        if name == p.NODE_STATUS_INTERVAL and isinstance(wanted, (int, float)):
            wanted = min(max(wanted, low), high)
        return right(name, wanted)

    controller.memory.set = clamp


def test_a_controller_that_takes_the_nearest_value_is_as_good_as_one_that_refuses():
    run = Run(Risk.NONE)
    _clamps(run.controller, 2, 1000)
    run.to()
    result = run.results["parameter-range"]
    assert result.verdict is Verdict.PASSED
    assert "set to -5 and 1000000000 is 2 and 1000;" in result.why
    assert run.controller.values == CONTROLLER_PARAMETERS


def test_a_value_beyond_the_limits_that_it_tells_fails_and_is_set_back():
    """Given a controller that takes 1 where it tells that 2 is the least."""
    run = Run(Risk.NONE)
    right = run.controller.services[bus_requests.GET_SET]

    def answer(request):
        wanted = p.value_of(request.values["value"])
        if isinstance(wanted, int) and wanted < 0:
            run.controller.memory.values[p.NODE_STATUS_INTERVAL] = 1
            return run.controller.memory.answer(p.NODE_STATUS_INTERVAL)
        return right(request)

    run.controller.services[bus_requests.GET_SET] = answer
    run.to()
    assert run.results["parameter-range"].verdict is Verdict.FAILED
    assert run.controller.values == CONTROLLER_PARAMETERS
    assert run.problem == ""


def test_one_that_says_yes_to_a_restart_and_goes_on_fails_soon_after_its_start():
    run = Run(Risk.NONE)
    run.controller.services[bus_requests.RESTART_NODE] = lambda _: None
    (restart,) = (one for one in CLAUSES if one.name == "restart")
    late = KitRun(Session(run.bench, [restart], Allowed()), run.bus).to()
    assert late.of(Verdict.FAILED) == ["restart"]


class StartsLate(UpfNode):
    """Answers RestartNode, and starts anew a moment later, so that its answer can leave it."""

    _restarts_at = math.inf

    def reboot(self):
        if math.isnan(self.booted_at) or self.now >= self._restarts_at:
            self._restarts_at = math.inf
            super().reboot()
        else:
            self._restarts_at = self.now + 0.3

    def step(self, now):
        if now >= self._restarts_at:
            self.reboot()
        super().step(now)

    def next_step(self):
        return min(super().next_step(), self._restarts_at)


class LateTrigger(StartsLate, UpfTrigger):
    """A trigger."""


class LateRestart(StartsLate, UpfController):
    """A controller. intervals: those of its messages hold from the next start on."""

    intervals = False

    def reboot(self):
        super().reboot()
        if self.booted_at == self.now:
            self._at_start = dict(self.values)

    def _interval(self, name):
        values = self._at_start if self.intervals else self.values
        return float(values[name]) / 1000.0


@pytest.mark.parametrize("intervals", [False, True])
def test_what_takes_a_restart_is_judged_after_it(intervals):
    device = LateRestart(DEFINITIONS)
    device.intervals = intervals
    session = Session(UpfBench(DEFINITIONS), CLAUSES, Allowed())
    run = KitRun(session, UpfBus([device, UpfTrigger(DEFINITIONS)])).to()
    assert run.of(Verdict.FAILED) == []
    found = run.results
    assert found["auto-save"].verdict is Verdict.PASSED
    for name in ("node-interval", "parachute-interval"):
        assert found[name].verdict is Verdict.PASSED
        assert found[name].why.endswith("after a restart") is intervals
    assert device.values == device.saved == CONTROLLER_PARAMETERS
    assert run.problem == ""


@pytest.mark.parametrize("options", [(DNA,), (TRIGGER, DNA)])
def test_one_that_restarts_late_is_given_a_node_id_and_has_its_own_again(options):
    """Given a device that has no node id a moment after it has answered RestartNode."""
    if TRIGGER in options:
        nodes = LateTrigger(DEFINITIONS), UpfController(DEFINITIONS)
        kind, passed = A_TRIGGER, {"trigger-dna", "trigger-dna-forgets"}
    else:
        nodes = LateRestart(DEFINITIONS), UpfTrigger(DEFINITIONS)
        kind, passed = A_CONTROLLER, {"dna"}
    run = tried(*nodes, options=options, dna=True, device=kind)
    assert run.of(Verdict.FAILED) == []
    assert passed <= {*run.of(Verdict.PASSED)}
    assert run.problem == ""


# -- what it must not do -------------------------------------------------------------------------


@pytest.mark.parametrize("risk", list(Risk))
def test_it_is_left_as_it_was_found_and_did_no_more_than_was_allowed(risk):
    run = Run(risk)
    run.to()
    assert run.controller.values == run.controller.saved == CONTROLLER_PARAMETERS
    assert run.trigger.fired == (risk is Risk.FIRES)
    if risk is Risk.NONE:
        assert run.controller.requests_heard == []
    if risk is not Risk.FIRES:
        assert run.controller.state is ParachuteState.READY
        deploys = [one for one in run.controller.requests_heard if "DEPLOY" in one]
        assert deploys == []
    tried = [one for one in CLAUSES if run.results[one.name].verdict is Verdict.PASSED]
    assert max(one.risk for one in tried) == risk


@pytest.mark.parametrize("risk", list(Risk))
def test_a_device_that_was_sent_nothing_that_arms_is_not_said_to_be_left_armed(risk):
    """Given one that vanishes with a harmless parameter changed."""
    run = Run(risk)
    run.to(lambda: bool(run.bench.changed))
    run.controller.act("silent")
    run.to()
    assert f"{p.NODE_STATUS_INTERVAL} is not" in run.problem
    assert "ARMED" not in run.problem
    asked = [one for one in run.bench.traffic if one.sent and names.PARACHUTE_SERVICE in one.name]
    assert asked == []


def test_a_device_that_vanishes_armed_may_be_left_armed():
    run = Run(Risk.ARMS)
    run.to(lambda: run.controller.state is ParachuteState.ARMED)
    run.controller.act("silent")
    run.to()
    assert "it may be LEFT ARMED: no ParachuteStatus shows it" in run.problem


def test_an_abort_leaves_it_disarmed_with_its_parameters_as_they_were():
    run = Run(Risk.ARMS)
    run.to(lambda: run.controller.state is ParachuteState.ARMED)
    run.session.abort("aborted by Ctrl-C", run.line.now)
    run.to()
    assert run.controller.state is ParachuteState.READY
    assert run.controller.values == CONTROLLER_PARAMETERS
    assert run.problem == "aborted by Ctrl-C"


@pytest.mark.parametrize("after", [0.0, 0.3, 0.7, 1.1])
@pytest.mark.parametrize("name", ["dna", "dna-forgets", "trigger-dna", "trigger-dna-forgets"])
def test_an_abort_gives_it_its_own_node_id_again(name, after):
    """Given a Ctrl-C so long after its static node id became 0."""
    (clause,) = (one for one in CLAUSES if one.name == name)
    device, bench = KIT.simulated("", clause.needs)
    run = KitRun(Session(bench, [clause], Allowed(options=clause.needs.split())), device)
    assert isinstance(device, UpfBus)
    node, static = device.nodes[0], device.nodes[0].values[p.STATIC_NODE_ID]
    run.to(lambda: node.values[p.STATIC_NODE_ID] == 0)
    until = run.line.now + after
    run.to(lambda: run.line.now >= until)
    run.session.abort("aborted by Ctrl-C", run.line.now)
    assert run.to().problem == "aborted by Ctrl-C"
    assert node.node_id == node.values[p.STATIC_NODE_ID] == static
    assert static == (TRIGGER_NODE_ID if TRIGGER in clause.needs else CONTROLLER_NODE_ID)


def test_a_device_that_comes_back_without_a_node_id_is_named():
    """Given one that dies while it has none."""
    device, bench = KIT.simulated("", DNA)
    clauses = [one for one in CLAUSES if one.name == "dna"]
    run = KitRun(Session(bench, clauses, Allowed(options=(DNA,))), device)
    assert isinstance(device, UpfBus)
    run.to(lambda: device.nodes[0].values[p.STATIC_NODE_ID] == 0)
    device.nodes[0].act("silent")
    assert f"{p.STATIC_NODE_ID} is LEFT 0" in run.to().problem


@pytest.mark.parametrize("risk", list(Risk))
def test_its_node_id_is_not_taken_unasked(risk):
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
def test_a_trial_that_would_fire_unasked_ends_in_our_own_error(service, type_name):
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


# -- a trigger -----------------------------------------------------------------------------------

FIRING = [one for one in CLAUSES if TRIGGER in one.needs and one.risk is Risk.FIRES]


@pytest.mark.parametrize("risk", list(Risk))
def test_of_a_whole_parachute_the_trigger_alone_is_tried(risk):
    """Given a controller on its bus."""
    run = Run(risk, TRIGGER)
    run.to()
    assert run.of(Verdict.FAILED) == []
    assert run.bench.node == TRIGGER_NODE_ID
    assert run.trigger.fired == (risk is Risk.FIRES)
    assert run.trigger.values == run.trigger.saved == TRIGGER_PARAMETERS
    assert run.controller.requests_heard == []
    assert run.controller.values == run.controller.saved == CONTROLLER_PARAMETERS
    asked = [one.name for one in run.bench.traffic if one.sent]
    assert not any(f"node {CONTROLLER_NODE_ID}" in one for one in asked)


def test_a_controller_is_not_taken_for_a_trigger():
    """Given a bus without a trigger."""
    run = Run(Risk.FIRES, TRIGGER)
    run.bus.nodes.remove(run.trigger)
    run.to()
    assert run.problem.startswith("no TriggerStatus is received")
    assert f"received from nodes: {CONTROLLER_NODE_ID}" in run.problem
    assert run.controller.requests_heard == []


@pytest.mark.parametrize("options", [(TRIGGER,), (TRIGGER, BROADCAST)])
def test_where_several_would_fire_nothing_is_fired(options):
    run = Run(Risk.FIRES, *options)
    values = {**TRIGGER_PARAMETERS, p.STATIC_NODE_ID: 35}
    other = UpfTrigger(DEFINITIONS, NodeSettings("another trigger", values))
    run.bus.nodes.append(other)
    run.to()
    assert run.of(Verdict.FAILED) == []
    assert not run.trigger.fired
    assert not other.fired
    sent = {one.name for one in run.bench.traffic if one.sent}
    assert not any("Trigger" in one for one in sent)
    assert "(nodes 34, 35; need one)" in run.results["trigger-launch"].why


def test_one_that_is_fired_by_the_broadcast_is_not_fired_by_the_service_as_well():
    run = Run(Risk.FIRES, TRIGGER, BROADCAST)
    run.to()
    assert run.results["trigger-broadcast"].verdict is Verdict.PASSED
    assert run.results["trigger-launch"].verdict is Verdict.NOT_TRIED
    assert run.results["trigger-is-launched"].verdict is Verdict.PASSED


@pytest.mark.parametrize(
    ("action", "why"),
    [("trigger-fired", "it has fired already"), ("trigger-error", "it is ABNORMAL (need READY)")],
)
def test_one_that_cannot_fire_proves_nothing_about_what_fires_it(action, why):
    run = Run(Risk.FIRES, TRIGGER)
    run.trigger.add_action("trigger-fired", lambda _: run.trigger.fire("somebody"))
    run.trigger.act(action)
    run.to()
    assert run.of(Verdict.FAILED) == []
    met = [one.name for one in FIRING if BROADCAST not in one.needs][:-1]
    assert [one for one in met if not run.results[one].why.startswith(why)] == []


def test_one_that_fires_by_itself_between_two_clauses_fails_once():
    run = Run(Risk.FIRES, TRIGGER)
    run.to(lambda: "trigger-unknown-type" in run.results)
    run.trigger.fire("itself")
    run.to()
    assert run.of(Verdict.FAILED) == ["trigger-self-test"]
    assert run.results["trigger-self-test"].why == "IT HAS FIRED, and nothing told it to"
    assert run.results["trigger-launch"].verdict is Verdict.NOT_TRIED


def test_one_that_fires_late_by_the_broadcast_did_not_fire_by_itself():
    run = Run(Risk.FIRES, TRIGGER, BROADCAST)
    run.trigger.act("trigger-stuck")
    run.to(lambda: "trigger-broadcast" in run.results)
    run.trigger.act("trigger-free")
    run.trigger.fire("the broadcast")
    run.to()
    assert run.of(Verdict.FAILED) == ["trigger-broadcast"]
    assert run.results["trigger-launch"].verdict is Verdict.NOT_TRIED


def test_one_that_tells_nothing_more_after_a_wrong_request_is_not_said_to_have_held():
    """Given a trigger that falls silent, but for its NodeStatus."""
    run = Run(Risk.FIRES, TRIGGER)
    right = run.trigger.services[names.TRIGGER_SERVICE]

    def serve(request):
        del run.trigger.broadcasts[names.TRIGGER_STATUS]
        run.trigger.services[names.TRIGGER_SERVICE] = right
        return right(request)

    run.trigger.services[names.TRIGGER_SERVICE] = serve
    run.to()
    assert run.of(Verdict.FAILED) == ["trigger-bad-magic"]


def test_a_refusal_to_launch_fails():
    run = Run(Risk.FIRES, TRIGGER)
    run.trigger.act("refuse")
    run.to()
    assert run.of(Verdict.FAILED) == ["trigger-launch"]
    assert run.results["trigger-launch"].why == "TYPE_LAUNCH: FAILED"


def test_what_the_data_types_do_not_have_is_not_tried():
    """Given types of another vendor, with a launch that names no node, and no self test."""
    definitions = Definitions(load_data_types(str(OTHER_TYPES), "--dsdl-path"))
    run = Run(Risk.FIRES, TRIGGER, definitions=definitions)
    run.to()
    assert run.of(Verdict.FAILED) == []
    assert run.trigger.fired
    lack = [name for name, one in run.results.items() if one.why.startswith("the data types have")]
    assert lack == ["trigger-self-test", "trigger-broadcast-other", "trigger-is-launched"]


@pytest.mark.parametrize("service", [*UpfTrigger(DEFINITIONS).services])
def test_a_trigger_that_answers_one_service_never_is_tried_to_the_end(service):
    run = Run(Risk.FIRES, TRIGGER)
    del run.trigger.services[service]
    whole(run)


@settings(max_examples=4)
@given(
    states=st.lists(st.integers(0, 7), min_size=1),
    launched=st.lists(st.booleans(), min_size=1),
)
def test_a_trigger_with_any_states_is_tried_to_the_end(states, launched):
    run = Run(Risk.FIRES, TRIGGER, BROADCAST)
    interval, right = run.trigger.broadcasts[names.TRIGGER_STATUS]
    told = partial(_changed, right, "state", cycle(states))
    both = partial(_changed, told, "is_launched", cycle(launched))
    run.trigger.broadcasts[names.TRIGGER_STATUS] = (interval, both)
    run.to()
    assert [*run.results] == NAMES


@pytest.mark.parametrize("risk", [Risk.NONE, Risk.ARMS])
def test_no_launch_leaves_the_bench_unasked(risk):
    bench = UpfBench(DEFINITIONS, risk, device=A_TRIGGER)
    bench.at(1.0)
    with pytest.raises(NotAllowedError):
        bench.launch(magic_number=1)
    with pytest.raises(NotAllowedError):
        next(bench.call(names.TRIGGER_SERVICE, {"magic_number": 1, "type": 2}))
    assert bench.take_output() == []


def test_a_bench_that_tries_a_controller_tells_no_trigger_anything():
    bench = UpfBench(DEFINITIONS, Risk.FIRES)
    bench.at(1.0)
    with pytest.raises(NotAllowedError):
        bench.launch()
    with pytest.raises(NotAllowedError):
        next(bench.call(names.TRIGGER_SERVICE, {"magic_number": 1, "type": 2}))
    assert bench.take_output() == []
