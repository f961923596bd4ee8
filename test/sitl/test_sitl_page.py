"""docs/evidence/real_autopilots.md is written autopilot by autopilot."""

from sitl.judge import Verdict
from sitl.page import Flown, with_autopilot
from sitl.results import add, load


def run(kind: str, took: float, wrong: str = "") -> Flown:
    verdict = Verdict(["released at 27 m"], {"failure to release": took}, [wrong] if wrong else [])
    return Flown(kind, "1.2.3 (abcd)", "motor-30", "one motor dead", verdict)


def test_the_times_of_several_runs_are_told_with_their_middle_and_ends():
    page = with_autopilot("", [run("PX4", took) for took in (0.9, 0.8, 1.0)])
    assert "## PX4 1.2.3 (abcd)" in page
    assert "3 runs, 0 of them wrong. Load of the machine meanwhile: 0.0 to 0.0" in page
    assert (
        "| `motor-30`: one motor dead | 3 | released at 27 m | failure to release 0.90 s "
        "(0.80 to 1.00) | right |"
    ) in page


def test_what_was_wrong_stands_in_its_row():
    page = with_autopilot("", [run("PX4", 0.9), run("PX4", 1.4, "late: released after 1.40 s")])
    assert "2 runs, 1 of them wrong." in page
    assert "**late: released after 1.40 s**" in page


def test_an_autopilot_that_is_flown_again_leaves_the_others_alone():
    page = with_autopilot("", [run("PX4", 0.9)])
    page = with_autopilot(page, [run("ArduCopter", 0.8)])
    assert page.index("## ArduCopter") < page.index("## PX4")
    again = with_autopilot(page, [run("PX4", 0.7)])
    assert "0.80 s" in again
    assert "0.70 s" in again
    assert "0.90 s" not in again


def test_runs_are_kept_and_added_to(tmp_path):
    kept = tmp_path / "results"
    assert load(kept, "PX4") == []
    runs = [run("PX4", 0.9), run("PX4", 1.4, "late")]
    for one in (runs[0], run("ArduCopter", 0.8), runs[1]):
        add(kept, one)
    assert load(kept, "PX4") == runs
