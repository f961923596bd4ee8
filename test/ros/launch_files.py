"""Launch files run for real, with stand-ins for `launch`, which is not among the wheels."""

import sys
import types
from pathlib import Path
from typing import ClassVar

LAUNCH = Path(__file__).resolve().parents[2] / "launch"


class Recorded:
    """Stands for whatever a launch file imports: remembers what it was made with."""

    made: ClassVar[list] = []
    chosen: ClassVar[dict] = {}

    def __init__(self, *args, **options):
        self.args, self.options = args, options
        Recorded.made.append(self)

    @property
    def name(self):
        """Of an argument."""
        return self.args[0]

    def perform(self, context):
        return Recorded.chosen.get(self.args[0], "")


def loaded(file, monkeypatch):
    """What is in a launch file: run for real, with stand-ins for `launch`."""
    for name in {"launch", "launch.actions", "launch.substitutions", "launch_ros.actions"} | {
        "launch.launch_description_sources",
        "launch_ros",
        "launch_ros.substitutions",
    }:
        module = types.ModuleType(name)
        module.__getattr__ = lambda wanted: type(wanted, (Recorded,), {})
        monkeypatch.setitem(sys.modules, name, module)
    space = {}
    exec(compile(file.read_text(), str(file), "exec"), space)
    return space


class Context:
    """Stands for a LaunchContext as `ros2 launch` makes it: launched has these arguments of the
    user, and may include file, which now begins, in the namespace pushed. declared: the arguments
    of both."""

    def __init__(self, file, arguments, launched=None, pushed=None, declared=()):
        self.launch_configurations = dict(arguments)
        if pushed is not None:
            self.launch_configurations["ros_namespace"] = pushed
        include = types.SimpleNamespace(
            launch_description_source=types.SimpleNamespace(location=str(launched or file)),
            launch_arguments=tuple(arguments.items()),
        )
        began = types.SimpleNamespace(
            describe_sub_entities=lambda: [include],
            get_launch_arguments=lambda: [types.SimpleNamespace(name=one) for one in declared],
        )
        self.inside = {
            "event": types.SimpleNamespace(launch_description=began),
            "current_launch_file_path": str(file),
        }

    def get_locals_as_dict(self):
        return self.inside


def made_by(file, monkeypatch, launched=None, pushed=None, declares=(), **arguments):
    """What a launch file makes of a user's arguments; launched: what includes it, declares these
    of them itself, and has pushed this namespace."""
    space = loaded(file, monkeypatch)
    own = [one.name for one in space["_arguments"]()]
    context = Context(file, arguments, launched, pushed, [*own, *declares])
    Recorded.made.clear()
    space["_look"](context)
    Recorded.made.clear()
    monkeypatch.setattr(Recorded, "chosen", {"port": "14600", **arguments})
    function = space.get("_nodes") or space["_vehicle"]
    function(context=context)
    return list(Recorded.made)
