"""The flyfire data types, ours and others: what is needed, what is only told, what is new."""

import pytest
from upf_link_bench import LAYOUTS, Bench, Layout, layout_of, types_of

from chute_ros.errors import ParameterError
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.model import ErrorFlags, ParachuteState

STATES = [state for state in ParachuteState if state is not ParachuteState.UNKNOWN]
SEVEN = {
    "163.ParachuteService": (names.PARACHUTE_SERVICE, "request"),
    "1663.ParachuteStatus": (names.PARACHUTE_STATUS, None),
    "164.VehicleService": (names.VEHICLE_SERVICE, "request"),
    "1664.VehicleStatus": (names.VEHICLE_STATUS, None),
    "165.TriggerService": (names.TRIGGER_SERVICE, "request"),
    "1665.TriggerLaunch": (names.TRIGGER_LAUNCH, None),
    "1666.TriggerStatus": (names.TRIGGER_STATUS, None),
}


@pytest.fixture
def changed(tmp_path):
    """Our types, in which changed(file, old, new, ...) has replaced text; no new: no file."""

    def make(*changes):
        folder = tmp_path / "flyfire"
        folder.mkdir()
        for one in LAYOUTS["ours"].iterdir():
            text = one.read_text()
            for file, old, new in changes:
                if one.name.startswith(file + "."):
                    assert old in text
                    text = "" if new is None else text.replace(old, new)
            if text:
                (folder / one.name).write_text(text)
        return types_of(folder)

    return make


def test_each_of_the_seven_types_of_the_document_is_there_with_its_id(layout):
    for file, (name, mode) in SEVEN.items():
        kind = layout.types.find(name, mode)
        assert kind is not None, file
        assert kind.id == int(file.partition(".")[0])


def test_ours_has_everything_that_is_told_and_nothing_that_is_new():
    ours = layout_of("ours").definitions
    assert ours.absent == ()
    assert ours.new == ()


def test_other_lacks_what_is_only_told_and_has_fields_that_are_new():
    other = layout_of("other").definitions
    assert other.absent == (
        "flyfire.ParachuteStatus.is_enable_auto_launch",
        "flyfire.ParachuteStatus.error_flags",
        "flyfire.ParachuteStatus.vz",
        "flyfire.TriggerStatus.is_launched",
        "flyfire.TriggerStatus.error_flags",
    )
    assert "flyfire.ParachuteStatus.temperature" in other.new
    assert "flyfire.VehicleStatus.battery_remaining" in other.new


def test_no_number_of_the_other_layout_is_read_by_ours():
    """What is found by name cannot pass by the same number."""
    ours, other = layout_of("ours").definitions, layout_of("other").definitions
    assert all(ours.state_number(state) != other.state_number(state) for state in STATES[:-1])
    for service in (names.PARACHUTE_SERVICE, names.VEHICLE_SERVICE, names.TRIGGER_SERVICE):
        mine, theirs = (one.types.request(service).constants for one in (ours, other))
        assert mine["MAGIC_NUMBER"] != theirs["MAGIC_NUMBER"]


def test_state_goes_to_its_number_and_back(definitions):
    for state in STATES:
        assert definitions.state(definitions.state_number(state)) is state
    assert definitions.state(15) is None


def test_everything_that_is_missing_is_named_at_once(changed):
    types = changed(
        ("1663.ParachuteStatus", "STATE_READY", "STATE_FINE"),
        ("163.ParachuteService", "uint8 type ", "uint8 kind "),
        ("163.ParachuteService", "RESULT_REJECTED", "RESULT_NO"),
        ("1665.TriggerLaunch", "", None),
        ("164.VehicleService", "", None),
    )
    with pytest.raises(ParameterError) as raised:
        Definitions(types)
    assert str(raised.value) == (
        "the flyfire data types lack names needed to fire or to answer: "
        "flyfire.ParachuteService (request) field type, "
        "flyfire.ParachuteService (response) constant RESULT_REJECTED, "
        "flyfire.ParachuteStatus constant STATE_READY, "
        "flyfire.VehicleService (request), "
        "flyfire.VehicleService (response), "
        "flyfire.TriggerLaunch"
    )


def test_two_states_with_one_number_are_refused(changed):
    types = changed(("1663.ParachuteStatus", "STATE_ARMED = 4", "STATE_ARMED = 3"))
    with pytest.raises(ParameterError, match="TAKEOFF and ARMED are both 3"):
        Definitions(types)


def test_absent_field_that_is_only_told_is_reported_once_and_reads_as_not_known(changed):
    types = changed(("1663.ParachuteStatus", "float16 height_of_home", "float16 height"))
    definitions = Definitions(types)
    story = Bench(Layout("changed", types, definitions), "").step()
    text = "the data types have no flyfire.ParachuteStatus.height_of_home: it reads as not known"
    assert story.notices().count(text) == 1
    story.status("READY").at(5.0).status("READY")
    assert story.notices().count(text) == 1
    assert story.picture().height != story.picture().height  # NaN


def test_new_fields_are_kept_for_who_looks():
    story = Bench(layout_of("other"), "").status("READY", temperature=21)
    controller = story.link.devices.controllers[33]
    assert controller.unknown_fields["temperature"] == 21
    assert "state" not in controller.unknown_fields
    story.trigger_status(temperature=19)
    assert story.link.devices.triggers[34].unknown_fields["temperature"] == 19


def test_results_are_told_by_name(definitions):
    for name in ("SUCCESS", "REJECTED", "TEMPORARILY_REJECTED"):
        said = definitions.result(names.PARACHUTE_SERVICE, name)
        assert definitions.result_name(names.PARACHUTE_SERVICE, said) == name
    assert definitions.result_name(names.PARACHUTE_SERVICE, {"result": 14}) == "result 14"


def test_result_that_the_types_do_not_have_reads_as_rejected(layout):
    said = layout.definitions.result(names.VEHICLE_SERVICE, "FAILED")
    name = layout.definitions.result_name(names.VEHICLE_SERVICE, said)
    assert name == {"ours": "FAILED", "other": "REJECTED"}[layout.name]


def test_type_of_a_request_is_told_by_name_unless_its_magic_number_is_bad(definitions):
    said = definitions.request(names.VEHICLE_SERVICE, "TYPE_KILLSWITCH")
    assert definitions.type_name(names.VEHICLE_SERVICE, said) == "TYPE_KILLSWITCH"
    assert definitions.magic_is_good(names.VEHICLE_SERVICE, said)
    bad = {**said, "magic_number": said["magic_number"] ^ 1}
    assert definitions.type_name(names.VEHICLE_SERVICE, bad) == ""
    assert not definitions.magic_is_good(names.VEHICLE_SERVICE, bad)


def test_state_is_told_by_name_and_is_empty_where_there_is_none(definitions):
    number = definitions.constant(names.TRIGGER_STATUS, "STATE_ABNORMAL")
    assert definitions.state_name(names.TRIGGER_STATUS, {"state": number}) == "ABNORMAL"
    assert definitions.state_name(names.TRIGGER_STATUS, {"state": 15}) == ""
    assert definitions.state_name(names.TRIGGER_STATUS, {}) == ""
    assert definitions.constant(names.TRIGGER_STATUS, "STATE_ASLEEP") is None


def test_faults_come_from_the_bits_of_the_flags_or_from_fields_of_their_own(definitions):
    ours, other = layout_of("ours").definitions, layout_of("other").definitions
    assert ours.faults(names.PARACHUTE_STATUS, {"error_flags": 0}) == []
    faults = ours.faults(names.PARACHUTE_STATUS, {"error_flags": 1 | 8 | 128})
    assert faults == ["IMU", "LOW_POWER", "error bit 7"]
    values = {"error_imu": True, "error_barometer": False, "fault_code": 7, "temperature": 3}
    assert other.faults(names.PARACHUTE_STATUS, values) == ["error_imu", "fault_code 7"]
    no_number = {"error_flags": [1]}
    assert definitions.faults(names.PARACHUTE_STATUS, no_number) == []


def test_error_has_its_flag_in_the_picture_in_either_form():
    for layout, said in (
        ("ours", {"error_flags": 1 | 2}),
        ("other", {"error_imu": True, "error_barometer": True}),
    ):
        picture = Bench(layout_of(layout), "").status("ABNORMAL", **said).picture()
        assert picture.error_flags == ErrorFlags.IMU_ERROR | ErrorFlags.BAROMETER_ERROR
        assert len(picture.faults) == 2, layout


@pytest.mark.parametrize(
    ("layout", "said", "name"),
    [
        ("ours", {"error_flags": 32}, "PARACHUTE_DISABLED"),
        ("ours", {"error_flags": 64}, "error bit 6"),
        ("ours", {"error_flags": 128}, "error bit 7"),
        ("other", {"error_trigger_connection": True}, "error_trigger_connection"),
    ],
)
def test_error_without_a_flag_of_its_own_is_an_error_all_the_same(layout, said, name):
    """Pre-flight checks look at the flags; the name stays in words."""
    picture = Bench(layout_of(layout), "").status("READY", **said).picture()
    assert picture.error_flags == ErrorFlags.POD_CONNECTION_ERROR
    assert picture.faults == (name,)


def test_a_controller_that_tells_that_it_is_disabled_never_deploys():
    """Given one whose parameters cannot be read."""
    story = Bench(layout_of("ours"), "").status("READY", error_flags=32)
    assert story.link.devices.controllers[33].never_deploys
    assert story.picture().state is ParachuteState.ABNORMAL
    assert not story.status("READY").link.devices.controllers[33].never_deploys
    # Its own parameter knows better: the name of the bit is assumed.
    story.status("READY", error_flags=32).link.devices.controllers[33].parameters[
        p.ENABLE_PARACHUTE
    ] = True
    assert not story.link.devices.controllers[33].never_deploys
