"""Every type in use, byte by byte, as the dronecan library makes it; and what cannot be made."""

import math
import struct

import pytest
from dronecan_bench import ALLOCATION, FLYFIRE, GET_SET, NODE_STATUS, RESTART, TIME, UID, types
from dronecan_bench import reference as ask_the_library
from dronecan_vectors import DISCRIMINATOR, VECTORS
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import MessageError, ParameterError
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.protocol.dronecan.transfer import frames_of

USED = sorted({(one.name, one.mode) for one in VECTORS}, key=str)


def as_json(value):
    if isinstance(value, dict):
        return {name: as_json(one) for name, one in value.items()}
    if isinstance(value, list):
        return [as_json(one) for one in value]
    return {"hex": value.hex()} if isinstance(value, bytes) else value


@pytest.fixture(scope="module")
def library():
    """Story -> what the library makes of its values."""
    whole = ("name", "mode", "source", "transfer_id", "priority")
    tasks = [
        {
            **{name: getattr(one, name) for name in whole},
            "values": as_json(one.values),
            "destination": one.destination or None,
            "discriminator": DISCRIMINATOR,
        }
        for one in VECTORS
    ]
    made = ask_the_library(tasks)
    return {one.story: answer for one, answer in zip(VECTORS, made, strict=True)}


def test_every_type_of_the_parachute_has_a_vector():
    names = {file.name.split(".")[1] for file in FLYFIRE.iterdir()}
    assert len(names) == 7
    assert names == {
        name.removeprefix("flyfire.") for name, _ in USED if name.startswith("flyfire.")
    }


def test_the_library_makes_these_bytes_of_it(library):
    for vector in VECTORS:
        made = library[vector.story]
        assert made["payload"] == vector.payload, vector.story
        frames = tuple(f"{number:08x}#{data}" for number, data in made["frames"])
        assert frames == vector.frames, vector.story


def test_we_make_these_bytes_of_it_and_read_them():
    for vector in VECTORS:
        data_type = types().find(vector.name, vector.mode)
        assert data_type.encode(vector.values).hex() == vector.payload, vector.story
        assert data_type.decode(bytes.fromhex(vector.payload)) == vector.values, vector.story
        assert data_type.fields == tuple(vector.values), vector.story
        transfer = vector.transfer(data_type.id)
        frames = frames_of(transfer, data_type.base_crc, DISCRIMINATOR)
        assert frames == vector.can_frames, vector.story


def test_the_library_reads_what_we_send(library):
    tasks = []
    for one in VECTORS:
        data_type = types().find(one.name, one.mode)
        frames = frames_of(one.transfer(data_type.id), data_type.base_crc, DISCRIMINATOR)
        tasks.append({"frames": [[frame.identifier, frame.data.hex()] for frame in frames]})
    for one, read in zip(VECTORS, ask_the_library(tasks), strict=True):
        assert read["source"] == one.source
        assert (read["destination"] or 0) == one.destination
        assert (read["transfer_id"], read["priority"]) == (one.transfer_id, one.priority)
        assert read["text"].startswith(f"{one.name}(")
        for name, value in one.values.items():
            if isinstance(value, (int, float)) and not isinstance(value, bool):
                assert f"{name}={value}" in read["text"]


def test_what_is_not_given_is_zero_and_too_short_is_nothing():
    for name, mode in USED:
        data_type = types().find(name, mode)
        payload = data_type.encode({})
        assert not any(payload), name
        assert data_type.decode(payload) is not None, name
        # Of an array at the end, and of the value of a parameter, an empty one is whole as well.
        for length in range(len(payload)):
            cut = data_type.decode(payload[:length])
            assert cut is None or data_type.encode(cut) == payload[:length], name


def test_what_was_read_belongs_to_all_who_read_the_same_bytes_and_is_changed_by_none():
    data_type = types().response(GET_SET)
    payload = data_type.encode({"name": b"node_id", "value": {"integer_value": 7}})
    read = data_type.decode(payload)
    for values, name in ((read, "name"), (read["value"], "integer_value")):
        with pytest.raises(TypeError):
            values[name] = 8
    assert data_type.decode(payload)["value"] == {"integer_value": 7}


STATUS = "flyfire.ParachuteStatus"
FLOAT16 = r"-65504\.0 to 65504"
STATISTICS = "uavcan.protocol.GetTransportStats response"
#: Type -> values that it cannot carry, and what the error says.
TOO_MUCH = {
    STATUS: [
        ({"state": 8}, "0 to 7"),
        ({"state": -1}, "0 to 7"),
        ({"state": 1.5}, "state|code"),
        ({"state": math.nan}, "0 to 7"),
        ({"state": None}, "carry"),
        ({"state": "4"}, "carry"),
        ({"state": {}}, "carry"),
        ({"state": b"\x04"}, "carry"),
        ({"is_vehicle_connected": 2}, "0 to 1"),
        ({"error_flags": 256}, "0 to 255"),
        ({"vz": 65505.0}, FLOAT16),
        ({"vz": math.inf}, FLOAT16),
        ({"vz": -math.inf}, FLOAT16),
        ({"speed": 1.0}, "no field speed"),
        ({"_void_3": 1}, "padding"),
        ({"STATE_READY": 2}, "no field"),
    ],
    NODE_STATUS: [({"uptime_sec": 2**32}, "0 to")],
    # A truncated uint56 is not cut off.
    TIME: [({"previous_transmission_timestamp_usec": 2**56}, "0 to")],
    f"{RESTART} request": [({"magic_number": -1}, "0 to")],
    ALLOCATION: [
        ({"unique_id": bytes(17)}, "at most 16"),
        ({"unique_id": [1, 2]}, "need bytes"),
        ({"unique_id": "ab"}, "need bytes"),
        ({"unique_id": 5}, "need bytes"),
    ],
    "uavcan.protocol.GetNodeInfo response": [
        ({"hardware_version": {"unique_id": UID[:15]}}, "need 16"),
        ({"hardware_version": 5}, "by name"),
        ({"status": {"health": 4}}, "0 to 3"),
    ],
    f"{GET_SET} request": [
        ({"value": {"integer_value": 1, "real_value": 1.0}}, "one field"),
        ({"value": {"name": 1}}, "no field"),
        ({"value": {"integer_value": 2**63}}, "to 9223372036854775807"),
        ({"value": {"integer_value": -(2**63) - 1}}, "to 92"),
        ({"value": {"real_value": 1e39}}, r"to 3\.4"),
    ],
    STATISTICS: [
        ({"can_iface_stats": [{"errors": 2**48}]}, "0 to"),
        ({"can_iface_stats": [{}] * 4}, "at most 3"),
    ],
}


def find(which):
    """A type by its name, a service's with its direction."""
    name, _, mode = which.partition(" ")
    return types().find(name, mode or None)


@pytest.mark.parametrize("which", TOO_MUCH)
def test_what_does_not_fit_is_the_callers_mistake_and_never_cut_to_size(which):
    for values, why in TOO_MUCH[which]:
        with pytest.raises(MessageError, match=why):
            pytest.fail(f"{values} became {find(which).encode(values)!r}")


def test_nan_is_carried_as_nan_and_infinity_that_comes_is_infinity():
    data_type = types().message("flyfire.VehicleStatus")
    payload = data_type.encode({"height_of_home": math.nan, "vz": -0.0})
    assert payload.hex() == "00ff7f0080"
    read = data_type.decode(payload)
    assert math.isnan(read["height_of_home"])
    assert math.copysign(1.0, read["vz"]) == -1.0
    read = data_type.decode(bytes.fromhex("00007c00fc"))
    assert (read["height_of_home"], read["vz"]) == (math.inf, -math.inf)


@pytest.mark.parametrize(
    ("which", "payload"),
    [
        # Seventeen bytes of unique id; a union without this field; none of the union.
        (ALLOCATION, "00" + "11" * 17),
        (f"{GET_SET} response", "05"),
        (f"{GET_SET} response", "0007"),
        # Four buses of at most three; half a bus.
        (STATISTICS, "00" * 18 + "00" * 18 * 4),
        (STATISTICS, "00" * 18 + "00" * 17),
    ],
)
def test_what_makes_no_sense_is_nothing(which, payload):
    assert find(which).decode(bytes.fromhex(payload)) is None


ALL = sorted(
    (one for one in [*types()._by_id.values()] if one.name.startswith(("flyfire", "uavcan."))),
    key=lambda one: (one.name, str(one.is_service)),
)


@given(st.sampled_from(ALL), st.binary(max_size=80))
def test_any_bytes_are_read_or_not_but_never_raise_and_what_was_read_can_be_sent(kind, payload):
    read = kind.decode(payload)
    if read is not None and not _infinite(read):
        again = kind.decode(kind.encode(read))
        assert repr(again) == repr(read)


def _infinite(value):
    if isinstance(value, dict):
        return any(_infinite(one) for one in value.values())
    if isinstance(value, list):
        return any(_infinite(one) for one in value)
    return isinstance(value, float) and math.isinf(value)


def _padded(name, **values):
    data_type = types().message(name)
    return data_type.decode(data_type.encode(values))


@given(
    st.integers(0, 7),
    st.booleans(),
    st.booleans(),
    st.integers(0, 255),
    *[st.floats(-65504, 65504, width=16)] * 3,
)
def test_a_parachute_status_comes_back_as_it_was(
    state, connected, auto, errors, height, vz, volts
):
    values = {
        "state": state,
        "is_vehicle_connected": connected,
        "is_enable_auto_launch": auto,
        "error_flags": errors,
        "height_of_home": height,
        "vz": vz,
        "backup_power_voltage": volts,
    }
    assert _padded(STATUS, **values) == values
    # Bit by bit: state, two flags, three bits of padding, most significant bit first.
    payload = types().message(STATUS).encode(values)
    assert payload[0] == state << 5 | connected << 4 | auto << 3
    assert payload[1] == errors
    assert struct.unpack("<3e", payload[2:]) == (height, vz, volts)


@given(st.floats(-65504, 65504))
def test_a_float16_is_the_nearest_or_its_neighbour(number):
    read = _padded("flyfire.VehicleStatus", vz=number)["vz"]
    assert abs(read - number) <= max(abs(number) * 2**-10, 2**-24)


def test_types_are_found_by_name_and_by_id():
    found = types()
    assert found.message(NODE_STATUS).id == 341
    assert found.by_id(341, None) is found.message(NODE_STATUS)
    assert found.request(GET_SET).is_service
    assert found.by_id(11, "response") is found.response(GET_SET)
    assert found.find(NODE_STATUS, "request") is None
    assert found.by_id(9999, None) is None
    with pytest.raises(KeyError):
        found.message("flyfire.None")


def test_constants_are_those_of_the_direction():
    assert types().request("flyfire.ParachuteService").constants["TYPE_DEPLOY"] == 5
    assert "TYPE_DEPLOY" not in types().response("flyfire.ParachuteService").constants


def _parsed(folder, **files):
    from dronecan.dsdl import parse_namespaces

    root = folder / "flyfire"
    root.mkdir()
    for name, text in files.items():
        (root / f"{name.replace('_', '.')}.uavcan").write_text(text)
    return parse_namespaces([str(root)])


def test_arrays_of_any_kind(tmp_path):
    text = "int8[<=2] small\nuint12[3] fixed\nbool[2] flags\nfloat16[<=2] f\n"
    kind = DataTypes(_parsed(tmp_path, **{"20000_Odd": text})).message("flyfire.Odd")
    values = {"small": (-128, 127), "fixed": (0, 4095, 1), "flags": (True, False), "f": (0.5,)}
    assert kind.decode(kind.encode(values)) == values
    for name, one in (
        ("small", [128]),
        ("small", b"\x01"),
        ("fixed", [1, 2]),
        ("fixed", [1, 2, 4096]),
        ("flags", [True, 2]),
        ("f", [1e6]),
    ):
        with pytest.raises(MessageError):
            kind.encode({name: one})
    # The length of the first stands in its first two bits: 3 of at most 2.
    payload = kind.encode(values)
    assert payload[0] >> 6 == 2
    assert kind.decode(bytes((payload[0] | 0xC0, *payload[1:], 0))) is None


def test_truncated_floats_carry_infinity(tmp_path):
    text = "truncated float16 a\n"
    kind = DataTypes(_parsed(tmp_path, **{"20000_Odd": text})).message("flyfire.Odd")
    assert kind.encode({"a": -math.inf}).hex() == "00fc"
    with pytest.raises(MessageError):
        kind.encode({"a": 65505.0})


def test_types_without_an_id_are_only_parts_of_others(tmp_path):
    parsed = _parsed(tmp_path, Part="uint8 a\n", **{"20000_Whole": "Part part\n"})
    made = DataTypes(parsed)
    assert made.find("flyfire.Part", None) is None
    assert made.message("flyfire.Whole").encode({"part": {"a": 7}}) == b"\x07"


def test_two_types_of_one_id_are_refused_and_the_same_twice_is_one(tmp_path):
    parsed = _parsed(tmp_path, **{"341_Mine": "uint8 a\n"})
    standard = types().message(NODE_STATUS)._type
    with pytest.raises(ParameterError, match=r"341 .*NodeStatus.*flyfire\.Mine"):
        DataTypes([standard, *parsed])
    assert DataTypes([standard, standard]).message(NODE_STATUS).id == 341
