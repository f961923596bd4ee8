"""What the safety case traces: an orphan on either side is told, and so is what does not exist."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
import yaml

from chute_ros.tools.compare_words import CURVES
from safety_case import evidence, single_failures, thresholds
from safety_case.check import KINDS, MODES, problems
from safety_case.documents import FOLDER, ROOT
from safety_case.parts import ACTIONS, PARTS, carried_by, without_section

SHOWS = "test/test_deploy.py"
SHOWN = f"- ``{SHOWS}::test_it_opens``"


def requirement(uid="R-1", **other):
    files = ["chute_ros/deploy.py", SHOWS]
    node = {"_NODE_TYPE": "REQUIREMENT", "UID": uid, "SECTION": "deploy", "PAGES": "deploy.md"}
    return {**node, "CAMPAIGN": "MOTOR", "RELATIONS": relations(*files), **other}


def relations(*files):
    return [{"TYPE": "File", "VALUE": one} for one in files]


def row(kind, section, title, **other):
    node = {"_NODE_TYPE": kind, "SECTION": section, "TITLE": title, "UID": f"{section} {title}"}
    parent = {"TYPE": "Parent", "VALUE": "R-1"}
    return {**node, "RELATIONS": [parent], "SHOWN_BY": SHOWN, **other}


def failures():
    return [
        row("FAILURE_MODE", part, mode, SINGLE="NONE", STATEMENT="")
        for part in PARTS
        for mode in MODES
    ]


def actions():
    return [row("UNSAFE_ACTION", action, kind) for action in ACTIONS for kind in KINDS]


def all_rows():
    return [*failures(), *actions()]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name, text in {
        "chute_ros/deploy.py": "",
        "docs/deploy.md": "",
        "test/test_deploy.py": "def test_it_opens(): ...",
    }.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def test_a_whole_case_has_no_problem(root):
    assert problems([requirement(), *all_rows()], root) == []


@pytest.mark.parametrize(
    ("file", "lacks"),
    [
        ("chute_ros/deploy.py", "no test shows it; name one in its RELATIONS"),
        (SHOWS, "no code fulfils it; name a file in its RELATIONS"),
    ],
)
def test_a_requirement_without_a_test_or_without_code_is_an_orphan(root, file, lacks):
    orphan = requirement("R-2", RELATIONS=relations(file))
    told = problems([requirement(), orphan, *all_rows()], root)
    assert told == [f"R-2 is an orphan: {lacks}"]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("msg_defs/test/test_new.py", "it shows no requirement"),
        ("test/tools/test_new.py", "it shows no requirement"),
        ("chute_ros/supervisor/conditions/new.py", "no requirement names it"),
        ("chute_ros/runtime/new.py", "no requirement names it"),
        ("chute_ros/links/new/__init__.py", "no requirement names it"),
        ("docs/guide/new.md", "it describes no requirement"),
    ],
)
def test_what_no_requirement_names_is_an_orphan(root, name, told):
    path = root / name
    path.parent.mkdir(parents=True)
    path.write_text('"""A docstring."""\n\nLINK = None\n')
    (found,) = problems([requirement(), *all_rows()], root)
    assert found.startswith(f"{name} is an orphan: {told}")


def test_a_folder_names_the_modules_in_it_and_none_below(root):
    for name in ("links/new/node.py", "links/new/protocol/wire.py", "links/new/__init__.py"):
        path = root / "chute_ros" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('"""A docstring."""\n')
    named = requirement(FOLDERS="chute_ros/links/new, chute_ros/links/gone")
    gone, below = problems([named, *all_rows()], root)
    assert gone == "R-1: there is no folder chute_ros/links/gone"
    assert below.startswith("chute_ros/links/new/protocol/wire.py is an orphan")


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (
            {"RELATIONS": relations("chute_ros/gone.py", "chute_ros/deploy.py", SHOWS)},
            "R-1: there is no chute_ros/gone.py",
        ),
        ({"PAGES": "deploy.md, none.md"}, "R-1: there is no page docs/none.md"),
        ({"CAMPAIGN": "MOTOR, Stop, DOUBLED, WINGS"}, "R-1: the campaign has no row WINGS"),
    ],
)
def test_what_a_requirement_names_and_is_not_there_is_told(root, changed, told):
    assert problems([requirement(**changed), *all_rows()], root) == [told]


@pytest.mark.parametrize(("said", "enough"), [("", 0), ("none: ", 0), ("none: it is text", 1)])
def test_a_requirement_names_a_row_of_the_campaign_or_says_why_not(root, said, enough):
    told = problems([requirement(CAMPAIGN=said), *all_rows()], root)
    assert len(told) == 1 - enough
    assert all("says 'none: why'" in one for one in told)


LIST = "SHOWN_BY is a list of ``path`` or ``path::test``"
STAYS = "STAYS says why a single failure stays"
TOLD = "TOLD says who learns of what stays: NOBODY; FLIGHT; GROUND; GROUND, FLIGHT"
MISSED = {"SINGLE": "MISSED", "STAYS": "One wire."}


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"SHOWN_BY": "- ``test/test_gone.py::test_it``"}, "there is no test/test_gone.py"),
        ({"SHOWN_BY": f"- ``{SHOWS}::test_it``"}, f"{SHOWS} has no test_it"),
        ({"SHOWN_BY": f"- {SHOWS}"}, LIST),
        ({"SHOWN_BY": ""}, LIST),
        ({"RELATIONS": []}, "no requirement answers it"),
        ({"SINGLE": "MISSED", "STAYS": "", "TOLD": ""}, STAYS),
        ({"SINGLE": "NONE", "STAYS": "it is rare", "TOLD": "NOBODY"}, STAYS),
        (MISSED, TOLD),
        ({**MISSED, "TOLD": "FLIGHT, NOBODY"}, TOLD),
        ({**MISSED, "TOLD": "FLIGHT, GROUND"}, TOLD),
    ],
)
def test_what_is_wrong_with_a_row_is_told(root, changed, told):
    first, *others = all_rows()
    (found,) = problems([requirement(), {**first, **changed}, *others], root)
    assert found.startswith(f"{first['UID']}: {told}")


def test_a_part_without_one_of_its_failures_is_told(root):
    told = problems([requirement(), *failures()[1:], *actions()[:-1]], root)
    first = failures()[0]["SECTION"]
    assert told == [
        f"{first}: 0 rows for the failure 'late', need 1",
        f"{actions()[-1]['SECTION']}: 0 rows for the unsafe action 'stopped too soon', need 1",
    ]


def test_a_failure_that_is_none_of_the_six_is_told(root):
    odd = row("FAILURE_MODE", failures()[0]["SECTION"], "blue", SINGLE="NONE")
    (told,) = problems([requirement(), *failures(), odd, *actions()], root)
    assert told.endswith(
        "the failure 'blue' is none of late, lost, wrong, twice, restarted, forged"
    )


@pytest.mark.parametrize("section", ["a hot standby", "Disarm the parachute"])
def test_a_part_or_an_action_that_is_left_out_whole_is_told(root, section):
    rows = [one for one in all_rows() if one["SECTION"] != section]
    told = problems([requirement(), *rows], root)
    assert len(told) in (len(MODES), len(KINDS))
    assert all(one.startswith(f"{section}: 0 rows for the ") for one in told)


def test_a_section_that_stands_for_nothing_is_told(root):
    odd = [row("UNSAFE_ACTION", "Wave", kind) for kind in KINDS]
    told = problems([requirement(), *failures(), *actions(), *odd], root)
    assert told == ["Wave: no such section in safety_case/parts.py"]


@pytest.mark.parametrize(
    ("table", "section", "told"),
    [
        (PARTS, "relay: an output without telemetry", ["the link relay", "board"]),
        (PARTS, "a hot standby", ["standby"]),
        (PARTS, "other sources of the vehicle", ["imu", "mavros", "odometry"]),
        (ACTIONS, "Release of the flight block", ["FLIGHT_BLOCK_RELEASE"]),
        (ACTIONS, "Reset", ["safety/reset"]),
    ],
)
def test_what_the_code_has_needs_a_section(monkeypatch, table, section, told):
    monkeypatch.delitem(table, section)
    assert [one.split(" has no ")[0] for one in without_section()] == told


def test_the_page_of_single_failures_has_those_that_stay(tmp_path, monkeypatch):
    """In four parts, and first what nobody is told of; a stranger's row stands last."""
    monkeypatch.setattr("safety_case.documents.FOLDER", tmp_path)
    stays = {
        (0, "late"): ("GROUND, FLIGHT", "It is slow."),
        (0, "lost"): ("NOBODY", "One wire\nis one chance."),
        (0, "forged"): ("NOBODY", "It has no signature."),
        (5, "lost"): ("FLIGHT", "One trigger."),
        (9, "wrong"): ("NOBODY", "All run it."),
    }
    rows = failures()
    for (part, mode), (told, why) in stays.items():
        number = part * len(MODES) + list(MODES).index(mode)
        rows[number] = {**rows[number], "SINGLE": "MISSED, FALSE", "TOLD": told, "STAYS": why}
    single_failures.write(rows)
    text = (tmp_path / "made_single_failures.sdoc").read_text()
    assert f"5 of {len(rows)} failure modes stay." in text
    read = [
        "Nobody is told before it does harm",
        "All run it.",  # it concerns all vehicles
        "One wire is one chance.",
        "An alarm in flight: land",
        "One trigger.",
        "and an alarm in flight",
        "It is slow.",
        "A stranger on a wire",
        "It has no signature.",
    ]
    places = [text.index(one) for one in read]
    assert places == sorted(places)
    assert "in flight nothing tells" not in text, "a part that has no row is left out"
    assert text.count("- missed deploy\n") == text.count("   false deploy\n") == 5
    assert text.count("[LINK: ") == 5
    assert "in mavlink, both" in text


@pytest.mark.parametrize(
    ("section", "names"),
    [
        ("mavlink_parachute: the parachute and its wire", {"mavlink", "both"}),
        ("mavlink_parachute: the autopilot", {"mavlink", "relay", "upf", "both"}),
        ("upf_can: the trigger", {"upf", "both"}),
        ("umbilical: the flight computer and the cable", {"umbilical"}),
        ("relay: an output without telemetry", {"relay"}),
        ("the supervisor", {"mavlink", "relay", "umbilical", "upf", "both"}),
    ],
)
def test_each_part_is_of_the_wirings_that_have_it(section, names):
    assert {*carried_by(section)} == names


def git(folder, *arguments):
    person = ("-c", "user.name=a", "-c", "user.email=a@b.invalid")
    subprocess.run(["git", *person, *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def history(tmp_path, monkeypatch):
    """A repository with a page that a run wrote; the page's words were changed later."""
    monkeypatch.setattr("safety_case.evidence.ROOT", tmp_path)
    git(tmp_path, "init", "-q")
    page = tmp_path / "docs" / "evidence" / "fall.md"
    page.parent.mkdir(parents=True)
    for number, words in enumerate(("Falls.", "Falls, in words.")):
        page.write_text(f"Written by `make fall`: 12 s, here.\n\n{words}\n")
        git(tmp_path, "add", ".")
        git(tmp_path, "commit", "-qm", str(number))
    return tmp_path


def test_a_page_is_as_old_as_its_numbers(history):
    first = subprocess.check_output(["git", "rev-parse", "HEAD~1"], cwd=history, text=True)
    told = evidence.age("fall.md")
    assert f"commit {first[:7]}" in told
    assert told.endswith("; unchanged since: profiles, supervisor, campaign.")


def test_what_changed_since_a_page_was_written_is_counted(history):
    for number in range(2):
        path = history / "config" / "profiles" / f"{number}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
        git(history, "add", ".")
        git(history, "commit", "-qm", "a profile")
    assert evidence.age("fall.md").endswith("; commits since: profiles 2.")


@pytest.mark.parametrize("way", ["no repository", "shallow", "not committed"])
def test_a_page_whose_age_nobody_knows_says_so(history, tmp_path_factory, monkeypatch, way):
    folder, name = tmp_path_factory.mktemp("elsewhere"), "fall.md"
    if way == "shallow":
        git(folder, "clone", "-q", "--depth", "1", history.as_uri(), ".")
    elif way == "not committed":
        folder, name = history, "new.md"
    monkeypatch.setattr("safety_case.evidence.ROOT", folder)
    assert "when it was written is not known" in evidence.age(name)


def test_the_introduction_says_of_each_page_how_old_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr("safety_case.documents.FOLDER", tmp_path)
    evidence.write()
    text = (tmp_path / "made_evidence.sdoc").read_text()
    for path in (ROOT / "docs" / "evidence").glob("*.md"):
        assert f"- ``docs/evidence/{path.name}``: " in text
    assert (
        "\n[DOCUMENT_FROM_FILE]\nFILE: made_evidence.sdoc\n"
        in (FOLDER / "introduction.sdoc").read_text()
    )


def test_each_document_has_its_version(tmp_path, monkeypatch):
    written = [*FOLDER.glob("*.sdoc")]
    monkeypatch.setattr("safety_case.documents.FOLDER", tmp_path)
    thresholds.write()
    for path in [*written, *tmp_path.glob("*.sdoc")]:
        assert "\nVERSION: @GIT_VERSION\n" in path.read_text(), path.name


def test_the_page_that_compares_says_what_was_scaled_as_its_code_does():
    assert CURVES in (ROOT / "docs" / "evidence" / "compare.md").read_text()


def test_the_shares_in_the_mapping_are_those_of_the_page_that_compares():
    page = (ROOT / "docs" / "evidence" / "compare.md").read_text()
    row = next(line for line in page.splitlines() if line.startswith("| chute_ros |"))
    aeroplanes, _, multirotors, _ = (
        round(float(one)) for one in re.findall(r"\(([\d.]+) %\)", row)
    )
    told = f"compare.md: {multirotors} % of multirotors, {aeroplanes} % of aeroplanes"
    assert told in (FOLDER / "mapping.sdoc").read_text()


@pytest.mark.parametrize("profile", ["by_hand", "fixed_wing", "multirotor", "rocket"])
def test_a_threshold_without_its_why_is_told(tmp_path, profile):
    text = (ROOT / "config" / "profiles" / f"{profile}.yaml").read_text()
    path = tmp_path / "cut.yaml"
    path.write_text(text)
    assert list(thresholds.problems(tmp_path)) == []
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    path.write_text("\n".join(lines))
    read = yaml.safe_load(text)
    values = {*read, *read.get("measurements", ())} - {"profile", "rules", "measurements"}
    told = {one.split(" has no why")[0] for one in thresholds.problems(tmp_path)}
    of_values = {one for one in told if " of the rule " not in one}
    assert of_values == {f"cut.yaml: {one}" for one in values}
    assert told - of_values, "limits of rules whose why stood in a comment"


def test_a_limit_of_a_rule_without_its_why_is_told(tmp_path):
    text = (ROOT / "config" / "profiles" / "multirotor.yaml").read_text()
    moved = text.replace("tilt_deg, above: 60.0, weight", "tilt_deg, above: 61.5, weight")
    (tmp_path / "moved.yaml").write_text(moved.replace("    for: 0.2\n", "    for: 0.21\n", 1))
    first, second = thresholds.problems(tmp_path)
    assert first.startswith("moved.yaml: tilt_deg above 61.5 of the rule 'excess tilt' has no why")
    assert second.startswith("moved.yaml: for 0.21 of the rule 'falling' has no why")


def test_a_rule_without_its_source_is_told(tmp_path):
    rules = "rules:\n  fall:\n    says: it falls\n"
    (tmp_path / "new.yaml").write_text(f"profile: new\n# m. ours.\nlow_height: 3.0\n{rules}")
    assert list(thresholds.problems(tmp_path)) == ["new.yaml: the rule 'fall' has no source"]


def test_the_page_of_thresholds_has_each_rule_of_each_profile(tmp_path, monkeypatch):
    monkeypatch.setattr("safety_case.documents.FOLDER", tmp_path)
    thresholds.write()
    text = (tmp_path / "made_thresholds.sdoc").read_text()
    for profile in ("by_hand", "fixed_wing", "multirotor", "rocket"):
        assert f"TITLE: {profile}" in text
    assert "**uncommanded sink**" in text
    # What stands above a value in the profile is why it is so.
    assert "AP\\_PARACHUTE\\_ALT\\_MIN\\_DEFAULT" in text
    assert "one motor of four gone leaves three quarters" in text, "a comment in a rule"
    assert "Limits that several rules share" in text
