"""What /diagnostics say of a MAVLink parachute."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from chute_ros.links.mavlink.diagnostics import _parachute, details_of
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.model import LinkState, ParachuteState, ParachuteStatus
from chute_ros.protocol.liveness import Liveness, LivenessLimits
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameEncoder


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"state": ParachuteState.READY}, "READY"),
        ({"state": ParachuteState.TOUCHDOWN, "deployed": True}, "released; TOUCHDOWN"),
        ({"deployed": True, "faults": ("LOW_POWER", "x")}, "released; LOW_POWER; x"),
    ],
)
def test_a_released_parachute_is_told_before_its_state(fields, text):
    status = ParachuteStatus("1/161", LinkState.OK, **({"state": ParachuteState.UNKNOWN} | fields))
    tracker = SimpleNamespace(
        status=lambda now: status,
        liveness=Liveness(LivenessLimits()),
        status_interval=0.1,
        deaf=lambda now: "",
    )
    name, _, told, _, device = _parachute(cast(Any, tracker), 5.0)
    assert (name, told, device) == ("parachute 1/161", text, "1/161")


def test_an_acknowledgement_that_nobody_waits_for_is_counted():
    """Of a parachute that was asked for nothing, to the node (system 1, component 191)."""
    link = MavlinkLink(MavlinkConfig())
    ack = dialect.MAVLink_command_ack_message(
        dialect.MAV_CMD_DO_PARACHUTE, 0, target_system=1, target_component=191
    )
    link.receive(FrameEncoder(1, 161).encode(ack, 0.0), 0.0)
    assert details_of(link, 0.0).useless["unexpected acknowledgements"] == 1
