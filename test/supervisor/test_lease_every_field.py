"""Every field of a lease after each event."""

import math

import pytest

from chute_ros.errors import ParameterError
from chute_ros.supervisor.epochs import LARGEST_EPOCH
from chute_ros.supervisor.lease import (
    TRANSITIONS,
    Claim,
    Event,
    Lease,
    LeaseConfig,
    Role,
)

FIRST = LeaseConfig("a", 0, standby=True, timeout=0.5, listen=4.0)
T = 1000.0


def claim(name: str, epoch: int) -> Claim:
    return Claim(name, 0, epoch, leading=True, empty=False)


@pytest.mark.parametrize("timeout", [0.15, 60.0])
def test_a_timeout_may_reach_its_limits(timeout: float) -> None:
    assert LeaseConfig("a", timeout=timeout).timeout == timeout


def test_a_timeout_may_not_pass_its_limit() -> None:
    with pytest.raises(ParameterError, match="lease_timeout"):
        LeaseConfig("a", timeout=60.5)


def test_one_that_is_alone_waits_for_nobody() -> None:
    assert Lease.begin(LeaseConfig("a"), T).waiting_since == T


def test_one_that_was_deaf_looks_for_a_leader_anew() -> None:
    lease = Lease(Role.FOLLOWING, T - 10.0, looked_at=T, leader="b", leader_heard=T)
    lease, event = lease.looked(FIRST, T + 0.6)
    assert (event, lease.role, lease.leader) == (None, Role.FOLLOWING, "b")
    assert lease.waiting_since == T + 0.6
    assert math.isnan(lease.leader_heard)
    assert lease.deadline(FIRST) == T + 1.1


def test_one_that_was_deaf_while_it_listened_after_its_start_listens_on() -> None:
    lease, event = Lease.begin(FIRST, T).looked(FIRST, T)
    lease, event = lease.looked(FIRST, T + 0.6)
    assert (event, lease.waiting_since) == (None, T + 4.0)


def test_one_that_takes_over_has_no_leader_any_more() -> None:
    lease = Lease(Role.FOLLOWING, T - 10.0, looked_at=T, leader="b", leader_heard=T)
    lease, event = lease.looked(FIRST, T + 0.5)
    assert (event, lease.role, lease.leader) == (Event.SILENCE, Role.LEADING, "")
    assert lease.waiting_since == T + 0.5
    assert math.isnan(lease.leader_heard)


def test_one_that_is_outranked_follows_the_other_from_now_on() -> None:
    lease = Lease(Role.LEADING, T, looked_at=T)
    lease, event = lease.heard(FIRST, claim("a", 4), claim("b", 8), T + 1.0)
    assert (event, lease.role, lease.leader) == (Event.OUTRANKED, Role.FOLLOWING, "b")
    assert (lease.waiting_since, lease.leader_heard) == (T + 1.0, T + 1.0)


def test_of_two_with_the_same_claim_neither_yields() -> None:
    lease = Lease(Role.LEADING, T, looked_at=T)
    lease, event = lease.heard(FIRST, claim("a", 4), claim("b", 4), T + 1.0)
    assert (event, lease.role, lease.same_rank) == (None, Role.LEADING, "b")


def test_one_that_was_refused_remembers_the_newer_epoch() -> None:
    lease, event = Lease(Role.LEADING, T, looked_at=T, leader="").refused(9, T)
    assert (event, lease.highest, lease.leader) == (Event.REFUSED, 9, "")
    assert lease.next_epoch(FIRST, 4) == 12
    assert math.isnan(lease.leader_heard)


@pytest.mark.parametrize(("later", "deadline"), [(0.0, 1.25), (0.125, 1.625)])
def test_one_that_heard_a_link_just_so_long_ago_is_not_deaf(later: float, deadline: float) -> None:
    lease = Lease(Role.FOLLOWING, T - 10.0, looked_at=T + 0.75, leader="b", leader_heard=T + 0.75)
    lease, event = lease.looked(FIRST, T + 1.0 + later, link_heard=T)
    assert (event, lease.deadline(FIRST)) == (None, T + deadline)


def test_one_that_took_over_as_it_hears_more_forgets_that_with_the_lease() -> None:
    lease = Lease(
        Role.FOLLOWING, T, looked_at=T, leader="b", leader_heard=T, hears_more_since=T - 0.25
    )
    lease, event = lease.looked(FIRST, T + 0.25)
    assert (event, lease.role, lease.leader) == (Event.HEARS_MORE, Role.LEADING, "")
    assert lease.waiting_since == T + 0.25
    lease, event = lease.looked(FIRST, T + 1.0)
    assert event is Event.OVERSLEPT
    assert lease.deadline(FIRST) == T + 1.5, "it has to hear less anew"


@pytest.mark.parametrize(
    ("other", "hearer", "why"),
    [
        (Claim("x", 0, 4, leading=True, empty=False), 0, ""),
        (Claim("x", 4, 4, leading=True, empty=False), 0, "rank 4 (0 to 3)"),
        (Claim("x", -1, 3, leading=True, empty=False), 0, "rank -1 (0 to 3)"),
        (
            Claim("x", 1, 6, leading=True, empty=False),
            0,
            "epoch 6, which is none of rank 1",
        ),
        (Claim("x", 2, LARGEST_EPOCH - 1, leading=True, empty=False), 3, ""),
        (
            Claim("x", 2, LARGEST_EPOCH - 1, leading=True, empty=False),
            2,
            "epoch 4294967294, above which there is none",
        ),
    ],
)
def test_a_claim_may_leave_the_very_last_number_and_no_less(
    other: Claim, hearer: int, why: str
) -> None:
    assert other.implausible(hearer) == why


def test_the_table_once_more() -> None:
    told = {f"{role.name} {event.name} {to.name}" for (role, event), to in TRANSITIONS.items()}
    assert told == {
        "FOLLOWING SILENCE LEADING",
        "FOLLOWING HEARS_MORE LEADING",
        "FOLLOWING KNOWS_MORE LEADING",
        "LEADING OUTRANKED FOLLOWING",
        "LEADING OVERSLEPT FOLLOWING",
        "LEADING REFUSED FOLLOWING",
        "LEADING OVERTAKES LEADING",
    }


def test_one_that_is_told_nothing_else_is_alone_and_begins_with_the_first_number() -> None:
    alone = LeaseConfig("a")
    assert (alone.rank, alone.standby) == (0, False)
    assert (alone.timeout, alone.listen, alone.deaf_after) == (0.5, 4.0, 1.0)
    second = LeaseConfig("b", 1)
    lease = Lease.begin(second, T)
    assert (lease.leader, lease.same_rank) == ("", "")
    assert lease.next_epoch(second, 0) == 1
