"""`campaign --vehicle`: what does not fit is refused, what was found is printed and drawn."""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import pytest
from command_bench import assert_refused, call

from chute_ros.campaign import heights as needed
from chute_ros.campaign.cases import Case
from chute_ros.campaign.heights import CaseFlights
from chute_ros.campaign.needed_height import Fall, FallStage, Needed
from chute_ros.campaign.scenario import Failure
from chute_ros.tools import campaign_command as campaign
from chute_ros.tools import campaign_vehicle
from chute_ros.tools.heights_page import heights, times
from chute_ros.tools.heights_picture import picture

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "config" / "vehicles"
DRONE = str(EXAMPLES / "example_multirotor.yaml")
PLANE = str(EXAMPLES / "example_aeroplane.yaml")

run = partial(call, campaign)


def found(name: str, *every: float) -> CaseFlights:
    """A failure whose flights need these heights, m, and take a tenth of it in s."""
    case = Case(name, "it fails", Failure.MOTOR)
    flights = []
    for seed, height in enumerate(every):
        lost = min(height, 80.0)
        stages = (FallStage(lost / 40.0, lost / 4.0), FallStage(lost / 20.0, lost / 2.0))
        one = Fall(80.0, *stages, FallStage(lost / 10.0, lost), math.nan)
        saved = height < 80.0
        usual = one if saved else Fall(80.0, FallStage(), FallStage(), FallStage(), 20.0)
        flights.append(Needed(seed, height, usual, saved, one if saved else None))
    return CaseFlights(case, tuple(flights))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--replay", "7"], "argument --vehicle: not with --replay: the failures of a described"),
        (["--tapes-only"], "argument --vehicle: not with --tapes-only: "),
        (["--resume", "/tmp/kept"], "argument --vehicle: not with --resume: "),
        (["--each", "3"], "argument --vehicle: not with --each: "),
        (["--scheduler", "tcp://h:1"], "argument --vehicle: not with --scheduler: "),
        (["--plan", "1000"], "argument --vehicle: not with --plan: "),
        (["--core-hour-price", "1"], "argument --vehicle: not with --core-hour-price: "),
        (["--failures", "/tmp/wrong"], "argument --vehicle: not with --failures: "),
        (["--flights", "0"], "argument --flights: 0: need a whole number, 1 or more"),
        (["--faults", "-1"], "argument --faults: -1: need a whole number, 1 or more"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, words, monkeypatch, capsys):
    assert_refused(campaign, monkeypatch, capsys, ["--vehicle", DRONE, *arguments], words)


def test_two_files_of_one_name_would_have_one_picture(monkeypatch, capsys):
    words = "argument --vehicle: two files have the same name: rename one"
    assert_refused(campaign, monkeypatch, capsys, ["--vehicle", DRONE, DRONE], words)


def test_faults_are_for_described_vehicles(monkeypatch, capsys):
    words = "argument --faults: only with --vehicle"
    assert_refused(campaign, monkeypatch, capsys, ["--faults", "2"], words)


def test_a_description_that_is_wrong_is_refused_with_its_line(tmp_path, monkeypatch, capsys):
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(Path(DRONE).read_text().replace("mass: 6.0", "mass: 6000"))
    words = "wrong.yaml, line 6: mass (kg) is 6000: need 0.1 to 1000"
    assert_refused(campaign, monkeypatch, capsys, ["--vehicle", PLANE, str(wrong)], words)


def test_a_profile_of_its_own_that_is_wrong_is_refused_with_its_line(
    tmp_path, monkeypatch, capsys
):
    (tmp_path / "mine.yaml").write_text("profile: mine\nrules: {}\n")
    file = tmp_path / "drone.yaml"
    file.write_text(Path(DRONE).read_text().replace("profile: multirotor", "profile: mine.yaml"))
    words = "mine.yaml, line 2: rules is empty"
    assert_refused(campaign, monkeypatch, capsys, ["--vehicle", str(file)], words)


def test_its_page_and_pictures_go_over_nothing_else(tmp_path, monkeypatch, capsys):
    drone, page = tmp_path / "drone.yaml", tmp_path / "a.md"
    drone.write_text(Path(DRONE).read_text())
    (tmp_path / "a.drone.svg").write_text("mine")
    given = ["--vehicle", str(drone), "--page"]
    words = f"argument --page: {tmp_path}/a.drone.svg exists and is no SVG picture: remove it, or"
    assert_refused(campaign, monkeypatch, capsys, [*given, str(page)], words)
    drone.write_text("# A vehicle\n\n" + drone.read_text())
    words = f"argument --page: {drone} is read here: nothing is written over it: name another"
    assert_refused(campaign, monkeypatch, capsys, [*given, str(drone)], words)


def test_it_prints_its_tables_and_writes_its_page_and_its_picture(monkeypatch, tmp_path, capsys):
    # All failures are flown in test/campaign/test_needed_height.py.
    every = needed.cases
    few = ("motor lost, level", "power lost, level")
    monkeypatch.setattr(
        needed, "cases", lambda *given: [c for c in every(*given) if f"{c.name}, {c.flown}" in few]
    )
    page = tmp_path / "mine.md"
    options = ("--flights", "1", "--seed", "5", "--jobs", "1", "--page", str(page))
    run(monkeypatch, "--vehicle", DRONE, *options)
    told = capsys.readouterr().out
    assert told.startswith("example multirotor, 1 flights of each failure:\n")
    assert re.search(r"^\| motor lost, level \| \d+\.\d m \|", told, re.M)
    text = page.read_text()
    assert f"`campaign --vehicle {DRONE} --flights 1 --seed 5 --page {page}`: " in text
    assert "this page is no certificate" in text
    assert "| `mass` | 6 kg | mass at the take-off |" in text
    assert "**No height is enough for:** power lost, level (1 of 1 were not saved" in text
    assert "1 flights of each failure are too few to bound 99 % of them: that takes 299" in text
    assert "Lower than 10 m above the take-off no rule releases the parachute" in text
    drawn = tmp_path / "mine.example_multirotor.svg"
    assert f"]({drawn.name})" in text
    assert ElementTree.fromstring(drawn.read_text()).tag.endswith("svg")


def test_a_failure_for_which_no_height_is_enough_is_said_so():
    rows = heights([found("falls", *range(10, 20)), found("silent", *[math.inf] * 10)])
    falls, silent = rows.splitlines()[2:]
    assert falls.startswith("| falls, level | 14.5 m | **19.0 m** | 74.1 % | 3.6 + 3.6 + 7.2 m |")
    assert falls.endswith("| 10 of 10 (at least 74.1 %) |")
    assert silent.startswith("| silent, level | no height | **no height** |")
    assert silent.endswith("| 0 of 10 (at least 0 %) |")


def test_times_are_medians_and_99th_percentiles_of_those_that_were_carried():
    row = times([found("falls", *range(10, 20), math.inf)]).splitlines()[2]
    assert row.startswith("| falls, level | 10 | 0.36 / 0.47 s | 0.36 / 0.47 s |")
    assert row.endswith("| 0.72 / 0.95 s | 1.45 / 1.90 s |")


def test_the_picture_has_a_row_for_each_failure_and_a_dot_for_each_flight():
    every = [found("falls", *range(10, 20)), found("silent & lost", *[math.inf] * 3)]
    drawn = ElementTree.fromstring(picture(every, 10.0))
    texts = [one.text for one in drawn.iter("{http://www.w3.org/2000/svg}text")]
    assert {"falls, level", "silent & lost, level", "none saved"} <= {*texts}
    dots = [*drawn.iter("{http://www.w3.org/2000/svg}circle")]
    assert len(dots) == 10 + 1, "one of them is the legend's"


def test_enough_flights_are_flown_where_none_are_asked_for():
    assert campaign_vehicle.FLIGHTS == 299
