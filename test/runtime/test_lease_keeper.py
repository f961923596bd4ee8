"""What a supervisor says of the others that it hears, and how long it says it."""

from typing import Any

import pytest

from chute_ros.runtime.lease_keeper import LeaseKeeper
from chute_ros.runtime.topics import LeaseClaim
from chute_ros.supervisor.epochs import RANKS, epoch_above
from chute_ros.supervisor.lease import Claim, LeaseConfig
from chute_ros.supervisor.state import State

T = 1000.0


class Supervisor:
    """As far as its lease goes: the owner, and the way out of it."""

    def __init__(self) -> None:
        self.state = State(epoch=RANKS, started_at=T)
        self.said: list[str] = []

    def links_heard(self, now: float) -> int:
        return 1

    def lease_event(self, *event: Any) -> None:
        pass

    def follow(self, state: State) -> None:
        raise AssertionError("nothing was told to follow")

    def publish(self, message: Any) -> int:
        return 0

    def log(self, notice: Any) -> None:
        self.said.append(notice.text)


def heard(keeper: LeaseKeeper, name: str, rank: int, now: float) -> None:
    claim = Claim(name, rank, epoch_above(RANKS, rank), False, True, 1)
    keeper.claim(LeaseClaim(claim, "another", now - T, "", ""), now)


@pytest.mark.parametrize(("name", "told"), [("b", "has rank 0"), ("a", "is called a")])
def test_a_rank_that_another_has_as_well_is_told_while_that_is_heard(name, told):
    """Given one of its rank, with its own name or another: gone, or given a rank of its own, it
    is a trouble no more. An operator who had mended it read it until the next start."""
    config, owner = LeaseConfig("a", 0, standby=True), Supervisor()
    keeper = LeaseKeeper(config, "ours", owner, owner, T)
    heard(keeper, name, 0, T + 40.0)
    assert f"{told} as well" in keeper.trouble(T + 40.0)
    for step in range(1, 10 * RANKS):
        now = T + 40.0 + step * config.timeout / 10.0
        heard(keeper, "b", 1, now)
        assert keeper.trouble(now)
    now = T + 40.0 + RANKS * config.timeout
    heard(keeper, "b", 1, now)
    assert keeper.trouble(now) == ""
    assert len(owner.said) == 1
