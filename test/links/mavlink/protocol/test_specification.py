"""Each sentence of the two parachute protocol documents that test_parachute.py does not hold."""

import pytest
from link_bench import Bench, ack, ardupilot, heartbeat, setting, status

from chute_ros.links.mavlink.protocol.config import KillMethod
from chute_ros.model import LinkState, ParachuteState, TriggerFlags
from chute_ros.protocol.mavlink.dialect import dialect as d

PARACHUTE = (1, 161)


def ready(ids=PARACHUTE, **config):
    return Bench(**config).hear(ids, heartbeat(), status())


def test_connection_identified_by_type_MAV_TYPE_PARACHUTE():  # noqa: N802
    """Any ID may be used; the public emulator uses 0."""
    for component in (d.MAV_COMP_ID_PARACHUTE, 1, 191, 0, 255):
        bench = ready((2, component))
        assert bench.link.chosen_parachute(bench.now).device == f"2/{component}"
        assert bench.last_status().state is ParachuteState.READY


def test_connection_counts_by_the_type_alone():
    # Connection MAV COMP ID PARACHUTE without the type is no parachute.
    # Connection type counts whatever the field autopilot says.
    bench = Bench().hear(PARACHUTE, heartbeat(autopilot=d.MAV_AUTOPILOT_GENERIC), status())
    assert bench.link.chosen_parachute(bench.now).device == "1/161"
    assert bench.link.autopilots.all() == []


def test_connection_heartbeats_at_1_Hz_keep_it_and_their_end_loses_it():  # noqa: N802
    bench = ready().stream(5.0, 1.0, PARACHUTE, heartbeat)
    assert bench.link.chosen_parachute(bench.now).liveness.state is LinkState.OK
    bench.at(7.6)
    assert bench.last_status().link_state is LinkState.STALE
    bench.at(10.1)
    assert bench.last_status().link_state is LinkState.LOST


def test_connection_distinguished_by_component_id():
    bench = ready().hear((1, 162), heartbeat(), status(errors=1))
    assert [p.device for p in bench.link.parachutes.all()] == ["1/161", "1/162"]
    states = [p.status(bench.now).state for p in bench.link.parachutes.all()]
    assert states == [ParachuteState.READY, ParachuteState.ABNORMAL]


def test_connection_a_status_before_any_heartbeat_is_of_nobody_known():
    bench = Bench().hear(PARACHUTE, status())
    assert bench.link.chosen_parachute(bench.now) is None
    assert bench.events == []
    bench.call("arm", 1, True, 0)
    assert "no parachute was received on this link" in bench.end(1).finished.message
    assert bench.commands() == []


def information_basic(manufactured=86400):
    return d.MAVLink_component_information_basic_message(
        1500, 3, manufactured, b"Maker", b"Chute 3", b"1.2.3", b"B", b"S-7"
    )


def test_connection_MAV_CMD_REQUEST_MESSAGE_512():  # noqa: N802
    for message_id, answer in ((430, status(boot_ms=5100)), (396, information_basic())):
        bench = ready().at(1.0).call("request_message", 7, message_id, "")
        (order,) = bench.commands()
        assert (order.command, order.param1) == (512, message_id)
        assert (order.target_system, order.target_component) == PARACHUTE
        end = bench.at(1.1).hear(PARACHUTE, ack(512), answer).end(7)
        assert end.finished.success
        assert end.data.get_type() == answer.get_type()


def test_connection_COMPONENT_INFORMATION_BASIC_field_by_field():  # noqa: N802
    def told(message):
        return ready().hear(PARACHUTE, message).link.chosen_parachute(0.0).information

    assert vars(told(information_basic())) == {
        "vendor_name": "Maker",
        "model_name": "Chute 3",
        "software_version": "1.2.3",
        "hardware_version": "B",
        "serial_number": "S-7",
        "manufacture_date": "1970-01-02",
        "capabilities": 3,
        "uptime": 1.5,
    }
    assert told(information_basic(0)).manufacture_date == "", "not known, and no day of 1970"


def on_the_wire(bench):
    (order,) = bench.commands(225)
    return int(order.param1), int(order.param2)


def test_SET_PARACHUTE_ARM_worked_example():  # noqa: N802
    """ATS and FC are armed, MANUAL and GEOFENCE disarmed; bit 3 is left alone."""
    bench = ready().call("set_triggers", 3, 0b00000110, 0b00010111, "")
    assert on_the_wire(bench) == (0b00000110, 0b00010111)
    bench.at(0.1).hear(PARACHUTE, ack(225), status(boot_ms=5100, armed=0b00001110))
    assert bench.end(3).finished.success
    text = "PARACHUTE_STATUS reports ATS armed, FC armed, MANUAL disarmed, GEOFENCE disarmed"
    assert text in bench.end(3).finished.message


def test_SET_PARACHUTE_ARM_single_source():  # noqa: N802
    for flag in TriggerFlags:
        for armed in (int(flag), 0):
            bench = ready().call("set_triggers", 3, armed, int(flag), "")
            assert on_the_wire(bench) == (armed, int(flag))
            shown = 0xFF & ~int(flag) | armed
            bench.at(0.1).hear(PARACHUTE, ack(225), status(boot_ms=5100, armed=shown))
            assert bench.end(3).finished.success, flag


def test_SET_PARACHUTE_ARM_acknowledged_but_not_shown_is_no_success():  # noqa: N802
    bench = ready().call("set_triggers", 3, 4, 4, "").at(0.1).hear(PARACHUTE, ack(225))
    boot = iter(range(5100, 9000, 100))
    bench.stream(5.5, 0.5, PARACHUTE, lambda: status(boot_ms=next(boot), armed=0))
    end = bench.end(3).finished
    assert (end.success, end.accepted) == (False, True)
    assert "never showed that PARACHUTE_STATUS reports FC armed" in end.message


def test_SET_PARACHUTE_ARM_mask_that_no_status_can_show_is_not_sent():  # noqa: N802
    for arm, select in ((0, 0), (1, 256), (256, 1), (1, 2**24), (2**32 - 1, 1), (-1, 1)):
        bench = ready().call("set_triggers", 3, arm, select, "")
        text = f"arm {arm}, select {select}: arm is a mask from 0 to 255, select from 1 to 255"
        assert text in bench.end(3).finished.message
        assert bench.commands() == []
    bench = ready().call("arm", 3, True, 256)
    assert "arm 256, select 256: arm is a mask from 0 to 255" in bench.end(3).finished.message
    assert bench.commands() == []


def test_STATUS_stream_nominally_1_Hz_is_watched():  # noqa: N802
    bench = ready().at(1.0).hear(PARACHUTE, heartbeat(), status(boot_ms=6000))
    assert bench.link.chosen_parachute(bench.now).status_interval == pytest.approx(1.0)
    bench.stream(4.0, 1.0, PARACHUTE, heartbeat).at(4.5)
    assert bench.last_status().faults == ("PARACHUTE_STATUS 3.5 s old",)


def test_STATUS_rate_by_MAV_CMD_SET_MESSAGE_INTERVAL_511_and_read_back():  # noqa: N802
    bench = ready().call("set_message_interval", 4, 430, 500_000, "")
    (order,) = bench.commands(511)
    assert (order.param1, order.param2) == (430, 500_000)
    bench.at(0.1).hear(PARACHUTE, ack(511))
    (ask,) = bench.commands(512)
    assert (ask.param1, ask.param2) == (d.MAVLINK_MSG_ID_MESSAGE_INTERVAL, 430)
    other = d.MAVLink_message_interval_message(30, 1)
    answer = d.MAVLink_message_interval_message(430, 500_000)
    bench.at(0.2).hear(PARACHUTE, ack(512), other, answer)
    end = bench.end(4)
    assert end.finished.success
    assert (end.data.message_id, end.data.interval_us) == (430, 500_000)


def test_MAV_CMD_DO_PARACHUTE_208():  # noqa: N802
    deployed = d.PARACHUTE_DEPLOYMENT_TRIGGER_MAVLINK
    for param1, name in enumerate(("DISABLE", "ENABLE", "RELEASE")):
        bench = ready().call("parachute_action", 5, getattr(d, f"PARACHUTE_{name}"), "")
        (order,) = bench.commands()
        assert (order.command, order.param1) == (208, param1)
        bench.hear(PARACHUTE, ack(208))
        if name == "RELEASE":
            assert bench.ends(5) == []
            bench.at(0.2).hear(PARACHUTE, status(boot_ms=5200, deployed=deployed))
        assert bench.end(5).finished.success, name


@pytest.mark.parametrize(
    ("method", "number", "params"),
    [
        pytest.param(
            KillMethod.FLIGHT_TERMINATION, 185, (1, 0), id="MAV_CMD_DO_FLIGHTTERMINATION"
        ),
        pytest.param(KillMethod.FORCED_DISARM, 400, (0, 21196), id="MAV_CMD_COMPONENT_ARM_DISARM"),
    ],
)
def test_kill(method, number, params):
    bench = Bench(kill_method=method).hear((1, 1), ardupilot(armed=True))
    afs = {"AFS_ENABLE": 1, "AFS_TERM_ACTION": 42, "AFS_TERM_PIN": -1}
    bench.hear((1, 1), *(setting(name, value) for name, value in afs.items()))
    bench.call("kill", 6)
    (order,) = bench.commands()
    assert (order.command, order.param1, order.param2) == (number, *params)
    assert (order.target_system, order.target_component) == (1, 1)
    bench.at(0.1).hear((1, 1), ack(number))
    assert bench.ends(6) == []
    bench.at(0.2).hear((1, 1), ardupilot(armed=False))
    assert bench.end(6).finished.success
    assert "the autopilot reports motors off" in bench.end(6).finished.message
