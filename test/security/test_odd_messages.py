"""Messages that no node of ours would send, by thousands: nobody falls silent or fails inside."""

from __future__ import annotations

import math
import random
import re
import sys

import pytest
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyDecision,
    SafetyRequest,
    SafetyState,
    SupervisorLease,
    VehicleState,
)
from mavlink_bench import Network
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from umbilical_bench import Cable
from upf_bench import Network as Bus

from chute_ros.ros import qos
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

NAMES = ("mavlink_parachute", "upf_can", "umbilical", "safety_supervisor", "liar")
TEXTS = (*NAMES, "", "1/161", "33", "parachute open", "ä\N{PARACHUTE}", "\0", "{}", "x" * 3000)
#: Topic -> its type and quality of service.
TOPICS = {
    "safety/heartbeat": (LinkHeartbeat, qos.STATUS),
    "safety/decision": (SafetyDecision, qos.DECISION),
    "safety/action": (ActionReport, qos.DECISION),
    "safety/request": (SafetyRequest, qos.STATUS),
    "safety/state": (SafetyState, qos.LATCHED),
    "safety/lease": (SupervisorLease, qos.STATUS),
    "parachute/status": (ParachuteStatus, qos.STATUS),
    "vehicle/state": (VehicleState, qos.STATUS),
    "odometry": (Odometry, qos.STATUS),
    "imu": (Imu, qos.STATUS),
}
ROUNDS = 150


class Odd:
    """Draws messages: extremes, what is no number, numbers of no name, texts of any length."""

    def __init__(self, seed):
        self._chance = random.Random(seed)

    def message(self, kind):
        made = kind()
        for name, of in kind.get_fields_and_field_types().items():
            setattr(made, name, self._value(of, type(getattr(made, name))))
        return made

    def _value(self, of, held):
        if fixed := re.fullmatch(r"(.*)\[(\d+)\]", of):
            return [self._value(fixed[1], None) for _ in range(int(fixed[2]))]
        if many := re.fullmatch(r"sequence<(.*)>", of):
            return [self._value(many[1], None) for _ in range(self._chance.randrange(4))]
        if "/" in of:
            return self.message(held or self._named(of))
        return self._plain(of)

    @staticmethod
    def _named(of):
        package, name = of.split("/")
        return getattr(sys.modules[f"{package}.msg"], name)

    def _plain(self, of):
        choice = self._chance.choice
        if of == "string":
            return choice(TEXTS)
        if of == "boolean":
            return choice((False, True))
        if of in ("float", "double"):
            large = 3e38 if of == "float" else 1e308
            return choice(
                (0.0, -0.0, 1.0, -1.0, 50.0, -large, large, math.nan, math.inf, -math.inf)
            )
        signed, bits = (of[0] != "u"), int(re.search(r"\d+", of)[0])
        top = 2 ** (bits - signed) - 1
        return choice((0, 1, 2, 3, 4, 5, 99, top - 1, top, -top - 1 if signed else top // 2))


@pytest.mark.parametrize("hot_standby", [False, True])
def test_odd_messages_on_every_topic_fail_nothing_and_silence_nobody(bench, hot_standby):
    Network(bench)
    Bus(bench)
    Cable(bench)
    supervisor = bench.add(
        SafetySupervisorNode,
        profile="multirotor",
        required_links=["mavlink_parachute", "upf_can", "umbilical"],
        deploy_links=["mavlink_parachute", "upf_can", "umbilical"],
        vehicle_sources=["vehicle/state", "odometry", "imu"],
        hot_standby=hot_standby,
        lease_listen=0.3,
    )
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    odd = Odd(seed=hot_standby)
    for _ in range(ROUNDS):
        for topic, (kind, profile) in TOPICS.items():
            bench.publish(odd.message(kind), topic, profile)
        bench.turns(0.01)
    bench.turns(1.0)  # what was forged has had its time
    beats.clear()
    bench.until(lambda: {beat.link for beat in beats} >= set(NAMES[:4]), "all of them beat again")
    assert supervisor._health.newest == ""
