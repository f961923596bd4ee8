"""Two UPF devices under one node id, or under each other's: one clear error, and no flapping."""

from chute_ros.model import LinkState
from chute_ros.protocol.events import DeviceLinkChanged, Notice, Severity

OTHER = b"\x55" * 16


def errors(story):
    notices = [one for one in story.events if isinstance(one, Notice)]
    return [one.text for one in notices if one.severity is Severity.ERROR]


def test_two_controllers_under_one_node_id_are_one_error(bench):
    """Given two controllers with id 33, one armed, one not ready, for half a minute."""
    story, told = bench(""), []
    for tick in range(150):
        story.at(tick * 0.2)
        told.append(len([one for one in story.notices() if one.startswith("controller 33")]))
        story.status("ARMED" if tick % 2 else "NOT_READY")
        if tick % 5 == 0:
            story.node_status(uptime=100 + tick // 5).node_status(uptime=3 + tick // 5)
    assert errors(story) == ["two nodes use node id 33: give one of them another"]
    changes = [one.change for one in story.events if isinstance(one, DeviceLinkChanged)]
    assert [one.after for one in changes] == [LinkState.OK]
    assert told[-1] == told[10], "no line for each change of what the two say, once it is known"


def test_a_trigger_in_place_of_the_controller_is_no_controller_any_more(bench):
    """Given a controller 33 that is switched off, and a trigger that comes with its id."""
    story = bench("").status("READY").node_status(uptime=100)
    information = {"hardware_version": {"unique_id": bytes(16)}, "name": b"controller"}
    story.link.bus.nodes.information(33, information, story.now)
    story.at(20.0).node_status(uptime=1)
    information = {"hardware_version": {"unique_id": OTHER}, "name": b"trigger"}
    story.link.bus.nodes.information(33, information, story.now)
    for second in range(21, 25):
        story.at(second).node_status(uptime=second - 19).trigger_status(node_id=33)
    (text,) = errors(story)
    assert text.startswith("node 33 is another device than before")
    assert story.link.devices.controllers == {}
    assert list(story.link.devices.triggers) == [33]


def test_the_parameters_of_a_controller_that_is_gone_are_not_read_again(bench):
    """Given a controller 33 whose parameters were asked for, and a trigger in its place."""
    story = bench("").status("READY").node_status(uptime=100)
    information = {"hardware_version": {"unique_id": bytes(16)}, "name": b"controller"}
    story.link.bus.nodes.information(33, information, story.now)
    story.at(3.0).node_status(uptime=0)
    information = {"hardware_version": {"unique_id": OTHER}, "name": b"trigger"}
    story.link.bus.nodes.information(33, information, story.now)
    for second in range(4, 20):
        story.at(second).node_status(uptime=second - 3).trigger_status(node_id=33)
    assert story.link.devices.controllers == {}


def test_a_controller_that_is_replaced_while_it_deploys_is_gone_round(bench):
    """Given a controller 33 that has accepted a deploy, and another device that starts in its
    place, accepts the deploy as well and says nothing of a parachute."""
    story = bench("").status("ARMED").node_status(uptime=100).trigger_status()
    information = {"hardware_version": {"unique_id": bytes(16)}, "name": b"controller"}
    story.link.bus.nodes.information(33, information, story.now)
    story.link.deploy(1, False, story.now)
    while story.link.devices.controllers and story.t < 4.5:
        if story.after(0.1).t > 0.5:
            story.node_status(uptime=int(story.t))
            information = {"hardware_version": {"unique_id": OTHER}, "name": b"another"}
            story.link.bus.nodes.information(33, information, story.now)
        for request in story.requests("flyfire.ParachuteService"):
            story.answer_result(request, "SUCCESS")
        story.heard.clear()
        story.trigger_status()
    assert story.link.devices.controllers == {}
    assert story.after(0.3).requests("flyfire.TriggerService"), "the trigger is fired directly"
