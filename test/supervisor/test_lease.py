"""Of several supervisors one leads: who takes over, who yields, and under which number."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import ParameterError
from chute_ros.supervisor.epochs import LARGEST_EPOCH, RANKS, epoch_above
from chute_ros.supervisor.lease import TRANSITIONS, Claim, Lease, LeaseConfig, LeaseEvent, Role

FIRST = LeaseConfig("a", 0, standby=True, timeout=0.5, listen=4.0)
SECOND = LeaseConfig("b", 1, standby=True, timeout=0.5, listen=4.0)
T = 1000.0


def claim(name: str, rank: int, epoch: int, leading: bool = True, empty: bool = False) -> Claim:
    return Claim(name, rank, epoch, leading, empty)


def hears(name: str, rank: int, links_heard: int, leading: bool = True) -> Claim:
    return knows(name, rank, False, links_heard, leading)


def knows(name: str, rank: int, empty: bool, links_heard: int, leading: bool) -> Claim:
    return Claim(name, rank, epoch_above(7, rank), leading, empty, links_heard)


def leading(config: LeaseConfig, since: float = T) -> Lease:
    return Lease(Role.LEADING, since, looked_at=since)


def following(config: LeaseConfig, heard: float = T) -> Lease:
    return Lease(Role.FOLLOWING, T - 10.0, looked_at=heard, leader="a", leader_heard=heard)


def test_one_that_is_alone_leads_at_once_however_long_it_slept():
    alone = LeaseConfig("a")
    lease = Lease.begin(alone, T)
    assert lease.role is Role.LEADING
    assert lease.deadline(alone) == math.inf
    assert lease.waiting_since == T
    lease, event = lease.looked(alone, T)
    lease, event = lease.looked(alone, T + 60.0)
    assert (lease.role, event) == (Role.LEADING, None)


def test_one_of_several_that_starts_looks_for_a_leader_before_it_leads():
    lease = Lease.begin(FIRST, T)
    assert lease.role is Role.FOLLOWING
    assert lease.deadline(FIRST) == pytest.approx(T + 4.5)
    event = None
    for tenth in range(45):
        lease, event = lease.looked(FIRST, T + tenth * 0.1)
        assert event is None
    lease, event = lease.looked(FIRST, T + 4.5)
    assert (lease.role, event) == (Role.LEADING, LeaseEvent.SILENCE)


def test_one_that_starts_beside_a_leader_follows_it():
    lease = Lease.begin(SECOND, T)
    own = claim("b", 1, 5, leading=False, empty=True)
    for tenth in range(100):
        lease, event = lease.heard(own, claim("a", 0, 8), T + tenth * 0.1)
        assert event is None
        lease, event = lease.looked(SECOND, T + tenth * 0.1)
        assert event is None
    assert (lease.role, lease.leader) == (Role.FOLLOWING, "a")


@pytest.mark.parametrize(("config", "wait"), [(FIRST, 0.5), (SECOND, 1.0)])
def test_silence_of_the_leader_is_a_takeover_the_first_in_rank_first(config, wait):
    lease = following(config)
    for tenth in range(1, round(wait * 10)):
        lease, event = lease.looked(config, T + tenth * 0.1)
        assert event is None
    lease, event = lease.looked(config, T + wait)
    assert event is LeaseEvent.SILENCE
    assert lease.role is Role.LEADING


def test_a_follower_that_was_deaf_itself_does_not_take_its_deafness_for_silence():
    lease = replace(following(SECOND), leader="a")
    lease, event = lease.looked(SECOND, T + 3.0)
    assert (event, lease.role, lease.leader) == (None, Role.FOLLOWING, "a")
    assert (lease.waiting_since, lease.deadline(SECOND)) == (T + 3.0, T + 4.0)
    assert math.isnan(lease.leader_heard)
    # What the leader said meanwhile is read now.
    lease, event = lease.heard(claim("b", 1, 8, leading=False), claim("a", 0, 8), T + 3.001)
    lease, event = lease.looked(SECOND, T + 3.4)
    assert (lease.role, event) == (Role.FOLLOWING, None)
    # And if it did fall silent, the takeover is only later.
    for tenth in range(35, 42):
        lease, event = lease.looked(SECOND, T + tenth * 0.1)
    assert (lease.role, event) == (Role.LEADING, LeaseEvent.SILENCE)


def test_a_leader_that_was_stopped_has_lost_its_lease():
    lease = leading(FIRST)
    lease, event = lease.looked(FIRST, T + 0.5)
    assert event is None
    lease, event = lease.looked(FIRST, T + 1.1)
    assert (lease.role, event) == (Role.FOLLOWING, LeaseEvent.OVERSLEPT)
    # Nobody took over: it leads again after the lease's time.
    for tenth in range(12, 17):
        lease, event = lease.looked(FIRST, T + tenth * 0.1)
    assert (lease.role, event) == (Role.LEADING, LeaseEvent.SILENCE)


def test_of_two_that_lead_the_one_that_came_later_goes_on():
    lease, event = leading(FIRST).heard(claim("a", 0, 8), claim("b", 1, 9), T + 1.0)
    assert (lease.role, event, lease.leader) == (Role.FOLLOWING, LeaseEvent.OUTRANKED, "b")
    assert (lease.waiting_since, lease.leader_heard) == (T + 1.0, T + 1.0)
    lease, event = leading(SECOND).heard(claim("b", 1, 9), claim("a", 0, 8), T)
    assert (lease.role, event) == (Role.LEADING, None)


def test_one_that_knows_of_nothing_yields_to_one_that_knows_of_a_flight():
    # It was started in flight and did not find the leader in time: its number is the higher.
    fresh, flying = claim("b", 1, 9, empty=True), claim("a", 0, 8)
    lease, event = leading(SECOND).heard(fresh, flying, T)
    assert (lease.role, event) == (Role.FOLLOWING, LeaseEvent.OUTRANKED)
    lease, event = leading(FIRST).heard(flying, fresh, T)
    assert (lease.role, event) == (Role.LEADING, LeaseEvent.OVERTAKES)
    assert lease.next_epoch(FIRST, 8) == 12, "above the one that devices may have seen"


@given(
    st.integers(0, RANKS - 1),
    st.integers(0, RANKS - 1),
    st.integers(0, 40),
    st.integers(0, 40),
    st.booleans(),
    st.booleans(),
)
def test_of_two_leaders_exactly_one_yields(rank, other_rank, seen, other_seen, empty, other_empty):
    if rank == other_rank:
        return
    one = LeaseConfig("a", rank, standby=True)
    other = LeaseConfig("b", other_rank, standby=True)
    mine = claim("a", rank, epoch_above(seen, rank), empty=empty)
    theirs = claim("b", other_rank, epoch_above(other_seen, other_rank), empty=other_empty)
    _, first = leading(one).heard(mine, theirs, T)
    _, second = leading(other).heard(theirs, mine, T)
    assert (first is LeaseEvent.OUTRANKED) != (second is LeaseEvent.OUTRANKED)


def test_a_follower_is_no_rival():
    lease, event = leading(FIRST).heard(claim("a", 0, 8), claim("b", 1, 99, leading=False), T)
    assert (lease.role, event, lease.highest) == (Role.LEADING, None, 99)


def test_whom_a_device_refuses_as_older_stands_back_although_nobody_is_heard():
    lease, event = leading(FIRST).refused(9, T)
    assert (lease.role, event) == (Role.FOLLOWING, LeaseEvent.REFUSED)
    assert (lease.highest, lease.leader) == (9, "")
    assert math.isnan(lease.leader_heard)
    for tenth in range(1, 50):
        lease, event = lease.looked(FIRST, T + tenth * 0.1)
        assert event is None
    lease, event = lease.looked(FIRST, T + 5.0)
    assert event is LeaseEvent.SILENCE
    assert lease.next_epoch(FIRST, 8) == 12


def test_one_that_was_refused_stands_back_all_the_same_and_then_leads_from_then_on():
    refused, _ = leading(FIRST).refused(12, T)
    own, other = knows("a", 0, False, 2, leading=False), knows("b", 1, True, 2, leading=True)
    lease, event = refused.heard(own, other, T + 1.0)
    assert (lease.role, lease.leader, event) == (Role.FOLLOWING, "b", None)
    now = refused.stand_back_until
    lease, event = refused.heard(own, other, now)
    assert (lease.role, event, lease.waiting_since) == (Role.LEADING, LeaseEvent.KNOWS_MORE, now)


def claims(lease: Lease, leader: int, own: int, tenths: range) -> tuple[Lease, LeaseEvent | None]:
    """The leader, a, claims ten times a second to hear so many links; b, that follows, so many."""
    event = None
    for tenth in tenths:
        now = T + tenth * 0.1
        mine = hears("b", 1, own, leading=False)
        lease, event = lease.heard(mine, hears("a", 0, leader), now)
        assert event is None
        lease, event = lease.looked(SECOND, now)
        if event is not None:
            break
    return lease, event


def test_a_leader_that_hears_less_than_a_follower_loses_the_lease():
    # Its messages go out and none comes in: it renews its lease, and sees no vehicle fall.
    lease, event = claims(following(SECOND), 0, 2, range(1, 11))
    assert event is None
    lease, event = claims(lease, 0, 2, range(11, 20))
    assert (lease.role, event) == (Role.LEADING, LeaseEvent.HEARS_MORE)
    assert lease.looked_at == pytest.approx(T + 1.1), "the lease's time for the second in rank"
    # The deaf one, when it hears again, yields to the higher epoch.
    later = replace(hears("b", 1, 2), epoch=lease.next_epoch(SECOND, 8))
    first, event = leading(FIRST).heard(hears("a", 0, 0), later, T + 9.0)
    assert (first.role, event) == (Role.FOLLOWING, LeaseEvent.OUTRANKED)


@pytest.mark.parametrize(
    ("leader_knows", "knows_itself", "hears", "takes_over"),
    [
        (False, True, 2, True),
        (False, True, 3, True),
        # It has just begun, and does not hear as many yet; or never will.
        (False, True, 1, False),
        (False, False, 2, False),
        (True, True, 2, False),
        (True, False, 2, False),
    ],
)
def test_one_that_starts_again_and_knows_of_a_flight_takes_over_from_one_that_does_not(
    leader_knows, knows_itself, hears, takes_over
):
    """Given two supervisors that were both away as the vehicle fell."""
    lease = Lease.begin(FIRST, T)
    own = knows("a", 0, not knows_itself, hears, leading=False)
    other = knows("b", 1, not leader_knows, 2, leading=True)
    lease, event = lease.heard(own, other, T + 0.1)
    assert (event is LeaseEvent.KNOWS_MORE) is takes_over
    assert (lease.role is Role.LEADING) is takes_over
    undecided = not leader_knows and knows_itself and hears < 2
    assert (lease.leader == "b") is (not takes_over and not undecided)


def test_until_it_hears_as_many_it_waits_for_as_long_as_it_listens():
    lease = Lease.begin(FIRST, T)
    deaf = knows("a", 0, False, 1, leading=False)
    other = knows("b", 1, True, 2, leading=True)
    lease, event = lease.heard(deaf, other, T + 3.9)
    assert (lease.leader, event) == ("", None)
    later, event = lease.heard(replace(deaf, links_heard=2), other, T + 3.95)
    assert (later.role, event) == (Role.LEADING, LeaseEvent.KNOWS_MORE)
    lease, event = lease.heard(deaf, other, T + 4.0)
    assert (lease.role, lease.leader, event) == (Role.FOLLOWING, "b", None)


def test_a_leader_that_is_reset_keeps_its_lease():
    lease = following(SECOND)
    flown, reset = knows("b", 1, False, 2, leading=False), knows("a", 0, True, 2, leading=True)
    lease, event = lease.heard(flown, reset, T + 0.1)
    assert (lease.role, lease.leader, event) == (Role.FOLLOWING, "a", None)


@pytest.mark.parametrize(("leader", "own"), [(2, 2), (2, 1), (0, 0)])
def test_a_leader_that_hears_as_much_keeps_it(leader, own):
    lease, event = claims(following(SECOND), leader, own, range(1, 50))
    assert (lease.role, event) == (Role.FOLLOWING, None)


def test_a_leader_that_misses_a_link_for_a_moment_keeps_it():
    lease, _ = claims(following(SECOND), 1, 2, range(1, 10))
    lease, _ = claims(lease, 2, 2, range(10, 11))
    lease, event = claims(lease, 1, 2, range(11, 20))
    assert (lease.role, event) == (Role.FOLLOWING, None)


def test_a_follower_that_slept_counts_from_its_waking():
    lease, _ = claims(following(SECOND), 1, 2, range(1, 5))
    lease, event = lease.looked(SECOND, T + 3.0)
    assert event is None
    lease, event = claims(lease, 1, 2, range(31, 40))
    assert (lease.role, event) == (Role.FOLLOWING, None)


def looks(
    lease: Lease, tenths: range, link_heard: float | None = None
) -> tuple[Lease, LeaseEvent | None]:
    """b looks ten times a second and hears no leader; links are heard always, or last then."""
    event = None
    for tenth in tenths:
        now = T + tenth * 0.1
        lease, event = lease.looked(SECOND, now, now if link_heard is None else link_heard)
        if event is not None:
            break
    return lease, event


def test_a_follower_whose_network_is_gone_does_not_take_over():
    # The last heartbeat of a link came with the leader's last claim, or a little later.
    lease, event = looks(following(SECOND), range(1, 100), link_heard=T + 0.45)
    assert (lease.role, event) == (Role.FOLLOWING, None)
    # It is back: the leader has its time to be heard before anybody takes over.
    lease, event = looks(lease, range(100, 109))
    assert event is None
    lease, event = lease.heard(hears("b", 1, 1, leading=False), hears("a", 0, 1), T + 10.9)
    lease, event = looks(lease, range(110, 119))
    assert (lease.role, event) == (Role.FOLLOWING, None)
    lease, event = looks(lease, range(119, 130))
    assert (lease.role, event) == (Role.LEADING, LeaseEvent.SILENCE)


def test_a_leader_is_dead_where_links_are_heard_after_it():
    lease, event = looks(following(SECOND), range(1, 10), link_heard=T + 0.5)
    assert event is None
    lease, event = looks(lease, range(10, 11), link_heard=T + 0.5)
    assert (lease.role, event) == (Role.LEADING, LeaseEvent.SILENCE)


def test_where_links_are_rarely_heard_the_next_heartbeat_decides():
    slow = replace(SECOND, deaf_after=6.0)
    lease = following(slow)
    for tenth in range(1, 30):
        lease, event = lease.looked(slow, T + tenth * 0.1, T - 0.1)
        assert event is None
    lease, event = lease.looked(slow, T + 3.0, T + 3.0)
    assert event is LeaseEvent.SILENCE


@given(st.integers(0, LARGEST_EPOCH), st.integers(0, RANKS - 1))
def test_each_rank_has_its_own_epochs_each_above_the_last(seen, rank):
    epoch = epoch_above(seen, rank)
    assert seen < epoch <= seen + RANKS
    assert epoch % RANKS == rank


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"rank": 4}, "rank is 4: need a whole number from 0 to 3"),
        ({"rank": -1}, "rank is -1"),
        ({"timeout": 0.1}, "lease_timeout is 0.1: need a number .* from 0.15 to 60 s"),
        ({"timeout": 60.5}, "lease_timeout is 60.5"),
    ],
)
def test_a_wrong_setting_says_what_is_allowed(settings, words):
    with pytest.raises(ParameterError, match=words):
        replace(FIRST, **settings)
    for timeout in (0.15, 60.0):
        assert LeaseConfig("a", timeout=timeout).timeout == timeout


def test_a_claim_that_no_supervisor_makes_is_known_for_it():
    nothing_above = "above which there is none"
    for other, hearer, why in (
        (claim("x", 9, 4), 0, "rank 9 (0 to 3)"),
        (claim("x", 4, 4), 0, "rank 4 (0 to 3)"),
        (claim("x", -1, 3), 0, "rank -1 (0 to 3)"),
        (claim("x", 1, 4), 0, "epoch 4, which is none of rank 1"),
        (claim("x", 1, 6), 0, "epoch 6, which is none of rank 1"),
        (claim("x", 0, 4), 0, ""),
        (claim("x", 1, 5), 0, ""),
        (claim("x", 1, 4, leading=False), 0, ""),
        (claim("x", 3, LARGEST_EPOCH - RANKS), 0, ""),
        (claim("x", 3, LARGEST_EPOCH), 0, f"epoch 4294967295, {nothing_above}"),
        (claim("x", 3, LARGEST_EPOCH, leading=False), 0, f"epoch 4294967295, {nothing_above}"),
        # It may leave the very last number, for whom that is one, and no less.
        (claim("x", 2, LARGEST_EPOCH - 1), 3, ""),
        (claim("x", 2, LARGEST_EPOCH - 1), 2, f"epoch 4294967294, {nothing_above}"),
    ):
        assert other.implausible(hearer) == why, (other, hearer)


@given(st.integers(0, RANKS - 1), st.integers(0, LARGEST_EPOCH), st.integers(0, RANKS - 1))
def test_whom_one_listens_to_leaves_a_number_for_the_takeover(rank, epoch, other_rank):
    config = LeaseConfig("a", rank, standby=True)
    other = claim("x", other_rank, epoch, leading=False)
    if not other.implausible(rank):
        lease, _ = following(config).heard(claim("a", rank, 0, leading=False), other, T)
        assert lease.next_epoch(config, 0) <= LARGEST_EPOCH


def test_one_that_was_deaf_while_it_listened_after_its_start_listens_on():
    lease, _ = Lease.begin(FIRST, T).looked(FIRST, T)
    lease, event = lease.looked(FIRST, T + 0.6)
    assert (event, lease.waiting_since) == (None, T + 4.0)


def test_one_that_takes_over_has_no_leader_any_more():
    lease = Lease(Role.FOLLOWING, T - 10.0, looked_at=T, leader="b", leader_heard=T)
    lease, event = lease.looked(FIRST, T + 0.5)
    assert (event, lease.role, lease.leader) == (LeaseEvent.SILENCE, Role.LEADING, "")
    assert lease.waiting_since == T + 0.5
    assert math.isnan(lease.leader_heard)


def test_of_two_with_the_same_claim_neither_yields():
    lease = Lease(Role.LEADING, T, looked_at=T)
    lease, event = lease.heard(claim("a", 0, 4), claim("b", 0, 4), T + 1.0)
    assert (event, lease.role) == (None, Role.LEADING)


@pytest.mark.parametrize(("later", "deadline"), [(0.0, 1.25), (0.125, 1.625)])
def test_one_that_heard_a_link_just_so_long_ago_is_not_deaf(later, deadline):
    lease = Lease(Role.FOLLOWING, T - 10.0, looked_at=T + 0.75, leader="b", leader_heard=T + 0.75)
    lease, event = lease.looked(FIRST, T + 1.0 + later, link_heard=T)
    assert (event, lease.deadline(FIRST)) == (None, T + deadline)


def test_one_that_took_over_as_it_hears_more_forgets_that_with_the_lease():
    lease = Lease(
        Role.FOLLOWING, T, looked_at=T, leader="b", leader_heard=T, hears_more_since=T - 0.25
    )
    lease, event = lease.looked(FIRST, T + 0.25)
    assert (event, lease.role, lease.leader) == (LeaseEvent.HEARS_MORE, Role.LEADING, "")
    assert lease.waiting_since == T + 0.25
    lease, event = lease.looked(FIRST, T + 1.0)
    assert event is LeaseEvent.OVERSLEPT
    assert lease.deadline(FIRST) == T + 1.5, "it has to hear less anew"


def test_the_table_once_more():
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


def test_one_that_is_told_nothing_else_is_alone_and_begins_with_the_first_number():
    alone = LeaseConfig("a")
    assert (alone.rank, alone.standby) == (0, False)
    assert (alone.timeout, alone.listen, alone.deaf_after) == (0.5, 4.0, 1.0)
    second = LeaseConfig("b", 1)
    lease = Lease.begin(second, T)
    assert lease.leader == ""
    assert lease.next_epoch(second, 0) == 1
