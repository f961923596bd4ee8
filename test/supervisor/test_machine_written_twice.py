"""The table once more: a change of the one without the other is noticed, whatever it is."""

from chute_ros.supervisor.machine import TRANSITIONS, Stage

#: Stage -> "event stage" of each pair that is listed.
EXPECTED = {
    "STARTUP": (
        "LINKS_HEALTHY READY",
        "LINKS_UNHEALTHY BLOCKED",
        "TAKEN_OFF IN_FLIGHT",
        "KILL KILLING",
    ),
    "BLOCKED": (
        "LINKS_HEALTHY READY",
        "TAKEN_OFF IN_FLIGHT",
        "KILL KILLING",
        "RESET STARTUP",
    ),
    "READY": (
        "LINKS_UNHEALTHY BLOCKED",
        "ARMED ARMED",
        "TAKEN_OFF IN_FLIGHT",
        "KILL KILLING",
        "RESET STARTUP",
    ),
    "ARMED": (
        "LINKS_UNHEALTHY BLOCKED",
        "DISARMED READY",
        "TAKEN_OFF IN_FLIGHT",
        "KILL KILLING",
        "RESET STARTUP",
    ),
    "IN_FLIGHT": (
        "RESET STARTUP",
        "LANDED LANDED",
        "KILL KILLING",
        "PARACHUTE_OPEN DEPLOYED",
    ),
    "KILLING": (
        "KILL KILLING",
        "TAKEN_OFF IN_FLIGHT",
        "DEPLOY_DUE DEPLOYING",
        "PARACHUTE_OPEN DEPLOYED",
        "RESET STARTUP",
    ),
    "DEPLOYING": (
        "PARACHUTE_OPEN DEPLOYED",
        "MODE_CHANGED KILLING",
        "DEPLOY_FAILED FAULT",
    ),
    "DEPLOYED": (
        "KILL KILLING",
        "TAKEN_BACK IN_FLIGHT",
        "RESET STARTUP",
    ),
    "LANDED": (
        "LINKS_UNHEALTHY BLOCKED",
        "DISARMED READY",
        "SECURED READY",
        "TAKEN_OFF IN_FLIGHT",
        "KILL KILLING",
        "RESET STARTUP",
    ),
    "FAULT": (
        "PARACHUTE_OPEN DEPLOYED",
        "KILL KILLING",
        "RESET STARTUP",
    ),
}


def test_the_table_lists_exactly_what_is_meant() -> None:
    listed = {
        stage.name: {
            f"{s.name} {after.name}" for (one, s), after in TRANSITIONS.items() if one is stage
        }
        for stage in Stage
    }
    assert listed == {name: set(pairs) for name, pairs in EXPECTED.items()}
