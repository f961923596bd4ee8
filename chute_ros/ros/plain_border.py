"""The border between a node and all others: texts that pass it are plain, both ways.

Names of links and devices, reasons, faults, texts of an autopilot or a parameter's name come from
whoever is on the network or the wire. Here, once, control characters and line ends are written
out, so that none of them reaches a log, a terminal or diagnostics, whatever becomes of the text.
"""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable
from typing import Any

from rclpy.impl import rcutils_logger
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.publisher import Publisher

from chute_ros.plain_text import plain

#: ROS's own talk about parameters: a value that is read must be the one that was set.
_EXEMPT = ("rcl_interfaces", "type_description_interfaces")


def with_plain_texts(message: Any) -> Any:
    """message itself, each of its texts plain. It may be a request or a response as well."""
    for name, is_list, is_text in _texts_of(type(message)):  # type: ignore[arg-type]
        value = getattr(message, name)
        if not is_text:
            for one in value if is_list else (value,):
                with_plain_texts(one)
        elif is_list:
            if not all(map(str.isprintable, value)):
                setattr(message, name, [plain(one) for one in value])
        elif not value.isprintable():
            setattr(message, name, plain(value))
    return message


@functools.cache
def _texts_of(kind: type) -> tuple[tuple[str, bool, bool], ...]:
    """The fields of a type with a text anywhere inside: (name, it is a list, it is a text)."""
    found = []
    for name, declared in kind.get_fields_and_field_types().items():  # type: ignore[attr-defined]
        element = declared.removeprefix("sequence<").partition("[")[0].partition(">")[0]
        element = element.partition(",")[0]
        is_list = declared.startswith("sequence<") or declared.endswith("]")
        if element.partition("<")[0] in ("string", "wstring"):
            found.append((name, is_list, True))
        elif "/" in element and _texts_of(_type_of(element)):
            found.append((name, is_list, False))
    return tuple(found)


def _type_of(name: str) -> type:
    package, _, kind = name.partition("/")
    module = __import__(f"{package}.msg", fromlist=[kind])
    found: type = getattr(module, kind)
    return found


def is_exempt(kind: type) -> bool:
    """Of messages and services of this type nothing is changed."""
    return kind.__module__.startswith(_EXEMPT)


class PlainPublisher(Publisher):
    """Publishes messages with plain texts."""

    def publish(self, message: Any) -> None:
        """Publish a message, or the bytes of one as they are."""
        is_message = not isinstance(message, bytes) and not is_exempt(type(message))
        super().publish(with_plain_texts(message) if is_message else message)


def hearing_plainly(callback: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The callback of a subscription, which gets messages with plain texts."""

    def heard(message: Any) -> Any:
        return callback(with_plain_texts(message))

    return heard


def serving_plainly(callback: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """The callback of a service, which gets and gives plain texts."""
    if inspect.iscoroutinefunction(callback):

        async def served_later(request: Any, response: Any) -> Any:
            return with_plain_texts(await callback(with_plain_texts(request), response))

        return served_later

    def served(request: Any, response: Any) -> Any:
        return with_plain_texts(callback(with_plain_texts(request), response))

    return served


class PlainLogger(RcutilsLogger):
    """A logger whose lines are each one line, plain."""

    def log(self, message: Any, severity: Any, **options: Any) -> bool:
        """As the logger that it is made of."""
        logged: bool = super().log(plain(message), severity, **options)
        return logged

    def get_child(self, name: str) -> PlainLogger:
        """One whose lines are told apart by this name."""
        made = super().get_child(name)
        child = PlainLogger(made.name)
        # It goes with whoever has it.
        child.logger_sublogger_namepair = made.logger_sublogger_namepair
        made.logger_sublogger_namepair = None
        return child


# ROS tells callers apart by their place in the source, which is never here.
rcutils_logger._internal_callers.append(os.path.realpath(__file__))
