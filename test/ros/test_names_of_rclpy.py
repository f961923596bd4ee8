"""No node of ours takes a name that rclpy's Node has for itself.

An attribute that covers one of rclpy's breaks it where nobody looks: rclpy and the executor read
`node.services`, `node._clock` and the like.
"""

import ast
import inspect
import textwrap
from importlib import import_module
from pathlib import Path

import pytest
from rclpy.node import Node

ROOT = Path(__file__).parents[2]
# What our nodes put around rclpy's own: they call it (the logger: what it writes is plain).
MEANT_TO_BE_COVERED = {
    "_logger",
    "create_publisher",
    "create_service",
    "create_subscription",
    "destroy_node",
}
SPECIAL = ("__",)


def modules_with_nodes():
    for path in sorted((ROOT / "chute_ros").rglob("*.py")):
        if "Node" in path.read_text():
            yield ".".join(path.relative_to(ROOT).with_suffix("").parts)


def node_classes() -> list[type]:
    found = set()
    for name in modules_with_nodes():
        if name.endswith("__main__"):
            continue
        for _, kind in inspect.getmembers(import_module(name), inspect.isclass):
            if issubclass(kind, Node) and kind.__module__.startswith("chute_ros."):
                found.add(kind)
    return sorted(found, key=lambda kind: kind.__qualname__)


def names_set_on_self(kind: type) -> set[str]:
    """The attributes that a class's own code gives to its objects."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind)))
    return {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
    }


@pytest.fixture
def names_of_rclpy(ros, namespace) -> set[str]:
    node = Node("plain", namespace=namespace)
    try:
        return {name for name in dir(node) if not name.startswith(SPECIAL)}
    finally:
        node.destroy_node()


def test_no_node_covers_a_name_of_rclpy(names_of_rclpy):
    classes = node_classes()
    assert len(classes) >= 8
    for kind in classes:
        own = set(vars(kind)) | names_set_on_self(kind)
        covered = (own & names_of_rclpy) - MEANT_TO_BE_COVERED
        assert not covered, (kind, sorted(covered))
