"""The supervisor's core: one function of (state, inputs, now) to (state, outputs).

It fuses the heartbeats of all links and the measurements of the vehicle, blocks flight while a
required link is not healthy, counts the rules of its profile, and carries what they, a person or a
device want through to the devices: the kill first, then the deploy, step by step of its ladder,
until a device's own status confirms it. A fire command leaves only through Steps.fire.
"""

from __future__ import annotations

import math
from types import MappingProxyType

from chute_ros.model import Action, LinkState
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.deploying import Deploying, release_due, step_deadline
from chute_ros.supervisor.machine import Stage, Stimulus, listed
from chute_ros.supervisor.measurements import on_earth
from chute_ros.supervisor.orders import ON_GROUND
from chute_ros.supervisor.policy import rule_deadlines
from chute_ros.supervisor.preflight import block_reasons, not_seen
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.state import Pending, State
from chute_ros.supervisor.steps import Slot

#: What people ask for, besides a kill, which devices want as well.
_PERSONS = (i.ArmRequest, i.DeployRequest, i.ResetRequest, i.ModeRequest)
#: What the health of the links can do; in flight nothing.
_OF_LINKS = (Stimulus.LINKS_UNHEALTHY, Stimulus.LINKS_HEALTHY)
#: Once `safety/arm` has armed the parachutes, their own status says so within this time, s.
_ARMED_SHOWS = 2.0
#: A vehicle that nobody watched may have climbed as fast, m/s.
_CLIMBS_UNSEEN = 20.0
#: Off the ground for so long it was seen to be up, on it to be down, s; no look counts for more.
_UP_TAKES, _DOWN_TAKES, _LONGEST_LOOK = 0.5, 1.0, 0.2
#: A limit that an age may just reach has passed this much later, s.
_JUST_AFTER = 1e-6


def update(
    config: SupervisorConfig, state: State, inputs: tuple[i.Input, ...], now: float
) -> tuple[State, tuple[i.Output, ...]]:
    """Take in what came since the last call, look at the clock, and decide."""
    # Time does not run backwards; a clock that says so is not followed. (NaN is never the larger.)
    now = max(now, state.updated_at)
    turn = _Update(config, state, now)
    turn.begin()
    for one in inputs:
        turn.take(one)
    turn.look()
    turn.state = replace(turn.state, updated_at=now)
    return turn.state, tuple(turn.outputs)


def next_deadline(config: SupervisorConfig, state: State, now: float) -> float:
    """When update has something to decide without any input, later than now; infinity: never."""
    deadlines: list[float] = []
    for link, evidence in state.links.items():
        deadlines += evidence.deadlines(config.limits(link))
    if state.stage in (Stage.STARTUP, Stage.READY, Stage.ARMED, Stage.LANDED):
        since = state.vehicle_received - state.vehicle.armed_age
        # Just after the limit, which still counts as young enough.
        deadlines.append(math.nextafter(since + config.vehicle_state_age, math.inf) + _JUST_AFTER)
    if state.stage is Stage.ARMED:
        deadlines.append(state.stage_since + _ARMED_SHOWS)
    if state.stage is Stage.STARTUP:
        deadlines += [state.started_at + config.limits(one).startup_grace for one in config.links]
    if state.stage is Stage.DEPLOYED and state.deploy_tokens:
        deadlines.append(state.stage_since + config.report_wait)
    for pending in (state.block, state.kill, *state.deploys):
        if pending is not None and pending.unreported():
            deadlines.append(pending.resend_at(config))
    if state.kill is not None:
        deadlines.append(state.kill.decided_at + config.kill_timeout)
    if state.stage is Stage.KILLING and state.deploy_rule:
        deadlines.append(release_due(config, state, now))
    if state.deploy is not None:
        deadlines.append(step_deadline(config, state, state.deploy))
    deadlines.append(state.alarm_at)
    if state.stage is Stage.FAULT:
        deadlines.append(state.stage_since + config.deploy_timeout)
    if state.airborne:
        deadlines.append(flight.landed_at(config, state))
        if state.stage is Stage.KILLING:
            deadlines.append(flight.down_after_kill_at(config, state))
    deadlines += [one + _JUST_AFTER for one in rule_deadlines(config, state, now)]
    return min([deadline for deadline in deadlines if deadline > now], default=math.inf)


class _Update(Deploying):
    """One update."""

    def begin(self) -> None:
        """What time has done since the last update."""
        state = self.state
        if math.isnan(state.updated_at):
            return
        passed = self.now - state.updated_at
        # A deadline lies after the last update: none can be missed by more than what has passed.
        if passed > self.config.late_after:
            late = self.now - next_deadline(self.config, state, state.updated_at)
            if late > self.config.late_after:
                self._was_late(late)
                passed -= late
        self.count_rules(passed)

    def _was_late(self, late: float) -> None:
        """While nobody listened, nobody was silent: what was sent meanwhile is still to come."""
        heard = {
            link: replace(evidence, heard=evidence.heard + late)
            for link, evidence in self.state.links.items()
        }
        rules = dict(self.state.rules)
        # Full before a silence that was our own, they would fire at its first word.
        deaf = late >= self.config.vehicle_state_age / 2.0
        for rule in self.config.profile.rules if deaf else ():
            if not all(one.counted for one in rule.conditions) and rule.name in rules:
                rules[rule.name] = replace(rules[rule.name], level=0.0, holds=False, kept=())
        unseen = late * _CLIMBS_UNSEEN >= self.config.profile.minimum_height
        self.state = replace(
            self.state,
            links=MappingProxyType(heard),
            rules=MappingProxyType(rules),
            late_count=self.state.late_count + 1,
            # A height that can be used counts all the same.
            was_high=self.state.was_high or (self.state.airborne and unseen),
        )
        text = f"an update came {late:.2f} s late (limit {self.config.late_after:g} s)"
        self.outputs.append(i.Say(f"{text}: silence meanwhile does not count", alarm=True))

    def take(self, one: i.Input) -> None:
        """One input, in the order in which it came. One that follows does nothing for people."""
        if not self.state.leading and isinstance(one, _PERSONS):
            self.finish(one.token, False, False, f"refused: {i.CALL_AGAIN}")
            return
        if isinstance(one, i.LinkHeartbeat):
            self.heartbeat(one)
        elif isinstance(one, i.ParachuteReport):
            self.parachute(one)
        elif isinstance(one, i.VehicleReport):
            self.vehicle(one)
        elif isinstance(one, i.ActionReport):
            self.action_report(one)
        elif isinstance(one, i.ArmRequest):
            self.arm_request(one)
        elif isinstance(one, i.ArmDone):
            self.arm_done(one)
        elif isinstance(one, i.KillRequest):
            self.kill_request(one)
        elif isinstance(one, i.BlockRequest):
            self.block_request(one)
        elif isinstance(one, i.DeployRequest):
            self.deploy_request(one)
        elif isinstance(one, i.ResetRequest):
            self.reset_request(one)
        elif isinstance(one, i.TakeOver):
            self._take_over(one)
        elif isinstance(one, i.StepDown):
            self.answer_all(f"{i.CALL_AGAIN}: {one.why}")
            self.state = replace(self.state, leading=False)
        else:
            self.mode_request(one)

    def _take_over(self, one: i.TakeOver) -> None:
        """What has not been begun is decided anew, so that no shot is lost; what a device has
        begun goes on there, so that there is no second one."""
        self.state = replace(self.state, leading=True, epoch=one.epoch)
        # A parachute that this one has heard to be out is not ordered once more.
        self.look_at_parachutes()
        self.renew_not_begun("another supervisor took over")

    def look(self) -> None:
        """What follows from all that is known now. One that follows only counts: what it was
        told by the leader is what was decided."""
        if not self.state.leading:
            self._note_down()
            self._note_height()
            self.look_at_rules()
            return
        self._look_at_vehicle()
        self._note_height()
        self.look_at_parachutes()
        self.look_at_rules()
        self._look_at_armed()
        # After the rules, of which one may block flight.
        self._look_at_links()
        self.look_at_kill()
        self.look_at_deploy()
        self._block_or_release()
        self._send_again()

    def _look_at_vehicle(self) -> None:
        self._note_down()
        in_air = flight.in_air(self.config, self.state, self.now)
        stage = self.state.stage
        blocked = stage in (Stage.STARTUP, Stage.BLOCKED)
        if in_air and blocked and flight.low_as_at_take_off(self.config, self.state, self.now):
            return  # it says so because it was ordered to take off, and is kept down
        if in_air and listed(stage, Stimulus.TAKEN_OFF) and self._may_take_off():
            if stage in (Stage.STARTUP, Stage.BLOCKED, Stage.KILLING):
                self.alarm(f"in the air although {stage.name}")
            self.move(Stimulus.TAKEN_OFF)
            self._took_off(anew=stage is not Stage.LANDED)
        elif in_air and self._falls_since_kill():
            self.alarm("it falls since the kill, although it said that it stood")
            self.state = replace(
                self.state, airborne=True, airborne_since=self.now, killed_in_flight=True
            )
        elif in_air is False and listed(stage, Stimulus.LANDED):
            self.move(Stimulus.LANDED)
            self.state = replace(self.state, airborne=False, rebooted=False, landed_at=self.now)
        if in_air is False and not math.isnan(self.state.killed_height):
            # It has come down, whatever is told, or not told any more, from now on.
            self.state = replace(self.state, killed_height=math.nan)
        if self._down_since_kill():
            # As one that was killed on the ground: who lifts it is not to be met by its canopy.
            self.state = replace(
                self.state,
                airborne=False,
                killed_in_flight=False,
                rebooted=False,
                landed_at=self.now,
            )
        if self.state.stage is Stage.LANDED and flight.disarmed(self.config, self.state, self.now):
            self.move(Stimulus.SECURED)
            self._disarm_parachutes()
        if in_air is False and not self.state.flown and self.state.stage in ON_GROUND:
            self.note_released()

    def _may_take_off(self) -> bool:
        """From KILLING only one that was killed on the ground and has armed again."""
        state = self.state
        if state.stage is not Stage.KILLING:
            return True
        again = state.kill is not None and self.armed_since(state.kill)
        return not state.killed_in_flight and not state.deploy_rule and again

    def _down_since_kill(self) -> bool:
        """It was killed in the air, nothing is to follow, and it has come down for good."""
        state = self.state
        killed = state.stage is Stage.KILLING and state.killed_in_flight and not state.deploy_rule
        return killed and self.now >= flight.down_after_kill_at(self.config, state)

    def _falls_since_kill(self) -> bool:
        """It was killed as one on the ground, and was in the air all the same."""
        state = self.state
        on_ground = state.stage is Stage.KILLING and not state.killed_in_flight
        return on_ground and bool(flight.moving(self.config, state, self.now))

    def _note_down(self) -> None:
        """Since when it says that it stands, and nothing contradicts it."""
        down = flight.down_undisputed(self.config, self.state, self.now)
        known = not math.isnan(self.state.down_since)
        if down != known:
            self.state = replace(self.state, down_since=self.now if down else math.nan)
        still = flight.is_still(self.config, self.state, self.now)
        if still == math.isnan(self.state.still_since):
            self.state = replace(self.state, still_since=self.now if still else math.nan)

    def _disarm_parachutes(self) -> None:
        """After a flight nobody is to carry an armed one; those that arm themselves disarm
        themselves."""
        state = self.state
        if self.config.disarm_after_landing and state.armed_by_us and state.mode is i.Mode.ACTIVE:
            self.outputs.append(i.ArmDevices(0, False, 0, self.config.deploy_links))
            self.state = replace(state, armed_by_us=False)

    def _note_height(self) -> None:
        """Since when a deploy is worth it; without any height, some time after the take-off."""
        state, now, minimum = self.state, self.now, self.config.profile.minimum_height
        if not state.airborne:
            return
        height = flight.measured(self.config, state, "height", now)
        # Which no estimator moves; it says where the ground was, and so that it is there again.
        by_pressure = flight.pressure_height(self.config, state, now)
        passed = min(max(now - self.before.updated_at, 0.0), _LONGEST_LOOK)
        up = flight.seen_up(self.config, state, height, by_pressure, now)
        up_for = state.up_for + (passed if up else 0.0)
        told = height if math.isnan(by_pressure) else by_pressure
        # Far below the take-off nobody knows the height above the ground.
        high = told >= minimum or (told <= -minimum and up_for >= _UP_TAKES)
        if math.isnan(told):
            # One that tells what cannot be is no silence: it may run away on the ground.
            wrong = now < state.measured("height").doubted_at + flight.HIGH_AFTER
            high = not wrong and now >= state.airborne_since + flight.HIGH_AFTER
        since = state.at_ground_since
        if not flight.at_ground(self.config, state, by_pressure, now):
            since = math.nan
        elif math.isnan(since):
            since = now
        down = now >= since + _DOWN_TAKES
        was_high, up_for = (state.was_high or high) and not down, 0.0 if down else up_for
        if (was_high, up_for, since) != (state.was_high, state.up_for, state.at_ground_since):
            self.state = replace(
                state, was_high=was_high, up_for=min(up_for, _UP_TAKES), at_ground_since=since
            )

    def _took_off(self, anew: bool) -> None:
        """anew: it stood disarmed before; otherwise it bounced, or was not down at all."""
        vehicle, home = self.state.vehicle, None if anew else self.state.home
        here = (vehicle.latitude, vehicle.longitude)
        if home is None and on_earth(*here):
            home = here
        measurements = dict(self.state.measurements)
        if home != self.state.home:
            measurements.pop("distance_from_home", None)  # it was that from another place
        self.state = replace(
            self.state,
            flown=True,
            airborne=True,
            airborne_since=self.now,
            was_high=False,
            up_for=0.0,
            at_ground_since=math.nan,
            took_off_height=flight.measured(self.config, self.state, "height", self.now),
            home=home,
            measurements=MappingProxyType(measurements),
            # What was acted on in an earlier flight says nothing about this one.
            rules=MappingProxyType({}) if anew else self.state.rules,
            asks=MappingProxyType({}) if anew else self.state.asks,
        )

    def _look_at_armed(self) -> None:
        """ARMED is what the parachutes say: one may be disarmed past us, or start anew."""
        state = self.state
        if state.stage is not Stage.ARMED or self.now < state.stage_since + _ARMED_SHOWS:
            return
        said = [
            status.armed
            for link in self.config.deploy_links
            for status in state.evidence(link).devices.values()
            if status.link_state is LinkState.OK
        ]
        if said and not any(said):
            text = "no parachute says any more that it is armed"
            self.outputs.append(i.Say(text, alarm=True))
            self.move(Stimulus.DISARMED, text)

    def _look_at_links(self) -> None:
        stage = self.state.stage
        if not any(listed(stage, stimulus) for stimulus in _OF_LINKS):
            return
        reasons = block_reasons(self.config, self.state, self.now)
        grace = max(self.config.limits(link).startup_grace for link in self.config.links)
        starting = self.now < self.state.started_at + grace
        if stage is Stage.STARTUP and reasons and starting:
            return
        stimulus = Stimulus.LINKS_UNHEALTHY if reasons else Stimulus.LINKS_HEALTHY
        if listed(stage, stimulus):
            self.move(stimulus, "; ".join(reasons))
            if not reasons and (text := not_seen(self.config, self.state)):
                self.outputs.append(i.Say(f"not seen in flight: {text}"))

    def _block_or_release(self) -> None:
        """Flight is blocked on the ground until READY, and after a deploy until a reset."""
        if self.state.mode is i.Mode.INHIBITED:
            return
        if self.state.stage in (Stage.READY, Stage.ARMED):
            action = Action.FLIGHT_BLOCK_RELEASE
            reasons: tuple[str, ...] = ("every required link is healthy",)
        elif self.state.stage in (Stage.STARTUP, Stage.BLOCKED, Stage.DEPLOYED, Stage.FAULT) or (
            self._killed_on_ground()
        ):
            action = Action.FLIGHT_BLOCK
            reasons = block_reasons(self.config, self.state, self.now)
        elif self.state.stage is Stage.IN_FLIGHT:
            action, reasons = Action.FLIGHT_BLOCK_RELEASE, ("in the air",)
        else:
            return
        block = self.state.block
        if self.state.mode is i.Mode.SHADOW and block is not None and not block.decision.shadow:
            # Leaving ACTIVE took the block back; that must arrive before anything is only said.
            if self._worth_sending(block):
                return
            block = None
        if block is None or block.decision.action is not action:
            self.decide("block", action, "links", reasons, self.config.links)

    def _killed_on_ground(self) -> bool:
        """The kill has ended, so that a block does not overtake it, and nothing follows it."""
        state = self.state
        ended = state.kill is not None and (state.kill.confirmed or self.kill_failed(state.kill))
        on_ground = not state.killed_in_flight and not state.deploy_rule
        return state.stage is Stage.KILLING and ended and on_ground

    def _send_again(self) -> None:
        waiting = {slot: one for slot in self.slots if (one := self._unheard(slot)) is not None}
        due = {slot for slot, one in waiting.items() if self.now >= one.resend_at(self.config)}
        # A node that is started anew must not see the deploy first.
        kill_too = any(isinstance(slot, int) for slot in due)
        for slot in waiting:
            if slot in due or (slot == "kill" and kill_too):
                self.send_again(slot)

    def _unheard(self, slot: Slot) -> Pending | None:
        """What is on its way, and worth to be sent again."""
        one = self.pending(slot)
        heard = one is None or one.decision.shadow or not self._worth_sending(one)
        return None if heard else one

    def _worth_sending(self, pending: Pending) -> bool:
        """Somebody has not reported: a node that is alive, or any while it can still help."""
        action = pending.decision.action
        if action is Action.DEPLOY:
            # It ends with the stage, by its limit or because a parachute is out.
            return self.state.stage is Stage.DEPLOYING and bool(pending.unreported())
        if action is Action.KILL:
            return self.kill_can_help(pending) and bool(pending.unreported())
        return any(
            not self.evidence(link).silent(self.config.limits(link).lost_after, self.now)
            for link in pending.unreported()
        )
