"""scripts/without.py takes away what it names, and nothing else."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence

import pytest
import without
from without import (
    FOLDER,
    HEURISTICS,
    changed,
    concerns,
    contributions,
    deciding_rules,
    differing,
    fly,
    profile_parts,
    wrong_of,
)

from chute_ros.campaign.scenario import PROFILES
from chute_ros.supervisor.profile_reader import read_profile


@pytest.mark.parametrize("name", HEURISTICS)
def test_each_heuristic_is_where_it_is_said_to_be(name: str) -> None:
    where, attribute, instead = HEURISTICS[name]
    before = getattr(where, attribute)
    assert callable(before) is callable(instead)
    assert before != instead


def test_each_part_of_a_profile_is_taken_from_that_one() -> None:
    for name in PROFILES:
        profile = read_profile((FOLDER / f"{name}.yaml").read_text(), name, ("any",))
        for part in profile_parts():
            left = changed(profile, part)
            if not part.startswith(f"{name}: "):
                assert left == profile
                continue
            rule = part.split(": ")[1]
            others = [one for one in left.rules if one.name != rule]
            assert others == [one for one in profile.rules if one.name != rule]
            (before,) = (one for one in profile.rules if one.name == rule)
            after = [one for one in left.rules if one.name == rule]
            if ": " not in part.removeprefix(f"{name}: "):
                assert after == []
            else:
                assert len(after[0].conditions) == len(before.conditions) - 1
                assert 0.0 < after[0].needed <= before.needed


def test_a_part_of_one_profile_is_not_flown_with_another() -> None:
    assert concerns((), "rocket")
    assert not concerns(("multirotor: falling",), "rocket")
    assert concerns(("multirotor: falling", "rocket: critical sink"), "rocket")
    assert concerns(("flight: a ground below home",), "rocket")


def test_what_differs_is_told_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    base, wrong = {"1": "LATE", "2": "FALSE"}, {"2": "FALSE", "3": "MISSED"}
    assert differing(("flight: a ground below home",), base, wrong) == (["3"], ["1"])
    # 910000057 is a rocket whose drogue does not come by itself; another rule orders it low down.
    rule = "rocket: critical sink"
    assert wrong_of(fly((), ("910000057",))) == {}
    assert wrong_of(fly((rule,), ("910000057",))) == {"910000057": "LATE"}
    assert without.some(["3"], wrong) == "1 (3 MISSED)"


class HerePool:
    """Flies in this process."""

    def __init__(self) -> None:
        self.works: list[tuple[Sequence[str], Sequence[str]]] = []

    def shared(self, names: Sequence[str], flights: Sequence[str]) -> dict[str, without.Outcome]:
        return fly(names, flights)

    def each(
        self, works: Sequence[tuple[Sequence[str], Sequence[str]]]
    ) -> list[dict[str, without.Outcome]]:
        self.works += works
        return [fly(*one) for one in works]


def test_a_rule_that_alone_saves_a_flight_is_told_and_one_that_decided_nothing_is_not_flown() -> (
    None
):
    pool = HerePool()
    rows = contributions(pool, ("910000057",))
    assert [f"{row[0]}: {row[1]}" for row in rows] == deciding_rules()
    told = {row[:2]: row[2:] for row in rows}
    assert told["rocket", "critical sink"] == ("1", "0", "1", "0", "0", "")
    assert told["multirotor", "free fall"] == ("0", "0", "0", "0", "0", "")
    assert pool.works == [(("rocket: critical sink",), ["910000057"])]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["multirotor: fallin"], "there is no 'multirotor: fallin': need 'multirotor: falling'"),
        (["no such thing"], "need one that --list has"),
        (["--rules-page", "/dev/full/x"], "/dev/full/x: Not a directory"),
        (["--jobs", "0"], "0: need a whole number, 1 or more"),
        (["--python", "/no/such"], "'/no/such' is no command here"),
    ],
)
def test_a_mistake_is_told_in_one_line(
    arguments: list[str],
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["without", *arguments])
    with pytest.raises(SystemExit) as ended:
        without.main()
    assert ended.value.code == 2
    assert told in capsys.readouterr().err.splitlines()[-1]


def test_a_process_that_ends_by_itself_is_started_again_and_then_told() -> None:
    command = [sys.executable, without.__file__, "--flights", "1", "--python", "false"]
    done = subprocess.run(
        [*command, "rocket: critical sink"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "without: one of its processes ended 3 times: exit code 1"
    )
