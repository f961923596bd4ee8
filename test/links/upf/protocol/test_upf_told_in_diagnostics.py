"""What /diagnostics tell of a UPF link, and whether its node calls it healthy."""

from typing import Any

import pytest
from upf_link_bench import Bench, layout_of

from chute_ros.links.upf.diagnostics import details_of
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.runtime import UpfRuntime, UpfSettings
from chute_ros.model import LinkState
from chute_ros.ros.diagnostics import ERROR, OK, WARN


def tasks(story):
    """Task -> level, text and values."""
    told = details_of(story.link, story.now).tasks
    return {name: (level, text, values) for name, level, text, values, _ in told}


def summary(story):
    runtime = UpfRuntime("upf_can", UpfSettings(UpfConfig()), Any)
    return runtime.summarise(story.link, story.now)


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
