"""What a spoilt cable lets through."""

import socket

import pytest

from faults.switch import Cable

#: From the second host to the first, to everybody (ARP), to a multicast group of IP (discovery).
TO_ONE = bytes.fromhex("020000000001 020000000002 0800") + b"payload"
TO_ALL = bytes.fromhex("ffffffffffff 020000000002 0806") + b"who has"
TO_GROUP = bytes.fromhex("01005eff0001 020000000002 0800") + b"discovery"


@pytest.fixture
def cable():
    here, there = socket.socketpair()
    yield Cable(here)
    here.close()
    there.close()


def test_a_whole_cable_passes_everything(cable):
    assert (cable.sends, cable.receives, cable.delay) == (True, True, 0.0)
    assert all(map(cable.passes, (TO_ONE, TO_ALL, TO_GROUP)))


def test_without_multicast_hosts_still_find_each_others_addresses(cable):
    cable.set("unicast", "0")
    assert [cable.passes(one) for one in (TO_ONE, TO_ALL, TO_GROUP)] == [True, True, False]


@pytest.mark.parametrize(
    ("what", "sends", "receives"),
    [("cut", False, False), ("mute", False, True), ("deaf", True, False)],
)
def test_a_cable_can_be_cut_in_one_direction(cable, what, sends, receives):
    cable.set(what, "0")
    assert (cable.sends, cable.receives) == (sends, receives)


def test_a_lossy_cable_loses_its_share(cable):
    cable.set("lossy", "0.3")
    passed = sum(cable.passes(TO_ONE) for _ in range(10_000))
    assert 6_700 < passed < 7_300


def test_what_is_set_next_ends_what_was_before(cable):
    cable.set("slow", "0.2")
    assert cable.delay == 0.2
    cable.set("unicast", "0")
    assert cable.delay == 0.0
    cable.set("heal", "0")
    assert cable.passes(TO_GROUP)
