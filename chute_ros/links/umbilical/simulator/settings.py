"""What a simulated flight computer can be set to, and the modes it can be in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from chute_ros.errors import ParameterError


class ComputerMode(IntEnum):
    """Field flight_mode; the names are those of the flight computer."""

    Startup = 0
    Standby = 1
    Ascent = 2
    Coast = 3
    DrogueDeployed = 4
    MainDeployed = 5
    Fault = 6


@dataclass(frozen=True)
class FlightComputerSettings:
    """Times are real seconds unless they say otherwise."""

    #: Lines of telemetry a second.
    rate: float = 10.0
    #: Simulated seconds of the flight in one real second. Nothing else is accelerated.
    speed: float = 1.0
    #: Log lines on the wire.
    debug: bool = False
    #: Arming needs a wiped flash.
    interlock: bool = False
    #: At the apogee nothing comes out; by command it still does.
    drogue_fails: bool = False
    #: <V> opens SV, as newer firmware does, in place of closing it.
    safe_opens_sv: bool = False
    #: Without a heartbeat for this long the umbilical is not connected, s.
    heartbeat_timeout: float = 15.0
    #: In Ascent and Coast a <H> that comes is a fault, as of an umbilical that did not let go.
    faults_on_heartbeat: bool = False
    #: While it boots it neither hears nor sends, s.
    boot_time: float = 0.3
    #: Of the Universal day at the start, s.
    time_of_day: float = 43_200.0
    #: <G> sends bytes in place of lines.
    binary_dump: bool = False
    #: What was recorded before the start, bytes, and how fast it comes, chunks a second.
    dump_size: int = 8192
    dump_rate: float = 500.0
    #: Flash in use at the start, kB of 1024 bytes.
    flash_used: int = 1024
    wipe_sectors: int = 3584
    wipe_time: float = 4.0
    #: USB packets a second that leave the outbound queue.
    packet_rate: float = 1000.0
    #: Probability that a line is cut, and that random bytes come after it.
    cut: float = 0.0
    garbage: float = 0.0
    seed: int = 1

    def __post_init__(self) -> None:
        for name, lowest, highest, unit in (
            ("rate", 0.01, 100.0, "Hz"),
            ("speed", 0.01, 1000.0, ""),
            ("heartbeat_timeout", 0.0, 3600.0, "s"),
            ("boot_time", 0.0, 3600.0, "s"),
            ("time_of_day", 0.0, 86_400.0, "s"),
            ("dump_size", 0, 2**24, "bytes"),
            ("dump_rate", 0.01, 1e6, "chunks/s"),
            ("flash_used", 0, 14_336, "kB"),
            ("wipe_sectors", 1, 2**16, "sectors"),
            ("wipe_time", 0.0, 3600.0, "s"),
            ("packet_rate", 0.01, 1e6, "packets/s"),
            ("cut", 0.0, 1.0, ""),
            ("garbage", 0.0, 1.0, ""),
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and lowest <= value <= highest):
                shown = name.replace("_", "-")
                text = f"{shown} is {value}: need {lowest:g} to {highest:g} {unit}"
                raise ParameterError(text.rstrip())
