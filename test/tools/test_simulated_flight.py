"""The arguments of simulation.launch.py: what the simulators are told, and each mistake."""

import os
from importlib.metadata import EntryPoint

import pytest
from other_package import other_package, python

from chute_ros.errors import NotRegisteredError, ParameterError
from chute_ros.links.registered import vehicles
from chute_ros.sim.bench_actions import ACTIONS, actions_of
from chute_ros.tools import simulated_vehicle
from chute_ros.tools.launch_checks import FAILURES, FlightArguments
from chute_ros.tools.simulated_vehicle import own_folder, simulator_module, simulators_of

DRONE, ROCKET = simulators_of("mavlink"), simulators_of("umbilical")
CALM, FLIES = ["--at", "0:wind=0.5"], {"fly": "60"}


def test_one_that_stands_is_told_nothing_but_of_light_air():
    assert FlightArguments().options(DRONE) == {"sim_autopilot": CALM}
    assert FlightArguments().options(ROCKET) == {}


def test_a_flight_with_several_failures_is_a_script_of_each_simulator():
    flight = FlightArguments(fly="60", fail="refuse@0, motor@15,link@20.5", wind="5")
    assert flight.options(DRONE) == {
        "sim_autopilot": [
            *("--at", "10:arm", "--at", "11:takeoff=60", "--at", "0:wind=5"),
            *("--at", "26:fail-motor", "--at", "31.5:cut"),
        ],
        "sim_mavlink_parachute": ["--at", "11:refuse"],
    }


def test_a_rocket_is_launched():
    flight = FlightArguments(launch="12", fail="drogue@0,umbilical@3")
    assert flight.options(ROCKET) == {
        "sim_flight_computer": ["--at", "12:launch", "--at", "12:drogue-fails", "--at", "15:cut"]
    }


def test_each_failure_is_an_action_of_the_table_and_of_some_vehicle():
    assert set(FAILURES.values()) <= {one.name for one in ACTIONS}
    for word, action in FAILURES.items():
        able = [
            name
            for name in vehicles()
            if action in {one.name for one in actions_of(simulators_of(name))}
        ]
        assert able, word
        for name in able:
            begin = {"launch": "1"} if name == "umbilical" else FLIES
            assert FlightArguments(**begin, fail=f"{word}@1").options(simulators_of(name))


NO_HEIGHT, NO_SPEED = "need a height from 1 to 500 (m)", "need a speed from 0 to 30 (m/s)"


@pytest.mark.parametrize(
    ("simulators", "given", "told"),
    [
        (DRONE, {"fly": "high"}, f"fly is 'high': {NO_HEIGHT}, for example 60"),
        (DRONE, {"fly": "0.5"}, f"fly is '0.5': {NO_HEIGHT}"),
        (DRONE, {"fly": "nan"}, f"fly is 'nan': {NO_HEIGHT}"),
        (DRONE, {"wind": "31"}, f"wind is '31': {NO_SPEED}, for example 5"),
        (DRONE, {"wind": "-1"}, f"wind is '-1': {NO_SPEED}"),
        (DRONE, {"fail": "motor@5"}, "fail is 'motor@5': need fly too, which it counts from"),
        (DRONE, FLIES | {"fail": "motor"}, "fail is 'motor': need one of motor, autopilot, "),
        (
            DRONE,
            FLIES | {"fail": "motor@"},
            "@ and seconds after the take-off or launch from 0 to",
        ),
        (DRONE, FLIES | {"fail": "motor@-1"}, "fail is 'motor@-1': need one of "),
        (DRONE, FLIES | {"fail": "motor@inf"}, "fail is 'motor@inf': need one of "),
        (DRONE, FLIES | {"fail": "engine@5"}, "for example motor@15"),
        (DRONE, FLIES | {"fail": "motor@5,drogue@1"}, "fail is 'drogue@1': need one of motor, "),
        (
            DRONE,
            {"launch": "12"},
            f"launch is '12': need a vehicle with {ROCKET[0]}; this one has {', '.join(DRONE)}",
        ),
        (ROCKET, {"launch": "soon"}, "launch is 'soon': need a time after the start from 0 to 36"),
        (
            ROCKET,
            FLIES,
            "fly is '60': need a vehicle with sim_autopilot; this one has sim_flight_",
        ),
        (ROCKET, {"wind": "5"}, "wind is '5': need a vehicle with sim_autopilot"),
        (
            ROCKET,
            {"fail": "drogue@5"},
            "fail is 'drogue@5': need launch too, which it counts from",
        ),
        (
            ROCKET,
            {"launch": "5", "fail": "motor@5"},
            "fail is 'motor@5': need one of drogue, computer, ",
        ),
    ],
)
def test_a_mistake_names_the_argument_the_value_and_what_is_needed(simulators, given, told):
    with pytest.raises(ParameterError) as caught:
        FlightArguments(**given).options(simulators)
    assert told in str(caught.value)


def test_the_folder_of_the_sockets_is_for_this_user_alone(tmp_path):
    before = os.umask(0)
    try:
        folder = own_folder(tmp_path / "sockets")
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert own_folder(folder) == folder, "it may be there already"
    folder.chmod(0o770)
    with pytest.raises(ParameterError, match="is not for this user alone: remove it, or chmod"):
        own_folder(folder)
    link = tmp_path / "link"
    link.symlink_to(tmp_path)
    with pytest.raises(ParameterError, match="is not for this user alone"):
        own_folder(link)
    (tmp_path / "file").write_text("")
    with pytest.raises(ParameterError, match="need a folder for sockets"):
        own_folder(tmp_path / "file")


@pytest.mark.parametrize(
    ("places", "said"),
    [
        ([], "simulator sim_motor is no module: need one module for it among the console_scripts"),
        (["ours.sim:main", "theirs:main"], "simulator sim_motor is ours.sim and theirs: need one"),
    ],
)
def test_a_simulator_is_one_module(places, said, monkeypatch):
    def installed(group, name):
        return [EntryPoint(name, place, group) for place in places]

    monkeypatch.setattr(simulated_vehicle, "entry_points", installed)
    with pytest.raises(NotRegisteredError, match=f"^{said}"):
        simulator_module("sim_motor")


def test_a_simulation_can_carry_the_vehicle_of_another_package(tmp_path):
    other_package(tmp_path)
    tell = "import sys; sys.argv = ['sim', '--help']; from chute_ros.tools.sim import main; main()"
    done = python(tell, tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"--parachute {{{','.join(one for one in vehicles() if one != 'umbilical')}" in (
        done.stdout
    )
    assert ",other" in done.stdout
