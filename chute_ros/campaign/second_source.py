"""A sensor besides the autopilot, which outlives it: with power and a process of its own."""

from __future__ import annotations

from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.sensor_messages import Imu, Odometry, Vector, odometry, rolled
from chute_ros.campaign.sensors import Sensors
from chute_ros.campaign.vehicle import WindyModel
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY

#: As such drivers are delivered, Hz.
_RATES = {IMU: 50.0, ODOMETRY: 30.0}


class SecondSource:
    """process: named as the source in vehicle_sources."""

    def __init__(self, process: Process, ros: Ros, model: WindyModel, sensors: Sensors) -> None:
        self.process, self._ros, self._model, self._sensors = process, ros, model, sensors
        self._interval = 1.0 / _RATES[process.name]
        self._at = 0.0

    def update(self, now: float) -> None:
        """Tell what the sensors say."""
        if now >= self.next_deadline():
            self._at = max(self._at + self._interval, now)
            self._ros.publish(self.process, self._message(now))

    def next_deadline(self) -> float:
        """Of the next message."""
        return max(self._at, self.process.stopped_until)

    def start_again(self, now: float) -> None:
        """It was killed."""
        self._at = now
        self._ros.world.stir(self)

    def _message(self, now: float) -> Imu | Odometry:
        model, read = self._model, self._sensors.read
        roll = read("tilt", model.lean, now)
        if self.process.name == IMU:
            # Which of its axes feels it does not matter: its length is told.
            return Imu(rolled(roll), Vector(z=read("force", model.acceleration, now)))
        height = read("height", model.height, now)
        return odometry(height, read("speed", model.vertical_speed, now), roll)
