"""The flight program of the simulated flight computer: key, launch, canopies, overrides."""

import pytest
from test_flight_computer import Host, standing_by

from chute_ros.links.umbilical.simulator.settings import ComputerMode


def in_mode(name, **settings):
    host = Host(**settings)
    host.act(f"jump={name}")
    host.run(0.2)
    return host


def flags(host):
    return host.newest["ssa_drogue_deployed"], host.newest["ssa_main_deployed"]


# The key


def seen(host):
    """Mode and what is out."""
    return (host.newest["flight_mode"], *flags(host))


def test_in_flight_the_key_changes_nothing():
    host = in_mode("Coast")
    host.send("<KD>")
    assert host.newest["flight_mode"] == ComputerMode.Coast


def test_with_the_interlock_arming_needs_a_wiped_flash():
    host = Host(interlock=True, wipe_time=1.0)
    host.send("<KA>")
    assert host.others == ["Arming blocked: wipe flash first"]
    assert host.newest["flight_mode"] == ComputerMode.Startup
    host.send("<W>", 1.5)
    host.send("<KA>")
    assert host.newest["flight_mode"] == ComputerMode.Standby
    # The permission is used up, or forgotten by a reboot; and a failed wipe is none.
    for ends in (["<KA>", "<KD>"], ["<R>"], []):
        host = Host(interlock=True, wipe_time=1.0)
        if not ends:
            host.act("wipe-fails")
        host.send("<W>", 1.5)
        for token in ends:
            host.send(token, 1.0)
        host.forget()
        host.send("<KA>")
        assert host.others == ["Arming blocked: wipe flash first"], ends
        assert host.newest["flight_mode"] == ComputerMode.Startup


# The flight


def test_a_whole_flight():
    host = standing_by(speed=20.0)
    host.send("<L>", 0.16)
    assert host.newest["flight_mode"] == ComputerMode.Ascent
    assert host.newest["mav_open"] == 1
    host.until(lambda: host.newest["flight_mode"] == ComputerMode.Coast)
    assert host.newest["mav_open"] == 0
    assert flags(host) == (0, 0)
    host.until(lambda: host.newest["flight_mode"] == ComputerMode.DrogueDeployed)
    assert flags(host) == (1, 0)
    assert host.newest["altitude"] == pytest.approx(3000.0, abs=80.0)
    host.until(lambda: host.newest["flight_mode"] == ComputerMode.MainDeployed)
    assert flags(host) == (1, 1)
    assert host.newest["altitude"] == pytest.approx(590.0, abs=80.0)
    host.until(lambda: host.newest["altitude"] == 0.0)
    host.run(5.0)
    assert host.newest["flight_mode"] == ComputerMode.MainDeployed
    assert host.newest["altitude"] == 0.0
    modes = [line for line in host.log if " -> " in line]
    assert modes[-1] == "DrogueDeployed -> MainDeployed"
    assert len(modes) == 5


def test_in_real_time_the_flight_takes_as_long_as_it_does():
    host = standing_by()
    host.send("<L>", 0.0)
    assert host.until(lambda: host.device.mode is ComputerMode.Coast) == pytest.approx(
        6.1, abs=0.2
    )


def test_launch_is_for_standby_only():
    for name in ("Startup", "Ascent", "Coast", "MainDeployed", "Fault"):
        host = in_mode(name)
        host.send("<L>", 0.1)
        assert host.newest["flight_mode"] == ComputerMode[name]
        assert host.newest["mav_open"] == (name == "Ascent"), name


def test_the_main_waits_until_the_drogue_has_been_out_for_3_s():
    host = in_mode("Coast", drogue_fails=True)
    host.until(lambda: 0.0 < host.newest["altitude"] < 560.0)
    host.send("<D>", 0.2)
    assert host.newest["flight_mode"] == ComputerMode.DrogueDeployed
    waited = host.until(lambda: host.newest["flight_mode"] == ComputerMode.MainDeployed)
    assert waited + 0.2 == pytest.approx(3.0, abs=0.2)


# What fails, and the manual override


def test_a_drogue_that_fails_by_itself_comes_by_command():
    host = in_mode("Coast", drogue_fails=True, speed=5.0)
    host.until(lambda: host.newest["vel_d"] > 30.0)
    assert host.newest["flight_mode"] == ComputerMode.Coast
    assert flags(host) == (0, 0)
    host.send("<D>", 2.0)
    assert host.newest["flight_mode"] == ComputerMode.DrogueDeployed
    assert flags(host) == (1, 0)
    assert host.newest["vel_d"] < 30.0


def test_drogue_and_main_come_by_command():
    host = in_mode("Coast")
    host.send("<D>")
    assert seen(host) == (ComputerMode.DrogueDeployed, 1, 0)
    host.send("<d>")
    assert seen(host) == (ComputerMode.MainDeployed, 1, 1)
    host.run(10.0)
    assert host.newest["vel_d"] < 8.0
    host = in_mode("Coast")
    host.send("<d>")
    assert seen(host) == (ComputerMode.Coast, 0, 1), "the main alone does not change the mode"
    for name in ("Startup", "Standby", "Fault"):
        host = in_mode(name)
        host.send("<D>")
        host.send("<d>")
        assert seen(host) == (ComputerMode[name], 1, 1), "on the ground the flags alone are set"


def test_stuck_it_takes_commands_but_nothing_comes_out():
    host = in_mode("Coast", speed=5.0)
    host.act("stuck")
    host.until(lambda: host.newest["vel_d"] > 30.0)
    host.send("<D>")
    host.send("<d>")
    assert [token for _, token in host.device.came] == ["<D>", "<d>"]
    assert (host.newest["flight_mode"], *flags(host)) == (ComputerMode.Coast, 0, 0)
    host.until(lambda: host.newest["altitude"] == 0.0)
    assert flags(host) == (0, 0)


def test_in_fault_nothing_is_automatic_but_the_override_works():
    host = in_mode("Coast", speed=5.0)
    host.act("fault")
    host.until(lambda: host.newest["vel_d"] > 30.0)
    assert (host.newest["flight_mode"], *flags(host)) == (ComputerMode.Fault, 0, 0)
    host.send("<D>", 2.0)
    assert (host.newest["flight_mode"], *flags(host)) == (ComputerMode.Fault, 1, 0)
    assert host.newest["vel_d"] < 30.0


def test_after_a_reboot_in_the_air_a_canopy_that_is_out_stays_out():
    host = in_mode("MainDeployed")
    host.send("<R>", 1.0)
    assert (host.newest["flight_mode"], *flags(host)) == (ComputerMode.Startup, 0, 0)
    assert 6.0 < host.newest["vel_d"] < 7.0


# Jumps


def test_a_jump_puts_it_where_it_plausibly_is():
    for name, lowest, highest, falls in (
        ("Ascent", 250.0, 400.0, False),
        ("Coast", 1990.0, 2020.0, False),
        ("DrogueDeployed", 2450.0, 2510.0, True),
        ("MainDeployed", 390.0, 401.0, True),
    ):
        host = in_mode(name)
        assert host.newest["flight_mode"] == ComputerMode[name]
        assert lowest < host.newest["altitude"] < highest, name
        assert (host.newest["vel_d"] > 0.0) is falls, name
        assert flags(host) == (falls, name == "MainDeployed")
    host = in_mode("Ascent", speed=20.0)
    host.until(lambda: host.newest["flight_mode"] == ComputerMode.DrogueDeployed)
    assert host.newest["altitude"] == pytest.approx(3000.0, abs=100.0), "and flies on"


def test_it_can_be_put_on_the_ground_and_on_the_pad():
    host = in_mode("MainDeployed", speed=20.0)
    host.act("land")
    host.run(1.0)
    assert (host.newest["altitude"], host.newest["vel_d"]) == (0.0, 0.0)
    assert host.newest["flight_mode"] == ComputerMode.MainDeployed
    host = in_mode("MainDeployed", speed=20.0)
    host.act("jump=Standby")
    host.run(0.2)
    assert (host.newest["altitude"], *flags(host)) == (0.0, 0, 0)
    host.send("<L>")
    host.until(lambda: host.newest["flight_mode"] == ComputerMode.DrogueDeployed)
