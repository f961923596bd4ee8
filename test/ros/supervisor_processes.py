"""Supervisors that are processes of their own, to be killed and stopped; with a stub link."""

import time

from chute_msgs.msg import SafetyDecision, SafetyState, SupervisorLease
from supervisor_bench import StubLink

from chute_ros.ros import qos
from chute_ros.tools.processes import Processes

QUICK = {
    "startup_grace": 0.3,
    "hot_standby": True,
    "lease_timeout": 0.5,
    "lease_listen": 3.0,
    "profile": "by_hand",
    "deploy_timeout": 20.0,
    "kill_timeout": 20.0,
}


class Pair:
    """Supervisors a (rank 0) and b (rank 1), one stub link, a vehicle."""

    def __init__(self, bench):
        self.bench = bench
        self.processes = Processes(bench.folder)
        self.claims, self.started = {}, []
        #: Of other computers, or started beside ours; ended with it.
        self.others = []
        self.states = bench.follow(SafetyState, "safety/state", qos.LATCHED)
        self.decisions = bench.follow(SafetyDecision, "safety/decision", qos.DECISION)
        bench.client.create_subscription(
            SupervisorLease,
            f"{bench.namespace}/safety/lease",
            lambda message: self.claims.update({message.name: (time.monotonic(), message)}),
            qos.STATUS,
        )
        self.link = bench.add(lambda **options: StubLink("mavlink_parachute", **options))
        self.link.offer_arming()

    def elsewhere(self, folder):
        """Processes that are watched apart from ours."""
        self.others.append(Processes(folder))
        return self.others[-1]

    def start(self, name, rank, **parameters):
        self.started.append(name)
        told = [
            part
            for key, value in (QUICK | {"rank": rank} | parameters).items()
            for part in ("-p", f"{key}:={str(value).lower()}")
        ]
        self.processes.start(
            name,
            "chute_ros.ros.safety_supervisor",
            "--ros-args",
            *("-r", f"__ns:={self.bench.namespace}", "-r", f"__node:={name}"),
            *told,
        )

    def send_signal(self, name, number):
        self.processes.send_signal(name, number)

    def leads(self, name):
        return name in self.claims and self.claims[name][1].leading

    def offers(self, name):
        """Its services are seen. A call to one that is just closing is lost."""
        client, namespace = self.bench.client, self.bench.namespace
        offered = client.get_service_names_and_types_by_node(name, namespace)
        return f"{namespace}/safety/kill" in dict(offered)

    def await_leader(self, name):
        self.bench.until(lambda: self.leads(name), f"{name} leads")

    def await_stage(self, stage):
        self.bench.until(
            lambda: self.states and self.states[-1].state == stage, f"the stage is {stage}"
        )

    def both(self):
        """a leads, b follows it, the vehicle is in the air."""
        self.start("a", 0)
        self.await_leader("a")
        self.start("b", 1)
        self.bench.until(
            lambda: "b" in self.claims and self.claims["b"][1].leader == "a", "b follows a"
        )
        assert not self.leads("b")
        self.await_stage(SafetyState.READY)
        self.link.flying = True
        self.await_stage(SafetyState.IN_FLIGHT)
        self.await_word_to("b")
        return self

    def await_word_to(self, name):
        """What the other one has published by now, this one knows."""
        heard = self.claims[name][0]
        self.bench.until(lambda: self.claims[name][0] > heard + 0.3, f"{name} has heard of it")

    def acted(self, action):
        return [(epoch, number) for epoch, number, one in self.link.acted if one is action]

    def epoch(self, name):
        self.bench.until(lambda: name in self.claims, f"{name} is heard")
        return self.claims[name][1].epoch
