"""The global working states of a UPF controller, as one table: what may follow what, and why.

The simulator's controller moves by it; the vehicle follows what the controller broadcasts and says
so when a change is none of the table's. Source: Flyfire UPF UAVCAN protocol V1.0, chapter "global
working state"; the document's state diagram is a picture without text, so that the lines marked
"assumed" are read from the parameters' descriptions.
"""

from __future__ import annotations

import enum

from chute_ros.model import ParachuteState


class ControllerEvent(enum.Enum):
    """Event that moves a controller."""

    SELF_TEST_PASSED = "self test passed"
    SELF_TEST_FAILED = "self test failed"
    TAKEOFF = "take-off, by Auto-Takeoff or TYPE_TAKEOFF"
    ARM = "arm, by Auto-Arm or TYPE_ARM"
    DISARM = "disarm, by Auto-Disarm or TYPE_DISARM"
    LAND = "land, by Auto-Land or TYPE_LAND"
    TRIGGER_FIRED = "the trigger reported fired"
    AT_REST = "at rest for 5 s"
    FAULT = "a fault"
    FAULT_CLEARED = "the fault is gone"
    RESTART = "restart"


_S, _E = ParachuteState, ControllerEvent

TRANSITIONS: dict[tuple[ParachuteState, ControllerEvent], ParachuteState] = {
    (_S.NOT_READY, _E.SELF_TEST_PASSED): _S.READY,
    (_S.NOT_READY, _E.SELF_TEST_FAILED): _S.ABNORMAL,
    (_S.READY, _E.TAKEOFF): _S.TAKEOFF,
    (_S.TAKEOFF, _E.ARM): _S.ARMED,
    (_S.ARMED, _E.DISARM): _S.TAKEOFF,
    (_S.TAKEOFF, _E.LAND): _S.READY,
    # TYPE_DEPLOY* and APS; the trigger's answer is what moves the controller.
    (_S.READY, _E.TRIGGER_FIRED): _S.LAUNCHED,  # assumed: TYPE_DEPLOY_FORCE on the ground
    (_S.TAKEOFF, _E.TRIGGER_FIRED): _S.LAUNCHED,
    (_S.ARMED, _E.TRIGGER_FIRED): _S.LAUNCHED,
    (_S.ABNORMAL, _E.TRIGGER_FIRED): _S.LAUNCHED,  # assumed: TYPE_DEPLOY_FORCE despite a fault
    (_S.NOT_READY, _E.TRIGGER_FIRED): _S.LAUNCHED,  # a restart after the trigger has fired
    (_S.LAUNCHED, _E.AT_REST): _S.TOUCHDOWN,
    (_S.READY, _E.FAULT): _S.ABNORMAL,
    (_S.TAKEOFF, _E.FAULT): _S.ABNORMAL,
    (_S.ARMED, _E.FAULT): _S.ABNORMAL,
    (_S.ABNORMAL, _E.FAULT_CLEARED): _S.READY,  # assumed
    **{(state, _E.RESTART): _S.NOT_READY for state in _S if state is not _S.UNKNOWN},
}

#: Requests of VehicleService that the controller makes on entering a state (document: states 1, 2
#: and 7); before it launches it asks for the kill switch (state 5).
ENTRY_REQUESTS: dict[ParachuteState, str] = {
    _S.NOT_READY: "TYPE_FLIGHT_BLOCK",
    _S.READY: "TYPE_FLIGHT_BLOCK_RELEASE",
    _S.ABNORMAL: "TYPE_FLIGHT_BLOCK",
}
LAUNCH_REQUEST = "TYPE_KILLSWITCH"
#: Rest after which a launched controller says touchdown (document: state 6), s.
REST_TIME = 5.0

#: A vehicle must not take off with a controller in these states (document: states 1 and 7).
BLOCKING = frozenset(state for state, name in ENTRY_REQUESTS.items() if name.endswith("_BLOCK"))
#: The parachute is out.
DEPLOYED = frozenset({_S.LAUNCHED, _S.TOUCHDOWN})


def _reached(before: ParachuteState) -> frozenset[ParachuteState]:
    """The states that steps of the table lead to from this one, without a restart on the way: that
    would explain everything."""
    reached, left = {before}, [before]
    while left:
        here = left.pop()
        for (state, event), following in TRANSITIONS.items():
            if state is here and event is not ControllerEvent.RESTART and following not in reached:
                reached.add(following)
                left.append(following)
    return frozenset(reached)


_REACHED = {state: _reached(state) for state in ParachuteState}


def is_known_jump(before: ParachuteState, after: ParachuteState) -> bool:
    """Nothing to wonder about: a restart, one step of the table, or several between two statuses.

    The first state that is received needs no cause.
    """
    if before is ParachuteState.UNKNOWN or after is ParachuteState.NOT_READY:
        return True
    return after in _REACHED[before]
