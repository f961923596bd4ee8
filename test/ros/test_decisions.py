"""What mavlink_parachute does with the supervisor's decisions beside the deploy (device_suite)."""

import itertools
from dataclasses import replace

import pytest
from chute_msgs.msg import ActionReport, ParachuteStatus, SafetyDecision, VehicleState
from mavlink_bench import Autopilot, Module, Network, airborne, do
from node_bench import stamped

from chute_ros.model import Action, Outcome
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.ros import qos
from chute_ros.sim.autopilot_kinds import ARDUPLANE, GENERIC

ARDUPLANE_WITH_AFS = replace(
    ARDUPLANE, parameters={**ARDUPLANE.parameters, "AFS_ENABLE": 1, "AFS_TERM_ACTION": 42}
)
TERMINATE = dialect.MAV_CMD_DO_FLIGHTTERMINATION
ARM_DISARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM


class Supervisor:
    """Decides what the test wants, and follows what is reported."""

    def __init__(self, bench):
        self.bench = bench
        self.reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
        self.vehicle = bench.follow(VehicleState, "vehicle/state")
        self.numbers = itertools.count(1)

    def decide(self, action, **fields):
        values = {"epoch": 1, "id": next(self.numbers), "targets": ["mavlink_parachute"]} | fields
        message = SafetyDecision(
            action=int(action), rule="test", reasons=["a loose rotor"], **values
        )
        self.bench.publish(stamped(self.bench.client, message), "safety/decision", qos.DECISION)
        return message

    def report(self, decision, outcome):
        def found():
            return [
                report
                for report in self.reports
                if (report.id, report.outcome) == (decision.id, outcome)
            ]

        return self.bench.until(found, f"{outcome.name} is reported")[0]

    def outcomes(self, decision):
        return [report.outcome for report in self.reports if report.id == decision.id]

    def sees(self, **fields):
        self.bench.until(
            lambda: (
                self.vehicle
                and all(getattr(self.vehicle[-1], name) == value for name, value in fields.items())
            ),
            f"the vehicle shows {fields}",
        )


@pytest.fixture
def supervisor(bench):
    return Supervisor(bench)


def flying(bench, kind=GENERIC, **parameters):
    """An autopilot in the air on the node's network."""
    autopilot = airborne(80.0, kind)
    autopilot.loop = Network(bench, **parameters).plug(autopilot)
    return autopilot


# Kill


@pytest.mark.parametrize(
    ("method", "command", "params"),
    [
        ("flight_termination", TERMINATE, (1.0, 0.0)),
        ("forced_disarm", ARM_DISARM, (0.0, 21196.0)),
    ],
)
def test_a_kill_stops_the_motors_by_the_method_chosen(bench, supervisor, method, command, params):
    autopilot = flying(bench, kind=ARDUPLANE_WITH_AFS, kill_method=method)
    supervisor.sees(armed=VehicleState.ARMED, landed_state=2, faults=[])
    bench.until(lambda: autopilot.asked_for >= set(ARDUPLANE.parameters), "settings are read")
    decision = supervisor.decide(Action.KILL)
    supervisor.report(decision, Outcome.CONFIRMED)
    assert not autopilot.model.armed
    (heard,) = autopilot.heard_command(command)
    assert heard[2][:2] == params
    told = supervisor.outcomes(decision)
    assert told == [Outcome.SENT, Outcome.ACCEPTED, Outcome.CONFIRMED]
    supervisor.sees(armed=VehicleState.DISARMED)


def test_a_kill_is_tried_again_until_the_motors_stop(bench, supervisor):
    autopilot = flying(bench, give_up_after=10.0)
    supervisor.sees(armed=VehicleState.ARMED)
    do(bench, autopilot.loop, lambda: autopilot.act("mute"))
    decision = supervisor.decide(Action.KILL)
    bench.until(lambda: len(autopilot.heard_command(ARM_DISARM)) >= 4, "it is tried again")
    assert Outcome.CONFIRMED not in supervisor.outcomes(decision)
    do(bench, autopilot.loop, lambda: autopilot.act("unmute"))
    supervisor.report(decision, Outcome.CONFIRMED)
    assert not autopilot.model.armed


def test_a_kill_that_cannot_be_confirmed_fails_in_words(bench, supervisor):
    autopilot = flying(bench)
    supervisor.sees(armed=VehicleState.ARMED)
    do(bench, autopilot.loop, lambda: autopilot.act("mute"))
    report = supervisor.report(supervisor.decide(Action.KILL), Outcome.FAILED)
    assert "kill (forced_disarm) given up after" in report.detail
    assert report.link == "mavlink_parachute"


def test_a_kill_without_any_autopilot_fails_at_once(bench, supervisor):
    Network(bench).plug(Module())
    report = supervisor.report(supervisor.decide(Action.KILL), Outcome.FAILED)
    assert "no autopilot" in report.detail


def test_a_shadow_kill_stops_nothing(bench, supervisor):
    autopilot = flying(bench)
    supervisor.sees(armed=VehicleState.ARMED)
    shadow = supervisor.decide(Action.KILL, shadow=True)
    supervisor.report(supervisor.decide(Action.FLIGHT_BLOCK_RELEASE), Outcome.CONFIRMED)
    assert autopilot.heard_command(ARM_DISARM) == []
    assert supervisor.outcomes(shadow) == []


def test_a_repeated_kill_is_reported_again_after_other_reports(bench, supervisor):
    autopilot = flying(bench)
    supervisor.sees(armed=VehicleState.ARMED)
    kill = supervisor.decide(Action.KILL)
    supervisor.report(kill, Outcome.CONFIRMED)
    # An old one comes late and is refused: its report is now the newest.
    old = supervisor.decide(Action.FLIGHT_BLOCK, epoch=0, id=90)
    supervisor.report(old, Outcome.FAILED)
    supervisor.reports.clear()
    supervisor.decide(Action.KILL, id=kill.id)
    report = supervisor.report(kill, Outcome.CONFIRMED)
    assert (report.epoch, report.action) == (1, Action.KILL)
    assert len(autopilot.forced) == 1


# Flight block


def grounded(bench, supervisor, **parameters):
    autopilot = Autopilot()
    autopilot.loop = Network(bench, **parameters).plug(autopilot)
    supervisor.sees(armed=VehicleState.DISARMED, landed_state=1)
    return autopilot


def arm(bench, autopilot):
    do(bench, autopilot.loop, lambda: autopilot.act("arm"))


def test_a_flight_block_undoes_arming_on_the_ground_until_it_is_released(bench, supervisor):
    autopilot = grounded(bench, supervisor)
    supervisor.report(supervisor.decide(Action.FLIGHT_BLOCK), Outcome.CONFIRMED)
    arm(bench, autopilot)
    bench.until(lambda: not autopilot.model.armed, "it is disarmed")
    heard = autopilot.heard_command(ARM_DISARM)[0]
    assert heard[2][:2] == (0.0, 0.0), "a plain disarm, never a forced one"
    supervisor.report(supervisor.decide(Action.FLIGHT_BLOCK_RELEASE), Outcome.CONFIRMED)
    supervisor.sees(armed=VehicleState.DISARMED)
    before = len(autopilot.commands_heard)
    arm(bench, autopilot)
    supervisor.sees(armed=VehicleState.ARMED)
    beats = len(supervisor.vehicle)
    bench.until(lambda: len(supervisor.vehicle) > beats + 10, "time goes by")
    assert autopilot.model.armed
    assert not [h for h in autopilot.commands_heard[before:] if h[1] == ARM_DISARM]


def test_a_vehicle_that_was_armed_already_is_disarmed_when_the_block_comes(bench, supervisor):
    autopilot = grounded(bench, supervisor)
    arm(bench, autopilot)
    supervisor.sees(armed=VehicleState.ARMED)
    supervisor.decide(Action.FLIGHT_BLOCK)
    bench.until(lambda: not autopilot.model.armed, "it is disarmed")


def test_a_flight_block_never_touches_a_vehicle_in_the_air(bench, supervisor):
    autopilot = flying(bench)
    supervisor.sees(armed=VehicleState.ARMED, landed_state=2)
    supervisor.report(supervisor.decide(Action.FLIGHT_BLOCK), Outcome.CONFIRMED)
    beats = len(supervisor.vehicle)
    bench.until(lambda: len(supervisor.vehicle) > beats + 20, "time goes by")
    assert autopilot.heard_command(ARM_DISARM) == []
    assert autopilot.heard_command(TERMINATE) == []
    assert autopilot.model.armed


def test_a_flight_block_only_says_so_where_it_may_not_disarm(bench, supervisor):
    autopilot = grounded(bench, supervisor, disarm_when_blocked=False)
    report = supervisor.report(supervisor.decide(Action.FLIGHT_BLOCK), Outcome.CONFIRMED)
    assert (
        report.detail
        == "noted; a vehicle that arms is not disarmed (disarm_when_blocked is false)"
    )
    arm(bench, autopilot)
    supervisor.sees(armed=VehicleState.ARMED)
    beats = len(supervisor.vehicle)
    bench.until(lambda: len(supervisor.vehicle) > beats + 20, "time goes by")
    assert autopilot.heard_command(ARM_DISARM) == []


@pytest.mark.parametrize(("may", "outcome"), [(True, Outcome.CONFIRMED), (False, Outcome.FAILED)])
def test_a_decided_deploy_arms_the_trigger_only_where_it_may(bench, supervisor, may, outcome):
    module = Module()
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    Network(bench, deploy_arms_trigger=may).plug(module)
    bench.until(lambda: statuses, "the module is heard")
    supervisor.report(supervisor.decide(Action.DEPLOY), outcome)
    assert bool(module.deployment) is may
    assert bool(module.heard_command(dialect.MAV_CMD_SET_PARACHUTE_ARM)) is may
