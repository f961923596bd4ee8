"""The flyfire data types in use, ours or the vendor's: fields and constants are found by name.

What is needed to fire or to answer must be there; what is only told may be absent and then reads
as not known; what is new is kept for diagnostics. Source: Flyfire UPF UAVCAN protocol V1.0, "UPF
custom protocol"; which name comes from where is said in each file of msg_defs/dsdl/flyfire.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.data_types import DataType, DataTypes

PARACHUTE_SERVICE = "flyfire.ParachuteService"
PARACHUTE_STATUS = "flyfire.ParachuteStatus"
VEHICLE_SERVICE = "flyfire.VehicleService"
VEHICLE_STATUS = "flyfire.VehicleStatus"
TRIGGER_SERVICE = "flyfire.TriggerService"
TRIGGER_LAUNCH = "flyfire.TriggerLaunch"
TRIGGER_STATUS = "flyfire.TriggerStatus"

MAGIC = "MAGIC_NUMBER"
_RESULT = "RESULT_"
_ERROR = "ERROR_"
_STATES: list[ParachuteState] = list(ParachuteState)[1:]


@dataclass(frozen=True)
class _Need:
    """Names that one type (or one direction of a service) should have."""

    name: str
    mode: str | None
    fields: tuple[str, ...]
    constants: tuple[str, ...]
    #: Only told: absent reads as not known.
    told: tuple[str, ...] = ()
    #: Known, and left as it is: 0.
    unused: tuple[str, ...] = ()


_RESULTS = ("RESULT_SUCCESS", "RESULT_REJECTED")
_NEEDS = (
    _Need(
        PARACHUTE_SERVICE,
        "request",
        ("magic_number", "type"),
        (
            MAGIC,
            "TYPE_TAKEOFF",
            "TYPE_ARM",
            "TYPE_DISARM",
            "TYPE_LAND",
            "TYPE_DEPLOY",
            "TYPE_DEPLOY_FORCE",
        ),
    ),
    _Need(PARACHUTE_SERVICE, "response", ("result",), _RESULTS),
    _Need(
        PARACHUTE_STATUS,
        None,
        ("state",),
        tuple(f"STATE_{state.name}" for state in _STATES),
        (
            "is_vehicle_connected",
            "is_enable_auto_launch",
            "error_flags",
            "height_of_home",
            "vz",
            "backup_power_voltage",
        ),
    ),
    _Need(
        VEHICLE_SERVICE,
        "request",
        ("magic_number", "type"),
        (MAGIC, "TYPE_KILLSWITCH", "TYPE_FLIGHT_BLOCK", "TYPE_FLIGHT_BLOCK_RELEASE"),
    ),
    _Need(VEHICLE_SERVICE, "response", ("result",), _RESULTS),
    _Need(
        VEHICLE_STATUS, None, (), (), ("state", "is_parachute_connected", "height_of_home", "vz")
    ),
    _Need(TRIGGER_SERVICE, "request", ("magic_number", "type"), (MAGIC, "TYPE_LAUNCH")),
    _Need(TRIGGER_SERVICE, "response", ("result",), _RESULTS),
    _Need(TRIGGER_LAUNCH, None, ("magic_number",), (MAGIC,), unused=("node_id",)),
    _Need(TRIGGER_STATUS, None, (), (), ("state", "is_launched", "error_flags", "supply_voltage")),
)


class Definitions:
    """The flyfire types of one bus.

    ParameterError, with the list, if something needed is absent.
    """

    def __init__(self, types: DataTypes) -> None:
        self.types = types
        missing: list[str] = []
        #: Fields that are only told and absent here, "type.field" each.
        self.absent: tuple[str, ...] = ()
        #: Fields that we know nothing of, "type.field" each.
        self.new: tuple[str, ...] = ()
        for need in _NEEDS:
            where = need.name + (f" ({need.mode})" if need.mode else "")
            kind = types.find(need.name, need.mode)
            if kind is None:
                missing.append(where)
                continue
            missing += [f"{where} field {name}" for name in need.fields if name not in kind.fields]
            missing += [
                f"{where} constant {name}" for name in need.constants if name not in kind.constants
            ]
            self.absent += tuple(f"{need.name}.{n}" for n in need.told if n not in kind.fields)
            known = (*need.fields, *need.told, *need.unused)
            self.new += tuple(f"{need.name}.{n}" for n in kind.fields if n not in known)
        if missing:
            raise ParameterError(
                "the flyfire data types lack names needed to fire or to answer: "
                + ", ".join(missing)
            )
        status = types.message(PARACHUTE_STATUS)
        self._states: dict[int, ParachuteState] = {}
        for one in _STATES:
            number = status.constants[f"STATE_{one.name}"]
            if number in self._states:
                both = f"{self._states[number].name} and {one.name}"
                raise ParameterError(f"{PARACHUTE_STATUS}: the states {both} are both {number}")
            self._states[number] = one
        self._numbers: dict[ParachuteState, int] = {
            state: number for number, state in self._states.items()
        }

    # -- what is said --------------------------------------------------------------------------

    def request(self, service: str, type_name: str) -> dict[str, Any]:
        """The request of a flyfire service: magic number and type, by the type's name."""
        constants = self.types.request(service).constants
        return {"magic_number": constants[MAGIC], "type": constants[type_name]}

    def result(self, service: str, name: str) -> dict[str, Any]:
        """A response with this result; one that the types do not have reads as rejected."""
        constants = self.types.response(service).constants
        return {"result": constants.get(_RESULT + name, constants[_RESULT + "REJECTED"])}

    def present(self, name: str, values: Mapping[str, Any]) -> dict[str, Any]:
        """Those of values that the message type of this name has a field for."""
        fields = self.types.message(name).fields
        return {field: value for field, value in values.items() if field in fields}

    def constant(self, name: str, constant: str) -> Any:
        """A constant of a message type; None: it has none of this name."""
        return self.types.message(name).constants.get(constant)

    def state_number(self, state: ParachuteState) -> int:
        """How ParachuteStatus writes a state."""
        return int(self._numbers[state])

    # -- what was heard --------------------------------------------------------------------------

    def state(self, number: int) -> ParachuteState | None:
        """The state in a ParachuteStatus; None: a number without a name."""
        return self._states.get(number)

    def type_name(self, service: str, values: Mapping[str, Any]) -> str:
        """The name of a request's type, by its number; empty: none, or the magic number is bad."""
        kind = self.types.request(service)
        if values["magic_number"] != kind.constants[MAGIC]:
            return ""
        return _named(kind, "TYPE_", values["type"])

    def magic_is_good(self, service: str, values: Mapping[str, Any]) -> bool:
        """A request carries the magic number of its type."""
        return bool(values["magic_number"] == self.types.request(service).constants[MAGIC])

    def result_name(self, service: str, values: Mapping[str, Any]) -> str:
        """The name of a response's result without RESULT_, or "result N"."""
        number = values["result"]
        name = _named(self.types.response(service), _RESULT, number)
        return name.removeprefix(_RESULT) or f"result {number}"

    def state_name(self, name: str, values: Mapping[str, Any]) -> str:
        """The name of the state in a message without STATE_; empty: not told, or no name."""
        kind = self.types.message(name)
        return _named(kind, "STATE_", values.get("state")).removeprefix("STATE_")

    def faults(self, name: str, values: Mapping[str, Any]) -> list[str]:
        """Every fault that a status message tells, in words.

        Bits of error_flags by the ERROR_* constants, and any other field that is set and calls
        itself an error or a fault: the vendor's own files may have one for each.
        """
        kind: DataType = self.types.message(name)
        flags = values.get("error_flags", 0)
        found = []
        if isinstance(flags, int):
            for bit in (1 << n for n in range(flags.bit_length())):
                if flags & bit:
                    named = _named(kind, _ERROR, bit).removeprefix(_ERROR)
                    found.append(named or f"error bit {bit.bit_length() - 1}")
        for field, value in values.items():
            word = field.lower()
            tells = "error" in word or "fault" in word
            if tells and field != "error_flags" and isinstance(value, (bool, int)) and value:
                found.append(field if value is True else f"{field} {value}")
        return found


def _named(kind: DataType, prefix: str, number: Any) -> str:
    """The constant with this prefix and value; empty: none. number: whatever the types have."""
    return kind.named(prefix).get(number, "") if isinstance(number, (int, float)) else ""
