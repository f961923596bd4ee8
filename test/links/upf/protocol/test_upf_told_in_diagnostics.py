"""What /diagnostics tell of a UPF link, and whether its node calls it healthy."""

from typing import Any

import pytest
from upf_link_bench import US, Bench, flying, landed, layout_of

from chute_ros.links.upf.diagnostics import details_of
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.runtime import UpfRuntime, UpfSettings
from chute_ros.model import LinkState
from chute_ros.protocol.dronecan.can_frame import ERROR_BUS_OFF, ERROR_RESTARTED, CanFrame, pack
from chute_ros.ros.diagnostics import ERROR, OK, WARN


def tasks(story):
    """Task -> level, text and values."""
    told = details_of(story.link, story.now).tasks
    return {name: (level, text, values) for name, level, text, values, _ in told}


def new_runtime():
    return UpfRuntime("upf_can", UpfSettings(UpfConfig()), Any)


def summary(story):
    return new_runtime().summarise(story.link, story.now)


def test_a_request_with_a_bad_magic_number_is_told_and_counted():
    story = Bench(layout_of("ours"), "").ask("TYPE_KILLSWITCH", magic_number=7)
    level, text, values = tasks(story)["vehicle service"]
    assert (level, text) == (WARN, "bad request of 33: BAD_MAGIC_NUMBER")
    assert values["requests with a bad magic number"] == 1


def test_a_launch_that_nobody_ordered_is_told_by_its_reason(bench):
    story = bench("").trigger_status("LAUNCHED")
    assert details_of(story.link, story.now).dropped["launched without an order, not believed yet"]
    assert tasks(story)["trigger 34"][2]["has fired"] is False
    assert tasks(story.trigger_out())["trigger 34"][2]["has fired"] is True


def test_a_controller_that_came_back_under_another_node_id_is_told_so(bench):
    story = bench("").status("READY", 120)
    while story.t < 2.0:
        story.after(0.1).status("READY", 121)
    assert tasks(story)["controller 120"][:2] == (WARN, "came back as 121")
    assert tasks(story)["controller 121"][:2] == (OK, "READY")


def test_a_named_trigger_that_is_missing_forbids_take_off(bench):
    """Given a controller that is READY, as after a restart of the node alone."""
    story = bench("", trigger_node_id=34).status("READY")
    assert not summary(story).device_healthy
    assert summary(story).link_state is LinkState.OK
    assert summary(story).reasons[0].startswith("trigger 34 was never received")
    assert tasks(story)["trigger 34"][0] == ERROR
    assert summary(story.trigger_status()).device_healthy


@pytest.mark.parametrize("without_controller", [False, True])
def test_a_controller_that_is_missing_beside_its_trigger_is_an_error(bench, without_controller):
    story = bench("", without_controller=without_controller).trigger_status()
    told = tasks(story).get("controller")
    assert (told is None) is without_controller
    assert summary(story).device_healthy is without_controller
    if told is not None:
        assert told[0] == ERROR
        assert told[1].startswith("never received, and without it")
        assert summary(story).link_state is LinkState.NEVER_SEEN
        assert story.pictures() == [], "a trigger alone is no parachute"


def test_a_trigger_in_trouble_forbids_take_off_and_takes_nothing_back_in_the_air(bench):
    story = bench("").status("READY").trigger_status("ABNORMAL")
    assert not summary(story).device_healthy
    assert summary(story).link_state is LinkState.OK
    assert summary(story.call("vehicle", flying())).device_healthy
    assert not summary(story.call("vehicle", landed())).device_healthy
    assert summary(story.trigger_status()).device_healthy


def test_a_controller_that_restarts_is_counted(bench):
    story = bench().ready()
    assert tasks(story)["controller 33"][2]["restarts"] == 0
    story.after(2.0).devices.act("reboot")
    assert tasks(story.after(3.0))["controller 33"][2]["restarts"] == 1
    assert summary(story).device_healthy


# Who is on the bus


def doubled(bench):
    """Two controllers have said who they are under one node id, and tell that they are READY."""
    story = bench("", vehicle_state_age=60.0)
    for second in range(8):
        story.at(float(second)).status("READY")
        story.node_status(uptime=100 + second).node_status(uptime=3 + second)
    return story


def test_two_devices_with_one_node_id_forbid_take_off_only(bench):
    story = doubled(bench)
    told = "two nodes use node id 33: give one of them another"
    assert details_of(story.link, story.now).troubles == (told,)
    assert summary(story).reasons == (told,)
    assert summary(story.call("vehicle", flying())).device_healthy
    # Both are switched off, and one of them on again.
    story.after(30.0).status("READY").node_status(uptime=1).after(0.1)
    assert details_of(story.link, story.now).troubles == ()
    assert summary(story.call("vehicle", landed())).device_healthy


def test_one_that_arms_or_flies_under_a_flight_block_lifts_it_not_by_that(bench):
    """Given a doubt as flight is blocked, and an order to disarm that is lost; by its height the
    supervisor knows when it flies, and releases the block."""
    story, runtime = doubled(bench), new_runtime()
    runtime.decided_block = "links"
    assert not runtime.summarise(story.link, story.now).device_healthy
    story.call("vehicle", flying())
    assert not runtime.summarise(story.link, story.now).device_healthy
    runtime.decided_block = ""
    assert runtime.summarise(story.link, story.now).device_healthy


def test_another_node_with_our_node_id_is_told_and_forbids_take_off(bench):
    story = bench("").status("READY").node_status(US, uptime=1).after(0.1)
    told = f"another node uses our node id {US}: set node_id to a free one"
    assert details_of(story.link, story.now).troubles == (told,)
    assert summary(story).reasons == (told,)
    assert details_of(story.after(5.0).link, story.now).troubles == ()
    assert summary(story.status("READY")).device_healthy


def test_bus_off_is_told_and_over_once_the_can_controller_restarts(bench):
    """As the wire of an interface that tells of errors hands them on."""
    story = bench("")
    story.link.receive(pack(CanFrame(ERROR_BUS_OFF, b"", False, error=True)), story.now)
    details = details_of(story.step().link, story.now)
    assert details.troubles[0].startswith("the CAN controller is bus-off")
    assert details.bus["times bus-off"] == 1
    story.link.receive(pack(CanFrame(ERROR_RESTARTED, b"", False, error=True)), story.now)
    assert details_of(story.step().link, story.now).troubles == ()
