"""Every release of a recorded flight, ordered or not: by whose order, what was reported of it and
what was not. Nothing in it that the recording does not show."""

from __future__ import annotations

import bisect

from chute_ros.model import LinkState, VehicleState
from chute_ros.tools.flight_story import FlightStory
from chute_ros.tools.release_orders import (
    Fate,
    MotionThen,
    Release,
    ReleaseOrder,
    ReleaseStep,
    TurnedDeployed,
    called,
    decided,
    foreign,
    in_vain,
    trigger_of,
)


def releases(story: FlightStory, end: float) -> list[Release]:
    """All of a story, in the order of time. end: of the recording, s from the start."""
    own = _Own(story)
    orders = [*decided(story, end), *called(story, end)]
    others = list(foreign(story))
    found = list(in_vain(story, end))
    for turned in own.turned:
        order = _newest(orders, turned)
        if order is None and (order := _newest(others, turned)) is not None:
            orders.append(order)
        if order is None:
            found.append(_unordered(turned, story.has_calls))
        else:
            order.effects.append(turned)
    for order in orders:
        own.add_effects(order, end)
        found.append(order.release)
    found.sort(key=lambda one: one.at)
    for one in found:
        one.motion = _motion(story.vehicle, one.at)
        one.steps.sort(key=lambda step: step.after)
    return found


class _Own:
    """What the parachutes say themselves."""

    def __init__(self, story: FlightStory) -> None:
        #: (link, device) -> (s, deployed) of every report of the device itself.
        self._told: dict[tuple[str, str], list[tuple[float, bool]]] = {}
        self.turned: list[TurnedDeployed] = []
        for at, report in story.statuses:
            status = report.status
            if status.link_state is not LinkState.OK:
                continue  # its node repeats what was
            told = self._told.setdefault((report.link, status.device), [])
            if status.deployed and told and not told[-1][1]:
                self.turned.append(TurnedDeployed(at, report.link, status, at - told[-1][0]))
            told.append((at, status.deployed))

    def add_effects(self, order: ReleaseOrder, end: float) -> None:
        """What the parachutes of an order's link say after it."""
        release = order.release
        for turned in order.effects:
            release.steps.append(_step(turned, turned.at - release.at))
        devices = [
            device for link, device in self._told if link == order.link and order.is_for(device)
        ]
        reached = [turned.status.device for turned in order.effects] or devices
        named = ", ".join(reached) if len(reached) == 1 or order.effects else order.device
        release.parachute = f"{order.link} {named}".strip()
        if order.effects or not order.is_sent:
            release.fate = Fate.RELEASED if order.effects else Fate.NOT_SENT
            return
        release.fate = Fate.REFUSED if order.is_refused else Fate.UNCONFIRMED
        out = [device for device in devices if self._was_out(order.link, device, release.at)]
        for device in out:
            text = f"{device} reported it before the order"
            release.steps.append(ReleaseStep(0.0, "own status", "deployed already", "quiet", text))
        later = (one.at for one in self.turned if self._is_of(one, order, devices))
        if (at := min(later, default=None)) is not None:
            release.missing.append(f"not deployed by it: its own status says so at {at:.3f} s")
            return
        after = any(self._told[order.link, device][-1][0] > release.at for device in devices)
        if not after:
            if order.is_confirmed and not out:
                release.fate = Fate.RELEASED  # by the word of its node, which nothing denies
            release.missing.append(
                f"no status of a parachute of {order.link} in the {end - release.at:.1f} s to the "
                "recording's end"
            )
        elif not out:
            release.missing.append(
                f"no own status that says deployed in the {end - release.at:.1f} s to the "
                "recording's end"
            )

    @staticmethod
    def _is_of(turned: TurnedDeployed, order: ReleaseOrder, devices: list[str]) -> bool:
        """A later release of what the order was for."""
        same = turned.link == order.link and turned.status.device in devices
        return same and turned.at >= order.release.at

    def _was_out(self, link: str, device: str, at: float) -> bool:
        before = [deployed for when, deployed in self._told[link, device] if when <= at]
        return bool(before) and before[-1]


def _step(turned: TurnedDeployed, after: float) -> ReleaseStep:
    status = turned.status
    text = f"{status.device}, {trigger_of(status)}; not deployed {turned.silent:.1f} s before"
    return ReleaseStep(after, "own status", "deployed", "act", text)


def _newest(orders: list[ReleaseOrder], turned: TurnedDeployed) -> ReleaseOrder | None:
    """The order that a release is taken for the effect of: the newest, rather one that was not
    refused."""
    explaining = [one for one in orders if one.explains(turned)]
    return max(explaining, key=lambda one: (not one.is_refused, one.release.at), default=None)


def _unordered(turned: TurnedDeployed, has_calls: bool) -> Release:
    order = "no order is in this recording"
    if has_calls:
        order += ": the device itself, by hand, or past the nodes"
    who = f"{turned.link} {turned.status.device}"
    release = Release(turned.at, who, order, fate=Fate.RELEASED)
    release.steps.append(_step(turned, 0.0))
    return release


def _motion(vehicle: list[tuple[float, VehicleState]], at: float) -> MotionThen:
    """By the newest report until then."""
    number = bisect.bisect_right(vehicle, at, key=lambda one: one[0])
    if not number:
        return MotionThen()
    when, state = vehicle[number - 1]
    then = state.aged(at - when)
    return MotionThen(then.height, then.height_age, then.vertical_speed, then.vertical_speed_age)
