"""How low a failure may happen so that the vehicle still lands softly under its canopy: found by
flights, each from another height, with the same chances."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass

from chute_ros.campaign.aircraft import Aircraft
from chute_ros.campaign.flight import Flight, Flown
from chute_ros.campaign.scenario import Scenario
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.vehicle import lift_time
from chute_ros.errors import CampaignError
from chute_ros.model import Action
from chute_ros.sim.motion import Motion

#: From no greater height than this it is tried, and from none lower, m. No rule of a shipped
#: profile ends a flight for its height.
CEILING, FLOOR = 300.0, 3.0
#: Flights from no greater height are all at theirs at the same time, m.
_AS_HIGH = 120.0
#: To this the height is found, m.
GRAIN = 1.0


@dataclass(frozen=True)
class FallStage:
    """s since the failure, and m of height lost since; NaN: it did not come to that."""

    after: float = math.nan
    lost: float = math.nan


@dataclass(frozen=True)
class Fall:
    """One flight. height: of the failure above the ground, m; decided: the supervisor ordered the
    motors off; carried: the canopy is open, and the vehicle no faster than a soft landing;
    touchdown: m/s.

    ended_before: it was released before the failure, as faults around it may do."""

    height: float
    decided: FallStage
    released: FallStage
    carried: FallStage
    touchdown: float
    ended_before: bool = False

    @property
    def was_released(self) -> bool:
        """A parachute came out."""
        return not math.isnan(self.released.after)

    @property
    def noticed(self) -> FallStage:
        """The supervisor's order, or a release that came before any."""
        return self.decided if self.decided.after <= self.released.after else self.released

    @property
    def lost(self) -> float:
        """From the failure to the canopy that carries; all, if it touched down before, m."""
        return self.height if math.isnan(self.carried.lost) else self.carried.lost

    @property
    def parts(self) -> tuple[float, float, float]:
        """What is lost until it is noticed, in the chain, and while the canopy opens, m."""
        noticed, released = self.noticed.lost, self.released.lost
        return noticed, released - noticed, self.lost - released

    def is_saved(self, soft: float) -> bool:
        """It came down under its canopy, no faster than this, m/s."""
        carried = not math.isnan(self.carried.after)
        return self.was_released and (carried or self.touchdown <= soft)


FlyFrom = Callable[[float], Fall]


@dataclass(frozen=True)
class Needed:
    """height: the least from which a flight was saved, m; 0: no parachute is needed; infinity:
    from no height. usual: the flight from a height that the vehicle is flown at; lowest: the one
    from height, where there is one."""

    seed: int
    height: float
    usual: Fall
    usual_saved: bool
    lowest: Fall | None = None

    @property
    def counts(self) -> bool:
        """The failure happened."""
        return not self.usual.ended_before


class ObservedFlight(Flight):
    """Followed until its canopy carries, or the vehicle is on the ground. soft: landing, m/s."""

    def __init__(self, scenario: Scenario, shipped: Shipped, soft: float) -> None:
        super().__init__(scenario, shipped)
        assert isinstance(self.rig, Aircraft)
        self._aircraft, self._soft = self.rig, soft
        #: Virtual s, and m above the ground, from the failure on.
        self._times: list[float] = []
        self._heights: list[float] = []
        self._carried = math.nan
        self._aircraft.feeling.append(self._feel)
        # Whatever its height, it is there at the same time: so gusts and messages are the same.
        self._aircraft.spools_up += max(0.0, lift_time(_AS_HIGH) - lift_time(scenario.height))

    def fall(self) -> Fall:
        """Live through it. CampaignError: it never took off."""
        flown = self.run()
        if flown.grounded:
            raise CampaignError(f"seed {self.scenario.seed} never took off: {flown.grounded}")
        if flown.released < self._failed_at:
            return Fall(
                math.nan, FallStage(), FallStage(), FallStage(), math.nan, ended_before=True
            )
        decided = [
            at for at, one in flown.decided if one.action is Action.KILL and at >= self._failed_at
        ]
        return Fall(
            self._heights[0],
            self._stage(decided[0] if decided else math.nan),
            self._stage(flown.released),
            self._stage(self._carried),
            self._touchdown(flown),
        )

    @property
    def _failed_at(self) -> float:
        return self.up + self.scenario.failure_at

    def _feel(self, motion: Motion) -> None:
        now, model = self.rig.world.now, self._aircraft.model
        if not now >= self._failed_at:
            return
        self._times.append(now)
        self._heights.append(model.clearance)
        if (
            math.isnan(self._carried)
            and not model.on_ground
            and model.canopy >= 1.0
            and -motion.vertical_speed <= self._soft
        ):
            self._carried = now

    def _stage(self, at: float) -> FallStage:
        if math.isnan(at):
            return FallStage()
        row = min(bisect.bisect_left(self._times, at), len(self._times) - 1)
        return FallStage(at - self._failed_at, self._heights[0] - self._heights[row])

    def _touchdown(self, flown: Flown) -> float:
        """What is still in the air when nobody looks on any more goes on as it sinks then."""
        if math.isnan(flown.landing_speed):
            return max(0.0, -self._aircraft.model.vertical_speed)
        return flown.landing_speed

    def _over(self, quiet: float) -> bool:
        rig = self.rig
        if not math.isnan(self._carried) or not math.isnan(rig.landed):
            return True
        ended = math.isnan(rig.released) and not rig.truth.falls
        return rig.world.now > quiet and ended


def needed_height(fly_from: FlyFrom, soft: float, seed: int) -> Needed:
    """fly_from: a flight that fails at a height, m; 0: at one that the vehicle is flown at. soft:
    landing, m/s."""
    usual = fly_from(0.0)
    if not usual.was_released and usual.touchdown <= soft:
        return Needed(seed, 0.0, usual, usual_saved=True)
    is_saved = usual.is_saved(soft)
    best = usual if is_saved else fly_from(CEILING)
    if not best.is_saved(soft):
        return Needed(seed, math.inf, usual, is_saved)
    best = _lowest(fly_from, soft, best)
    return Needed(seed, best.height, usual, is_saved, best)


def _lowest(fly_from: FlyFrom, soft: float, best: Fall) -> Fall:
    """Of what was saved from some height: the flight from the least height that is saved."""
    saved_from = best.height
    while True:
        aim = float(max(FLOOR, math.ceil(best.lost)))
        if aim > saved_from - GRAIN / 2.0:
            return best
        one = fly_from(aim)
        if not one.is_saved(soft):
            return _between(fly_from, soft, aim, best)
        best, saved_from = one, aim


def _between(fly_from: FlyFrom, soft: float, lost_from: float, best: Fall) -> Fall:
    """The least height lies above one from which it was not saved."""
    saved_from, step = best.height, GRAIN
    while saved_from - lost_from > GRAIN:
        aim = min(lost_from + step, (lost_from + saved_from) / 2.0)
        one = fly_from(aim)
        if one.is_saved(soft):
            best, saved_from = one, aim
        else:
            lost_from = aim
        step *= 2.0
    return best
