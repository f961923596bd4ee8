"""Why a UPF parachute is not healthy: the whole reason, with its value and what is needed."""

import pytest

from chute_ros.links.upf.runtime import reasons_of


def reasons(story, *troubles):
    link = story.link
    picture = link.devices.picture(story.now)
    return reasons_of(link.config, link.devices, picture, troubles, story.now)


def test_each_reason_is_told_with_its_value(bench):
    # Nothing is wrong with healthy devices.
    assert reasons(bench().ready()) == ()
    # A state is told with those that are needed.
    story = bench("").status("NOT_READY")
    assert reasons(story) == ("controller 33: state NOT_READY, need READY, TAKEOFF or ARMED",)
    story = bench("").status("LAUNCHED")
    assert reasons(story)[-1] == (
        "controller 33: state LAUNCHED, the parachute is out, need READY, TAKEOFF or ARMED"
    )
    # A lost controller is told with its silence.
    story = bench("").status("READY").node_status().at(10.0)
    assert "controller 33 LOST: 10.0 s" in reasons(story)
    # A trigger in trouble is told with its supply.
    story = bench("").status("READY").trigger_status("NOT_READY", supply_voltage=3.125)
    assert reasons(story) == ("trigger 34: state NOT_READY, supply 3.1 V, need READY",)
    # Troubles of the bus are reasons.
    story = bench("").status("READY")
    assert reasons(story, "two nodes use node id 40") == ("two nodes use node id 40",)


def test_a_named_trigger_that_was_never_received_is_a_reason(bench):
    story = bench("", trigger_node_id=34).status("READY")
    missing = "trigger 34 was never received: need its TriggerStatus from this node id"
    assert reasons(story) == (missing,)
    # Another trigger is not the one that is named.
    assert reasons(story.trigger_status(node_id=35)) == (missing,)
    assert reasons(story.trigger_status()) == ()
    # Without a controller it is told once, and with a controller that is missing as well.
    assert reasons(bench("", trigger_node_id=34, without_controller=True)) == (missing,)
    assert len(reasons(bench("", trigger_node_id=34))) == 2


@pytest.mark.parametrize(
    ("config", "text"),
    [
        (
            {},
            "a controller was never received: need its ParachuteStatus (controller_node_id 0: of",
        ),
        ({"controller_node_id": 33}, "controller 33 was never received: need its ParachuteStatus"),
        ({"without_controller": True}, "a trigger was never received: need its TriggerStatus"),
    ],
)
def test_never_heard(bench, config, text):
    (reason,) = reasons(bench("", **config))
    assert reason.startswith(text)
