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


def made_by(file, monkeypatch, **arguments):
    """What the function of a launch file makes."""
    space = loaded(file, monkeypatch)
    Recorded.made.clear()
    monkeypatch.setattr(Recorded, "chosen", {"port": "14600", **arguments})
    function = space.get("_nodes") or space["_vehicle"]
    function(context=None)
    return list(Recorded.made)
