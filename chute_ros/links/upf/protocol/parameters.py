"""The parameters of a UPF device, by the names of the document.

Source: Flyfire UPF UAVCAN protocol V1.0, chapter "parameters", which lists twelve names. Types and
ranges are not in the document: they are read from the meanings, and what the device itself says
(GetSet: minimum, maximum, the kind of its value) wins.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chute_ros.errors import ParameterError

STATIC_NODE_ID = "Static Node ID"
AUTO_SAVE = "Enable Auto-Save"
CANBUS_RESISTER = "Enable CANBUS resister"
ENABLE_PARACHUTE = "Enable Parachute"
ENABLE_APS = "Enable APS"
AUTO_TAKEOFF = "Enable Auto-Takeoff"
AUTO_ARM = "Enable Auto-Arm"
AUTO_DISARM = "Enable Auto-Disarm"
AUTO_LAND = "Enable Auto-Land"
LIGHT = "Enable Light"
NODE_STATUS_INTERVAL = "Node Status Interval(ms)"
PARACHUTE_STATUS_INTERVAL = "Parachute Status Interval(ms)"

Value = bool | int | float | str


@dataclass(frozen=True)
class DocumentedParameter:
    """One parameter. default: as delivered where the document says so, else None."""

    name: str
    meaning: str
    kind: type
    default: Value | None = None
    minimum: int = 0
    maximum: int = 1


PARAMETERS: tuple[DocumentedParameter, ...] = (
    DocumentedParameter(
        STATIC_NODE_ID, "node id; 0: asks for one at each start (DNA)", int, None, 0, 125
    ),
    DocumentedParameter(
        AUTO_SAVE, "keep changes at once; off: only ExecuteOpcode save keeps them", bool
    ),
    DocumentedParameter(CANBUS_RESISTER, "120 ohm resistor of the bus", bool, False),
    DocumentedParameter(
        ENABLE_PARACHUTE, "off: never deploys, not even by TYPE_DEPLOY_FORCE", bool
    ),
    DocumentedParameter(ENABLE_APS, "off: never deploys by itself", bool),
    DocumentedParameter(AUTO_TAKEOFF, "off: stays READY until TYPE_TAKEOFF", bool),
    DocumentedParameter(AUTO_ARM, "off: is not ARMED until TYPE_ARM", bool),
    DocumentedParameter(AUTO_DISARM, "off: stays ARMED until TYPE_DISARM", bool),
    DocumentedParameter(AUTO_LAND, "off: does not return to READY until TYPE_LAND", bool),
    DocumentedParameter(LIGHT, "status light", bool),
    DocumentedParameter(NODE_STATUS_INTERVAL, "between two NodeStatus, ms", int, None, 2, 1000),
    DocumentedParameter(
        PARACHUTE_STATUS_INTERVAL, "between two ParachuteStatus, ms", int, None, 2, 60000
    ),
)
BY_NAME: Mapping[str, DocumentedParameter] = {one.name: one for one in PARAMETERS}

#: A request of ParachuteService is rejected while its automatic counterpart is enabled (document,
#: below the state diagram).
EXCLUDES: Mapping[str, str] = {
    "TYPE_TAKEOFF": AUTO_TAKEOFF,
    "TYPE_ARM": AUTO_ARM,
    "TYPE_DISARM": AUTO_DISARM,
    "TYPE_LAND": AUTO_LAND,
}
#: While all of these are off nothing moves a controller on but requests.
AUTOMATIC = tuple(EXCLUDES.values())
#: Switching one of these off takes protection away.
PROTECTION = (ENABLE_PARACHUTE, ENABLE_APS)

_TRUE, _FALSE = ("true", "on", "yes", "1"), ("false", "off", "no", "0")
#: What uavcan.protocol.param.Value can hold.
_LARGEST_INTEGER, _LARGEST_REAL, MOST_TEXT_BYTES = 2**63 - 1, 3.4028234e38, 128
#: Of a name (uavcan.protocol.param.GetSet).
MOST_NAME_BYTES = 92


def switches_on(text: str) -> bool:
    """text surely switches something on; whatever else it is may switch it off."""
    return text.strip().lower() in _TRUE


def parse(text: str, kind: str, name: str) -> Value:
    """The value in text for a parameter of this kind of GetSet ("integer", "real", "boolean",
    "string"); ParameterError with what is needed if it is none."""
    if kind == "string":
        if len(text.encode("utf-8", "replace")) > MOST_TEXT_BYTES:
            raise ParameterError(
                f"{name} cannot be {text!r}: need at most {MOST_TEXT_BYTES} bytes"
            )
        return text
    word = text.strip().lower()
    documented = BY_NAME.get(name)
    if kind == "boolean" or (documented is not None and documented.kind is bool):
        if word not in _TRUE + _FALSE:
            raise ParameterError(f"{name} cannot be {text!r}: need true or false")
        on = word in _TRUE
        # A device may keep a switch as a number.
        return on if kind == "boolean" else int(on) if kind == "integer" else float(on)
    number: int | float
    try:
        number, largest = (
            (int(word, 0), _LARGEST_INTEGER) if kind == "integer" else (float(word), _LARGEST_REAL)
        )
    except ValueError:
        raise ParameterError(f"{name} cannot be {text!r}: need a number ({kind})") from None
    if not -largest <= number <= largest:
        raise ParameterError(f"{name} cannot be {text!r}: no parameter can hold it")
    return number


def value_of(union: Mapping[str, Any]) -> Value | None:
    """The value in a uavcan.protocol.param.Value or NumericValue; None: empty."""
    if "integer_value" in union:
        return int(union["integer_value"])
    if "real_value" in union:
        return float(union["real_value"])
    if "boolean_value" in union:
        return bool(union["boolean_value"])
    if "string_value" in union:
        return bytes(union["string_value"]).decode("utf-8", "replace")
    return None


def union_of(value: Value) -> dict[str, Any]:
    """value as a uavcan.protocol.param.Value."""
    if isinstance(value, bool):
        return {"boolean_value": int(value)}
    if isinstance(value, int):
        return {"integer_value": value}
    if isinstance(value, float):
        return {"real_value": value}
    return {"string_value": value.encode("utf-8", "replace")}


def kind_of(union: Mapping[str, Any]) -> str:
    """ "integer", "real", "boolean", "string", or empty."""
    name = next(iter(union), "empty")
    return "" if name == "empty" else name.removesuffix("_value")


def words(value: Value | None) -> str:
    """A value as it is written in a request or an answer; empty: none."""
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def as_switch(value: Value | None) -> bool | None:
    """A switch's value, which a device may send as a number as well; None: not known."""
    if isinstance(value, (bool, int, float)):
        return bool(value)
    return None
