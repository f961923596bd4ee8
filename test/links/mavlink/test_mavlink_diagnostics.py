"""What /diagnostics say of a MAVLink parachute."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from chute_ros.links.mavlink.diagnostics import _parachute
from chute_ros.model import LinkState, ParachuteState, ParachuteStatus
from chute_ros.protocol.liveness import Liveness, LivenessLimits


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"state": ParachuteState.READY}, "READY"),
        ({"state": ParachuteState.TOUCHDOWN, "deployed": True}, "released; TOUCHDOWN"),
        ({"deployed": True, "faults": ("LOW_POWER", "x")}, "released; LOW_POWER; x"),
    ],
)
def test_a_released_parachute_is_told_before_its_state(fields: dict[str, Any], text: str) -> None:
    status = ParachuteStatus("1/161", LinkState.OK, **({"state": ParachuteState.UNKNOWN} | fields))
    tracker = SimpleNamespace(
        status=lambda now: status,
        liveness=Liveness(LivenessLimits()),
        status_interval=0.1,
        deaf=lambda now: "",
    )
    name, _, told, _, device = _parachute(cast(Any, tracker), 5.0)
    assert (name, told, device) == ("parachute 1/161", text, "1/161")
