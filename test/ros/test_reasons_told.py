"""Why a device is not healthy is in its node's heartbeat; trouble of a wire is told once."""

from chute_msgs.msg import LinkHeartbeat
from chute_msgs.srv import Arm, Deploy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_bench import stamped
from umbilical_bench import Cable
from upf_bench import PATIENT, Devices, Network, tasks

from chute_ros import model
from chute_ros.ros import messages
from chute_ros.transport.wire_events import WireTrouble


def told(beats, healthy=False):
    """The reasons of the newest heartbeat, if it says so."""
    return beats and beats[-1].device_healthy is healthy and list(beats[-1].reasons)


def test_upf_can_tells_every_reason(bench):
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    network = Network(bench, controller_node_id=33)
    first = "controller 33 was never received: need its ParachuteStatus from this node id"
    bench.until(lambda: told(beats) == [first], "the controller is missing")
    devices = Devices(network)
    bench.until(lambda: beats[-1].device_healthy, "all is well")
    assert told(beats, healthy=True) == []
    devices.act("silent")
    bench.until(lambda: beats[-1].link_state == model.LinkState.LOST, "it is lost")
    bench.until(lambda: any("33 LOST: " in one for one in told(beats) or []), "it is told")
    assert all(beat.device_healthy or beat.reasons for beat in beats), "never without a reason"


def test_umbilical_tells_every_reason(bench):
    cable = Cable(bench)
    beats = cable.heartbeats
    first = "the flight computer was never received: 0 bytes received, no $TELEM record, need one"
    bench.until(lambda: told(beats) == [first], "it is missing")
    cable.plugged()
    cable.act("fault")
    wanted = ["flight mode Fault", "flight computer: state ABNORMAL, need READY or ARMED"]
    bench.until(lambda: told(beats) == wanted, "the fault is told")
    assert all(beat.device_healthy or beat.reasons for beat in beats), "never without a reason"


def test_a_wire_in_trouble_is_an_error_in_diagnostics_until_it_is_over(bench):
    log, diagnostics = bench.follow_log(), bench.follow(DiagnosticArray, "/diagnostics")
    network = Network(bench)
    text = "/dev/ttyACM0 has a second reader"
    network.node.deliver([WireTrouble(text)])

    def link():
        return tasks(diagnostics).get("link", DiagnosticStatus())

    bench.until(lambda: link().message == text, "diagnostics tell it")
    assert link().level == DiagnosticStatus.ERROR
    network.node.deliver([WireTrouble("")])
    bench.until(lambda: text not in link().message, "it is over")
    assert sum(one.msg == text for one in log) == 1


def test_a_deploy_over_turning_motors_says_so_in_its_answer(bench):
    network = Network(bench, killswitch_policy="accept", **PATIENT)
    devices = Devices(network)
    devices.await_beat(device_healthy=True)
    assert bench.call(Arm, "upf_can/arm", arm=True).success
    armed = model.VehicleState(
        link_state=model.LinkState.OK, armed=model.Armed.ARMED, armed_age=0.0
    )
    future = bench.ask(Deploy, "upf_can/deploy", force=True, reason="a test")

    def answered():
        message = messages.vehicle_state(armed, bench.client.get_clock().now().to_msg())
        bench.publish(stamped(bench.client, message), "vehicle/state")
        return future.done()

    bench.until(answered, "it is answered")
    answer = future.result()
    assert answer.success, answer.message
    assert answer.message.startswith("WARNING: the vehicle reported armed 0.")
    assert "the motors may turn, STOP THEM" in answer.message
