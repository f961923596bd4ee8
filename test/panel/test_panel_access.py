"""Who may give orders: sessions, and patience with whoever guesses. Pure."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.tools.panel.access import (
    FIRST_WAIT,
    FREE_MISTAKES,
    LONGEST_WAIT,
    MOST_ADDRESSES,
    MOST_SESSIONS,
    MOST_TRIES,
    SESSION_LASTS,
    TRIES_WITHIN,
    Access,
    AccessRefusedError,
)

RIGHT = "a canopy of silk"
PHONE, LAPTOP = "10.0.0.5", "10.0.0.6"


@pytest.fixture
def access():
    numbers = itertools.count(1)
    return Access(RIGHT, lambda: f"token {next(numbers)}")


def refused(access, password, address, now):
    with pytest.raises(AccessRefusedError) as told:
        access.log_in("Anna", password, address, now)
    return str(told.value)


def test_a_session_is_of_who_logged_in_until_it_ends(access):
    token = access.log_in("  Anna  Berg ", RIGHT, PHONE, 10.0)
    person = access.person(token, PHONE, 11.0)
    assert (person.name, person.address) == ("Anna Berg", PHONE)
    assert person.text == "Anna Berg at 10.0.0.5 (panel)"
    assert access.person(token, PHONE, 10.0 + SESSION_LASTS - 0.1) is person
    assert access.person(token, PHONE, 10.0 + SESSION_LASTS) is None
    # Ended once, it does not come back.
    assert access.person(token, PHONE, 11.0) is None


def test_another_token_is_nobodys(access):
    access.log_in("Anna", RIGHT, PHONE, 0.0)
    assert [access.person(one, PHONE, 1.0) for one in (None, "", "token 2")] == [None] * 3


def test_logging_out_ends_one_session_alone(access):
    anna, ben = (access.log_in(name, RIGHT, PHONE, 0.0) for name in ("Anna", "Ben"))
    access.log_out(anna)
    access.log_out("what is no token")
    assert access.person(anna, PHONE, 1.0) is None
    assert access.person(ben, PHONE, 1.0).name == "Ben"


def test_without_a_password_nobody_can_log_in():
    access = Access(None, lambda: "token")
    assert not access.is_possible
    assert refused(access, "", PHONE, 0.0) == "nobody can log in: the panel has no password_file"


@pytest.mark.parametrize("name", ["", "  ", "x" * 41])
def test_a_name_is_needed_for_the_record(access, name):
    with pytest.raises(AccessRefusedError, match="need your name, 1 to 40 characters"):
        access.log_in(name, RIGHT, PHONE, 0.0)


@given(st.text(max_size=30).filter(lambda text: text != RIGHT))
def test_no_other_password_is_right(password):
    access = Access(RIGHT, lambda: "token")
    assert refused(access, password, PHONE, 0.0) == "wrong password"
    assert access.person("token", PHONE, 0.0) is None


def test_guessing_takes_longer_each_time_also_for_the_right_one(access):
    now = 0.0
    for _ in range(FREE_MISTAKES):
        assert refused(access, "guess", PHONE, now) == "wrong password"
    # The last free one began the wait.
    assert refused(access, RIGHT, PHONE, now + 1.0) == (
        "too many wrong passwords: try again in 1 s"
    )
    for wait in (FIRST_WAIT, 2 * FIRST_WAIT, 4 * FIRST_WAIT):
        now += wait
        assert refused(access, "guess", PHONE, now) == "wrong password"
    # Another one is not kept waiting, and the right one is let in once the wait is over.
    access.log_in("Ben", RIGHT, LAPTOP, now)
    token = access.log_in("Anna", RIGHT, PHONE, now + 8 * FIRST_WAIT)
    assert access.person(token, PHONE, now + 8 * FIRST_WAIT)
    # And what was wrong before is forgiven.
    assert refused(access, "guess", PHONE, now + 100.0) == "wrong password"


def test_the_longest_wait_is_bounded(access):
    now = 0.0
    for _ in range(200):
        refused(access, "guess", PHONE, now)
        now += LONGEST_WAIT
    assert access.log_in("Anna", RIGHT, PHONE, now)


def test_a_session_is_of_the_network_in_which_it_began(access):
    token = access.log_in("Anna", RIGHT, PHONE, 0.0)
    assert access.person(token, LAPTOP, 1.0) is None
    assert access.person(token, PHONE, 1.0).name == "Anna"
    far = access.log_in("Ben", RIGHT, "2001:db8::1", 0.0)
    assert access.person(far, "2001:db8::2", 1.0).name == "Ben"


def test_strangers_who_guess_shut_nobody_out_who_has_logged_in_before(access):
    access.log_in("Anna", RIGHT, PHONE, 0.0)
    for number in range(MOST_TRIES):
        refused(access, "guess", f"10.0.1.{number}", 1.0)
    assert refused(access, RIGHT, LAPTOP, 2.0).startswith("too many wrong passwords")
    assert access.log_in("Anna", RIGHT, PHONE, 2.0)


def test_many_addresses_guess_no_faster(access):
    for number in range(MOST_TRIES):
        refused(access, "guess", f"10.0.1.{number}", 0.0)
    assert refused(access, RIGHT, LAPTOP, 1.0).startswith("too many wrong passwords")
    assert access.log_in("Anna", RIGHT, LAPTOP, TRIES_WITHIN)


def test_one_network_of_ipv6_is_one_address(access):
    for number in range(FREE_MISTAKES):
        refused(access, "guess", f"2001:db8::{number}", 0.0)
    assert refused(access, RIGHT, "2001:db8::ffff", 0.0).startswith("too many")
    assert access.log_in("Anna", RIGHT, "2001:db8:0:1::1", 0.0)
    # An address of IPv4 in the clothes of IPv6 is that address.
    for _ in range(FREE_MISTAKES):
        refused(access, "guess", "::ffff:10.0.0.9", 70.0)
    assert refused(access, RIGHT, "10.0.0.9", 70.0).startswith("too many")


def test_what_is_remembered_is_bounded(access):
    now = 0.0
    for number in range(MOST_ADDRESSES + 10):
        now += TRIES_WITHIN
        refused(access, "guess", f"10.{number // 65536}.{number // 256 % 256}.{number % 256}", now)
    tokens = [access.log_in("Anna", RIGHT, LAPTOP, now := now + 60.0) for _ in range(60)]
    alive = [access.person(one, LAPTOP, now) is not None for one in tokens]
    assert alive == [False] * (60 - MOST_SESSIONS) + [True] * MOST_SESSIONS
