"""Type definitions in a file of messages, so that other programs can read it.

The definitions are those that rosidl installs with each package of messages: read, not repeated.
"""

from __future__ import annotations

import functools
import importlib
import json
import re
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory

#: Between a definition and those that it names, as rosbag2 writes it.
_LINE = "=" * 80
#: The type of messages in a field's type: "std_msgs/Header", "sequence<chute_msgs/RuleState, 5>".
_NAMED = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*")


def type_name(kind: Any) -> str:
    """As ROS names the class of a message: "chute_msgs/msg/SafetyState"."""
    return f"{_package(kind)}/msg/{kind.__name__}"


@functools.cache
def definition(kind: Any) -> str:
    """The .msg file of a class of messages, and after it those of all that it is made of."""
    texts = [_installed(kind, "msg")]
    for name, part in _parts(kind).items():
        texts.append(f"{_LINE}\nMSG: {name}\n{_installed(part, 'msg')}")
    return "\n".join(texts)


@functools.cache
def type_hash(kind: Any) -> str:
    """Changes with the fields of a type and of all that it is made of; not with their comments."""
    hashes = json.loads(_installed(kind, "json"))["type_hashes"]
    name = type_name(kind)
    return str(next(one["hash_string"] for one in hashes if one["type_name"] == name))


def _parts(kind: Any) -> dict[str, Any]:
    """Every type that a type is made of, each once: name in a definition -> class."""
    found: dict[str, Any] = {}
    waiting = [kind]
    while waiting:
        for field in waiting.pop().get_fields_and_field_types().values():
            for name in _NAMED.findall(field):
                if name not in found:
                    package, _, short = name.partition("/")
                    found[name] = getattr(importlib.import_module(f"{package}.msg"), short)
                    waiting.append(found[name])
    return found


def _installed(kind: Any, suffix: str) -> str:
    share = Path(get_package_share_directory(_package(kind)))
    return (share / "msg" / f"{kind.__name__}.{suffix}").read_text(encoding="utf-8")


def _package(kind: Any) -> str:
    return str(kind.__module__.partition(".")[0])
