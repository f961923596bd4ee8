"""Controllers and triggers as the vehicle sees them: alive, overdue, several, ours or not."""

import math

import pytest
from upf_link_bench import BY_REQUEST, Bench, layout_of

from chute_ros.errors import ParameterError
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.device_table import MOST_DEVICES
from chute_ros.links.upf.protocol.events import TriggerChanged
from chute_ros.model import LinkState, ParachuteState, SafetyFlags, TriggerFlags
from chute_ros.protocol.events import DeviceLinkChanged

S = ParachuteState


def changes(story):
    """Changes of links in words."""
    told = [one for one in story.events if isinstance(one, DeviceLinkChanged)]
    return [f"{one.name} {one.change.before.name} to {one.change.after.name}" for one in told]


def triggers(story):
    return [one.picture for one in story.events if isinstance(one, TriggerChanged)]


def test_nothing_is_there_before_it_is_heard(bench):
    story = bench("").at(5.0)
    assert story.picture() is None
    assert story.link.devices.controller() is None
    assert story.link.devices.trigger() is None


def test_controller_that_falls_silent_is_stale_then_lost_then_back(bench):
    story = bench("").at(1.0).status("READY")
    assert story.picture().link_state is LinkState.OK
    assert story.picture().healthy
    assert story.at(2.6).picture().link_state is LinkState.STALE
    assert not story.picture().healthy
    assert story.at(4.1).picture().link_state is LinkState.LOST
    assert story.picture().state is S.ABNORMAL
    assert "controller 33 LOST: 3.1 s" in story.picture().faults
    assert story.status("READY").picture().healthy
    assert changes(story) == [
        "controller 33 NEVER_SEEN to OK",
        "controller 33 OK to STALE",
        "controller 33 STALE to LOST",
        "controller 33 LOST to OK",
    ]


def test_silence_is_told_without_being_asked(bench):
    story = bench("").status("READY").clear().at(10.0)
    assert [picture.link_state for picture in story.pictures()] == [
        LinkState.STALE,
        LinkState.LOST,
    ]


def test_status_that_is_overdue_makes_it_abnormal_though_the_node_lives(bench):
    story = bench("").status("ARMED")
    for tenth in range(1, 30):
        story.at(tenth / 10).node_status(uptime=tenth // 10)
    picture = story.picture()
    assert (picture.link_state, picture.state) == (LinkState.OK, S.ABNORMAL)
    assert "ParachuteStatus 2.9 s old" in picture.faults
    assert S.ABNORMAL in [one.state for one in story.pictures()]
    assert story.status("ARMED").picture().state is S.ARMED


def test_limit_of_the_status_is_a_parameter(bench):
    story = bench("", status_timeout=0.5).status("READY").at(0.6)
    assert story.picture().state is S.ABNORMAL


def test_state_that_says_more_than_overdue_stays(bench):
    for state in ("NOT_READY", "LAUNCHED", "TOUCHDOWN"):
        assert bench("").status(state).at(5.0).picture().state.name == state


def test_health_of_its_node_status_counts(bench):
    for health, name in ((1, "WARNING"), (2, "ERROR"), (3, "CRITICAL")):
        picture = bench("").status("READY").node_status(health=health).picture()
        assert f"NodeStatus of 33 reports {name}" in picture.faults
        assert (picture.state is S.ABNORMAL) is (health >= 2), name
        assert picture.uptime == 5.0


@pytest.mark.parametrize(
    ("mode", "name", "state"),
    [
        (1, "INITIALIZATION", S.NOT_READY),
        (2, "MAINTENANCE", S.ABNORMAL),
        (3, "SOFTWARE_UPDATE", S.ABNORMAL),
        (5, "5", S.ABNORMAL),
        (7, "OFFLINE", S.ABNORMAL),
    ],
)
def test_mode_of_its_node_status_counts(bench, mode, name, state):
    """A mode other than OPERATIONAL; a device that initialises is not ready yet."""
    story = bench("").status("READY").node_status(mode=mode)
    assert f"NodeStatus of 33 reports mode {name}" in story.picture().faults
    assert story.picture().state is state
    assert not story.picture().healthy
    assert story.node_status(mode=0).picture().faults == ()
    assert story.picture().healthy


def test_trigger_in_another_mode_than_operational_is_not_sound(bench):
    story = bench("").status("READY").trigger_status("READY").node_status(34, mode=7)
    trigger = story.link.devices.trigger()
    assert not trigger.sound
    assert "NodeStatus of 34 reports mode OFFLINE" in trigger.faults(story.now)
    alone = bench("", without_controller=True).trigger_status("READY").node_status(34, mode=3)
    assert alone.picture().state is S.ABNORMAL
    assert alone.node_status(34, mode=1).picture().state is S.NOT_READY
    assert alone.node_status(34, mode=0).picture().healthy


def test_restart_does_not_flap(bench):
    """Given a controller that tells READY before its next NodeStatus leaves INITIALIZATION."""
    story = bench("").node_status(uptime=0, mode=1).status("NOT_READY").status("READY")
    story.node_status(uptime=1, mode=0).status("READY")
    states = [one.state for one in story.pictures()]
    assert S.ABNORMAL not in states
    assert states[-1] is S.READY


def test_picture_of_an_armed_controller(bench):
    story = bench("").status("ARMED", height_of_home=40.5, backup_power_voltage=8.0)
    picture = story.picture()
    assert (picture.device, picture.state, picture.armed) == ("33", S.ARMED, True)
    assert picture.armed_triggers == TriggerFlags.ATS
    assert (picture.height, picture.backup_voltage) == (40.5, 8.0)
    assert not picture.deployed
    assert math.isnan(picture.uptime)
    assert picture.faults == ()


def test_picture_after_touchdown(bench):
    picture = bench("").status("LAUNCHED").status("TOUCHDOWN").picture()
    assert picture.deployed
    assert picture.safety_flags == SafetyFlags.ON_GROUND


def test_what_is_switched_off_or_abnormal_without_a_reason_is_a_fault(bench):
    assert "state ABNORMAL" in bench("").status("ABNORMAL").picture().faults
    picture = bench(parameters={**BY_REQUEST, p.ENABLE_PARACHUTE: False}).ready().picture()
    assert picture.state is S.ABNORMAL
    assert "Enable Parachute is off: it never deploys" in picture.faults
    no_aps = "Enable APS is off: it deploys only by command"
    picture = bench(parameters={**BY_REQUEST, p.ENABLE_APS: False}).ready().picture()
    assert picture.healthy
    assert no_aps in picture.faults
    story = Bench(layout_of("ours"), "").status("READY", is_enable_auto_launch=False)
    assert no_aps in story.picture().faults, "by the status alone"


def test_status_says_how_often_it_comes(bench):
    story = bench("").status("READY").at(0.25).status("READY")
    assert story.link.devices.controllers[33].status_interval == pytest.approx(0.25)


def test_first_controller_that_is_not_lost_is_chosen(bench):
    story = bench("").status("READY", 33).status("ARMED", 35)
    assert story.picture().device == "33"
    for tenth in range(1, 40):
        story.at(tenth / 10).status("ARMED", 35)
    assert story.picture().device == "35"
    assert story.link.devices.controller(33).node_id == 33
    assert story.link.devices.controller(77) is None


def test_with_several_controllers_nobody_knows_whose_a_trigger_is(bench):
    story = bench("").status("READY", 33).trigger_out()
    assert story.picture().state is S.LAUNCHED
    story.status("READY", 35)
    assert story.picture().state is S.READY


def test_node_ids_by_parameter_let_no_other_in(bench):
    story = bench("", controller_node_id=35, trigger_node_id=36)
    story.status("READY", 33).trigger_status(node_id=34)
    assert not story.link.devices.controllers
    assert not story.link.devices.triggers
    assert story.link.counts["status of devices not followed"] == 2
    story.status("READY", 35).trigger_status(node_id=36)
    assert (list(story.link.devices.controllers), list(story.link.devices.triggers)) == (
        [35],
        [36],
    )


def test_made_up_devices_do_not_grow_it(bench):
    story = bench("")
    story.link.devices.parachute_status(0, {"state": 1}, story.now)
    assert not story.link.devices.controllers, "nobody is no device"
    for node_id in range(20, 60):
        story.status("READY", node_id).trigger_status(node_id=node_id)
    assert len(story.link.devices.controllers) == MOST_DEVICES
    assert len(story.link.devices.triggers) == MOST_DEVICES
    assert story.link.counts["status of devices not followed"] == 2 * (40 - MOST_DEVICES)


def test_one_node_can_be_both(bench):
    story = bench("").status("READY", 40).trigger_status(node_id=40).node_status(40, uptime=7)
    assert story.link.devices.controllers[40].uptime == 7.0
    assert story.link.devices.triggers[40].uptime == 7.0


def test_controller_that_restarts_is_noticed_and_asked_again(bench):
    story = bench("").status("READY").node_status(uptime=100).at(2.0).clear()
    story.node_status(uptime=0).status("NOT_READY")
    controller = story.link.devices.controllers[33]
    assert controller.restart_count == 1
    assert controller.parameters == {}
    # Once it is known that it was no second node under the same id.
    story.at(2.5).node_status(uptime=0).at(4.6)
    assert "node 33 restarted" in story.notices()
    assert len(story.requests("uavcan.protocol.param.GetSet")) >= 1


def test_trigger_that_restarts_is_counted(bench):
    story = (
        bench("").trigger_status().node_status(34, uptime=100).at(2.0).node_status(34, uptime=0)
    )
    assert story.link.devices.triggers[34].restart_count == 1


def test_picture_of_a_trigger(bench):
    story = bench("").trigger_status("READY", supply_voltage=12.0)
    assert triggers(story)[-1] == {
        "node_id": 34,
        "link_state": LinkState.OK,
        "state": "READY",
        "launched": False,
        "supply_voltage": 12.0,
        "error_flags": 0,
        "faults": (),
    }
    assert story.link.devices.triggers[34].sound


def test_trigger_that_cannot_fire_is_ill_or_silent_is_not_sound(bench):
    for state in ("ABNORMAL", "NOT_READY", "LAUNCHED"):
        assert not bench("").trigger_status(state).link.devices.triggers[34].sound, state
    story = bench("").trigger_status().node_status(34, health=2)
    trigger = story.link.devices.triggers[34]
    assert not trigger.sound
    story.node_status(34, health=0)
    assert trigger.sound
    story.at(2.0)
    assert not trigger.sound


def test_trigger_with_an_error_is_a_fault_of_the_parachute(bench):
    said = {"ours": {"error_flags": 1}, "other": {"error_circuit_open": True}}
    words = {"ours": "CIRCUIT_OPEN", "other": "error_circuit_open"}
    story = bench("").status("READY")
    name = story.layout.name
    story.trigger_status("ABNORMAL", **said[name])
    assert f"trigger 34: {words[name]}" in story.picture().faults
    assert triggers(story)[-1]["error_flags"] == said[name].get("error_flags", 0)


def test_trigger_that_is_abnormal_without_a_reason(bench):
    story = bench("").status("READY").trigger_status("ABNORMAL")
    assert "trigger 34 is ABNORMAL" in story.picture().faults


def test_trigger_that_fires_is_told_with_the_picture_of_its_controller(bench):
    story = bench("").status("ARMED").trigger_status().at(5.0).clear()
    story.trigger_out()  # the controller is lost
    assert "trigger 34 has fired" in story.notices()
    assert story.pictures()[-1].state is S.LAUNCHED
    assert story.pictures()[-1].deployed
    story.clear().trigger_status("LAUNCHED")
    assert "trigger 34 has fired" not in story.notices()


def test_trigger_that_falls_silent_is_told_with_the_picture_of_its_controller(bench):
    story = bench("").trigger_status()
    for tenth in range(1, 40):
        story.at(tenth / 10).status("READY")
    assert changes(story)[-1] == "trigger 34 STALE to LOST"
    assert any("trigger 34 LOST" in fault for fault in story.pictures()[-1].faults)


def test_controller_under_a_new_node_id_takes_the_place_of_the_one_that_fell_silent(bench):
    """Given one that restarts and is given another node id (DNA)."""
    story = bench("").status("READY", 120)
    devices = story.link.devices
    for tenth in range(1, 40):
        story.at(tenth / 10)
        if story.t >= 1.0:
            story.status("READY", 121)
        silent = devices.controllers[120].liveness.state is not LinkState.OK
        assert devices.controller().node_id == (121 if silent else 120), story.t
        assert devices.came_back_as(devices.controllers[120]) == (121 if silent else 0)
    assert story.picture().device == "121"
    assert devices.only_controller().node_id == 121
    # Nothing came back: the first is meant still.
    assert story.after(9.0).link.devices.controller().node_id == 120
    # Both speak: they are two.
    story.status("READY", 120).status("READY", 121)
    assert devices.controller().node_id == 120
    assert devices.only_controller() is None


def test_controller_that_spoke_before_another_fell_silent_is_another(bench):
    story = bench("").status("READY", 120).status("READY", 121)
    for tenth in range(1, 25):
        story.at(tenth / 10).status("READY", 121)
    assert story.link.devices.controller().node_id == 120, "STALE, and not known to be gone"
    assert story.link.devices.only_controller() is None


def test_trigger_is_the_parachute_where_the_parameter_says_that_there_is_no_controller(bench):
    story = bench("").trigger_status()
    assert (story.picture(), story.pictures()) == (None, [])
    for state in (S.NOT_READY, S.READY, S.LAUNCHED, S.ABNORMAL):
        story = bench("", without_controller=True)
        for _ in range(3):
            story.trigger_status(state.name, supply_voltage=12.0)
        picture = story.picture()
        assert (picture.device, picture.state, picture.backup_voltage) == ("34", state, 12.0)
        assert picture.deployed is (state is S.LAUNCHED)
        assert story.pictures()[-1] == picture
    story = bench("", without_controller=True).trigger_status().at(2.0)
    assert story.picture().state is S.ABNORMAL, "one that is silent is not healthy"
    assert story.pictures()[-1].state is S.ABNORMAL


def test_stray_controller_does_not_take_the_place_of_the_trigger(bench):
    story = bench("", without_controller=True).trigger_status().status("ARMED")
    assert story.link.devices.picture(story.now).device == "34"
    story.call("deploy", 1, False)
    assert story.step().requests("flyfire.TriggerService")
    assert not story.requests("flyfire.ParachuteService")


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("node_id", 0, "node_id is 0: need a whole number from 1 to 127"),
        ("node_id", 128, "node_id is 128: need a whole number from 1 to 127"),
        (
            "controller_node_id",
            128,
            "controller_node_id is 128: need a whole number from 0 to 127 (",
        ),
        ("trigger_node_id", -1, "trigger_node_id is -1: need a whole number from 0 to 127 ("),
        ("controller_node_id", 100, "controller_node_id is 100 and node_id is 100: a node id"),
        ("status_timeout", 0.0, "status_timeout is 0.0: need a number (1.0, not 1) from 0.05"),
        ("last_resort_after", math.inf, "last_resort_after is inf"),
        ("vehicle_service_timeout", math.nan, "vehicle_service_timeout is nan"),
        ("vehicle_status_rate", -1.0, "vehicle_status_rate is -1.0"),
        ("vehicle_state_age", 0.0, "vehicle_state_age is 0.0"),
        ("unique_id", b"short", "unique_id has 5 bytes: need 16"),
        ("node_name", "", "node_name is '': need 1 to 80 bytes"),
        ("node_name", "x" * 81, "need 1 to 80 bytes"),
    ],
)
def test_setting_that_makes_no_sense_is_refused(name, value, text):
    with pytest.raises(ParameterError) as raised:
        UpfConfig(**{name: value})
    assert text in str(raised.value)


def test_node_ids_of_the_devices_are_never_given_out():
    config = UpfConfig(controller_node_id=40, trigger_node_id=41)
    assert config.bus().never == (33, 34, 40, 41)


def test_bus_that_was_closed_leaves_what_is_known(bench):
    story = bench("").status("READY")
    story.link.stream_ended(None)
    assert story.picture().healthy


def test_made_up_node_ids_that_fell_silent_make_room_for_the_true_device(bench):
    story = bench("")
    for node_id in range(40, 40 + MOST_DEVICES):
        story.status("READY", node_id)
    assert 33 not in story.status("READY", 33).link.devices.controllers
    story.after(60.0).status("READY", 33)
    assert 33 in story.link.devices.controllers
    assert len(story.link.devices.controllers) == MOST_DEVICES
