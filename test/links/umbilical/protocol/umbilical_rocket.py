"""A flight computer that speaks record by record, for the stories of its picture."""

import math

from umbilical_lines import record

from chute_ros.links.umbilical.protocol.flight_computer import FlightComputerTracker
from chute_ros.protocol.liveness import LivenessLimits
from chute_ros.sim.air import air_at

STARTUP, STANDBY, ASCENT, COAST, DROGUE, MAIN, FAULT = range(7)
LIMITS = LivenessLimits(3.0, 15.0)
ON_PAD = {"ssa_drogue_deployed": "0", "ssa_main_deployed": "0", "fix_type": "3"}


class Rocket:
    """A flight computer that started 100 s before time 0."""

    def __init__(self, main_counts=False):
        self.computer = FlightComputerTracker(LIMITS, main_counts)
        self.started = -100.0

    def says(self, at, mode, **texts):
        """A record; what changed of the link, and what its clock says. Of an altitude that is
        named the pressure is that of the standard atmosphere."""
        altitude = float(texts.get("altitude", "nan"))
        if math.isfinite(altitude) and "pressure" not in texts:
            texts["pressure"] = f"{air_at(altitude).pressure:.3f}"
        clock = {"ms_since_boot_cfc": str(round((at - self.started) * 1000))}
        texts = {**ON_PAD, **clock, "flight_mode": str(mode), **texts}
        came = self.computer.heard(record(at, **texts), at)
        self.computer.update(at)
        return came

    def descends(self, start, seconds, mode=DROGUE, height=2000.0, speed=20.0):
        """Ten records a second; the time of the last one."""
        at = start
        for step in range(round(seconds * 10) + 1):
            at = start + step / 10
            self.says(at, mode, altitude=f"{height - speed * step / 10:.3f}")
        return at

    def restarts(self, at):
        self.started = at - 0.5


def flown(*records):
    """A rocket that said these: (time, mode) or (time, mode, fields)."""
    rocket = Rocket()
    for at, mode, *texts in records:
        rocket.says(at, mode, **(texts[0] if texts else {}))
    return rocket


def status(rocket, at, pause=""):
    return rocket.computer.status(at, pause)


def vehicle(rocket, at):
    return rocket.computer.vehicle_state(at)
