"""Multirotors of RotorPy with rotors that fail: its rigid body, rotors and drag; some frames and
the mixer are ours."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from rotorpy.vehicles.hummingbird_params import quad_params as hummingbird
from rotorpy.vehicles.multirotor import Multirotor
from rotorpy.vehicles.px4_sihsim_quadx_params import quad_params as px4_sih
from scipy.spatial.transform import Rotation

from chute_ros.sim.flight import GRAVITY

BODY = f"rotorpy {version('rotorpy')}"


@dataclass(frozen=True)
class Frame:
    """name; quad_params: as RotorPy's, of any number of rotors."""

    name: str
    quad_params: dict[str, Any]


def _scaled(name: str, rotors: int, mass: float, arm: float, fall_speed: float) -> Frame:
    """Ours: RotorPy's Hummingbird by similarity. mass: kg; arm: m; fall_speed: m/s, flat."""
    angles = [math.tau * (number + 0.5) / rotors for number in range(rotors)]
    places = [arm * np.array([math.cos(one), math.sin(one), 0.0]) for one in angles]
    # The same speed at the tips: the rotors turn slower as they are larger. Hover at 45 % of the
    # thrust, as such vehicles are built.
    large = arm / 0.17
    most_speed = 1500.0 / large
    thrust = mass * GRAVITY / 0.45 / rotors / most_speed**2
    round_body = mass * arm**2
    drag = mass * GRAVITY / fall_speed**2
    params = {
        **hummingbird,
        "mass": mass,
        "Ixx": 0.25 * round_body,
        "Iyy": 0.25 * round_body,
        "Izz": 0.45 * round_body,
        "num_rotors": rotors,
        "rotor_pos": {f"r{number}": place for number, place in enumerate(places)},
        "rotor_directions": np.array([(-1.0) ** number for number in range(rotors)]),
        "c_Dx": 0.6 * drag,
        "c_Dy": 0.6 * drag,
        "c_Dz": drag,
        # Of its thrust, the same shares as the Hummingbird's by speed and lever.
        "k_eta": thrust,
        "k_m": thrust * 0.0244 * large,
        "k_d": 1.19e-4 * mass / 0.5 / rotors * 4.0 * large,
        "k_z": 2.32e-4 * mass / 0.5 / rotors * 4.0 * large,
        "k_h": 3.39e-3 * mass / 0.5 / rotors * 4.0 / 10.0,
        "tau_m": 0.02 * large**0.5,
        "rotor_speed_max": most_speed,
        "kp_att": 300.0 / large,
        "kd_att": 30.0 / large**0.5,
    }
    return Frame(name, params)


#: The first two with RotorPy's own parameters, the gains of the second ours, as it has none.
FRAMES = (
    Frame("AscTec Hummingbird, 0.5 kg", hummingbird),
    Frame("PX4 SIH quadrotor, 1 kg", {**px4_sih, "kp_att": 200.0, "kd_att": 22.0}),
    _scaled("quadrotor, 4 kg", 4, 4.0, 0.33, 24.0),
    _scaled("hexarotor, 7 kg", 6, 7.0, 0.48, 26.0),
    _scaled("octorotor, 15 kg", 8, 15.0, 0.65, 30.0),
)


class FailingMultirotor(Multirotor):  # type: ignore[misc]  # RotorPy has no types
    """shares: of its thrust that each rotor still gives; 1: it is whole."""

    def __init__(self, frame: Frame) -> None:
        params = dict(frame.quad_params)
        # RotorPy inverts the mixer's matrix, so that it takes four rotors: of others it is given
        # the first four, and then all.
        first = dict(list(params["rotor_pos"].items())[:4])
        four = {**params, "num_rotors": 4, "rotor_pos": first}
        four["rotor_directions"] = params["rotor_directions"][:4]
        if params["num_rotors"] != 4:
            four["rotor_pos"] = hummingbird["rotor_pos"]
        super().__init__(four, control_abstraction="cmd_ctatt", aero=True)
        self.num_rotors, self.rotor_pos = params["num_rotors"], params["rotor_pos"]
        self.rotor_dir = params["rotor_directions"]
        self.extract_geometry()
        torque = self.k_m / self.k_eta
        levers = [np.cross(one, [0.0, 0.0, 1.0])[:2] for one in self.rotor_pos.values()]
        self.f_to_TM = np.vstack(
            (np.ones(self.num_rotors), np.array(levers).T, torque * self.rotor_dir)
        )
        self.TM_to_f = np.linalg.pinv(self.f_to_TM)
        self.shares = np.ones(self.num_rotors)

    @property
    def most_thrust(self) -> float:
        """Of all its rotors, whole, N."""
        return float(self.num_rotors * self.k_eta * self.rotor_speed_max**2)

    def at_rest(self, height: float) -> dict[str, Any]:
        """Its state in a hover."""
        hover = math.sqrt(self.mass * self.g / self.num_rotors / self.k_eta)
        return {
            "x": np.array([0.0, 0.0, height]),
            "v": np.zeros(3),
            "q": np.array([0.0, 0.0, 0.0, 1.0]),
            "w": np.zeros(3),
            "wind": np.zeros(3),
            "rotor_speeds": np.full(self.num_rotors, hover),
        }

    def get_cmd_motor_speeds(self, state: Any, control: Any) -> Any:
        """As the mixers of autopilots do: where a rotor has no more, thrust is given up for the
        attitude. A rotor that failed does not follow."""
        speeds = super().get_cmd_motor_speeds(state, control)
        forces = np.sign(speeds) * speeds**2 * self.k_eta
        most = self.k_eta * self.rotor_speed_max**2
        forces -= max(0.0, forces.max() - most)
        forces = np.clip(forces, 0.0, most)
        return np.sqrt(np.minimum(forces, most * self.shares) / self.k_eta * self.shares)

    def step(self, state: Any, control: Any, t_step: float) -> Any:
        """RotorPy's derivatives by Runge-Kutta: its own step packs the state of four rotors only,
        and takes four times as long."""
        speeds = self.get_cmd_motor_speeds(state, control)
        packed = np.concatenate([state[name] for name in ("x", "v", "q", "w", "wind")])
        packed = np.concatenate((packed, state["rotor_speeds"]))
        half = t_step / 2.0
        for _ in range(2):
            first = self._s_dot_fn(0.0, packed, speeds)
            second = self._s_dot_fn(0.0, packed + half / 2.0 * first, speeds)
            third = self._s_dot_fn(0.0, packed + half / 2.0 * second, speeds)
            last = self._s_dot_fn(0.0, packed + half * third, speeds)
            packed = packed + half / 6.0 * (first + 2.0 * second + 2.0 * third + last)
            packed[6:10] /= np.linalg.norm(packed[6:10])
        return Multirotor._unpack_state(packed)

    def force(self, state: Any) -> float:
        """Length of the specific force, m/s^2."""
        turned = Rotation.from_quat(state["q"]).as_matrix()
        air = turned.T @ (state["v"] - state["wind"])
        force, _ = self.compute_body_wrench(state["w"], state["rotor_speeds"], air)
        return float(np.linalg.norm(force) / self.mass)


def angles(quaternion: Any) -> tuple[float, float, float]:
    """Roll, pitch and yaw as MAVLink tells them, rad, of RotorPy's forward, left, up."""
    yaw, pitch, roll = Rotation.from_quat(quaternion).as_euler("ZYX")
    return float(roll), -float(pitch), -float(yaw)
