"""Every name of the dialect that the code uses is one that it has."""

import ast
from pathlib import Path

import chute_ros
from chute_ros.protocol.mavlink import dialect

HERE = dialect.__name__


def names_of(module):
    """What this source takes of the dialect."""
    nodes = list(ast.walk(ast.parse(module)))
    given = [one for one in nodes if isinstance(one, ast.ImportFrom) and one.module == HERE]
    called = {
        alias.asname or alias.name
        for one in given
        for alias in one.names
        if alias.name == "dialect"
    }
    return {
        node.attr
        for node in nodes
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in called
    }


def test_no_name_is_one_that_the_dialect_does_not_have():
    """It is generated, so that no checker of types knows its names."""
    files = Path(chute_ros.__file__).parent.rglob("*.py")
    names = {(one, name) for one in files for name in names_of(one.read_text())}
    assert len(names) > 100
    assert not [(one, name) for one, name in names if not hasattr(dialect.dialect, name)]


def test_a_name_that_is_missing_would_be_found():
    source = f"from {HERE} import dialect as d\nd.MAV_TYPE_ROCKET\nd.MAV_TYPE_OF_NOBODY"
    assert names_of(source) == {"MAV_TYPE_ROCKET", "MAV_TYPE_OF_NOBODY"}
