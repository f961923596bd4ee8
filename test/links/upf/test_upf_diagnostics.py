"""What upf_can says on /diagnostics, and in its log at the start."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from upf_bench import OTHER_LAYOUT, Devices, Network, tasks, values

from chute_ros.links.upf.protocol import parameters as p

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)


def test_diagnostics_say_what_is_missing_and_what_is_there(bench):
    network = Network(bench)
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    bench.until(lambda: "link" in tasks(diagnostics), "they come")
    said = tasks(diagnostics)
    assert set(said) == {
        "link",
        "parachute",
        "vehicle service",
        "node ids",
        "supervisor",
        "middleware",
    }
    assert (said["link"].level, said["parachute"].level) == (WARN, STALE)
    assert said["link"].message == f"{network.connection} is open, nothing received yet"
    assert said["parachute"].message == "never received"
    assert said["supervisor"].level == STALE
    assert said["vehicle service"].message == "nothing was requested yet"
    assert said["node ids"].message == "0 node ids given out"
    devices = Devices(network)
    well = {"link", "controller 33", "trigger 34", "vehicle service", "node ids"}
    bench.until(
        lambda: well <= {task for task, one in tasks(diagnostics).items() if one.level == OK},
        "all is well",
    )
    said = tasks(diagnostics)
    assert (said["controller 33"].message, said["trigger 34"].message) == ("READY", "READY")
    assert said["controller 33"].hardware_id == "33"
    told = values(said["controller 33"])
    assert (told["link"], told["restarts"], told[p.LIGHT]) == ("OK", "0", "true")
    bench.until(
        lambda: "upf.controller" in values(tasks(diagnostics)["link"]).get("node 33", ""),
        "the nodes are named",
    )
    devices.act("error=IMU")
    bench.until(lambda: tasks(diagnostics)["controller 33"].level == ERROR, "the error is told")
    assert tasks(diagnostics)["controller 33"].message == "IMU"


def test_fields_that_the_types_lack_are_in_the_log_at_the_start(bench):
    said = bench.follow_log()
    network = Network(bench, dsdl_path=str(OTHER_LAYOUT))
    for absent in network.definitions.absent:
        bench.until(
            lambda absent=absent: any(f"have no {absent}" in one.msg for one in said),
            f"{absent} is named",
        )
