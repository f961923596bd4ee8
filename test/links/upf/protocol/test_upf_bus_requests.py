"""What is asked of a device besides flying: over a link with simulated and made-up devices."""

import pytest
from upf_link_bench import BY_REQUEST, flying, landed

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.protocol.dronecan.calls import CallFinished

GET_SET, OPCODE = bus_requests.GET_SET, bus_requests.EXECUTE_OPCODE


def parameter(name, union, **more):
    return {"name": name.encode(), "value": union, **more}


def set_it(story, name, text, force=False, node_id=0, token=1):
    return story.call("set_parameter", token, node_id, name, text, force).after(0.5)


def get_it(story, name, token=1):
    return story.call(
        "bus_request", token, 0, lambda node_id: bus_requests.get_parameter(node_id, name)
    )


def setting(bench, name, text):
    """A made-up controller is told to take this."""
    return bench("").status("READY").clear().call("set_parameter", 1, 33, name, text, False)


def answer(story, name, union, node_id=33, **more):
    """The newest question is answered with this parameter."""
    return story.answer_values(
        story.requests(GET_SET)[-1], parameter(name, union, **more), node_id
    )


OFF = {"boolean_value": 0}


def test_each_parameter_of_the_document_can_be_read_and_set_and_is_read_back(bench):
    story = bench().ready()
    values, delivered = story.controller.values, story.controller.settings.values
    for token, one in enumerate(p.PARAMETERS):
        done = get_it(story, one.name, 100 + token).after(0.5).bus_request(100 + token)
        assert done.success, one.name
        assert done.message.startswith(f"{one.name} is {p.words(values[one.name])}")
        assert done.parameters[0].default == delivered[one.name]
        wanted = 50 if one.kind is int else not values[one.name]
        done = set_it(story, one.name, p.words(wanted), token=token).bus_request(token)
        assert done.success, done.message
        assert values[one.name] == done.parameters[0].value == wanted, one.name
        assert story.link.devices.controllers[33].parameters[one.name] == wanted


def test_parameter_that_the_device_does_not_have_is_said_with_the_known_ones(bench):
    story = set_it(get_it(bench().ready(), "Enable Music"), "Enable Music", "true", token=2)
    for token in (1, 2):
        done = story.bus_request(token)
        assert not done.success
        assert "no parameter 'Enable Music'" in done.message
        assert "Static Node ID" in done.message


def test_name_that_no_parameter_can_have_is_refused_before_anything_is_sent(bench):
    """An empty one asks by index: it would set whatever comes first, the node id."""
    for name in ("", "x" * 93):
        story = set_it(get_it(bench().ready(), name), name, "50", token=2)
        assert "need 1 to 92 bytes" in story.bus_request(1).message
        assert "need 1 to 92 bytes" in story.bus_request(2).message
        assert not story.requests(GET_SET), name
        assert story.controller.values[p.STATIC_NODE_ID] == 33


def test_value_that_does_not_fit_is_refused_before_it_is_sent(bench):
    for name, text, why in (
        (p.LIGHT, "maybe", "need true or false"),
        (p.STATIC_NODE_ID, "many", "need a number (integer)"),
        (p.STATIC_NODE_ID, "126", "need 0 to 125"),
        (p.NODE_STATUS_INTERVAL, "1", "need 2 to 1000"),
        (p.PARACHUTE_STATUS_INTERVAL, "60001", "need 2 to 60000"),
        (p.PARACHUTE_STATUS_INTERVAL, "9" * 30, "no parameter can hold it"),
    ):
        story = bench().ready()
        before = dict(story.controller.values)
        done = set_it(story, name, text).bus_request(1)
        assert not done.success, text
        assert why in done.message
        assert "nothing was sent" in done.message
        assert story.controller.values == before


def test_limits_are_the_devices_or_those_of_the_document(bench):
    # Limits of the document count where the device has none.
    story = setting(bench, p.STATIC_NODE_ID, "126")
    answer(story, p.STATIC_NODE_ID, {"integer_value": 33})
    assert "need 0 to 125" in story.bus_request(1).message
    # Number of a device with its own range.
    limits = {"min_value": {"real_value": 0.0}, "max_value": {"real_value": 2.0}}
    story = answer(setting(bench, "Gain", "2.5"), "Gain", {"real_value": 1.0}, **limits)
    assert "need 0.0 to 2.0" in story.bus_request(1).message
    story.clear().call("set_parameter", 2, 33, "Gain", "0.1", False)
    for now_is in (1.0, 0.1, 0.1):
        answer(story, "Gain", {"real_value": now_is}, **limits)
    assert story.bus_request(2).success  # as near as 32 bits come


def test_device_that_does_not_take_a_value_or_answers_for_another_parameter_is_believed(bench):
    story = answer(setting(bench, p.LIGHT, "true"), "Enable Music", OFF)
    assert "no parameter 'Enable Light'" in story.bus_request(1).message
    story = setting(bench, p.LIGHT, "true")
    for _ in range(3):
        answer(story, p.LIGHT, OFF)
    assert story.bus_request(1).message == "Enable Light was not accepted: it is still false"
    assert not story.bus_request(1).success


def test_device_that_answers_late_is_asked_again_and_heard(bench):
    story = bench().ready()
    story.controller.mute = True
    story.call("set_parameter", 1, 33, p.LIGHT, "false", False).after(0.4)
    story.controller.mute = False
    assert story.after(1.0).bus_request(1).success


def test_device_that_falls_silent_on_the_way_leaves_what_is_not_known_open(bench):
    for answered, text in enumerate(
        (
            "Enable Light: no acknowledgement",
            "Enable Light may or may not be set: no acknowledgement",
            "Enable Light was sent, but not read back: no acknowledgement",
        )
    ):
        story = bench("").status("READY")
        controller = story.link.devices.controllers[33]
        controller.parameters[p.LIGHT] = False
        story.after(1.0).clear().call("set_parameter", 1, 33, p.LIGHT, "true", False)
        for _ in range(answered):
            answer(story, p.LIGHT, OFF)
        done = story.after(2.0).bus_request(1)
        assert not done.success
        assert done.message.startswith(text)
        assert controller.switch(p.LIGHT) is (False if answered == 0 else None), text


def test_text_parameter(bench):
    story = setting(bench, "Owner", "us")
    for now_is in (b"them", b"us", b"us"):
        answer(story, "Owner", {"string_value": now_is})
    assert story.bus_request(1).message == "Owner is us"


def test_value_is_kept_where_auto_save_is_on_or_once_it_is_saved(bench):
    done = set_it(bench().ready(), p.LIGHT, "false").bus_request(1)
    assert done.message == "Enable Light is false; kept"
    for saved in (False, True):
        story = set_it(bench(parameters={p.AUTO_SAVE: False}).ready(), p.LIGHT, "false")
        assert story.bus_request(1).message == (
            "Enable Light is false; lost at a restart until ~/save_params: Enable Auto-Save is off"
        )
        if saved:
            story.call("bus_request", 2, 0, lambda one: bus_requests.execute_opcode(one, 0))
            assert story.after(0.5).bus_request(2).message == "save: done"
        story.call("bus_request", 3, 0, bus_requests.restart).after(1.0)
        assert story.controller.values[p.LIGHT] is not saved


def test_what_is_kept_is_told_where_it_is_known(bench):
    # Nothing is said of what is kept where auto save is not known.
    story = bench().ready()
    done = set_it(story, p.LIGHT, "false", node_id=34).bus_request(1)
    assert done.message == "Enable Light is false"
    assert done.node_id == 34
    # Auto save tells of itself.
    story = bench().ready()
    assert "lost at a restart" in set_it(story, p.AUTO_SAVE, "false").bus_request(1).message
    done = set_it(story, p.AUTO_SAVE, "true", token=2).bus_request(2)
    assert done.message == "Enable Auto-Save is true; kept"


def test_node_id_takes_effect_at_the_next_start(bench):
    done = set_it(bench().ready(), p.STATIC_NODE_ID, "40").bus_request(1)
    assert done.message == "Static Node ID is 40; takes effect at the next start; kept"


def test_node_id_0_makes_it_ask_for_one_at_each_start(bench):
    story = set_it(bench().ready(), p.STATIC_NODE_ID, "0")
    assert story.bus_request(1).message == (
        "Static Node ID is 0; takes effect at the next start "
        "(0: requests a node id at each start); kept"
    )
    story.call("bus_request", 2, 33, bus_requests.restart).after(6.0)
    (given,) = [node_id for node_id in story.link.devices.controllers if node_id != 33]
    assert story.controller.node_id == given
    assert 1 <= given <= 125


def test_list_has_all_twelve_and_is_read_from_a_new_controller_unasked(bench):
    # List has all twelve.
    story = bench().ready().call("bus_request", 1, 0, bus_requests.list_parameters)
    done = story.after(0.5).bus_request(1)
    assert (done.success, done.message) == (True, "12 parameters")
    assert [one.name for one in done.parameters] == list(p.BY_NAME)
    # List is read from a new controller unasked.
    story = bench().ready()
    known = story.link.devices.controllers[33].parameters
    assert known == story.controller.values


def test_list_of_a_device_that_falls_silent_or_never_ends_tells_how_far_it_came(bench):
    for answered, text in (
        (1, "stopped after 1 parameters: no acknowledgement"),
        (
            bus_requests.MOST_PARAMETERS,
            "stopped after 128 parameters: the device does not end its list",
        ),
    ):
        story = (
            bench("")
            .trigger_status()
            .clear()
            .call("bus_request", 1, 0, bus_requests.list_parameters)
        )
        for _ in range(answered):
            answer(story, p.LIGHT, OFF, 34)
        done = story.after(3.0).bus_request(1)
        assert not done.success
        assert done.message.startswith(text)
        assert [one.name for one in done.parameters] == [p.LIGHT] * answered


def test_controller_that_did_not_tell_its_parameters_or_was_lost_is_asked_again(bench):
    # Controller that did not tell its parameters is asked again.
    story = bench()
    story.loses = lambda from_link, data: from_link
    story.at(5.0)
    assert not story.link.devices.controllers[33].parameters
    story.loses = lambda from_link, data: False
    assert story.at(20.0).link.devices.controllers[33].parameters == story.controller.values
    # Controller that is lost is not asked again until it is back.
    story = bench("").status("READY").at(30.0)
    assert story.link._desk.next_deadline() == float("inf")
    count = len(story.requests(GET_SET))
    story.status("READY")
    assert len(story.requests(GET_SET)) > count


def test_list_of_a_controller_that_never_ends_is_not_begun_again(bench):
    story = bench("").status("READY")
    for _ in range(bus_requests.MOST_PARAMETERS):
        answer(story, p.LIGHT, OFF)
    story.clear()
    for _ in range(40):
        story.after(0.5).status("READY")
    assert not story.requests(GET_SET)


def test_erased_parameters_are_those_of_delivery_after_a_restart(bench):
    story = set_it(bench().ready(), p.LIGHT, "false")
    story.call("disturb", 2, 0, False, lambda one: bus_requests.execute_opcode(one, 1))
    assert story.after(0.5).bus_request(2).message == "erase: done"
    story.call("disturb", 3, 0, False, bus_requests.restart)
    done = story.after(3.0).bus_request(3)
    assert (done.success, done.message) == (True, "restart: the device answered that it will")
    assert story.controller.values[p.LIGHT] is True
    assert "node 33 restarted" in story.notices()
    assert story.link.devices.controllers[33].restart_count == 1
    assert story.link.devices.controllers[33].parameters == story.controller.values


def test_restart_carries_the_magic_number_of_its_type(bench):
    story = bench("").status("READY").clear().call("bus_request", 1, 0, bus_requests.restart)
    (request,) = story.step().requests(bus_requests.RESTART_NODE)
    assert request.values == {"magic_number": 0xACCE551B1E}
    story.answer_values(request, {"ok": False}, 33)
    assert story.bus_request(1).message == "restart: the device answered that it will not"


def test_opcode_that_the_device_refuses(bench):
    story = (
        bench().ready().call("bus_request", 1, 0, lambda one: bus_requests.execute_opcode(one, 7))
    )
    done = story.after(0.5).bus_request(1)
    assert done.message == "erase: the device answered: not done"
    assert not done.success


def test_device_that_does_not_answer_ends_the_bus_request(bench):
    for make, what in (
        (lambda one: bus_requests.execute_opcode(one, 0), "save"),
        (bus_requests.restart, "restart"),
        (bus_requests.node_info, "node information"),
        (bus_requests.transport_stats, "transport statistics"),
        (lambda one: bus_requests.get_parameter(one, p.LIGHT), p.LIGHT),
    ):
        story = bench("").status("READY").after(3.0).clear().call("bus_request", 1, 33, make)
        done = story.after(2.0).bus_request(1)
        assert not done.success
        assert done.message.startswith(f"{what}: no acknowledgement after 3 sends")


def test_node_information_and_statistics_also_of_the_trigger(bench):
    # Node information and statistics.
    story = bench().ready().call("bus_request", 1, 0, bus_requests.node_info)
    story.call("bus_request", 2, 34, bus_requests.transport_stats).after(0.5)
    assert bytes(story.bus_request(1).values["name"]) == b"upf.controller"
    assert story.bus_request(2).values["transfers_tx"] > 0
    assert story.bus_request(2).node_id == 34
    # BusRequest goes to the trigger where there is no controller.
    story = bench("trigger").ready().call("bus_request", 1, 0, bus_requests.node_info)
    assert bytes(story.after(0.5).bus_request(1).values["name"]) == b"upf.trigger"


def test_bus_request_without_a_device_ends_at_once(bench):
    for node_id, why in ((0, "no UPF device was received"), (128, "there is no node id 128")):
        done = bench("").call("bus_request", 1, node_id, bus_requests.node_info).bus_request(1)
        assert not done.success
        assert done.message == f"{why} on this link; name a node id from 1 to 127"


@pytest.mark.parametrize("name", p.PROTECTION)
def test_protection_is_switched_off_in_the_air_only_by_force_which_is_said_loudly(bench, name):
    for text in ("false", "0", "0x0", "OFF"):
        story = bench().in_flight()
        done = set_it(story, name, text).bus_request(1)
        assert not done.success, text
        assert "force does it all the same" in done.message
        assert not story.requests(GET_SET)
        assert story.controller.values[name] is True
    story = set_it(bench().in_flight(), name, "false", force=True)
    assert story.bus_request(1).success
    assert f"{name} is being switched off" in story.notices()
    assert any(f"{name} is off" in fault for fault in story.picture().faults)
    # On the ground without force; on is told by nobody.
    story = set_it(bench().ready(), name, "false")
    assert story.bus_request(1).success
    story.call("vehicle", flying()).clear()
    assert set_it(story, name, "true", force=True, token=2).bus_request(2).success
    assert not story.notices()


@pytest.mark.parametrize("name", [one.name for one in p.PARAMETERS if one.name != p.LIGHT])
def test_any_parameter_but_the_light_needs_force_in_the_air(bench, name):
    """Each may take the automatic deployment, the status or the node away, also where it is on."""
    story = bench().in_flight()
    before = dict(story.controller.values)
    for token, text in enumerate(("0", "1", "1000"), start=2):
        done = set_it(story, name, text, token=token).bus_request(token)
        assert not done.success
        assert done.message.startswith(f"{name} may take the parachute away in the air; force")
    assert not story.requests(GET_SET)
    assert story.controller.values == before
    assert set_it(story, name, "1000" if "(ms)" in name else "1", True).bus_request(1).success


def test_interval_longer_than_the_status_timeout_is_set_with_a_warning(bench):
    story = bench().ready()
    done = set_it(story, p.PARACHUTE_STATUS_INTERVAL, "10000").bus_request(1)
    assert done.success
    assert "WARNING: status_timeout is 1.5 s" in done.message
    done = set_it(story, p.PARACHUTE_STATUS_INTERVAL, "1000", token=2).bus_request(2)
    assert done.success
    assert "WARNING" not in done.message


@pytest.mark.parametrize(
    "make",
    [
        bus_requests.restart,
        lambda one: bus_requests.execute_opcode(one, bus_requests.OPCODE_ERASE),
    ],
)
def test_device_is_not_taken_away_in_the_air_unless_forced(bench, make):
    story = bench("").status("ARMED").clear().call("disturb", 1, 0, False, make)
    assert "refused while the vehicle is in the air" in story.bus_request(1).message
    assert not story.requests(OPCODE) + story.requests(bus_requests.RESTART_NODE)
    story.call("disturb", 2, 0, True, make)
    assert story.requests(OPCODE) + story.requests(bus_requests.RESTART_NODE)
    lit = set_it(bench().in_flight(), p.LIGHT, "false").bus_request(1)
    assert lit.success, "what does not protect may be changed"


def test_vehicle_is_in_the_air_by_its_own_word_or_the_controllers(bench):
    story = bench("")
    for state, in_air in (
        (flying(), True),
        (flying(landed_state_age=2.0), True),  # armed
        (flying(landed_state_age=2.0, armed_age=2.0), True),  # it has stopped to say so
        (landed(), False),
        (landed(armed=flying().armed), True),
        (landed(), False),
    ):
        story.link.vehicle(state, story.now)
        assert story.link.in_air(story.now) is in_air
    assert story.link.in_air(story.now + 1.1)  # nobody says any more that it is on the ground


def test_controllers_word_counts_where_no_vehicle_ever_spoke(bench):
    story = bench("")
    for name in ("READY", "TAKEOFF", "ARMED", "LAUNCHED"):
        story.status(name)
        assert story.link.in_air(story.now + 1.1) is (name in ("TAKEOFF", "ARMED")), name
    story.status("NOT_READY").status("READY").status("TAKEOFF").after(4.0)
    assert not story.link.in_air(story.now)  # lost: its word is too old


def test_bus_requests_are_generators_that_know_no_bus():
    """The golden order of a change: read, set, read back."""
    bus_request = bus_requests.set_parameter(33, p.LIGHT, "on")
    told = {"name": b"Enable Light", "min_value": {"empty": {}}, "max_value": {"empty": {}}}
    told |= {"default_value": {"empty": {}}, "value": {"boolean_value": 1}}
    calls = [next(bus_request)]
    for _ in range(2):
        calls.append(bus_request.send(CallFinished(1, calls[-1], told, 1, 0.0)))
    with pytest.raises(StopIteration) as end:
        bus_request.send(CallFinished(1, calls[-1], told, 1, 0.0))
    assert end.value.value.success
    assert [call.values for call in calls] == [
        {"name": b"Enable Light"},
        {"name": b"Enable Light", "value": {"boolean_value": 1}},
        {"name": b"Enable Light"},
    ]
    assert {(call.server, call.service) for call in calls} == {(33, GET_SET)}


@pytest.mark.parametrize("enabled", [False, True])
def test_what_another_tool_has_set_is_known_soon(bench, enabled):
    """Whoever sits at the bus with a GUI tool may switch the protection off."""
    story = bench(parameters={**BY_REQUEST, p.ENABLE_PARACHUTE: not enabled}).ready()
    value = {"name": p.ENABLE_PARACHUTE.encode(), "value": {"boolean_value": int(enabled)}}
    tool = story.puppet(120)
    tool.request(33, GET_SET, 1, value, 16)
    for frame in tool.take_output():
        story.devices.receive(frame, story.now)
    story.after(11.0)
    assert story.link.devices.controllers[33].never_deploys is not enabled
    assert story.picture().healthy is enabled
