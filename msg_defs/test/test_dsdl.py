"""The DSDL files, each number written out as the vendor's document gives it, or named as assumed.

[document] is Flyfire UPF UAVCAN protocol V1.0; see the head of 163.ParachuteService.
"""

import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "dsdl" / "flyfire"

# Document, "UPF's own protocols", line by line: data type id, name; all are version 3.0.
DOCUMENT = {
    163: "ParachuteService",
    1663: "ParachuteStatus",
    164: "VehicleService",
    1664: "VehicleStatus",
    165: "TriggerService",
    1665: "TriggerLaunch",
    1666: "TriggerStatus",
}
# Document, "global state", line by line.
STATES = {
    "STATE_NOT_READY": 1,
    "STATE_READY": 2,
    "STATE_TAKEOFF": 3,
    "STATE_ARMED": 4,
    "STATE_LAUNCHED": 5,
    "STATE_TOUCHDOWN": 6,
    "STATE_ABNORMAL": 7,
}
# Named anywhere in the document, without a number.
NAMED = {
    "ParachuteService": ["TAKEOFF", "ARM", "DISARM", "LAND", "DEPLOY", "DEPLOY_FORCE"],
    "VehicleService": ["KILLSWITCH", "FLIGHT_BLOCK", "FLIGHT_BLOCK_RELEASE"],
}
FILES = [pytest.param(path, id=path.name) for path in sorted(FOLDER.iterdir())]


def file_of(name):
    (path,) = FOLDER.glob(f"*.{name}.*")
    return path


def constants(path):
    """Name -> (type, value) of all constants of a file, requests and responses alike."""
    pattern = re.compile(r"^(\w+) (\w+) = (\w+)\s", re.MULTILINE)
    return {name: (kind, int(value, 0)) for kind, name, value in pattern.findall(path.read_text())}


def declarations(path):
    """(line number, line) of all that is not a comment, padding or the rule between directions."""
    lines = enumerate(path.read_text().splitlines(), 1)
    bare = [(number, line) for number, line in lines if line and not line.startswith("#")]
    return [(number, line) for number, line in bare if not re.match(r"(void\d+|---)$", line)]


def test_names_ids_and_versions_are_those_of_the_document():
    assert sorted(path.name for path in FOLDER.iterdir()) == sorted(
        f"{number}.{name}.3.0.uavcan" for number, name in DOCUMENT.items()
    )
    # What those of services carry in eight bits, and what is kept for vendors' messages.
    assert all((number < 256) == DOCUMENT[number].endswith("Service") for number in DOCUMENT)


def test_the_states_are_those_of_the_document():
    found = constants(file_of("ParachuteStatus"))
    states = {name: one for name, one in found.items() if name.startswith("STATE_")}
    assert states == {name: ("uint3", value) for name, value in STATES.items()}


@pytest.mark.parametrize(("name", "types"), NAMED.items(), ids=NAMED)
def test_what_the_document_names_is_there_and_nothing_else(name, types):
    found = [one for one in constants(file_of(name)) if one.startswith("TYPE_")]
    assert found == [f"TYPE_{one}" for one in types]


@pytest.mark.parametrize("path", FILES)
def test_each_line_says_where_it_is_from(path):
    for number, line in declarations(path):
        _, _, source = line.partition("#")
        assert re.search(r"\[(document|driver|assumed)\]", source), f"line {number}: {line}"


@pytest.mark.parametrize("path", FILES)
def test_each_head_says_that_the_file_name_is_the_documents(path):
    head = path.read_text()
    assert "[document] file name, data type id" in head
    assert f"data type id {path.name.split('.')[0]}, version 3.0" in head


@pytest.mark.parametrize("path", FILES)
def test_a_number_that_the_document_does_not_give_says_that_it_is_assumed(path):
    for number, line in declarations(path):
        given = re.search(r" (\w+) = ", line)
        if given and given[1] not in STATES:
            sources = line.partition("#")[2]
            assert "[assumed]" in sources or "[document] the answer" in sources, (number, line)


@pytest.mark.parametrize("path", FILES)
def test_constants_of_one_kind_are_all_different(path):
    for direction in path.read_text().split("---"):
        pattern = re.compile(r"^\w+ ([A-Z]+)_\w+ = (\w+)\s", re.MULTILINE)
        found = pattern.findall(direction)
        assert len(found) == len(set(found))


def test_each_kind_of_request_has_its_own_magic_number():
    magic = {
        DOCUMENT[number]: found["MAGIC_NUMBER"]
        for number in DOCUMENT
        if "MAGIC_NUMBER" in (found := constants(file_of(DOCUMENT[number])))
    }
    assert {name: value.to_bytes(4, "big") for name, (_, value) in magic.items()} == {
        "ParachuteService": b"UPFP",
        "VehicleService": b"UPFV",
        "TriggerService": b"UPFT",
        "TriggerLaunch": b"UPFL",
    }


def test_the_library_reads_them():
    from dronecan.dsdl import parse_namespaces

    parsed = {one.default_dtid: one for one in parse_namespaces([str(FOLDER)])}
    assert {number: one.full_name for number, one in parsed.items()} == {
        number: f"flyfire.{name}" for number, name in DOCUMENT.items()
    }
    assert {tuple(one.version) for one in parsed.values()} == {(3, 0)}
    # Every request, every response and every message but the two statuses is one frame: nothing
    # of what fires or stops can lose a part.
    sizes = {
        DOCUMENT[number]: (
            (one.get_max_bitlen_request(), one.get_max_bitlen_response())
            if number < 256
            else (one.get_max_bitlen(),)
        )
        for number, one in parsed.items()
    }
    assert sizes == {
        "ParachuteService": (40, 8),
        "VehicleService": (40, 8),
        "TriggerService": (40, 8),
        "ParachuteStatus": (64,),
        "VehicleStatus": (40,),
        "TriggerLaunch": (40,),
        "TriggerStatus": (32,),
    }
