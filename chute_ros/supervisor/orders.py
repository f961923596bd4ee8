"""Kill and deploy as people, devices and rules order them: the kill first, each once."""

from __future__ import annotations

from chute_ros.model import Action, Armed, Outcome
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.gate import OPERATOR, out_already
from chute_ros.supervisor.machine import Stage, Stimulus, listed
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.state import Pending
from chute_ros.supervisor.steps import Steps

ON_GROUND = (Stage.STARTUP, Stage.BLOCKED, Stage.READY, Stage.ARMED, Stage.LANDED)
#: What a vehicle says so soon after a kill was decided may be from before it, s.
_KILL_SETTLES = 0.2


class Orders(Steps):
    """An order of the same kind that is under way is joined."""

    def order_kill(
        self, rule: str, reasons: tuple[str, ...], token: int = 0, kill_only: bool = False
    ) -> None:
        """Stop the motors. token not 0: a person waits for it, and kill_only says whether they
        want no deploy to follow it."""
        if self.state.mode is not i.Mode.ACTIVE:
            self.fire(Action.KILL, rule, reasons)
            return
        self.end_kill()
        if token:
            self.state = replace(self.state, kill_tokens=(*self.state.kill_tokens, token))
        # Beside an open canopy it changes nothing else; nor does it end what FAULT tries again.
        if self.state.stage not in (Stage.DEPLOYED, Stage.FAULT):
            self._to_killing("; ".join(reasons))
        if token:
            self.state = replace(self.state, kill_only=kill_only)
        if not self._kill_joined(token):
            self.fire(Action.KILL, rule, reasons)

    def order_deploy(self, rule: str, reasons: tuple[str, ...]) -> None:
        """The kill first, unless one is on its way or confirmed; the deploy follows it."""
        if self.state.mode is not i.Mode.ACTIVE:
            for action in (Action.KILL, Action.DEPLOY):
                self.fire(action, rule, reasons)
            return
        again = self.state.stage is Stage.DEPLOYED  # a person insists: another parachute
        if self.state.deploy_rule:
            self._join_deploy(rule, reasons)
            return
        if self.deploy_reached(Outcome.CONFIRMED) and not again:
            return  # out already, which is said at the end of this update
        all_out = all(out_already(self.state, rung) for rung in self.config.ladder)
        if again and rule != OPERATOR and all_out:
            text = f"the canopy does not carry, and no other is left: {'; '.join(reasons)}"
            self.alarm(text)
            alarm_at = self.now + self.config.alarm_interval
            self.state = replace(self.state, canopy_fails=True, alarm_at=alarm_at)
            return
        if self.state.stage in ON_GROUND or again:
            self.note_released()
        self.end_kill()
        kill, since = self.state.kill, self.now
        if self.state.stage is Stage.KILLING and self._kill_under_way():
            assert kill is not None
            since = kill.decided_at
        elif (
            self.state.stage is not Stage.KILLING
            or kill is None
            or not kill.confirmed
            or self.armed_since(kill)
        ):
            self._to_killing("; ".join(reasons))
            self.fire(Action.KILL, rule, reasons)
        still_in = tuple(r for r in self.config.ladder if not out_already(self.state, r))
        self.state = replace(
            self.state,
            deploy_rule=rule,
            deploy_reasons=reasons,
            deploy_due=since + self.config.kill_to_deploy_delay,
            # Where all are out as far as is known, none of them is trusted to be.
            deploy_ladder=still_in,
            deploys=(),
        )

    def _join_deploy(self, rule: str, reasons: tuple[str, ...]) -> None:
        """A rule's deploy that a person wants as well is theirs: no height holds it back."""
        if rule == OPERATOR and self.state.deploy_rule != OPERATOR:
            both = (*self.state.deploy_reasons, *reasons)
            self.state = replace(self.state, deploy_rule=rule, deploy_reasons=both)

    def _to_killing(self, why: str) -> None:
        if listed(self.state.stage, Stimulus.KILL):
            if self.state.stage is not Stage.KILLING:
                stood = flight.down_undisputed(
                    self.config, self.state, self.now
                ) or flight.disarmed(self.config, self.state, self.now)
                sinking = -flight.measured(self.config, self.state, "vertical_speed", self.now)
                self.state = replace(
                    self.state,
                    kill_only=False,
                    killed_in_flight=self.state.airborne,
                    killed_standing=stood,
                    killed_at=self.now,
                    killed_height=flight.measured(self.config, self.state, "height", self.now),
                    killed_sinking=max(sinking, 0.0),
                )
            self.move(Stimulus.KILL, why)

    def _kill_under_way(self) -> bool:
        """A kill is on its way and may still be confirmed."""
        kill = self.state.kill
        return kill is not None and not kill.confirmed and not self.kill_failed(kill)

    def _kill_joined(self, token: int) -> bool:
        """Does a kill that was decided already serve this request?

        A person who asks after the confirmation sees motors that turn, and is obeyed again. A
        device repeats itself; that must not become a new decision each time.
        """
        kill = self.state.kill
        if token or kill is None or self._kill_under_way():
            return self._kill_under_way()
        if kill.confirmed and self.armed_since(kill):
            return False
        wait = self.config.kill_timeout if kill.confirmed else self.config.resend_interval
        return self.now < kill.decided_at + wait

    def armed_since(self, kill: Pending) -> bool:
        """The vehicle says, and said after this kill had its time, that it is armed (again)."""
        said_at = self.state.vehicle_received - self.state.vehicle.armed_age
        said = flight.armed(self.config, self.state, self.now)
        return said is Armed.ARMED and said_at > kill.decided_at + _KILL_SETTLES
