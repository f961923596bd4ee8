"""Starts a simulator: its command, its settings, the ports that it speaks on."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from chute_ros.errors import ChuteError
from sitl.autopilots import ARDUCOPTER, ARDUPLANE, Autopilot

#: Where it stands: a field with nothing around it, 100 m above sea level.
LATITUDE, LONGITUDE, ALTITUDE = 47.397742, 8.545594, 100.0
_END_TIMEOUT = 5.0
#: What each of them needs to count as calibrated; what the simulated sensors have.
_ARDUPILOT = {
    "INS_ACCOFFS_X": 0.001, "INS_ACCOFFS_Y": 0.001, "INS_ACCOFFS_Z": 0.001,
    "INS_ACC2OFFS_X": 0.001, "INS_ACC2OFFS_Y": 0.001, "INS_ACC2OFFS_Z": 0.001,
    "INS_ACCSCAL_X": 1.001, "INS_ACCSCAL_Y": 1.001, "INS_ACCSCAL_Z": 1.001,
    "INS_ACC2SCAL_X": 1.001, "INS_ACC2SCAL_Y": 1.001, "INS_ACC2SCAL_Z": 1.001,
    "COMPASS_OFS_X": 5, "COMPASS_OFS_Y": 13, "COMPASS_OFS_Z": -18,
    "COMPASS_OFS2_X": 5, "COMPASS_OFS2_Y": 13, "COMPASS_OFS2_Z": -18,
    "COMPASS_OFS3_X": 5, "COMPASS_OFS3_Y": 13, "COMPASS_OFS3_Z": -18,
    **{f"RC{one}_{end}": value for one in range(1, 9)
       for end, value in (("MIN", 1000), ("TRIM", 1500), ("MAX", 2000))},
    # The bench's port; the companion computer's; the parachute's, where it hangs on the autopilot.
    "SERIAL0_BAUD": 921, "SERIAL0_PROTOCOL": 2, "SERIAL1_BAUD": 921, "SERIAL1_PROTOCOL": 2,
    "SERIAL2_BAUD": 57, "SERIAL2_PROTOCOL": 2,
    "MAV1_OPTIONS": 2, "MAV3_OPTIONS": 8, "MAV3_POSITION": 4,
    "LOG_BACKEND_TYPE": 0, "ARMING_RUDDER": 2, "BATT_MONITOR": 4, "FS_GCS_ENABLE": 0,
}  # fmt: skip
_COPTER = {
    "FRAME_CLASS": 1, "FRAME_TYPE": 0, "RC3_TRIM": 1000, "ATC_RAT_YAW_P": 0.3,
    "ATC_RAT_YAW_I": 0.02, "MOT_THST_EXPO": 0.65, "MOT_THST_HOVER": 0.39, "MOT_BAT_VOLT_MIN": 9.6,
    "MOT_BAT_VOLT_MAX": 12.8, "FENCE_ENABLE": 0, "AUTO_OPTIONS": 3,
    "WPNAV_SPEED_UP": 600,
}  # fmt: skip
_QUADPLANE = {
    # As docs/guide/mavlink.md has it: a device that hears its height must not hear that it stands.
    "HOME_RESET_ALT": -1,
    "Q_ENABLE": 1, "Q_FRAME_CLASS": 1, "Q_FRAME_TYPE": 1, "Q_GUIDED_MODE": 1,
    "Q_WP_SPEED_UP": 600, "RC3_TRIM": 1000,
    "SERVO1_FUNCTION": 4, "SERVO2_FUNCTION": 19, "SERVO3_FUNCTION": 70, "SERVO4_FUNCTION": 21,
    "SERVO5_FUNCTION": 33, "SERVO6_FUNCTION": 34, "SERVO7_FUNCTION": 35, "SERVO8_FUNCTION": 36,
    "SERVO3_MIN": 1000, "SERVO3_MAX": 2000, "SCHED_LOOP_RATE": 300, "ARSPD_USE": 1,
    "AIRSPEED_MIN": 13, "AIRSPEED_MAX": 35, "AIRSPEED_CRUISE": 25, "Q_ASSIST_SPEED": 18,
    "ROLL_LIMIT_DEG": 65, "PTCH_LIM_MAX_DEG": 30, "PTCH_LIM_MIN_DEG": -30, "NAVL1_PERIOD": 14,
    "PTCH_RATE_D": 0, "PTCH_RATE_I": 0.21, "PTCH_RATE_P": 0.31, "PTCH_RATE_IMAX": 0.89,
    "PTCH_RATE_FF": 1.4, "RLL_RATE_D": 0, "RLL_RATE_I": 0.21, "RLL_RATE_P": 0.14,
    "RLL_RATE_IMAX": 0.89, "RLL_RATE_FF": 0.55, "KFF_RDDRMIX": 0.5, "Q_M_THST_EXPO": 0.65,
    "Q_M_PWM_MIN": 1000, "Q_M_PWM_MAX": 2000, "Q_M_BAT_VOLT_MAX": 12.8, "Q_M_BAT_VOLT_MIN": 9.6,
    "Q_A_RAT_RLL_P": 0.108, "Q_A_RAT_RLL_I": 0.108, "Q_A_RAT_RLL_D": 0.001,
    "Q_A_RAT_PIT_P": 0.103, "Q_A_RAT_PIT_I": 0.103, "Q_A_RAT_PIT_D": 0.001,
    "Q_A_RAT_YAW_P": 0.2, "Q_A_RAT_YAW_I": 0.02, "RC1_TRIM": 1500, "RTL_ALTITUDE": 40,
}  # fmt: skip

#: No log. An injected motor failure stops the motor in CA_FAILURE_MODE 1 and 2 only.
_PX4 = {
    "MAV_SYS_ID": 1, "NAV_DLL_ACT": 0, "SDLOG_MODE": -1, "CA_FAILURE_MODE": 1, "FD_ACT_EN": 0,
    "MPC_TKO_SPEED": 4, "MPC_Z_V_AUTO_UP": 6, "MPC_Z_VEL_MAX_UP": 6,
}  # fmt: skip


class SimulatorError(ChuteError):
    """The simulator ended, or did not do what a story needs. The text shows its last words."""


@dataclass(frozen=True)
class Ports:
    """Of the router: the autopilot's lines, and the ends of those who speak with it."""

    #: The companion computer's line of the autopilot.
    line: int
    #: A line of its own for the bench: truth, faults. No node is on it. 0: see bench_port.
    bench: int
    #: The parachute's port of the autopilot, where it is wired to it.
    chute_line: int
    node: int
    parachute: int
    station: int
    bench_end: int


def ports_for(autopilot: Autopilot) -> Ports:
    """In a network of our own any will do; PX4 has its own for its lines."""
    lines = (19000, 19001, 19003) if autopilot.ardupilot else (14549, 0, 19003)
    return Ports(*lines, 19010, 19011, 19012, 19013)


@dataclass
class Simulator:
    """A running one. settings: parameters over those that it always has here."""

    autopilot: Autopilot
    folder: Path
    ports: Ports
    settings: Mapping[str, float] = field(default_factory=dict)
    #: Bytes a second of the companion computer's line; 0: as fast as may be.
    line_rate: int = 0
    #: Six motors: a frame that flies on with five.
    hexa: bool = False
    process: subprocess.Popen[bytes] = field(init=False)

    def __post_init__(self) -> None:
        # PX4: part of a lock file's name and of its ports, on the whole machine.
        self.instance = 10 + os.getpid() % 90

    def start(self) -> None:
        """On the ground. Whom it calls must listen by then: ArduPilot gives up soon."""
        self.process = self._start()

    @property
    def log(self) -> Path:
        """What it writes."""
        return self.folder / "autopilot.log"

    def bench_port(self) -> int:
        """Where it sends its truth, and takes faults from; of PX4, where its SIH shows itself."""
        return self.ports.bench or 19410 + self.instance

    def check(self) -> None:
        """SimulatorError if it has ended."""
        code = self.process.poll()
        if code is not None:
            last = "\n".join(self.log.read_text(errors="replace").splitlines()[-15:])
            raise SimulatorError(f"{self.autopilot.kind} ended with code {code}:\n{last}")

    def end(self) -> None:
        """Kill it: a simulator holds nothing that is worth an orderly end."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait(_END_TIMEOUT)

    def restart(self) -> None:
        """As after a loss of power, on the ground."""
        self.end()
        self.start()

    def slow_down(self) -> None:
        """PX4's line to the companion computer at the rate that it has; once it has started."""
        local = str(14580 + self.instance)
        mavlink = [
            str(self.autopilot.path.parent / "px4-mavlink"),
            "--instance",
            str(self.instance),
        ]
        mode = ("-m", "onboard_low_bandwidth")  # as docs/guide/mavlink.md has it for slow lines
        more = ("-r", str(self.line_rate), *mode, "-o", str(self.ports.line))
        for command in (("stop", "-u", local), ("start", "-x", "-u", local, *more)):
            subprocess.run([*mavlink, *command], check=True, timeout=10.0, capture_output=True)

    def _start(self) -> subprocess.Popen[bytes]:
        home = self.folder / "autopilot"
        home.mkdir(exist_ok=True)
        make = self._ardupilot if self.autopilot.ardupilot else self._px4
        command, more = make(home)
        with self.log.open("ab") as log:
            return subprocess.Popen(
                command,
                cwd=home,
                env={**os.environ, **more},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def _ardupilot(self, home: Path) -> tuple[list[str], dict[str, str]]:
        copter = self.autopilot.kind == ARDUCOPTER
        values = {**_ARDUPILOT, **(_COPTER if copter else _QUADPLANE)}
        if copter and self.hexa:
            values |= {"FRAME_CLASS": 2, "FRAME_TYPE": 0}
        if self.line_rate:
            # The port's own limit: 10 bits a byte.
            baud = self.line_rate * 10
            values |= {"SIM_BAUDLIMIT_EN": 1, "SERIAL1_BAUD": 57 if baud == 57600 else baud}
        values |= self.settings
        defaults = home / "defaults.parm"
        defaults.write_text("".join(f"{name} {value}\n" for name, value in values.items()))
        model = {ARDUCOPTER: "hexa" if self.hexa else "quad", ARDUPLANE: "quadplane"}
        # The simulator limits the rate of streams only; datagrams do not come through then.
        kind = "tcpclient" if self.line_rate else "udpclient"
        ends = ((kind, self.ports.bench), (kind, self.ports.line),
                ("udpclient", self.ports.chute_line))  # fmt: skip
        return [
            str(self.autopilot.path),
            *("--model", model[self.autopilot.kind], "--speedup", "1", "--wipe"),
            *("--home", f"{LATITUDE},{LONGITUDE},{ALTITUDE},0", "--defaults", str(defaults)),
            *(part for number, (kind, port) in enumerate(ends)
              for part in (f"--serial{number}", f"{kind}:127.0.0.1:{port}")),
        ], {}  # fmt: skip

    def _px4(self, home: Path) -> tuple[list[str], dict[str, str]]:
        build = self.autopilot.path.parent.parent
        values = {**_PX4, **self.settings}
        names = {f"PX4_PARAM_{name}": f"{value:g}" for name, value in values.items()}
        return [
            str(self.autopilot.path),
            *("-d", "-i", str(self.instance), "-w", str(home), str(build / "etc")),
        ], {
            **names,
            "PX4_SIM_MODEL": "sihsim_hex" if self.hexa else "sihsim_quadx",
            "PX4_SIMULATOR": "sihsim",
            "PX4_HOME_LAT": str(LATITUDE),
            "PX4_HOME_LON": str(LONGITUDE),
            "PX4_HOME_ALT": str(ALTITUDE),
        }
