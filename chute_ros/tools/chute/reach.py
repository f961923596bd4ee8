"""Whether an order can reach a parachute, as far as a listener can tell: a person who releases
must know before that only the motors will stop."""

from __future__ import annotations

from chute_ros.model import LinkState
from chute_ros.tools.chute.listening import SETTLE
from chute_ros.tools.chute.order import Order
from chute_ros.tools.chute.view import VehiclePicture
from chute_ros.tools.chute.words import not_here

_GONE = (LinkState.LOST.name, LinkState.NEVER_SEEN.name)


def warning(order: Order, picture: VehiclePicture | None, unheard: bool = True) -> str:
    """What an order does although it reaches no parachute; empty: it may reach one, needs none, or
    nothing is known yet. unheard: as of out_of_reach; once it is answered that is no news."""
    if not order.unreached or picture is None:
        return ""
    why = out_of_reach(picture, order.link, unheard)
    return f"{why}: {order.unreached}" if why else ""


def out_of_reach(picture: VehiclePicture, link: str = "", unheard: bool = True) -> str:
    """That no parachute can be reached, and why; empty: one may be. link: of this one alone.
    unheard: also where it is only this process that has received none."""
    states = {one.name: one.state for one in picture.links if link in ("", one.name)}
    those = [one for one in picture.parachutes if link in ("", one.link)]
    told = [
        (f"{one.link} {one.device}", one.link_state, states.get(one.link, "")) for one in those
    ]
    if not those:
        told = [(name, state, state) for name, state in states.items()]
    gone = [
        f"{name} {device if device in _GONE else judged}"
        for name, device, judged in told
        if device in _GONE or judged in _GONE
    ]
    what = f"THE PARACHUTE OF {link}" if link else "NO PARACHUTE"
    if gone and len(gone) == len(told):
        return f"{what} {'CANNOT' if link else 'CAN'} BE REACHED ({', '.join(gone)})"
    if those or picture.listened < SETTLE or not unheard:
        return ""
    return f"{what} IS {'NOT ' if link else ''}RECEIVED ({not_here(picture.listened)})"
