"""The numbers of the shared types are those of the wire they come from."""

import math

import pytest

from chute_ros import model
from chute_ros.protocol.mavlink.dialect import dialect

PREFIXES = {
    "PARACHUTE_ERROR_FLAGS_": model.ErrorFlags,
    "PARACHUTE_SAFETY_FLAGS_": model.SafetyFlags,
    "PARACHUTE_TRIGGER_FLAGS_": model.TriggerFlags,
    "PARACHUTE_DEPLOYMENT_TRIGGER_": model.DeploymentTrigger,
    "MAV_LANDED_STATE_": model.LandedState,
}
LANDED_NAMES = {"UNDEFINED": "UNKNOWN", "TAKEOFF": "TAKING_OFF"}


def of_dialect(prefix: str) -> dict[str, int]:
    entries = dialect.enums[prefix[:-1]].values()
    names = {e.name.removeprefix(prefix): v for v, e in dialect.enums[prefix[:-1]].items()}
    assert len(entries) == len(names)
    names.pop("ENUM_END", None)
    return names


@pytest.mark.parametrize("prefix", PREFIXES)
def test_enumeration_is_the_dialects(prefix):
    ours = {member.name: int(member) for member in PREFIXES[prefix].__members__.values()}
    wire = of_dialect(prefix)
    if prefix == "MAV_LANDED_STATE_":
        wire = {LANDED_NAMES.get(name, name): value for name, value in wire.items()}
    else:
        wire = {name: value for name, value in wire.items() if not name.endswith("ENUM_END")}
    assert ours == wire


def test_trigger_sources_are_all_but_the_two_that_follow_the_height():
    automatic = model.TriggerFlags.ATS_AUTO_ARM | model.TriggerFlags.ATS_AUTO_DISARM
    assert int(model.TRIGGER_SOURCES) | int(automatic) == 0xFF
    assert not model.TRIGGER_SOURCES & automatic


@pytest.mark.parametrize(
    ("flags", "names"),
    [
        (model.SafetyFlags(0), []),
        (model.SafetyFlags(5), ["GROUND_CLEARED", "GEOFENCE_MISSION_SET"]),
        (model.SafetyFlags(0x80), ["bit 7"]),
        (
            model.ErrorFlags(1 << 20 | 1 << 21 | 1),
            ["BAROMETER_ERROR", "IMU_CALIBRATION_ERROR", "bit 21"],
        ),
        (model.ErrorFlags(1 << 31), ["bit 31"]),
        (model.TriggerFlags(0x100), ["bit 8"]),
    ],
)
def test_every_set_bit_has_a_name(flags, names):
    assert model.flag_names(flags) == names


@pytest.mark.parametrize("kind", [model.ErrorFlags, model.SafetyFlags, model.TriggerFlags])
def test_unknown_bits_are_kept(kind):
    assert int(kind(0xFFFFFFFF)) == 0xFFFFFFFF
    assert int(kind(1) | kind(1 << 30)) == 1 | 1 << 30


HEALTHY = {model.ParachuteState.READY, model.ParachuteState.TAKEOFF, model.ParachuteState.ARMED}


@pytest.mark.parametrize("state", list(model.ParachuteState))
@pytest.mark.parametrize("link", list(model.LinkState))
def test_healthy_is_heard_in_time_and_still_able_to_release(link, state):
    status = model.ParachuteStatus("1/161", link, state)
    drogue_out = state is model.ParachuteState.LAUNCHED
    assert status.healthy == (link is model.LinkState.OK and (state in HEALTHY or drogue_out))
    released = model.ParachuteStatus("1/161", link, state, deployed=True)
    assert released.healthy == (link is model.LinkState.OK and state in HEALTHY)


def test_reading_never_received_has_no_age():
    assert math.isnan(model.Reading().age(10.0))
    assert model.Reading(1.0, 7.5).age(10.0) == 2.5


def test_a_later_action_wins():
    actions = [model.Action[name] for name in ("NONE", "FLIGHT_BLOCK", "KILL", "DEPLOY")]
    assert actions == sorted(actions)


def test_each_kind_of_vehicle_is_of_the_dialects_types():
    names = {number: entry.name for number, entry in dialect.enums["MAV_TYPE"].items()}
    hover = ("ROTOR", "COAXIAL", "HELICOPTER", "TRICOPTER", "VTOL")
    for number, name in names.items():
        kinds = model.airframes_of(number)
        assert (model.Airframe.MULTIROTOR in kinds) == any(word in name for word in hover), name
        wing = "WING" in name or "VTOL" in name
        assert (model.Airframe.FIXED_WING in kinds) == wing, name
        assert (model.Airframe.ROCKET in kinds) == name.endswith("ROCKET"), name
