"""The flight program of a simulated flight computer: modes, valves, canopies, commands to them.

It lives in two times: commands and the arming key are looked at in real time, the flight itself
is watched in the time of the simulated world, which may be faster.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from chute_ros.links.umbilical.simulator.commands import target_of
from chute_ros.links.umbilical.simulator.settings import ComputerMode, FlightComputerSettings
from chute_ros.sim.acting import NotNowError
from chute_ros.sim.rocket import Rocket

#: The flight is looked at this often, simulated s.
STEP = 0.05
#: Below this height above ground (2000 ft) the main canopy comes, m,
MAIN_HEIGHT = 610.0
#: but not before the drogue has been out for so long, simulated s.
MAIN_DELAY = 3.0


class FlightProgram:
    """say: a line for whoever watches; print_line: one on the wire; log: one in debug mode."""

    def __init__(
        self,
        settings: FlightComputerSettings,
        target_floats: int,
        log: Callable[[str, str], None],
        print_line: Callable[[str], None],
    ) -> None:
        self.rocket = Rocket()
        #: Neither drogue nor main come out any more, whoever wants it.
        self.is_stuck = False
        #: At the apogee nothing comes out; by command it still does.
        self.drogue_fails = settings.drogue_fails
        self.armed_altitude = 0.0
        self.handlers: dict[str, Callable[[], None]] = {
            "<L>": self._launch,
            "<V>": self._safe,
            "<KA>": self._arm,
            "<KD>": lambda: setattr(self, "_key", False),
            "<M>": lambda: self._set("mav_open", 1),
            "<m>": lambda: self._set("mav_open", 0),
            "<S>": lambda: self._set("sv_open", 1),
            "<s>": lambda: self._set("sv_open", 0),
            "<D>": self._manual_drogue,
            "<d>": self._manual_main,
            **{f"<{n}>": self._payload(f"cmd_n{n}") for n in range(1, 5)},
            **{f"<A{n}>": self._payload(f"cmd_a{n}") for n in range(1, 4)},
        }
        self._settings, self._target_floats, self._log = settings, target_floats, log
        self._print_line = print_line
        self._drogue_out_for = math.inf  # simulated s
        self.restart()

    def restart(self) -> None:
        """Begin as after a reset. A canopy that is out stays out."""
        self.mode = ComputerMode.Startup
        #: The flash was wiped; needed for arming with the interlock.
        self.may_arm = False
        self.target: tuple[float, ...] = ()
        self._key = False
        #: Fields that commands set, by name.
        self.flags = dict.fromkeys(
            (
                *("mav_open", "sv_open", "ssa_drogue_deployed", "ssa_main_deployed"),
                *("cmd_n1", "cmd_n2", "cmd_n3", "cmd_n4", "cmd_a1", "cmd_a2", "cmd_a3"),
            ),
            0,
        )

    def command(self, token: str) -> None:
        """Do what a token says that is for the flight program."""
        if token in self.handlers:
            self.handlers[token]()
        else:
            self.target = target_of(token, self._target_floats) or self.target

    def turn_key(self) -> None:
        """Follow the arming key, once each turn of the flight loop."""
        if self.mode is ComputerMode.Startup and self._key:
            self.armed_altitude = self.rocket.altitude
            self._enter(ComputerMode.Standby)
        elif self.mode is ComputerMode.Standby and not self._key:
            self.may_arm = False
            self._enter(ComputerMode.Startup)

    def fly(self, dt: float, is_running: bool) -> None:
        """Move the world on by dt, simulated s, and watch it if the program runs."""
        steps = max(1, math.ceil(dt / STEP - 1e-9))
        for _ in range(steps):
            self.rocket.step(dt / steps)
            self._drogue_out_for += dt / steps
            if is_running:
                self._watch()

    def fail(self) -> None:
        """Go to Fault: nothing is automatic any more."""
        self._enter(ComputerMode.Fault)

    def arm_and_launch(self) -> None:
        """What a crew does: turn the key, and launch. NotNowError: it cannot."""
        if self.mode not in (ComputerMode.Startup, ComputerMode.Standby):
            raise NotNowError(f"it is in {self.mode.name}: need Startup or Standby")
        if not self.rocket.on_ground or not math.isnan(self.rocket.burned_for):
            raise NotNowError("its motor is spent: start over (mend)")
        if self._settings.interlock and not self.may_arm:
            raise NotNowError("arming is blocked: wipe the flash first")
        self._key = True
        self.turn_key()
        self._launch()

    def mend(self) -> None:
        """Put the rocket on its pad, with a new motor and its canopies packed."""
        self.rocket = Rocket()
        self._drogue_out_for = math.inf
        self.is_stuck, self.drogue_fails = False, self._settings.drogue_fails

    def jump(self, mode: ComputerMode) -> None:
        """Put the rocket where it plausibly is in this mode."""
        if mode is ComputerMode.Fault:
            self.fail()
            return
        places = {
            ComputerMode.Ascent: (300.0, 155.0, 3.8),
            ComputerMode.Coast: (2000.0, 50.0, math.inf),
            ComputerMode.DrogueDeployed: (2500.0, -28.0, math.inf),
            ComputerMode.MainDeployed: (400.0, -6.6, math.inf),
        }
        height, speed, burned = places.get(mode, (0.0, 0.0, math.nan))
        self.rocket = Rocket(height=height, vertical_speed=speed, burned_for=burned, apogee=height)
        self._key = mode is not ComputerMode.Startup
        self._set("mav_open", int(mode is ComputerMode.Ascent))
        drogue = mode in (ComputerMode.DrogueDeployed, ComputerMode.MainDeployed)
        self._set("ssa_drogue_deployed", int(drogue))
        self._set("ssa_main_deployed", int(mode is ComputerMode.MainDeployed))
        if drogue:
            self.rocket.drogue_out_for = self._drogue_out_for = 60.0
        if mode is ComputerMode.MainDeployed:
            self.rocket.main_out_for = 60.0
        self._enter(mode)

    # -- the flight by itself -------------------------------------------------------------------

    def _watch(self) -> None:
        rocket = self.rocket
        falls = rocket.vertical_speed < 0.0 and not self.drogue_fails
        is_low = rocket.height < MAIN_HEIGHT and self._drogue_out_for >= MAIN_DELAY
        if self.mode is ComputerMode.Ascent and not rocket.burning:
            self._set("mav_open", 0)
            self._enter(ComputerMode.Coast)
        elif self.mode is ComputerMode.Coast and falls and self._fire_drogue():
            self._enter(ComputerMode.DrogueDeployed)
        elif self.mode is ComputerMode.DrogueDeployed and is_low and self._fire_main():
            self._enter(ComputerMode.MainDeployed)

    def _fire_drogue(self) -> bool:
        if self.is_stuck:
            return False
        if not self.flags["ssa_drogue_deployed"]:
            self._drogue_out_for = 0.0
            self._log("INFO", "Drogue deployed")
        self._set("ssa_drogue_deployed", 1)
        if not self.rocket.on_ground:
            self.rocket.release_drogue()
        return True

    def _fire_main(self) -> bool:
        if self.is_stuck:
            return False
        if not self.flags["ssa_main_deployed"]:
            self._log("INFO", "Main deployed")
        self._set("ssa_main_deployed", 1)
        if not self.rocket.on_ground:
            self.rocket.release_main()
        return True

    def _enter(self, mode: ComputerMode) -> None:
        if mode is not self.mode:
            self._log("INFO", f"Flight mode {self.mode.name} -> {mode.name}")
            self.mode = mode

    # -- commands -------------------------------------------------------------------------------

    def _set(self, name: str, value: int) -> None:
        self.flags[name] = value

    def _payload(self, name: str) -> Callable[[], None]:
        return lambda: self._set(name, 1)

    def _launch(self) -> None:
        if self.mode is ComputerMode.Standby:
            self._set("mav_open", 1)
            self.rocket.ignite()
            self._enter(ComputerMode.Ascent)

    def _safe(self) -> None:
        self._set("mav_open", 0)
        self._set("sv_open", int(self._settings.safe_opens_sv))

    def _arm(self) -> None:
        if self.mode is ComputerMode.Startup and self._settings.interlock and not self.may_arm:
            self._print_line("Arming blocked: wipe flash first")
            return
        self._key = True

    def _manual_drogue(self) -> None:
        if self._fire_drogue() and self.mode is ComputerMode.Coast:
            self._enter(ComputerMode.DrogueDeployed)

    def _manual_main(self) -> None:
        if self._fire_main() and self.mode is ComputerMode.DrogueDeployed:
            self._enter(ComputerMode.MainDeployed)
