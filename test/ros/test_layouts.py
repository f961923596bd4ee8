"""Every topic and every field that a layout names exists in our messages."""

import importlib
import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from rcl_interfaces.msg import Log
from sensor_msgs.msg import BatteryState

from chute_ros.ros.recorded_topics import recorded_topics
from chute_ros.supervisor.machine import Stage

FOLDER = Path(__file__).parents[2] / "config" / "layouts"
FOXGLOVE = sorted(FOLDER.glob("*.json"))
PLOTJUGGLER = FOLDER / "plotjuggler.xml"
#: A part of a path: a field, an element or all of an array, or a filter on a field.
PART = re.compile(r"\.(?P<field>\w+)|\[(?:\d+|:)\]|\{(?P<filter>\w+)==[^}]*\}")
#: What docs/guide/dashboards.md says to put a namespace into.
NAMED = re.compile(r'"(?=/(diagnostics|parachute|safety|umbilical|upf|vehicle)\b)')
#: Of every kind of panel that we use, the settings that name a topic or a path.
PATHS = {
    "Indicator": lambda one: [one["path"]],
    "RawMessages": lambda one: [one["topicPath"]],
    "Table": lambda one: [one["topicPath"]],
    "Plot": lambda one: [path["value"] for path in one["paths"]],
    "StateTransitions": lambda one: [path["value"] for path in one["paths"]],
    "DiagnosticSummary": lambda one: [one["topicToRender"]],
    "DiagnosticStatusPanel": lambda one: [one["topicToRender"]],
    "RosOut": lambda one: [one["topicToRender"]],
    "Tab": lambda one: [],
}
#: Of a screen of 1080 lines Lichtblick leaves so many to the panels; a row of a timeline needs
#: 64 of them, the title of its panel and the time below it 40, a bar of tabs 30.
LINES, LINES_A_ROW, LINES_OF_PANEL, LINES_OF_TABS = 960, 64, 40, 30


class _Root:
    def resolve_topic_name(self, name: str) -> str:
        return f"/{name}"


RECORDED = {one.name: one.kind for one in recorded_topics(_Root()).values()}  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def topics() -> dict[str, Any]:
    """Every topic -> its class."""
    summary = importlib.import_module("chute_msgs.msg").SafetySummary
    more = {"/vehicle/battery": BatteryState, "/safety/summary": summary, "/rosout": Log}
    return RECORDED | more


def type_of(kind: Any, field: str) -> Any:
    """The class of a field of messages, or its type's name if it is no message; an array's is that
    of its elements."""
    declared = kind.get_fields_and_field_types()[field]
    element = declared.removeprefix("sequence<").partition(">")[0].partition(",")[0]
    package, slash, name = element.partition("/")
    return getattr(importlib.import_module(f"{package}.msg"), name) if slash else element


def follow(topics: dict[str, Any], path: str) -> Any:
    """What a message path of Foxglove leads to; KeyError: to nothing."""
    topic = re.match(r"[/\w]+", path)
    assert topic is not None
    kind, rest = topics[topic[0]], path[topic.end() :]
    while rest:
        part = PART.match(rest)
        assert part is not None, rest
        rest = rest[part.end() :]
        if part["filter"]:
            type_of(kind, part["filter"])
        elif part["field"]:
            kind = type_of(kind, part["field"])
    return kind


def panels(file: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(file.read_text())["configById"]
    return found


def paths(file: Path) -> list[str]:
    return [
        path for id_, one in panels(file).items() for path in PATHS[id_.partition("!")[0]](one)
    ]


def placed(file: Path) -> list[tuple[str, float]]:
    """Ids of the panels of a layout, and how many lines of the screen each has."""
    configs = panels(file)

    def inside(layout: Any, lines: float) -> list[tuple[str, float]]:
        if isinstance(layout, str):
            if not layout.startswith("Tab!"):
                return [(layout, lines)]
            tabs = [one["layout"] for one in configs[layout]["tabs"]]
            shown = [panel for tab in tabs for panel in inside(tab, lines - LINES_OF_TABS)]
            return [(layout, lines), *shown]
        assert layout["direction"] in ("row", "column")
        assert 0 < layout["splitPercentage"] < 100
        share = layout["splitPercentage"] / 100
        above, below = (share, 1 - share) if layout["direction"] == "column" else (1, 1)
        return inside(layout["first"], above * lines) + inside(layout["second"], below * lines)

    return inside(json.loads(file.read_text())["layout"], LINES)


def test_there_is_one_for_the_field_the_bench_and_the_black_box():
    assert [one.stem for one in FOXGLOVE] == [
        "foxglove_bench",
        "foxglove_black_box",
        "foxglove_field",
    ]


@pytest.mark.parametrize("file", FOXGLOVE, ids=lambda one: one.stem)
def test_each_path_of_foxglove_leads_to_a_field(file, topics):
    assert len(paths(file)) > 10
    for path in paths(file):
        follow(topics, path)


@pytest.mark.parametrize("file", FOXGLOVE, ids=lambda one: one.stem)
def test_what_is_plotted_is_a_number(file, topics):
    for id_, one in panels(file).items():
        if id_.startswith("Plot!"):
            for path in PATHS["Plot"](one):
                assert follow(topics, path) in ("float", "double"), path


@pytest.mark.parametrize("file", FOXGLOVE, ids=lambda one: one.stem)
def test_each_panel_has_its_place(file):
    assert sorted(id_ for id_, _ in placed(file)) == sorted(panels(file))


@pytest.mark.parametrize("file", FOXGLOVE, ids=lambda one: one.stem)
def test_each_row_of_a_timeline_is_seen(file):
    """What does not fit is below the edge of its panel."""
    for id_, lines in placed(file):
        if id_.startswith("StateTransitions!"):
            rows = len(panels(file)[id_]["paths"])
            assert rows * LINES_A_ROW + LINES_OF_PANEL <= lines, id_


@pytest.mark.parametrize("file", FOXGLOVE, ids=lambda one: one.stem)
def test_a_plot_hides_nothing_and_joins_nothing(file):
    """Its legend is beside the curves; of an array the elements of one moment would be joined."""
    for id_, one in panels(file).items():
        if id_.startswith("Plot!"):
            assert one["legendDisplay"] == "left", id_
            assert not any("[:]" in path for path in PATHS["Plot"](one)), id_


@pytest.mark.parametrize("file", FOXGLOVE, ids=lambda one: one.stem)
def test_each_panel_has_its_title_in_both_viewers(file):
    for id_, one in panels(file).items():
        if not id_.startswith("Tab!"):
            assert one["lichtblickPanelTitle"] == one["foxglovePanelTitle"] != "", id_


def test_the_layout_of_a_black_box_names_only_what_is_recorded(topics):
    for path in paths(FOLDER / "foxglove_black_box.json"):
        follow(RECORDED, path)


@pytest.mark.parametrize("state", ["foxglove_field", "foxglove_bench"])
def test_each_state_of_the_vehicle_has_its_word_and_its_colour(state):
    kind = importlib.import_module("chute_msgs.msg").SafetyState
    rules = panels(FOLDER / f"{state}.json")["Indicator!state"]["rules"]
    assert [(int(one["rawValue"]), one["label"]) for one in rules] == [
        (stage.value, stage.name) for stage in Stage
    ]
    assert all(getattr(kind, one["label"]) == int(one["rawValue"]) for one in rules)


@pytest.mark.parametrize("path", ["/safety/nothing.state", "/safety/state.nothing", "/safety/x"])
def test_a_path_that_leads_to_nothing_is_found(path, topics):
    with pytest.raises(KeyError):
        follow(topics, path)


def curves() -> list[str]:
    return [str(one.get("name")) for one in ElementTree.parse(PLOTJUGGLER).iter("curve")]


def test_each_curve_of_plotjuggler_is_a_number_of_a_message(topics):
    """PlotJuggler's names: topic, "/", field, "[0]" for an element."""
    assert len(curves()) > 15
    for name in curves():
        topic, _, field = name.rpartition("/")
        kind = follow(topics, f"{topic}.{field}")
        assert kind in ("float", "double", "uint8", "boolean"), name


def test_plotjuggler_finds_as_many_areas_as_it_splits():
    root = ElementTree.parse(PLOTJUGGLER).getroot()
    assert root.tag == "root"
    for splitter in root.iter("DockSplitter"):
        areas = splitter.findall("DockArea")
        assert len(areas) == int(str(splitter.get("count")))
        assert len(str(splitter.get("sizes")).split(";")) == len(areas)
        assert all(area.find("plot") is not None for area in areas)


@pytest.mark.parametrize("file", [*FOXGLOVE, PLOTJUGGLER], ids=lambda one: one.stem)
def test_a_namespace_is_put_into_each_topic_as_the_guide_says(file):
    text = NAMED.sub('"/drone1', file.read_text())
    topics = set(re.findall(r'"(/[/\w]+)', text))
    assert topics - {"/rosout"}
    assert all(one.startswith("/drone1/") for one in topics - {"/rosout"}), topics
