"""What a person makes of a simulated device, each seen from the wire."""

import math

import pytest
from device_bench import Station, position

from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.links.relay.protocol.link import RelayConfig
from chute_ros.links.relay.simulator.relay_board import RelayBoard
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.autopilot_device import AutopilotDevice

STATUS, POSITION = "SYS_STATUS", "GLOBAL_POSITION_INT"
FAST = 20_000.0  # microseconds


def autopilot():
    station = Station(AutopilotDevice(1, []))
    for message in (
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        dialect.MAVLINK_MSG_ID_ATTITUDE,
        dialect.MAVLINK_MSG_ID_SCALED_PRESSURE,
        dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
    ):
        station.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, message, FAST)
    return station


def hovering(height=20.0):
    station = autopilot()
    assert station.device.act(f"fly={height}") == ""
    station.run(15.0)
    assert station.newest(POSITION).relative_alt == pytest.approx(height * 1000.0, abs=100.0)
    return station


def test_fly_arms_waits_and_takes_off():
    station = autopilot()
    assert station.device.act("fly=20") == ""
    station.run(0.9)
    assert station.newest("HEARTBEAT").base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
    assert station.newest(POSITION).relative_alt == 0
    station.run(10.0)
    assert station.newest(POSITION).relative_alt == pytest.approx(20_000, abs=500)
    assert "in the air, at" in station.device.act("fly=30"), "once is enough"


def test_one_that_is_disarmed_before_it_leaves_stays_where_it_is():
    """As a supervisor that blocks flight does."""
    station = autopilot()
    station.device.act("fly=20")
    station.run(0.5)
    station.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
    station.run(5.0)
    assert station.newest(POSITION).relative_alt == 0
    assert "NO TAKE-OFF: it was disarmed" in station.log


def test_what_is_broken_flies_only_after_it_was_mended():
    station = hovering()
    station.device.act("fail-motor")
    station.run(5.0)
    assert "start over (mend)" in station.device.act("fly=20")
    assert any(line.startswith("fly is not done: ") for line in station.device.take_events())
    assert station.device.act("mend") == ""
    assert station.device.act("fly=20") == ""
    station.run(6.0)
    assert station.newest(POSITION).relative_alt > 10_000


def test_its_battery_drains_and_shows_the_charge_of_its_voltage():
    station = autopilot()
    station.run(1.0)
    as_delivered = station.newest(STATUS)
    assert (as_delivered.voltage_battery, as_delivered.battery_remaining) == (15800, 87)
    station.device.act("battery=13.4")
    station.run(2.0)
    assert 14_000 < station.newest(STATUS).voltage_battery < 15_800, "not at once"
    station.run(5.0)
    told = station.newest(STATUS)
    assert (told.voltage_battery, told.battery_remaining) == (13400, 3)
    charges = [one.battery_remaining for one in station.messages(STATUS)]
    assert charges == sorted(charges, reverse=True)
    station.device.act("battery=16.8")
    station.run(1.0)
    assert station.newest(STATUS).battery_remaining == 100
    station.device.act("battery=0")
    station.run(40.0)
    empty = station.newest(STATUS)
    assert (empty.voltage_battery, empty.battery_remaining) == (0, 0)


@pytest.mark.parametrize(("kind", "speed"), [("climb", 3.0), ("fall", -3.0)])
def test_its_estimator_runs_away_while_the_barometer_tells_the_truth(kind, speed):
    station = hovering()
    pressure = station.newest("SCALED_PRESSURE").press_abs
    station.device.act(f"lie={kind}")
    station.run(5.0)
    told = station.newest(POSITION)
    assert told.vz == pytest.approx(-100.0 * speed, abs=10.0)
    # 2 s until it is in full, 3 s of it.
    assert told.relative_alt == pytest.approx(20_000 + 1000 * speed * 4.0, abs=200.0)
    assert station.device.model.height == pytest.approx(20.0, abs=0.1)
    # 0.12 hPa a metre, 0.3 m of noise.
    assert station.newest("SCALED_PRESSURE").press_abs == pytest.approx(pressure, abs=0.3)
    wanted = -station.newest("POSITION_TARGET_LOCAL_NED").z
    assert wanted == pytest.approx(20.0, abs=0.1), "what it is told to do has not changed"
    station.device.act("lie=truth")
    station.run(0.1)
    assert station.newest(POSITION).relative_alt == pytest.approx(20_000, abs=100.0)


def test_a_stuck_estimator_repeats_itself_in_the_fall_until_the_autopilot_restarts():
    station = hovering()
    station.device.act("lie=stuck")
    station.device.act("fail-motor")
    before = station.newest(POSITION)
    station.forget()
    station.run(1.0)
    heights = {one.relative_alt for one in station.messages(POSITION)}
    assert heights == {before.relative_alt}
    assert len({one.roll for one in station.messages("ATTITUDE")}) == 1
    assert station.device.model.height < 18.0
    station.device.act("reboot")
    station.run(0.3)
    assert station.newest(POSITION).relative_alt < 18_000


def test_wind_moves_it_in_the_air_and_ends():
    station = hovering()
    station.device.act("wind=8")
    station.forget()
    station.run(10.0)
    speeds = [one.vz for one in station.messages(POSITION)]
    assert max(speeds) - min(speeds) > 50, "cm/s"
    assert max(abs(one.roll) for one in station.messages("ATTITUDE")) > math.radians(1.0)
    station.device.act("wind=0")
    station.run(5.0)
    station.forget()
    station.run(2.0)
    assert max(abs(one.vz) for one in station.messages(POSITION)) < 20, "cm/s"
    rolls = [abs(one.roll) for one in station.messages("ATTITUDE")]
    assert 0.0 < max(rolls) < math.radians(1.5), "in still air too it does not stand quite still"
    assert len(set(rolls)) == len(rolls)


def test_on_the_ground_no_wind_moves_it():
    station = autopilot()
    station.device.act("wind=20")
    station.run(5.0)
    assert {one.vz for one in station.messages(POSITION)} == {0}


def parachute():
    station = Station(ParachuteDevice(ParachuteSettings(armed_triggers=4), []))
    station.send(position(30.0), sender=(1, 1))
    return station


def release(station):
    return station.command(dialect.MAV_CMD_DO_PARACHUTE, dialect.PARACHUTE_RELEASE)


def test_a_parachute_refuses_also_after_a_restart_until_it_accepts():
    station = parachute()
    station.device.act("refuse")
    assert release(station) == [dialect.MAV_RESULT_FAILED]
    station.device.act("reboot")
    assert release(station) == [dialect.MAV_RESULT_FAILED]
    station.run(1.1)
    assert station.newest("PARACHUTE_STATUS").deployment_status == 0
    station.device.act("accept")
    assert release(station) == [dialect.MAV_RESULT_ACCEPTED]


def test_a_parachute_that_is_packed_again_can_be_released_again():
    station = parachute()
    assert release(station) == [dialect.MAV_RESULT_ACCEPTED]
    station.device.act("repack")
    station.run(1.1)
    assert station.newest("PARACHUTE_STATUS").deployment_status == 0
    assert release(station) == [dialect.MAV_RESULT_ACCEPTED]
    station.run(0.1)
    assert station.newest("PARACHUTE_STATUS").deployment_status != 0


def test_a_relay_board_fires_again_once_its_canopy_is_packed():
    fired, order = [], RelayConfig()
    board = RelayBoard(on_fire=lambda: fired.append(True))
    board.receive(order.fire, 0.0)
    board.act("repack")
    assert (board.closed, board.fired) == (False, False)
    board.act("stuck")
    board.receive(order.fire, 1.0)
    assert len(fired) == 1
    board.act("repack")
    board.receive(order.fire, 2.0)
    assert len(fired) == 2
