"""Settings: each parameter is written once, as a field of a frozen dataclass.

parameter() makes a field with its default, meaning, range and unit; nested() makes a field that
holds other settings. The checks at construction, the ROS descriptors, the files in config/ and
docs/reference/parameters.md come from these fields.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import reprlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from chute_ros.errors import ParameterError

Value = bool | int | float | str | list[str]
T = TypeVar("T")
SettingsT = TypeVar("SettingsT", bound="Settings")
#: Attribute names that lead from settings to a field of them or of what is nested in them.
Path = tuple[str, ...]


@dataclass(frozen=True)
class Parameter:
    """One parameter, as ROS has it: an enumeration is one of its texts, flags are a mask.

    minimum and maximum are inclusive; a number has both. changeable: while the node runs.
    """

    name: str
    default: Value
    meaning: str
    minimum: float | None = None
    maximum: float | None = None
    unit: str = ""
    choices: tuple[str, ...] = ()
    changeable: bool = False

    def allowed(self) -> str:
        """Allowed values, in words."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.minimum is None or self.maximum is None:
            kinds = {bool: "true or false", str: "text", list: "a list of texts"}
            return kinds[type(self.default)]
        if isinstance(self.default, int):
            text = f"a whole number from {int(self.minimum)} to {int(self.maximum)}"
        else:
            text = f"a number (1.0, not 1) from {self.minimum:g} to {self.maximum:g}"
        return f"{text} {self.unit}".rstrip()

    @property
    def takes_switch(self) -> bool:
        """True and false are among its choices: YAML reads them as a switch."""
        return {"true", "false"} <= set(self.choices)

    def takes(self, value: Any) -> bool:
        """The value is of the parameter's type, and in its range or among its choices."""
        kind: Any = type(self.default)
        if type(value) is not kind:
            return False
        if isinstance(value, list):
            return all(isinstance(one, str) for one in value)
        if self.minimum is None or self.maximum is None:
            return not self.choices or value in self.choices
        return bool(self.minimum <= value <= self.maximum)

    def refusal(self, value: object, of: str = "") -> ParameterError:
        """The error for a value that is not allowed. of: " of NODE"."""
        return ParameterError(
            f"parameter {self.name}{of} is {reprlib.repr(value)}: "
            f"need {self.allowed()} ({self.meaning})"
        )


class ContradictionError(ParameterError):
    """Values of fields that contradict each other. names: of their parameters."""

    def __init__(self, values: Mapping[str, object], names: Mapping[str, str], why: str) -> None:
        self.values, self.why = values, why
        # A text in quotes: it may be empty.
        texts = [repr(one) if isinstance(one, str) else one for one in values.values()]
        told = [f"{names[field]} is {text}" for field, text in zip(values, texts, strict=True)]
        super().__init__(f"parameter {' and '.join(told)}: {why}")


class Settings:
    """Base of frozen dataclasses whose fields are parameters. ParameterError at construction if a
    value is not allowed. A subclass adds to __post_init__ what two fields demand of each other."""

    def __post_init__(self) -> None:
        for path, one in _places(type(self)):
            value = _as_ros(functools.reduce(getattr, path, self))
            # Python's whole numbers are floats as well; ROS's are not.
            whole = type(value) is int and isinstance(one.default, float)
            if not one.takes(float(value) if whole else value):
                raise one.refusal(value)

    def contradiction(self, why: str, *fields: str) -> ContradictionError:
        """The error for these fields, which are both in their ranges. why: and what to do."""
        values = {field: getattr(self, field) for field in fields}
        return ContradictionError(values, _names(_places(type(self))), why)


def parameter(
    default: T,
    meaning: str,
    minimum: float | None = None,
    maximum: float | None = None,
    unit: str = "",
    *,
    name: str = "",
    changeable: bool = False,
) -> T:
    """A field of Settings that is a parameter. name: if it is not the field's."""
    choices: tuple[str, ...] = ()
    if isinstance(default, enum.Enum) and not isinstance(default, enum.Flag):
        choices = tuple(_as_ros(one) for one in type(default))
    one = Parameter(name, _as_ros(default), meaning, minimum, maximum, unit, choices, changeable)
    field: T = dataclasses.field(default=default, metadata={Parameter: one})
    return field


def nested(default: SettingsT, of: str = "", **changes: Mapping[str, Any]) -> SettingsT:
    """A field of Settings that holds others, with these defaults. of: stands before the name of
    each parameter, and for "device" in its meaning. changes: of a field's Parameter here."""
    field: SettingsT = dataclasses.field(default=default, metadata={Settings: (of, changes)})
    return field


def parameters_of(kind: type[Settings]) -> tuple[Parameter, ...]:
    """All parameters of these settings, nested ones included, in the order of the fields."""
    return tuple(one for _, one in _places(kind))


def settings_from(kind: type[SettingsT], values: Mapping[str, Any]) -> SettingsT:
    """Settings from the values of parameters by name; a parameter without one has its default."""
    return _changed(kind(), _places(kind), values)


def _changed(
    before: SettingsT, places: Iterable[tuple[Path, Parameter]], values: Mapping[str, Any]
) -> SettingsT:
    changes: dict[str, Any] = {}
    parts: dict[str, list[tuple[Path, Parameter]]] = {}
    for (field, *rest), one in places:
        if rest:
            parts.setdefault(field, []).append((tuple(rest), one))
        elif one.name in values:
            if not one.takes(values[one.name]):
                raise one.refusal(values[one.name])
            changes[field] = _from_ros(values[one.name], getattr(before, field))
    for field, part in parts.items():
        try:
            changes[field] = _changed(getattr(before, field), part, values)
        except ContradictionError as error:
            told = ContradictionError(error.values, _names(part), error.why)
            raise ParameterError(str(told)) from None
    return replace(before, **changes)  # type: ignore[type-var]


def _places_of(kind: Any) -> tuple[tuple[Path, Parameter], ...]:
    """Each parameter with the way to its field."""
    found: list[tuple[Path, Parameter]] = []
    for field in dataclasses.fields(kind):
        if Parameter in field.metadata:
            one = field.metadata[Parameter]
            found.append(((field.name,), replace(one, name=one.name or field.name)))
        if Settings in field.metadata:
            of, changes = field.metadata[Settings]
            for path, one in _places(type(field.default)):
                told: dict[str, Any] = {
                    "default": _as_ros(functools.reduce(getattr, path, field.default)),
                    **changes.get(path[0], {}),
                }
                if of:
                    told.setdefault("name", f"{of}_{one.name}")
                    told.setdefault("meaning", one.meaning.replace("device", of))
                found.append(((field.name, *path), replace(one, **told)))
    return tuple(found)


# So written, as mypy takes no class for hashable.
_places: Callable[[Any], tuple[tuple[Path, Parameter], ...]] = functools.cache(_places_of)


def _names(places: Iterable[tuple[Path, Parameter]]) -> dict[str, str]:
    return {path[0]: one.name for path, one in places if len(path) == 1}


def _as_ros(value: Any) -> Any:
    if isinstance(value, enum.Flag):
        return value.value
    if isinstance(value, enum.Enum):
        return value.value if isinstance(value.value, str) else value.name
    if isinstance(value, tuple):
        return list(value)
    return value


def _from_ros(value: Any, like: Any) -> Any:
    """What _as_ros gave this value for; like: of the type that is wanted."""
    if isinstance(like, enum.Flag):
        return type(like)(value)
    if isinstance(like, enum.Enum):
        return next(one for one in type(like) if _as_ros(one) == value)
    return tuple(value) if isinstance(like, tuple) else value
