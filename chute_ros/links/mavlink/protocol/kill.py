"""Which way the motors are stopped: by what the autopilot is, its settings, and kill_method.

Two ways: a forced disarm (MAV_CMD_COMPONENT_ARM_DISARM) and flight termination
(MAV_CMD_DO_FLIGHTTERMINATION). A kill alone must never open a parachute, and PX4 orders the
release itself as it terminates, at any height; so termination waits there, and wherever it is not
known what it does, until a deploy was decided too. One way that is refused, not answered or
without effect is followed by the other at once, and is itself tried on.

Sources, read and flown: PX4 src/modules/commander/Commander.cpp (send_parachute_command, disarm);
ArduPilot AP_AdvancedFailsafe.cpp (gcs_terminate, TERM_PIN), ArduCopter and ArduPlane
terminate_vehicle (42 stops the motors, 43 lands), AP_Arming.cpp (is_armed with REQUIRE 0).
"""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.mavlink.protocol.autopilot_settings import AutopilotSettings
from chute_ros.links.mavlink.protocol.config import KillMethod
from chute_ros.links.mavlink.protocol.firmware import Firmware
from chute_ros.model import Airframe, airframes_of

#: AFS_TERM_ACTION of ArduPilot.
_STOPS, _LANDS = 42, 43
NAMES = {
    KillMethod.FORCED_DISARM: "forced disarm",
    KillMethod.FLIGHT_TERMINATION: "flight termination",
}


@dataclass(frozen=True)
class Way:
    """One way to stop the motors, on this autopilot."""

    method: KillMethod
    #: Why the autopilot's settings do not allow it; empty: nothing known.
    obstacle: str = ""
    #: Why it may release a parachute; empty: it does not.
    releases: str = ""
    #: It does something else than stop the motors.
    useless: bool = False
    #: The autopilot's settings that may yet show an obstacle.
    unread: tuple[str, ...] = ()


@dataclass(frozen=True)
class KillPlan:
    """The ways in the order in which they are tried."""

    method: KillMethod
    ways: tuple[Way, ...]

    def text(self) -> str:
        """For a person, before flight."""
        return "; if it is refused or not answered: ".join(map(_described, self._useful()))

    def fault(self) -> str:
        """Why a kill cannot work as it is set up, or nobody knows yet, which forbids take-off;
        empty: it can."""
        chosen = next((way for way in self.ways if way.method is self.method), None)
        if chosen is not None and chosen.obstacle:
            return (
                f"kill_method is {self.method.value}, and {chosen.obstacle}: "
                f"{_REMEDY[chosen.method]}, or set kill_method to auto"
            )
        if chosen is not None and chosen.unread:
            return _not_yet(chosen)
        if works := [way for way in self.ways if not way.obstacle and not way.releases]:
            return _not_yet(works[0]) if all(way.unread for way in works) else ""
        why = "; ".join(way.obstacle or way.releases for way in self.ways)
        alone = " without a deploy" if any(not way.obstacle for way in self.ways) else ""
        return f"nothing stops the motors{alone}: {why}; {_REMEDY[KillMethod.FORCED_DISARM]}"

    def warning(self) -> str:
        """What a person should know of it before flight; empty: nothing."""
        for way in self.ways:
            if way.method is self.method and way.releases:
                return (
                    f"kill_method is {self.method.value}, and {way.releases}: a kill without a "
                    "deploy goes by forced disarm"
                )
        return ""

    def allowed(self, tried: tuple[KillMethod, ...], deploy_decided: bool) -> Way | None:
        """The next way to try; None: none now."""
        for way in self._useful():
            if way.method not in tried and (deploy_decided or not way.releases):
                return way
        return None

    def _useful(self) -> tuple[Way, ...]:
        return tuple(way for way in self.ways if not way.useless)


def _not_yet(way: Way) -> str:
    return f"whether a {NAMES[way.method]} works is not known yet: {way.unread[0]} is being read"


_REMEDY = {
    KillMethod.FORCED_DISARM: "set ARMING_REQUIRE to 1",
    KillMethod.FLIGHT_TERMINATION: "set AFS_ENABLE to 1 and AFS_TERM_ACTION to 42",
}


def kill_plan(method: KillMethod, vehicle_type: int, settings: AutopilotSettings) -> KillPlan:
    """The plan for this autopilot. vehicle_type: AutopilotTracker.vehicle_type."""
    disarm = _forced_disarm(settings)
    terminate = _termination(vehicle_type, settings)
    ways = (disarm, terminate)
    cannot_disarm = disarm.obstacle and not terminate.obstacle
    by_itself = method is KillMethod.AUTO and cannot_disarm
    if method is KillMethod.FLIGHT_TERMINATION or by_itself:
        ways = (terminate, disarm)
    return KillPlan(method, ways)


def _forced_disarm(settings: AutopilotSettings) -> Way:
    way = KillMethod.FORCED_DISARM
    if settings.get("ARMING_REQUIRE") == 0:
        return Way(way, "ARMING_REQUIRE is 0: the motors run without arming, no disarm stops them")
    return Way(way, unread=settings.unread("ARMING_REQUIRE"))


def _termination(vehicle_type: int, settings: AutopilotSettings) -> Way:
    way = KillMethod.FLIGHT_TERMINATION
    if settings.firmware is Firmware.PX4:
        return Way(way, releases="PX4 itself orders the parachute's release when it terminates")
    if settings.firmware is Firmware.OTHER:
        return Way(
            way, releases="the other effects of termination on this autopilot are not known"
        )
    enabled, action = settings.get("AFS_ENABLE"), settings.get("AFS_TERM_ACTION")
    unread = settings.unread("AFS_ENABLE", "AFS_TERM_ACTION", "HOME_RESET_ALT")
    if enabled is None and not settings.absent("AFS_ENABLE"):
        return Way(way, releases="AFS_ENABLE of the autopilot is not known", unread=unread)
    # The pin is driven as soon as termination is asked for, also where it is refused then.
    releases = _by_pin(settings) if enabled == 1 else ""
    if enabled == 1 and action == _LANDS:
        lands = "AFS_TERM_ACTION is 43: it lands and stops no motor"
        return Way(way, lands, releases, useless=True)
    # A copter that has no AFS, or has it switched off, disarms.
    wings = Airframe.FIXED_WING in airframes_of(vehicle_type)
    aeroplane = wings or settings.get("HOME_RESET_ALT") is not None
    obstacle = ""
    if aeroplane and enabled != 1:
        obstacle = f"AFS_ENABLE is {settings.text('AFS_ENABLE')}: termination is refused"
    elif aeroplane and action != _STOPS:
        is_now = settings.text("AFS_TERM_ACTION")
        obstacle = f"AFS_TERM_ACTION is {is_now} (42 stops the motors): it is refused"
    return Way(way, obstacle, releases, unread=unread)


def _by_pin(settings: AutopilotSettings) -> str:
    """Why termination may drive a pin on which a parachute hangs; empty: it drives none."""
    pin = settings.get("AFS_TERM_PIN")
    if pin is not None and pin >= 0:
        return f"AFS_TERM_PIN is {pin:g}: a parachute may hang on that pin"
    unknown = pin is None and not settings.absent("AFS_TERM_PIN")
    return "AFS_TERM_PIN of the autopilot is not known" if unknown else ""


def _described(way: Way) -> str:
    text = NAMES[way.method]
    if way.obstacle:
        text += f" ({way.obstacle})"
    if way.releases:
        text += f", only once a deploy is decided ({way.releases})"
    return text
