"""The story of the simulated rocket: block, wipe, key, launch, apogee without a drogue, deploy,
main, landing."""

from __future__ import annotations

from typing import Any

from chute_msgs.msg import Telem
from chute_msgs.srv import UmbilicalCommand

from chute_ros.model import Action, Outcome
from chute_ros.ros import qos
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.demo_director import Director, StepFailedError
from chute_ros.tools.rocket_rig import SPEED, UMBILICAL, DemoRocketRig

#: The operator presses the button when it falls faster than this, m/s.
OPERATOR_SINK = -30.0
#: What counts as a soft landing, m/s.
LANDING_SINK = -8.0


class RocketStory:
    """Sees the telemetry beside what the director sees."""

    def __init__(self, rig: DemoRocketRig, director: Director) -> None:
        self.rig, self.director = rig, director
        self.telem = Telem(flight_mode=Telem.FLIGHT_MODE_UNKNOWN)
        self.apogee = 0.0
        director.node.create_subscription(Telem, "umbilical/telem", self._telem, qos.STATUS)

    def fly(self) -> None:
        """All of it; StepFailedError where a step does not happen in its time."""
        say = self.director.say
        say("demo", f"real nodes over a real pty, in {self.rig.namespace}, on this host only")
        say("demo", f"the rocket's world runs {SPEED:g} times as fast as ours")
        self.rig.start_ground()
        self._preflight()
        self._launch()
        self._no_drogue()
        self._descend()
        self._summary()

    # -- the steps ------------------------------------------------------------------------------

    def _preflight(self) -> None:
        director = self.director
        director.until("flight is blocked", 20.0, lambda: director.safety.flight_blocked)
        director.say("demo", f"no cable yet: {'; '.join(director.safety.block_reasons)}")
        self._refused("launch", True, "launch")

        director.say("demo", "plugs the cable in")
        self.rig.plug_cable_in()
        director.until("the flight computer is received", 15.0, lambda: bool(director.parachutes))
        director.until("telemetry is received", 5.0, lambda: self.telem.sequence > 0)
        director.say("rocket", f"telemetry {self.telem.layout}, flight mode Startup")
        director.until("flight is released", 15.0, director.stage(Stage.READY))
        director.say("supervisor", "READY: every required link is healthy")

        director.say("operator", "arms the parachute")
        refused = self._answer(director.ask_arm(), "arming is answered")
        if refused.success:
            raise StepFailedError("it armed although the flash was not wiped")
        director.say("rocket", refused.message)
        director.say("operator", "wipes the flash")
        wiped = self._command("wipe_flash", False)
        if not wiped.success:
            raise StepFailedError(f"wiping: {wiped.message}")
        director.say("rocket", wiped.message)
        director.until("it is received again", 10.0, director.stage(Stage.READY))
        armed = self._answer(director.ask_arm(), "arming is answered")
        if not armed.success:
            raise StepFailedError(f"arming: {armed.message}")
        director.say("rocket", f"key armed: {armed.message}")

    def _launch(self) -> None:
        director = self.director
        self._refused("drogue", False, "on the ground")
        self._refused("launch", False, "without a confirmation")
        director.say("operator", "confirms the launch")
        launched = self._command("launch", True)
        if not launched.confirmed:
            raise StepFailedError(f"launch: {launched.message}")
        director.failure_now()
        director.say("rocket", "LAUNCH")
        director.until("the supervisor sees it fly", 10.0, director.stage(Stage.IN_FLIGHT))
        director.say("supervisor", "IN_FLIGHT")
        self._until_mode(Telem.COAST, "burnout")
        director.say("rocket", f"burnout at {self.telem.altitude:.0f} m, {self._speed:+.0f} m/s")

    def _no_drogue(self) -> None:
        director = self.director
        director.until("apogee", 30.0, lambda: self._speed < 0.0 and self.apogee > 0.0)
        director.say("rocket", f"APOGEE at {self.apogee:.0f} m, and no drogue")
        director.until("it falls", 20.0, lambda: self._speed < OPERATOR_SINK)
        director.say("operator", f"sees {self._speed:.0f} m/s and calls deploy")
        result = self._answer(director.ask_deploy("it falls"), "the deploy is answered")
        director.say("operator", f"success={result.success}: {result.message}")
        if not result.success:
            raise StepFailedError(f"deploy: {result.message}")
        director.say("rocket", f"DROGUE at {self.telem.altitude:.0f} m")

    def _descend(self) -> None:
        director = self.director
        self._until_mode(Telem.MAIN_DEPLOYED, "the flight computer fires the main")
        director.say("rocket", f"MAIN at {self.telem.altitude:.0f} m, {self._speed:+.0f} m/s")
        last = {"speed": 0.0}

        def landed() -> bool:
            if self.telem.altitude > 2.0:
                last["speed"] = self._speed
            return bool(director.vehicle.landed_state == 1)

        director.until("landing", 60.0, landed)
        director.say("rocket", f"LANDED at {last['speed']:+.1f} m/s")
        if last["speed"] < LANDING_SINK:
            raise StepFailedError(f"landed at {last['speed']:.1f} m/s (limit {LANDING_SINK} m/s)")

    def _summary(self) -> None:
        """Times since the launch, and the flight as a picture."""
        director = self.director
        steps = [
            ("kill (<V>) on the wire", director.when(Action.KILL, Outcome.SENT)),
            ("kill confirmed: MAV and SV closed", director.when(Action.KILL, Outcome.CONFIRMED)),
            ("deploy (<D>) on the wire", director.when(Action.DEPLOY, Outcome.SENT)),
            ("drogue confirmed by telemetry", director.when(Action.DEPLOY, Outcome.CONFIRMED)),
        ]
        times = [when for _, when in steps]
        if times != sorted(times):
            raise StepFailedError(f"the kill did not go before the deploy: {steps}")
        marks = [(times[0], "K"), (times[2], "D")]
        director.summarize(steps, "launch", "altitude over time (K kill, D deploy)", marks)

    # -- what they are made of -------------------------------------------------------------------

    @property
    def _speed(self) -> float:
        """Up positive, m/s."""
        return -float(self.telem.vel_d)

    def _telem(self, message: Telem) -> None:
        self.telem = message
        self.apogee = max(self.apogee, message.altitude)

    def _until_mode(self, mode: int, what: str) -> None:
        self.director.until(what, 60.0, lambda: self.telem.flight_mode == mode)

    def _answer(self, future: Any, what: str) -> Any:
        self.director.until(what, 30.0, future.done)
        return future.result()

    def _command(self, name: str, force: bool) -> Any:
        future = self.director.ask(
            UmbilicalCommand, f"{UMBILICAL}/command", command=name, force=force, reason="demo"
        )
        return self._answer(future, f"{name} is answered")

    def _refused(self, name: str, force: bool, how: str) -> None:
        """The operator tries what the gate refuses."""
        self.director.say("operator", f"tries {name} {how}".replace(f"{name} {name}", name))
        answer = self._command(name, force)
        if answer.sent:
            raise StepFailedError(f"{name} left {how}: {answer.message}")
        self.director.say(UMBILICAL, answer.message)
