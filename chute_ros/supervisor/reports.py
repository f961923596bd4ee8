"""What the device nodes report: their heartbeats, their parachutes, how decisions fare."""

from __future__ import annotations

import math
from types import MappingProxyType

from chute_ros.model import Action, Armed, LinkState, Outcome, VehicleState
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.contradictions import commanded, denials, noted
from chute_ros.supervisor.epochs import LARGEST_EPOCH, RANKS, epoch_above
from chute_ros.supervisor.kinds import kind
from chute_ros.supervisor.machine import Stage, Stimulus
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    CLIMB_RATE,
    DEGREES,
    HEIGHT,
    PRESSURE_ALTITUDE,
    TILT,
    VERTICAL_SPEED,
    pressure_altitude,
    samples_of,
)
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.requests import Requests
from chute_ros.supervisor.state import CONTRADICTED_FOR

#: A vertical speed and that of the heights differ by so much if one of them is wrong, m/s: a fall
#: that began within the second of the heights is seen late by them.
_SPEEDS_DIFFER = 10.0
#: Accelerometers differ by more than motors that shake make them, m/s^2.
_FORCES_DIFFER = 6.0
#: What the newest pressure counts in that of the ground.
_OF_NEWEST = 0.1
#: A barometer that was not heard for longer was silent, s.
_SILENCE = 0.5
#: No force without any speed is that of a fall for so long, s.
_NEVER_FALLS_FOR = 3.0
#: An accelerometer at rest feels gravity, m/s^2 (with its bias, and motors that idle); it is found
#: fit or unfit by the samples of so long, s.
_AT_REST, _FITNESS_TAKES = (7.8, 11.8), 1.0
#: A vehicle that was not heard as it was killed may be so much later, s.
_HEARD_AFTER_KILL = 1.0


class Reports(Requests):
    """Takes reports in. Nobody but a link that is configured is listened to."""

    def heartbeat(self, one: i.LinkHeartbeat) -> None:
        """A node lives. One whose count does not rise has restarted; a lost one may have."""
        if one.link not in self.config.links:
            return
        before, limits = self.evidence(one.link), self.config.limits(one.link)
        known = not math.isnan(before.heard)
        silent = before.silent(limits.lost_after, self.now)
        self.set_evidence(one.link, before.with_heartbeat(one, limits, self.now))
        if self.state.leading:
            # The alarms of one that follows are those of the leader, which has another clock.
            self._look_at_clock(one.link)
            self._look_at_delay(one.link, before.looks_late)
        if known and (silent or one.seq <= before.seq):
            # It may know of no decision; what still holds for it is decided anew.
            restarted = one.seq <= before.seq
            why = f"{one.link} {'restarted' if restarted else 'is back'}"
            for slot in self.slots:
                pending = self.pending(slot)
                if pending is None or one.link not in pending.targets:
                    continue
                # One that goes on counting goes on with what it has begun: no second shot.
                begun = not restarted and one.link not in pending.not_begun()
                if slot == "block" or not begun:
                    self.renew(slot, why)

    def _look_at_clock(self, link: str) -> None:
        """Its wall clock against the one here."""
        text = f"{link}: its wall clock differs; it may refuse decisions as too old"
        difference = abs(self.evidence(link).clocks_differ_by)
        told, limit = text in self.state.alarms, self.config.preflight.max_clock_difference
        if difference > limit and not told:
            self.alarm(text)
        elif difference <= limit and told:
            alarms = tuple(one for one in self.state.alarms if one != text)
            self.state = replace(self.state, alarms=alarms)
            self.outputs.append(i.Say(f"{link}: its wall clock agrees again"))

    def _look_at_delay(self, link: str, before: str) -> None:
        """On the ground it forbids take-off."""
        text = self.evidence(link).looks_late
        if self.state.airborne and text and not before:
            self.outputs.append(i.Say(f"{link}: {text}", alarm=True))

    def parachute(self, one: i.ParachuteReport) -> None:
        """One device on a link tells its picture."""
        if one.link not in self.config.links:
            return
        status, alive = one.status, one.status.link_state is LinkState.OK
        said = self.evidence(one.link).devices.get(status.device)
        was_out = said is not None and said.deployed
        # One that started anew has forgotten it, which takes nothing back.
        forgot = said is not None and status.uptime < said.uptime
        self.set_evidence(one.link, self.evidence(one.link).with_status(status, self.now))
        if alive and not status.deployed:
            before = self.state.released_before - {(one.link, status.device)}
            self.state = replace(self.state, released_before=before)
            aloft = flight.in_air(self.config, self.state, self.now) is not False
            if was_out and aloft and self.state.stage is Stage.DEPLOYED:
                text = f"{one.link} {status.device} no longer reports deployed"
                if self.state.deploys or not self.state.airborne or forgot:
                    self.alarm(f"{text}; a forced deploy continues with the next")
                else:
                    # It may have erred when it said so; with nothing out, the rules must live.
                    self.alarm(text)
                    self.move(Stimulus.TAKEN_BACK, text)
                    self._unlatch_deploys()

    def _unlatch_deploys(self) -> None:
        """What a deploy rule was acted on for has not been done."""
        deploys = {one.name for one in self.config.profile.rules if one.action is Action.DEPLOY}
        rules = {
            name: replace(evidence, latched=evidence.latched and name not in deploys)
            for name, evidence in self.state.rules.items()
        }
        self.state = replace(self.state, rules=MappingProxyType(rules))

    def vehicle(self, one: i.VehicleReport) -> None:
        """What the vehicle is told to be, and each measurement in it as evidence."""
        new = one.state
        self._note_home(new)
        state, limits = self.state, self.config.profile.limits
        samples = samples_of(new, self.now, state.home, state.home_altitude)
        before = {
            # What nobody tells just now has not changed its source.
            name: state.measured(name).told_by(one.told_by.get(flight.PARTS.get(name, name), ""))
            if math.isfinite(sample.measured_at)
            else state.measured(name)
            for name, sample in samples.items()
        }
        measurements = {
            name: before[name].with_sample(sample, limits[name])
            for name, sample in samples.items()
        }
        was_disarmed = state.vehicle.armed is Armed.DISARMED
        differ = new.acceleration_spread > _FORCES_DIFFER
        self.state = replace(
            state,
            vehicle=new,
            vehicle_received=self.now,
            disputed=one.disputed | {ACCELERATION} if differ else one.disputed,
            measurements=MappingProxyType({**state.measurements, **measurements}),
        )
        self._note_heights_told()
        self._note_contradictions()
        self._note_height_of_kill()
        self._note_reboots(new)
        self._note_faults(new.faults)
        if was_disarmed and new.armed is Armed.ARMED:
            height = flight.measured(self.config, self.state, "height", self.now)
            self.state = replace(self.state, armed_height=0.0 if math.isnan(height) else height)

    def _note_height_of_kill(self) -> None:
        """Height and speed, where they were not known as it was killed: it has fallen since, so
        that no more is counted on than is left."""
        state = self.state
        known = not math.isnan(state.killed_height + state.killed_sinking)
        if known or state.stage is not Stage.KILLING or not state.killed_in_flight:
            return
        height = flight.measured(self.config, state, HEIGHT, self.now)
        sinking = -flight.measured(self.config, state, VERTICAL_SPEED, self.now)
        heard = not math.isnan(height + sinking)
        if heard and self.now <= state.killed_at + _HEARD_AFTER_KILL:
            sinking = max(sinking, 0.0)
            self.state = replace(state, killed_height=height, killed_sinking=sinking)

    def _note_home(self, new: VehicleState) -> None:
        """What heights are above, as long as it has not taken off: an autopilot that moves its
        home in flight, or sets its height to zero, moves nothing here."""
        state = replace(self.state, vehicle=new, vehicle_received=self.now)
        if state.airborne and not math.isnan(state.home_altitude):
            return
        home_altitude = new.altitude - new.height
        if not math.isnan(home_altitude):
            self.state = replace(self.state, home_altitude=home_altitude)
        here = pressure_altitude(new.pressure)
        if state.airborne or flight.says_down(self.config, state, self.now) is not True:
            return
        before = state.ground_pressure_altitude
        still = flight.armed(self.config, state, self.now) is not Armed.ARMED
        if not math.isnan(here) and (still or math.isnan(before)):
            ground = here if math.isnan(before) else before + _OF_NEWEST * (here - before)
            self.state = replace(self.state, ground_pressure_altitude=ground)

    def _note_heights_told(self) -> None:
        """Keep the heights of the last second, at most ten of them, all since one was doubted:
        what is left of noise without its jumps may look like a fall."""
        heights = self._kept(HEIGHT, self.state.heights)
        pressure_heights = self._kept(PRESSURE_ALTITUDE, self.state.pressure_heights)
        if heights is self.state.heights and pressure_heights is self.state.pressure_heights:
            return
        before, known = self.state.pressure_before, self.state.pressure_heights
        if known and pressure_heights[-1][0] - known[-1][0] > _SILENCE:
            before = known[-1]
        self.state = replace(
            self.state,
            heights=heights,
            pressure_heights=pressure_heights,
            pressure_before=before,
        )

    def _kept(
        self, name: str, before: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        height = self.state.measured(name)
        if math.isnan(height.measured_at):
            return before
        kept = tuple(
            one
            for one in before
            if 0.0 <= height.measured_at - one[0] <= 1.0 and not one[0] < height.doubted_at
        )
        if not kept or height.measured_at - kept[-1][0] >= 0.1:
            kept = (*kept, (height.measured_at, height.value))
        return before if kept == before else kept

    def _note_contradictions(self) -> None:
        """What is claimed of a fall and is not so; in flight an alarm once it has lasted."""
        state, now = self.state, self.now

        def certain(name: str) -> float:
            doubted = name in state.disputed or state.measured(name).doubt(name, now)
            return math.nan if doubted else flight.measured(self.config, state, name, now)

        cosine = math.cos(certain(TILT) / DEGREES)
        moment = (now, certain(VERTICAL_SPEED), certain(ACCELERATION), cosine)
        motion = noted(state.motion, moment)
        if motion is state.motion:
            return
        denied = denials(
            motion,
            flight.pressure_change(self.config, state, now),
            flight.pressure_drop(self.config, state, now),
        )
        tilt, error, beyond, rate = (
            flight.measured(self.config, state, name, now)
            for name in (TILT, "attitude_error", "sink_beyond_target", CLIMB_RATE)
        )
        # An estimator that is wrong follows its command where the vehicle does not.
        climb_beyond = beyond + flight.measured(self.config, state, VERTICAL_SPEED, now) - rate
        since = {name: state.denied_since.get(name, now) for name in denied}
        # Of motors that are off nothing is commanded, whatever an autopilot goes on to tell.
        off = state.vehicle.armed is Armed.DISARMED
        told = {} if off else commanded(tilt, error, beyond, climb_beyond)
        self.state = replace(
            state,
            motion=motion,
            denied=MappingProxyType(dict(denied)),
            denied_since=MappingProxyType(since),
            commanded=MappingProxyType(dict(told)),
        )
        last = state.motion[-1][0] if state.motion else now
        for name, begun in since.items():
            if state.airborne and last < begun + CONTRADICTED_FOR <= now:
                self.outputs.append(i.Say(f"{name} is contradicted: {denied[name]}", alarm=True))
        self._note_fitness()

    def _note_fitness(self) -> None:
        """An accelerometer that tells on the ground what it cannot feel there, or without any
        speed of a fall, is not used until it tells on the ground what it must."""
        state, now = self.state, self.now
        unfit = dict(state.unfit)
        begun = state.denied_since.get(ACCELERATION, math.nan)
        if now >= begun + _NEVER_FALLS_FOR:
            unfit.setdefault(ACCELERATION, f"it reports a fall, but {state.denied[ACCELERATION]}")
        since = math.nan
        stands = not state.airborne and flight.says_down(self.config, state, now) is True
        speeds = (
            flight.measured(self.config, state, name, now) for name in (VERTICAL_SPEED, CLIMB_RATE)
        )
        stands = stands and not any(abs(s) > self.config.profile.moving_speed for s in speeds)
        known = state.measured(ACCELERATION)
        force = known.usable(self.config.profile.limits[ACCELERATION], now)
        if stands and not math.isnan(force):
            least, most = _AT_REST
            fits = least <= force <= most
            if fits == (ACCELERATION in unfit):
                since = now if math.isnan(state.fitness_since) else state.fitness_since
                if now >= since + _FITNESS_TAKES:
                    unfit.pop(ACCELERATION, None)
                    if not fits:
                        unfit[ACCELERATION] = (
                            f"it reports {force:.1f} m/s^2 while the vehicle stands (need "
                            f"{least:g} to {most:g}; a driver that removes gravity reports 0)"
                        )
        if unfit != state.unfit or since != state.fitness_since:
            self.state = replace(state, unfit=MappingProxyType(unfit), fitness_since=since)

    def _note_faults(self, faults: tuple[str, ...]) -> None:
        """In flight what forbids a take-off is an alarm, each once as long as it lasts."""
        told = set(map(kind, self.state.faults_told))
        new = [one for one in faults if kind(one) not in told]
        if self.state.airborne:
            self.outputs += [i.Say(f"vehicle: {one}", alarm=True) for one in new]
        if faults != self.state.faults_told:
            self.state = replace(self.state, faults_told=faults if self.state.airborne else ())

    def _note_reboots(self, new: VehicleState) -> None:
        """Restarts on the ground do not count; a node that counts from 0 again has restarted."""
        state = self.state
        before = min(state.reboots_before, new.reboot_count)
        if not state.airborne and not flight.in_air(self.config, state, self.now):
            before = new.reboot_count
        again = new.rebooted_in_flight and new.reboot_count > before
        if again and state.airborne and not state.rebooted:
            self.outputs.append(i.Say("the autopilot started anew in flight", alarm=True))
        rebooted = state.rebooted or (again and state.airborne)
        if (before, rebooted) != (state.reboots_before, state.rebooted):
            # Heights from before it may be above another ground.
            heights = state.heights if rebooted == state.rebooted else ()
            self.state = replace(state, reboots_before=before, rebooted=rebooted, heights=heights)

    def action_report(self, one: i.ActionReport) -> None:
        """How far a node got with a decision, and which is the newest that it knows."""
        if one.link not in self.config.links or one.outcome is Outcome.NONE:
            return
        of_our_epoch = one.epoch == self.state.epoch
        # Somebody else decides, or decided before us, under our epoch: the numbers are not ours.
        same = one.newest_epoch == self.state.epoch
        foreign = same and one.newest_id >= self.state.next_id
        if not foreign:
            self._take_outcome(one)
        if (
            of_our_epoch
            and self.state.leading
            and (foreign or one.newest_epoch > self.state.epoch)
        ):
            self._overtake(one)

    def _take_outcome(self, one: i.ActionReport) -> None:
        for slot in self.slots:
            pending = self.pending(slot)
            if pending is None or one.link not in pending.targets:
                continue
            number, failed = (one.epoch, one.id), one.outcome is Outcome.FAILED
            if number != pending.number:
                asked_again = one.link in pending.decision.targets
                refused = failed or one.outcome is Outcome.REFUSED
                if number not in pending.earlier or (asked_again and refused):
                    continue
            elif (
                failed
                and not pending.of(one.link)
                and self.wanted(slot)
                and self._overtaken(number, one.link)
            ):
                # Refused as older, not tried: those that have not begun get a new number.
                self.renew_missing(slot, f"{one.link} saw a newer decision first")
                return
            reached = pending.of(one.link) | {one.outcome}
            outcomes = MappingProxyType({**pending.outcomes, one.link: reached})
            details, text = pending.details, f"{one.link}: {one.detail}"
            if text not in details:
                details = (*details, text)[-8:]
            self.put(slot, replace(pending, outcomes=outcomes, details=details))

    def _overtaken(self, number: tuple[int, int], link: str) -> bool:
        """A node that saw a later decision of ours before this one refuses this one as older."""
        others = [self.pending(slot) for slot in self.slots]
        return any(
            other is not None and link in other.targets and other.number > number
            for other in others
        )

    def _overtake(self, one: i.ActionReport) -> None:
        """A node refuses what is older than it has seen: go on above that, unless it is another
        supervisor's."""
        epoch = epoch_above(one.newest_epoch, self.config.rank)
        if epoch > LARGEST_EPOCH:
            self.alarm(f"{one.link} has seen epoch {one.newest_epoch}, the largest: restart it")
            return
        if self.config.standby and one.newest_epoch % RANKS != self.config.rank:
            self.outputs.append(i.Refused(one.newest_epoch))
            return
        text = f"{one.link} has seen epoch {one.newest_epoch}: continuing as {epoch}"
        self.outputs.append(i.Say(text))
        self.state = replace(self.state, epoch=epoch)
        self.renew_not_begun(f"{one.link} knows a newer epoch")
