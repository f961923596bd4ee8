"""The folder of the data types: ours, the vendor's, and what a person may get wrong."""

from pathlib import Path

import pytest

from chute_ros.errors import NotBuiltError, ParameterError
from chute_ros.transport.data_types import load_data_types

OURS = Path(__file__).resolve().parents[2] / "msg_defs" / "dsdl" / "flyfire"
STATUS = "flyfire.ParachuteStatus"


def folder(root, name="flyfire", **files):
    """A folder with these types; the parts of a file's name are joined by underscores."""
    made = root / name
    made.mkdir(parents=True)
    for file, text in files.items():
        made.joinpath(file.lstrip("_").replace("_", ".") + ".uavcan").write_text(text)
    return made


def load(path):
    return load_data_types(str(path), "parameter dsdl_path")


def refused(path):
    """Why; the text names the parameter."""
    with pytest.raises(ParameterError, match=r"^parameter dsdl_path is '") as caught:
        load(path)
    return str(caught.value)


def test_the_shipped_ones_and_the_standard_ones():
    types = load_data_types("", "parameter dsdl_path")
    assert types.message(STATUS).id == 1663
    assert types.message("uavcan.protocol.NodeStatus").id == 341
    # Of other vendors' types that come with the library nothing is spoken.
    assert types.find("ardupilot.indication.SafetyState", None) is None


def test_a_folder_by_its_name():
    assert load(OURS).message(STATUS).id == 1663


def test_a_folder_that_holds_the_folder():
    assert load(OURS.parent).message(STATUS).id == 1663


def test_a_folder_with_a_detour_or_at_home(tmp_path, monkeypatch):
    made = folder(tmp_path, _1663_ParachuteStatus="uint8 state\n")
    assert load(made / ".." / "flyfire").message(STATUS).fields == ("state",)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert load("~/flyfire").message(STATUS).fields == ("state",)
    monkeypatch.chdir(made)
    assert load(".").message(STATUS).fields == ("state",)


def test_a_link_counts_by_its_own_name(tmp_path):
    made = folder(tmp_path, "upf-v3.2", _1663_ParachuteStatus="uint8 state\n")
    link = tmp_path / "flyfire"
    link.symlink_to(made)
    assert load(link).message(STATUS).fields == ("state",)
    other = tmp_path / "other"
    other.symlink_to(OURS)
    assert "must be flyfire" in refused(other)


def test_types_of_the_vendor_may_be_made_of_standard_ones(tmp_path):
    made = folder(tmp_path, _20000_Log="uavcan.Timestamp when\nuint8 what\n")
    assert load(made).message("flyfire.Log").fields == ("when", "what")


def test_no_such_folder(tmp_path):
    assert "there is no such folder" in refused(tmp_path / "flyfire")
    file = tmp_path / "file"
    file.write_text("")
    assert "there is no such folder" in refused(file)


def test_a_folder_of_another_name(tmp_path):
    assert "must be flyfire, or it must hold a folder of this name" in refused(tmp_path)


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        pytest.param("_20000_A", "uint1 flag\n", "use bool instead", id="grammar"),
        pytest.param("_20000_A", "Nothing a\n", "not found", id="unknown_type"),
        pytest.param("_x_A", "bool a\n", "Invalid default data type ID", id="id_that_is_none"),
        pytest.param("_341_A", "bool a\n", "Redefinition of data type ID", id="standard_id"),
    ],
)
def test_a_file_that_cannot_be_read_is_named(tmp_path, name, text, why):
    said = refused(folder(tmp_path, **{name: text}))
    assert why in said
    assert name.lstrip("_").replace("_", ".") in said


def test_two_versions_of_one_type_are_refused(tmp_path):
    made = folder(tmp_path, _1663_A_2_0="uint8 a\n", _1663_A_3_0="uint16 a\n")
    assert "Redefinition of data type ID" in refused(made)


def test_not_built(monkeypatch, tmp_path):
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    with pytest.raises(NotBuiltError, match="build chute_msgs"):
        load_data_types("", "parameter dsdl_path")
