"""A supervisor among stub device nodes, for the tests of its node."""

import itertools

from chute_msgs.msg import ActionReport, LinkHeartbeat, SafetyDecision, SafetyState, VehicleState
from chute_msgs.srv import Arm
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_bench import stamped
from rclpy.node import Node

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.ros import qos
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

#: A supervisor that does not dawdle.
QUICK = {"startup_grace": 0.3, "deploy_timeout": 2.0, "kill_timeout": 2.0}


class StubLink(Node):
    """A device node that beats, arms and carries decisions out as it is told.

    It tells of a vehicle that stands disarmed on the ground.
    """

    def __init__(self, name, *, namespace, parameter_overrides):
        super().__init__(name, namespace=namespace, parameter_overrides=parameter_overrides)
        self.state, self.healthy, self.beating = LinkState.OK, True, True
        #: How far it gets with a decision.
        self.outcomes = [Outcome.SENT, Outcome.ACCEPTED, Outcome.CONFIRMED]
        self.arm_requests, self.arm_succeeds = [], True
        self.flying = False
        #: It tells of the vehicle.
        self.telling = True
        #: It sends diagnostics; a hung one does not.
        self.diagnosing = True
        #: It does not hear decisions.
        self.deaf = False
        #: Numbers of the decisions that it acted on.
        self.acted = []
        self.decisions = []
        self._seq = itertools.count()
        self._beats = self.create_publisher(LinkHeartbeat, "safety/heartbeat", qos.STATUS)
        self._vehicle = self.create_publisher(VehicleState, "vehicle/state", qos.STATUS)
        self._reports = self.create_publisher(ActionReport, "safety/action", qos.DECISION)
        self.create_subscription(SafetyDecision, "safety/decision", self._decision, qos.DECISION)
        self.create_timer(0.05, self._beat)
        self._diagnostics = self.create_publisher(DiagnosticArray, "diagnostics", qos.STATUS)
        self.create_timer(1.0, self._diagnose)

    def offer_arming(self):
        self.create_service(Arm, "~/arm", self._arm)

    def _beat(self):
        if self.beating:
            message = LinkHeartbeat(
                link=self.get_name(),
                link_state=int(self.state),
                seq=next(self._seq),
                device_healthy=self.healthy,
            )
            self._beats.publish(stamped(self, message))
        if self.telling:
            self._tell_vehicle()

    def _diagnose(self):
        if self.diagnosing:
            name = f"{self.get_namespace()}/{self.get_name()}: stub".lstrip("/")
            status = DiagnosticStatus(level=DiagnosticStatus.OK, name=name, message="is open")
            self._diagnostics.publish(stamped(self, DiagnosticArray(status=[status])))

    def _tell_vehicle(self):
        vehicle = VehicleState(
            source="1/1",
            link_state=int(LinkState.OK),
            armed=VehicleState.ARMED if self.flying else VehicleState.DISARMED,
            armed_age=0.0,
            landed_state=VehicleState.IN_AIR if self.flying else VehicleState.ON_GROUND,
            landed_state_age=0.0,
        )
        self._vehicle.publish(stamped(self, vehicle))

    def _arm(self, request, response):
        self.arm_requests.append((request.arm, request.triggers))
        response.success, response.message = self.arm_succeeds, "as told"
        return response

    def _decision(self, message):
        if self.deaf:
            return
        new = all((d.epoch, d.id) != (message.epoch, message.id) for d in self.decisions)
        self.decisions.append(message)
        if self.get_name() not in message.targets or message.shadow or not new:
            return
        self.acted.append((message.epoch, message.id, Action(message.action)))
        block = message.action in (Action.FLIGHT_BLOCK, Action.FLIGHT_BLOCK_RELEASE)
        for outcome in [Outcome.CONFIRMED] if block else self.outcomes:
            self._report(message, outcome)

    def report_newest(self, action, outcome):
        """It gets further with the newest decision of this action."""
        self._report(next(d for d in reversed(self.decisions) if d.action == action), outcome)

    def _report(self, message, outcome):
        report = ActionReport(
            epoch=message.epoch,
            id=message.id,
            action=message.action,
            link=self.get_name(),
            outcome=int(outcome),
            detail="by the stub",
            newest_epoch=message.epoch,
        )
        self._reports.publish(stamped(self, report))


class Scene:
    """A supervisor, one stub link, and what they say."""

    def __init__(self, bench, **parameters):
        self.bench = bench
        self.states = bench.follow(SafetyState, "safety/state", qos.LATCHED)
        self.decisions = bench.follow(SafetyDecision, "safety/decision", qos.DECISION)
        self.link = bench.add(lambda **options: StubLink("mavlink_parachute", **options))
        self.supervisor = bench.add(SafetySupervisorNode, **(QUICK | parameters))

    def await_stage(self, stage):
        self.bench.until(
            lambda: self.states and self.states[-1].state == stage, f"the stage is {stage}"
        )
        return self.states[-1]

    def decided(self, action):
        """The decisions of this action, each once."""
        found = {(d.epoch, d.id): d for d in self.decisions if d.action == action}
        return list(found.values())

    def await_decision(self, action):
        self.bench.until(lambda: self.decided(action), f"{action.name} is decided")
        return self.decided(action)[-1]

    def call(self, kind, service, **fields):
        return self.bench.call(kind, f"safety/{service}", **fields)
