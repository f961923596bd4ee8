"""A copy with changes is what dataclasses.replace makes of it, on CPython and as PyPy makes it."""

import dataclasses
import importlib.util
import platform

import pytest

from chute_ros.supervisor import quick_replace
from chute_ros.supervisor.counter import RuleEvidence
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.state import Own, State


@pytest.fixture(params=["CPython", "PyPy"])
def replace(request, monkeypatch):
    """The function as a module makes it that is read there."""
    monkeypatch.setattr(platform, "python_implementation", lambda: request.param)
    found = importlib.util.find_spec(quick_replace.__name__)
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    assert hasattr(module, "_copier") == (request.param == "PyPy")
    return module.replace


@pytest.mark.parametrize(
    ("one", "changes"),
    [
        (State(8, 1.0, own=Own(leading=True)), {}),
        (State(8, 1.0, own=Own(leading=True)), {"stage": Stage.IN_FLIGHT, "next_id": 2}),
        (RuleEvidence(level=0.5, shown=(1.0, 2.0)), {"level": 0.25, "kept": (0.0, 1.5)}),
    ],
)
def test_it_is_the_copy_that_the_library_makes(replace, one, changes):
    before = {field.name: getattr(one, field.name) for field in dataclasses.fields(one)}
    copy = replace(one, **changes)
    wanted = dataclasses.replace(one, **changes)
    assert type(copy) is type(one)
    assert list(vars(copy).items()) == list(vars(wanted).items())
    assert all(getattr(one, name) is value for name, value in before.items())
    assert copy is not one
