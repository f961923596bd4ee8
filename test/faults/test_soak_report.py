"""The page of the soak: what was lost and how long it took by kind of fault, and what grew."""

from xml.etree import ElementTree

from faults.soak_measure import LIMITS
from faults.soak_picture import picture
from faults.soak_plan import MOTOR, Plan
from faults.soak_processes import Sample
from faults.soak_report import by_cause, by_kind, findings, holds, not_flat, write
from faults.soak_run import Result


def loops(count, leak=0.0):
    """So many quiet loops of a kind; umbilical is started anew in the middle."""
    return [
        Result(
            Plan(number, "disk full", "ROS home", 1.0, 0.0),
            2,
            heartbeats_missed=number % 3,
            until_whole=1.0 + number / 100.0,
            samples={
                ("upf_can", 1): Sample(140.0 + leak * number, 20, 16),
                ("umbilical", 1 + (number > count // 2)): Sample(80.0, 24, 16),
                ("rocket", 1): Sample(24.0, 7, 2),
            },
        )
        for number in range(count)
    ]


def test_each_kind_has_its_row_with_medians_and_extremes():
    rows = by_kind(loops(11)).splitlines()
    assert len(rows) == 3, "a head, a line, and the one kind that was flown"
    assert rows[2] == "| disk full | 11 | 1 / 2 | 0 | 0 | 0 | 1.05 / 1.10 s | 0 |"


def test_a_cause_has_its_row_and_what_was_not_measured_no_number():
    caused = Result(
        Plan(4, "SIGSTOP", "first", 1.0, 0.0, cause=MOTOR), 1, until_kill=0.8, until_out=0.9
    )
    assert by_cause([*loops(4), caused]).splitlines()[2] == (
        "| a motor fails | 1 | 0.80 / 0.80 s | 0.90 / 0.90 s |"
    )
    assert "| - |" in by_kind([caused])


def test_a_leak_is_a_finding_and_a_process_that_is_flat_is_none():
    assert not_flat(loops(60)) == []
    (grown,) = not_flat(loops(60, leak=0.5))
    assert grown.startswith("memory of upf_can grew from ")
    assert "(+50.0 in 100 loops)" in grown


def test_a_process_that_was_started_again_is_measured_by_its_longest_life():
    table = holds(loops(60))
    assert "| umbilical | 26 |" in table
    assert "rocket" not in table, "simulated devices are not asked"
    assert all(measure in table for measure in LIMITS)


def test_a_finding_names_its_loop_and_the_picture_is_one():
    some = loops(30)
    some[7].findings.append("upf came out without a cause")
    said = findings(some, ["upf_can ended with code 1 after SIGINT"])
    assert "- loop 7 (2 supervisors; disk full: ROS home for 1.0 s): upf came out" in said
    assert "- upf_can ended with code 1 after SIGINT" in said
    assert findings(loops(3), []) == "None."
    drawn = ElementTree.fromstring(picture(some))
    assert len([one for one in drawn.iter() if one.tag.endswith("polyline")]) == 4


def test_the_page_says_what_it_was_given(tmp_path):
    names = ["loops", "seed", "machine", "load", "answer", "whole", "took", "faults", "causes"]
    names += ["limits", "holds", "picture", "findings"]
    page = tmp_path / "soak.md"
    write(page, **{name: f"<{name}>" for name in names})
    assert [name for name in names if f"<{name}>" not in page.read_text()] == []
