"""Before a release a person is told whether it can reach a parachute at all."""

from __future__ import annotations

import pytest
from heard_vehicle import Heard, parachute, stamped, state

from chute_ros.model import LinkState
from chute_ros.tools.chute import order
from chute_ros.tools.chute.reach import out_of_reach, warning

LOST, OK, UNMONITORED = int(LinkState.LOST), int(LinkState.OK), int(LinkState.UNMONITORED)
#: The autopilot's link, which carries no parachute, and the parachute's.
TWO = ["mavlink_parachute", "upf_can"]


def seen(*parachutes, links=("mavlink_parachute",), states=(OK,), at=3.0):
    """What was received of a vehicle with these links, and these parachutes: link and state."""
    told = {"links": list(links), "link_states": list(states)}
    told |= {"link_ages": [0.1] * len(links), "devices_healthy": [True] * len(links)}
    heard = Heard().hears(stamped(state(**told)))
    for number, (link, link_state) in enumerate(parachutes):
        heard.hears(stamped(parachute(link=link, device=str(number), link_state=link_state)))
    return heard.view(at)


@pytest.mark.parametrize(
    "picture",
    [
        seen(("mavlink_parachute", OK)),
        seen(("mavlink_parachute", int(LinkState.STALE)), states=[int(LinkState.STALE)]),
        seen(("relay", UNMONITORED), links=["relay"], states=[UNMONITORED]),
        seen(("mavlink_parachute", LOST), ("mavlink_parachute", OK)),
        seen(("mavlink_parachute", LOST), ("upf_can", OK), links=TWO, states=[LOST, OK]),
        # Nothing was received yet, and one of the links lives.
        seen(links=TWO, states=[OK, LOST], at=0.5),
    ],
)
def test_one_that_may_be_reached_is_enough(picture):
    assert out_of_reach(picture) == ""
    assert warning(order.deploy("a test"), picture) == ""


@pytest.mark.parametrize(
    ("picture", "why"),
    [
        (seen(states=[LOST]), "NO PARACHUTE CAN BE REACHED (mavlink_parachute LOST)"),
        (
            seen(("mavlink_parachute", LOST), states=[LOST]),
            "NO PARACHUTE CAN BE REACHED (mavlink_parachute 0 LOST)",
        ),
        # Its node has ended: the last status said OK.
        (
            seen(("mavlink_parachute", OK), states=[LOST]),
            "NO PARACHUTE CAN BE REACHED (mavlink_parachute 0 LOST)",
        ),
        (
            seen(("upf_can", LOST), ("upf_can", LOST), links=TWO, states=[OK, LOST]),
            "NO PARACHUTE CAN BE REACHED (upf_can 0 LOST, upf_can 1 LOST)",
        ),
        (
            seen(links=TWO, states=[OK, LOST]),
            "NO PARACHUTE IS RECEIVED (not received here within 3 s)",
        ),
    ],
)
def test_where_none_can_be_reached_each_is_named(picture, why):
    assert out_of_reach(picture) == why
    assert warning(order.deploy("a test"), picture) == (
        f"{why}: the motors will STOP all the same where the supervisor kills before a deploy, "
        "and nothing will open"
    )
    assert warning(order.kill("a test"), picture).endswith("STOP, and nothing will open")
    assert warning(order.kill("a test", only=True), picture) == ""
    assert warning(order.reset(), picture) == ""


def test_past_the_supervisor_only_the_link_counts():
    picture = seen(("mavlink_parachute", OK), ("upf_can", LOST), links=TWO, states=[OK, LOST])
    past = order.deploy("a test", link="upf_can")
    assert warning(past, picture) == (
        "THE PARACHUTE OF upf_can CANNOT BE REACHED (upf_can 1 LOST): nothing will open"
    )
    assert warning(order.deploy("a test", link="mavlink_parachute"), picture) == ""
    assert warning(past, None) == ""


def test_once_it_was_answered_what_this_process_did_not_receive_is_no_news():
    """A node that it had not found yet was answering; the warning read as if nothing had come."""
    unheard, lost = seen(links=TWO, states=[OK, LOST]), seen(states=[LOST])
    assert warning(order.deploy("a test"), unheard, unheard=False) == ""
    assert warning(order.deploy("a test"), lost, unheard=False)
