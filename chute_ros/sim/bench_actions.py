"""What a person can do to a simulated vehicle while it runs: one table for the buttons of the
panel, the services of sim_bench and docs/guide/simulation.md."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

AUTOPILOT = "sim_autopilot"
MAVLINK_PARACHUTE = "sim_mavlink_parachute"
UPF = "sim_upf"
RELAY = "sim_relay"
FLIGHT_COMPUTER = "sim_flight_computer"

#: The wind of a simulated vehicle from the start, m/s: in none at all its sensors would repeat the
#: same value, and count as stuck.
LIGHT_AIR = 0.5

#: Executable of a simulator, and what it is told to do.
SimulatorOrder = tuple[str, str]


@dataclass(frozen=True)
class BenchAction:
    """name: of its service, sim/NAME; title: on its button; effect: what will happen and where to
    look; orders: to the simulators, in this order; leaves_ground: it begins a flight."""

    name: str
    title: str
    effect: str
    orders: tuple[SimulatorOrder, ...]
    leaves_ground: bool = False


ACTIONS: tuple[BenchAction, ...] = (
    BenchAction(
        "take_off",
        "Take off",
        "The autopilot arms, and after 1 s climbs to 60 m at 6 m/s. The supervisor goes to "
        "IN_FLIGHT.",
        ((AUTOPILOT, "fly=60"),),
        leaves_ground=True,
    ),
    BenchAction(
        "land",
        "Land",
        "The vehicle sinks at 2 m/s, and disarms at touchdown. The supervisor is READY again 1 s "
        "later.",
        ((AUTOPILOT, "land"),),
    ),
    BenchAction(
        "fail_motor",
        "Motor fails",
        "The vehicle falls and tumbles. The supervisor kills the motors, then deploys. A UPF "
        "that is armed may release itself first.",
        ((AUTOPILOT, "fail-motor"),),
    ),
    BenchAction(
        "cut_vehicle_link",
        "Cut the vehicle's link",
        "The autopilot flies on, and nobody receives it nor can reach it. On the ground the "
        "supervisor blocks flight; in the air the rule 'autopilot lost' warns.",
        ((AUTOPILOT, "cut"),),
    ),
    BenchAction(
        "restore_vehicle_link",
        "Restore the vehicle's link",
        "The autopilot is received again.",
        ((AUTOPILOT, "restore"),),
    ),
    BenchAction(
        "silence_autopilot",
        "Telemetry falls silent",
        "The autopilot sends nothing, but obeys. On the ground the supervisor blocks flight; in "
        "the air the rule 'autopilot lost' warns.",
        ((AUTOPILOT, "silent"),),
    ),
    BenchAction(
        "let_autopilot_speak",
        "Telemetry comes back",
        "The autopilot sends as before.",
        ((AUTOPILOT, "speak"),),
    ),
    BenchAction(
        "restart_autopilot",
        "Restart the autopilot",
        "The autopilot starts again, disarmed. In the air nothing holds the vehicle any more: it "
        "falls, and the supervisor deploys.",
        ((AUTOPILOT, "reboot"),),
    ),
    BenchAction(
        "make_height_lie",
        "The height lies",
        "The autopilot's estimator reports a climb of 3 m/s that does not happen. The barometer "
        "and the accelerometer report the truth. The supervisor must not deploy.",
        ((AUTOPILOT, "lie=climb"),),
    ),
    BenchAction(
        "freeze_estimator",
        "The estimator sticks",
        "The autopilot reports the same position and attitude again and again, whatever the "
        "vehicle does.",
        ((AUTOPILOT, "lie=stuck"),),
    ),
    BenchAction(
        "tell_truth",
        "The estimator recovers",
        "The autopilot reports the height, the speed and the attitude of the vehicle again.",
        ((AUTOPILOT, "lie=truth"),),
    ),
    BenchAction(
        "wind",
        "Wind",
        "Gusts of a wind of 8 m/s lift, drop and tilt the vehicle in the air. The supervisor must "
        "not deploy.",
        ((AUTOPILOT, "wind=8"),),
    ),
    BenchAction(
        "calm",
        "Calm",
        "The wind falls to 0.5 m/s, as at the start.",
        ((AUTOPILOT, f"wind={LIGHT_AIR:g}"),),
    ),
    BenchAction(
        "low_battery",
        "Vehicle's battery is low",
        "The autopilot's battery drains to 13.4 V and 3 %. On the ground safety/arm is refused; "
        "in the air the rule 'battery dead' warns after 10 s.",
        ((AUTOPILOT, "battery=13.4"),),
    ),
    BenchAction(
        "fresh_battery",
        "Fresh battery",
        "The autopilot reports a full battery.",
        ((AUTOPILOT, "battery=16.8"),),
    ),
    BenchAction(
        "cut_parachute_link",
        "Cut the parachute's link",
        "The parachute's node neither receives nor reaches its device. On the ground the "
        "supervisor blocks flight; in the air the rule 'link lost' warns.",
        ((MAVLINK_PARACHUTE, "cut"), (UPF, "cut"), (RELAY, "cut")),
    ),
    BenchAction(
        "restore_parachute_link",
        "Restore the parachute's link",
        "The parachute is received again. The supervisor relies on it after a while.",
        ((MAVLINK_PARACHUTE, "restore"), (UPF, "restore"), (RELAY, "restore")),
    ),
    BenchAction(
        "restart_parachute",
        "Restart the parachute",
        "The parachute starts again, disarmed. What is released stays released.",
        ((MAVLINK_PARACHUTE, "reboot"), (UPF, "reboot"), (RELAY, "reboot")),
    ),
    BenchAction(
        "parachute_low_power",
        "Parachute's power is low",
        "The parachute reports the error LOW_POWER. On the ground the supervisor blocks flight.",
        ((MAVLINK_PARACHUTE, "error=LOW_POWER"), (UPF, "error=LOW_POWER")),
    ),
    BenchAction(
        "clear_parachute_errors",
        "Parachute's errors end",
        "The parachute reports no error.",
        ((MAVLINK_PARACHUTE, "clear-errors"), (UPF, "clear-errors")),
    ),
    BenchAction(
        "refuse_to_open",
        "Refuse to open",
        "The parachute does not open if it is ordered to. The supervisor orders it again and "
        "again, then goes to FAULT. A relay confirms nothing: it is ordered once, and FAULT "
        "follows also where it opens.",
        (
            (MAVLINK_PARACHUTE, "refuse"),
            (UPF, "refuse"),
            (RELAY, "stuck"),
            (FLIGHT_COMPUTER, "stuck"),
        ),
    ),
    BenchAction(
        "open_again",
        "Open if ordered",
        "The parachute opens if it is ordered to.",
        (
            (MAVLINK_PARACHUTE, "accept"),
            (UPF, "accept"),
            (RELAY, "free"),
            (FLIGHT_COMPUTER, "free"),
        ),
    ),
    BenchAction(
        "launch",
        "Launch",
        "The rocket's key is turned and its motor burns for 6 s; the rocket coasts to 3000 m.",
        ((FLIGHT_COMPUTER, "launch"),),
        leaves_ground=True,
    ),
    BenchAction(
        "fail_drogue",
        "No drogue at the apogee",
        "At the apogee nothing comes out. The supervisor orders the drogue after the rocket sank "
        "faster than 30 m/s for 2 s.",
        ((FLIGHT_COMPUTER, "drogue-fails"),),
    ),
    BenchAction(
        "fault_flight_computer",
        "Flight computer's fault",
        "The flight computer goes to Fault, in which nothing is automatic.",
        ((FLIGHT_COMPUTER, "fault"),),
    ),
    BenchAction(
        "cut_umbilical",
        "Cut the umbilical",
        "The umbilical's node neither receives nor reaches the flight computer. On the ground the "
        "supervisor blocks flight.",
        ((FLIGHT_COMPUTER, "cut"),),
    ),
    BenchAction(
        "restore_umbilical",
        "Restore the umbilical",
        "The flight computer is received again.",
        ((FLIGHT_COMPUTER, "restore"),),
    ),
    BenchAction(
        "restart_flight_computer",
        "Restart the flight computer",
        "The flight computer starts again in Startup. What is out of the rocket stays out.",
        ((FLIGHT_COMPUTER, "reboot"),),
    ),
    BenchAction(
        "start_over",
        "Start over",
        "The vehicle stands whole on the ground, with its parachute packed. Then reset the "
        "supervisor (safety/reset), which refuses for as long as it sees the vehicle in the air.",
        (
            (MAVLINK_PARACHUTE, "repack"),
            (UPF, "repack"),
            (RELAY, "repack"),
            (AUTOPILOT, "mend"),
            (FLIGHT_COMPUTER, "mend"),
        ),
    ),
)


def actions_of(simulators: Iterable[str]) -> tuple[BenchAction, ...]:
    """The actions of a vehicle with these simulators, each with the orders to those alone."""
    there = frozenset(simulators)
    return tuple(
        replace(one, orders=orders)
        for one in ACTIONS
        if (orders := tuple(order for order in one.orders if order[0] in there))
    )
