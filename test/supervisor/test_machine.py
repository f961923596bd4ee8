"""The table of stages, written once more: a change of the one without the other is noticed."""

from itertools import product

import pytest

from chute_ros.errors import TransitionError
from chute_ros.supervisor.machine import TRANSITIONS, Stage, StageEvent, listed
from chute_ros.transitions import after

#: Stage -> "event stage" of each pair that is listed. Deploying is entered from killing alone, and
#: nothing but a reset leads back to the start.
EXPECTED = {
    "STARTUP": "LINKS_HEALTHY READY, LINKS_UNHEALTHY BLOCKED, TAKEN_OFF IN_FLIGHT, KILL KILLING",
    "BLOCKED": "LINKS_HEALTHY READY, TAKEN_OFF IN_FLIGHT, KILL KILLING, RESET STARTUP",
    "READY": "LINKS_UNHEALTHY BLOCKED, ARMED ARMED, TAKEN_OFF IN_FLIGHT, KILL KILLING, "
    "RESET STARTUP",
    "ARMED": "LINKS_UNHEALTHY BLOCKED, DISARMED READY, TAKEN_OFF IN_FLIGHT, KILL KILLING, "
    "RESET STARTUP",
    "IN_FLIGHT": "RESET STARTUP, LANDED LANDED, KILL KILLING, PARACHUTE_OPEN DEPLOYED",
    "KILLING": "KILL KILLING, TAKEN_OFF IN_FLIGHT, DEPLOY_DUE DEPLOYING, "
    "PARACHUTE_OPEN DEPLOYED, RESET STARTUP",
    "DEPLOYING": "PARACHUTE_OPEN DEPLOYED, MODE_CHANGED KILLING, DEPLOY_FAILED FAULT",
    "DEPLOYED": "KILL KILLING, TAKEN_BACK IN_FLIGHT, RESET STARTUP",
    "LANDED": "LINKS_UNHEALTHY BLOCKED, DISARMED READY, SECURED READY, TAKEN_OFF IN_FLIGHT, "
    "KILL KILLING, RESET STARTUP",
    "FAULT": "PARACHUTE_OPEN DEPLOYED, KILL KILLING, RESET STARTUP",
}


def test_the_table_lists_exactly_what_is_meant():
    pairs = {
        stage.name: {
            f"{event.name} {after.name}"
            for (one, event), after in TRANSITIONS.items()
            if one is stage
        }
        for stage in Stage
    }
    assert pairs == {name: set(told.split(", ")) for name, told in EXPECTED.items()}


def test_a_pair_is_listed_or_raises():
    for stage, event in product(Stage, StageEvent):
        assert listed(stage, event) is ((stage, event) in TRANSITIONS)
        if listed(stage, event):
            assert after(TRANSITIONS, stage, event) is TRANSITIONS[stage, event]
        else:
            words = f"^{stage.name} cannot take '{event.value}'$"
            with pytest.raises(TransitionError, match=words):
                after(TRANSITIONS, stage, event)
