"""The product on bodies of RotorPy and JSBSim: the stored tapes (tapes/README.md), each flown."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from campaign_bench import FOLDER, scenario

from chute_ros.campaign.flight import fly
from chute_ros.campaign.judge import Count, judge
from chute_ros.campaign.scenario import Failure
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.tapes import TapeFile, on_tape
from chute_ros.sim.tape import Tape, read_tapes

STORED = Path(__file__).parent / "tapes" / "bodies.tapes"
SHIPPED = Shipped(FOLDER, TapeFile(STORED, only=True))
TAPES = read_tapes(STORED)
#: Tape -> what it is counted as, where that is not correct.
OTHERWISE = {
    # It hovers at 18 m as its thrust is lost, and is on the ground 1.4 s after that shows.
    "multirotor 3": Count.NO_TIME,
}


class _Calm(random.Random):
    """Nothing else goes wrong."""

    def random(self) -> float:
        return 0.0


def test_the_stored_tapes_are_of_all_kinds() -> None:
    labels = [one.label for one in TAPES]
    assert {one.profile for one in labels} == {"multirotor", "fixed_wing"}
    assert {one.body.split()[0] for one in labels} == {"rotorpy", "jsbsim"}
    assert sum(one.ends_hard for one in labels) >= 8
    assert sum(one.lost_at != one.lost_at for one in labels) >= 8
    assert STORED.stat().st_size <= 300_000


@pytest.mark.parametrize("tape", TAPES, ids=lambda tape: tape.label.name)
def test_each_is_released_in_time_or_left_alone(tape: Tape) -> None:
    plain = scenario(Failure.NOTHING, profile=tape.label.profile)
    judged = judge(fly(on_tape(plain, tape, _Calm()), SHIPPED))
    told = f"{tape.label.failed}, {tape.label.parameters}: {judged.why}"
    assert judged.count is OTHERWISE.get(tape.label.name, Count.CORRECT), told


@pytest.mark.parametrize("name", ["multirotor 4", "aeroplane 4"])
def test_with_rules_that_take_a_minute_the_same_tapes_are_missed(
    name: str, tmp_path: Path
) -> None:
    for profile in ("multirotor", "fixed_wing"):
        text = (FOLDER / f"{profile}.yaml").read_text(encoding="utf-8")
        slow = re.sub(r"^    for: .*$", "    for: 60.0", text, flags=re.MULTILINE)
        (tmp_path / f"{profile}.yaml").write_text(slow, encoding="utf-8")
    shipped = Shipped(tmp_path, TapeFile(STORED, only=True))
    tape = shipped.tape(name)
    plain = scenario(Failure.NOTHING, profile=tape.label.profile)
    assert judge(fly(on_tape(plain, tape, _Calm()), shipped)).count is Count.MISSED
