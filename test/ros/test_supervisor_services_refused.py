"""A system that has nothing left (descriptors, memory) refuses a leader its services."""

from chute_msgs.msg import SafetyState
from chute_msgs.srv import Arm
from supervisor_bench import Scene

from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode


def test_a_leader_that_can_offer_no_services_decides_all_the_same_and_offers_them_later(
    bench, monkeypatch
):
    """Given a supervisor whose third service is refused as it begins to lead, then it goes on to
    READY; once nothing is refused any more, all of them are there."""
    refused, create = [], SafetySupervisorNode.create_service

    def refuse(self, kind, name, *more, **options):
        if name == "safety/kill":
            refused.append(name)
            raise RuntimeError("too many open files")
        return create(self, kind, name, *more, **options)

    monkeypatch.setattr(SafetySupervisorNode, "create_service", refuse)
    scene = Scene(bench)
    scene.await_stage(SafetyState.READY)
    bench.until(lambda: len(refused) > 2, "it tries again")

    def offered():
        names = scene.supervisor.get_service_names_and_types_by_node(
            "safety_supervisor", bench.namespace
        )
        return {name.rpartition("/")[2] for name, _ in names if "/safety/" in name}

    assert offered() == {"arm", "deploy"}
    monkeypatch.undo()
    bench.until(
        lambda: offered() == {"arm", "deploy", "kill", "reset", "set_mode"}, "all are there"
    )
    scene.link.offer_arming()
    assert scene.call(Arm, "arm", arm=True).success
