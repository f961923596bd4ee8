"""What is said of the parameters elsewhere is what the nodes declare."""

import re
from importlib.metadata import entry_points
from pathlib import Path

import pytest
import yaml

from chute_ros.tools import parameter_docs

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("path", parameter_docs.CONFIGS, ids=str)
def test_each_config_file_is_up_to_date(path: Path) -> None:
    assert (ROOT / path).read_text() == parameter_docs.config_text(path), "run: make docs"


def test_every_config_file_is_written_from_the_tables() -> None:
    assert {*ROOT.glob("config/*_vehicle.yaml")} == {
        ROOT / path for path in parameter_docs.CONFIGS
    }


def test_the_tables_of_parameters_are_up_to_date() -> None:
    text = (ROOT / parameter_docs.PARAMETERS).read_text()
    assert text == parameter_docs.parameters_text(text), "run: make docs"


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_bytes()) <= 8000


def test_the_table_of_executables_has_each_and_no_other() -> None:
    text = (ROOT / "docs/reference/interfaces.md").read_text()
    table = text.partition("## Executables")[2].partition("\n## ")[0]
    named = re.findall(r"^\| `(\w+)` \|", table, flags=re.MULTILINE)
    installed = entry_points(group="console_scripts")
    scripts = {one.name for one in installed if one.value.startswith("chute_ros.")}
    assert len(scripts) >= 12
    assert sorted(named) == sorted(scripts)


def test_the_guide_shows_as_many_rules_as_a_multirotor_has() -> None:
    profile = yaml.safe_load((ROOT / "config/profiles/multirotor.yaml").read_text())
    shown = re.findall(r"rules: \d+ of (\d+) active", (ROOT / "docs/guide/command.md").read_text())
    assert {*map(int, shown)} == {len(profile["rules"])}


def test_the_table_of_measurements_is_up_to_date() -> None:
    text = (ROOT / parameter_docs.RULES).read_text()
    assert text == parameter_docs.rules_text(text), "run: make docs"


def test_the_table_of_a_description_is_up_to_date() -> None:
    text = (ROOT / parameter_docs.DESCRIPTION).read_text()
    assert text == parameter_docs.description_text(text), "run: make docs"


def test_each_file_on_the_way_of_a_frame_is_there() -> None:
    text = (ROOT / "docs/design/way_of_a_frame.md").read_text()
    # A name alone is of the folder that was named before it on its line.
    named, missing = 0, []
    for line in text.splitlines():
        folder = ""
        for found in re.findall(r"(?:[\w*]+/)*\w+\.py", line):
            folder = found.rpartition("/")[0] or folder
            named += 1
            if not [*(ROOT / "chute_ros").glob(f"{folder}/{found.rpartition('/')[2]}")]:
                missing.append(found)
    assert (named > 25, missing) == (True, [])


def test_each_link_between_pages_leads_somewhere() -> None:
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]
    broken, links = [], 0
    for page in pages:
        for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text()):
            if "://" not in target:
                links += 1
                if not (page.parent / target).exists():
                    broken.append(f"{page.relative_to(ROOT)}: {target}")
    assert (links > 50, broken) == (True, [])
