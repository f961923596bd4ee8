"""Whole flights by the command chute alone: real nodes, simulated vehicles, real processes.

What happens is awaited in the lines of `chute watch --json`, and what a person sees and orders are
further runs of the command.
"""

from __future__ import annotations

import json
import signal
import subprocess
import threading

import pytest
from chute_bench import COMMAND, ROOT
from command_bench import tool
from rocket_operator import commands_to

from chute_ros.tools.demo_rig import DemoRig
from chute_ros.tools.pilot import Pilot
from chute_ros.tools.processes import Processes
from chute_ros.tools.rocket_rig import DemoRocketRig

# Each flight takes the machine for half a minute.
pytestmark = pytest.mark.xdist_group("chute flights")
#: A flight on a busy machine, s.
PATIENCE = 60.0


def of_vehicle(name, value):
    """Whether a line tells this of the vehicle."""
    return lambda one: one["vehicle"] is not None and one["vehicle"][name] == value


def measured(name, fulfils):
    """The same of a number, which may not be known."""

    def told(one):
        value = one["vehicle"] and one["vehicle"][name]
        return value is not None and fulfils(value)

    return told


class Terminal:
    """One vehicle at a terminal: `chute watch` runs all the time, others when they are called."""

    def __init__(self, namespace, await_until):
        self._namespace, self._await_until = namespace, await_until
        #: All that was told, oldest first.
        self.told = []
        self._watching = subprocess.Popen(
            [*COMMAND, "--namespace", namespace, "watch", "--json"],
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self):
        for line in self._watching.stdout:
            self.told.append(json.loads(line))

    def close(self):
        self._watching.terminate()
        self._watching.wait(PATIENCE)
        self._reader.join()

    def sees(self, condition, what):
        """Wait until the newest line fulfils this; the line."""
        self._await_until(
            lambda: self.told and condition(self.told[-1]),
            f"{what}; the newest line: {self.told[-1:]}",
            PATIENCE,
        )
        return self.told[-1]

    def sees_state(self, state):
        return self.sees(lambda one: one["state"] == state, f"the state is {state}")

    def sees_on_the_ground(self):
        return self.sees(of_vehicle("landed_state", "ON_GROUND"), "it stands on the ground")

    def states(self):
        """Each state once, in the order in which they came."""
        return list(dict.fromkeys(one["state"] for one in self.told))

    def chute(self, *arguments):
        """(exit code, standard output, standard error) of one command."""
        return tool("chute", "--namespace", self._namespace, *arguments)

    def orders(self, *arguments):
        """One that must be done; what it answered."""
        code, out, err = self.chute(*arguments)
        assert (code, err) == (0, ""), out + err
        assert out.startswith(f"{arguments[0]}: done"), out
        return out

    def arms(self):
        """Whoever is refused on a busy machine, on which messages come late, asks again."""
        refusals = []

        def done():
            refusals.append(self.chute("arm"))
            return refusals[-1][0] == 0

        self._await_until(done, f"armed; refused as yet: {refusals}", PATIENCE)


@pytest.fixture
def terminal(namespace, await_until):
    one = Terminal(namespace, await_until)
    yield one
    one.close()


@pytest.fixture
def rig(request, namespace, tmp_path):
    """A drone on the ground, with a MAVLink parachute or those that a test names."""
    processes = Processes(tmp_path)
    one = DemoRig.on_free_ports(getattr(request, "param", "mavlink"), "", namespace, processes)
    one.start_supervisor("supervisor")
    one.start_vehicle()
    one.start_parachute()
    yield one
    processes.end()


@pytest.fixture
def pilot(rig):
    one = Pilot(rig.pilot, 1)
    yield one
    one.close()


def take_off(terminal, pilot, height=30.0):
    """Armed by the command, and up."""
    terminal.sees_state("READY")
    assert terminal.chute("status")[0] == 0
    terminal.arms()
    terminal.sees_state("ARMED")
    pilot.arm()
    terminal.sees(of_vehicle("armed", "ARMED"), "the motors run")
    pilot.take_off(height)
    terminal.sees_state("IN_FLIGHT")
    terminal.sees(measured("height", lambda above: above > height - 2.0), "it is up")
    code, out, _ = terminal.chute("status")
    assert code == 0
    assert out.startswith("IN_FLIGHT\n")
    assert "ARMED, armed, not deployed, link OK" in out


def test_a_drone_is_brought_down_by_deploy_and_reset_after_the_landing(rig, terminal, pilot):
    take_off(terminal, pilot)
    said = terminal.orders("deploy", "--yes", "--reason", "the motor burns")
    assert "PARACHUTE_STATUS reports deployed" in said
    told = terminal.sees_state("DEPLOYED")
    assert told["parachutes"][0]["deployed"]
    terminal.sees(of_vehicle("armed", "DISARMED"), "the motors are off")
    code, out, _ = terminal.chute("status")
    assert code == 1, "a vehicle under its parachute is not well"
    assert out.startswith("DEPLOYED\n")
    assert "LAUNCHED, armed, DEPLOYED" in out
    by_hand = [one for one in terminal.told[-1]["decisions"] if one["action"] == "DEPLOY"]
    assert any("the motor burns" in reason for one in by_hand for reason in one["reasons"])
    terminal.sees_on_the_ground()
    states = terminal.states()
    begun = states.index("READY")
    assert states[begun : begun + 3] == ["READY", "ARMED", "IN_FLIGHT"]
    assert states[-1] == "DEPLOYED"
    assert set(states[begun + 3 : -1]) <= {"KILLING", "DEPLOYING"}
    # Given the module that was packed again, then a reset makes it as at the start.
    rig.processes.send_signal("parachute", signal.SIGKILL)
    rig.start_parachute()
    terminal.sees(lambda one: not one["parachutes"][0]["deployed"], "another is plugged in")
    terminal.orders("reset")
    terminal.sees_state("READY")


@pytest.mark.long
def test_a_kill_stops_the_motors_and_releases_the_parachute(rig, terminal, pilot):
    take_off(terminal, pilot)
    terminal.orders("kill", "--yes", "--reason", "smoke")
    terminal.sees_state("DEPLOYED")
    told = terminal.sees_on_the_ground()
    assert told["vehicle"]["armed"] == "DISARMED"
    actions = [one["action"] for one in told["decisions"]]
    assert actions.index("KILL") < actions.index("DEPLOY")


@pytest.mark.long
def test_without_a_parachute_in_reach_the_motors_stop_and_that_was_said(rig, terminal, pilot):
    take_off(terminal, pilot)
    rig.processes.send_signal("parachute", signal.SIGSTOP)
    terminal.sees(lambda one: one["links"][0]["state"] == "LOST", "the parachute is lost")
    status = terminal.chute("status")[1]
    assert "parachutes\n  not received here within " in status
    assert "mavlink_parachute  LOST, device NOT healthy, device OLD: " in status
    code, out, err = terminal.chute("deploy", "--yes", "--timeout", "20")
    assert code == 1
    assert out.startswith("deploy: NOT DONE")
    assert err.startswith(
        "chute: deploy: NO PARACHUTE CAN BE REACHED (mavlink_parachute LOST): the motors will "
    )
    terminal.sees(of_vehicle("armed", "DISARMED"), "the motors are off")


@pytest.mark.long
def test_an_armed_parachute_is_told_in_every_state_on_the_ground(rig, terminal, await_until):
    """Given one that is armed, when its cable is out for a while: it never is READY."""
    terminal.sees_state("READY")
    # It must have heard that it stands on the ground, or it is refused.
    await_until(lambda: terminal.chute("arm")[0] == 0, "it arms", PATIENCE)
    terminal.sees_state("ARMED")
    begun = len(terminal.told)
    rig.processes.send_signal("parachute", signal.SIGSTOP)
    terminal.sees_state("BLOCKED")
    code, out, _ = terminal.chute("status")
    assert code == 1
    assert "ARMED when it was last received: mavlink_parachute 1/161" in " ".join(out.split())
    rig.processes.send_signal("parachute", signal.SIGCONT)
    terminal.sees_state("ARMED")
    assert "READY" not in {one["state"] for one in terminal.told[begun:]}
    terminal.orders("disarm")
    terminal.sees_state("READY")


@pytest.mark.long
@pytest.mark.parametrize("rig", ["both"], indirect=True)
def test_a_drone_with_both_parachutes(rig, terminal, pilot):
    terminal.sees_state("READY")
    terminal.sees(lambda one: len(one["parachutes"]) == 2, "both are received")
    take_off(terminal, pilot)
    assert [one["armed"] for one in terminal.told[-1]["parachutes"]] == [True, True]
    terminal.orders("deploy", "--yes")
    told = terminal.sees_state("DEPLOYED")
    assert [one["deployed"] for one in told["parachutes"]] == [True, False], "one was enough"
    terminal.sees_on_the_ground()


@pytest.fixture
def command(namespace):
    yield from commands_to(namespace)


def test_a_rocket_whose_drogue_a_person_releases(namespace, terminal, command, tmp_path):
    processes = Processes(tmp_path)
    # Nobody else releases: a rule would on a machine that is busy, before the person has.
    rocket = DemoRocketRig("", namespace, processes, tmp_path, profile="by_hand")
    try:
        rocket.start_ground()
        rocket.plug_cable_in()
        terminal.sees_state("READY")
        # Given a flash that was not wiped, then arming is refused, with the reason.
        code, out, _ = terminal.chute("arm")
        assert code == 1
        assert out.startswith("arm: NOT DONE")
        assert "flash" in out
        assert command("wipe_flash").success
        terminal.sees_state("READY")
        terminal.arms()
        terminal.sees_state("ARMED")
        assert command("launch", force=True).confirmed
        # Its fall takes three seconds: nothing else is asked meanwhile.
        terminal.sees(measured("vertical_speed", lambda speed: speed < 0.0), "it falls")
        assert terminal.told[-1]["state"] == "IN_FLIGHT"
        terminal.orders("deploy", "--yes", "--reason", "no drogue")
        told = terminal.sees_state("DEPLOYED")
        assert told["parachutes"][0]["deployed"]
        assert terminal.chute("status")[1].startswith("DEPLOYED\n")
    finally:
        processes.end()
