"""An autopilot whose messages come over the wire's bytes, and the commonest of them."""

from chute_ros.links.mavlink.protocol.autopilot import AutopilotTracker
from chute_ros.protocol.liveness import LivenessLimits
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder


class Told:
    """What its tracker makes of them."""

    def __init__(self):
        self.tracker = AutopilotTracker(1, 1, LivenessLimits(2.5, 5.0), 5.0)
        self._encoder, self._decoder = FrameEncoder(1, 1), FrameDecoder()

    def hear(self, *messages, now=0.0):
        return self.hear_bytes(*(self._encoder.encode(one, now) for one in messages), now=now)

    def hear_bytes(self, *frames, now=0.0):
        for raw in frames:
            (frame,) = self._decoder.feed_datagram(raw, now)
            if frame.message.get_type() == "HEARTBEAT":
                self.tracker.heartbeat(frame.message, now)
            else:
                self.tracker.message(frame.message, now)
        return self

    def at(self, now=0.0):
        return self.tracker.vehicle_state(now)


def position(boot_ms=1000, lat=0, lon=0, relative=0, vz=0):
    return d.MAVLink_global_position_int_message(boot_ms, lat, lon, 0, relative, 0, 0, vz, 0)


def attitude(boot_ms=1000, roll=0.0, pitch=0.0, yaw=0.0):
    return d.MAVLink_attitude_message(boot_ms, roll, pitch, yaw, 0.0, 0.0, 0.0)


def imu(x, y, z, boot_ms=1000):
    return d.MAVLink_scaled_imu_message(boot_ms, x, y, z, 0, 0, 0, 0, 0, 0)
