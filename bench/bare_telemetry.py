"""The peer to compare with: $TELEM lines from a serial port to umbilical/telem, nothing else.

Split at newlines, split at commas, float each field: no checks, no layouts, no commands, no
heartbeats. For layout telem57_airbrake_state. Arguments: path of the port; then what ROS takes.
"""

from __future__ import annotations

import math
import os
import sys
import time

import rclpy
from builtin_interfaces.msg import Time
from chute_msgs.msg import Telem
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

#: The fields of Telem in the order of a line; a whole number is marked by #, ms by /.
_ORDER = """
    #flight_mode pressure temp_degc altitude latitude_deg longitude_deg #num_satellites
    timestamp mag_x_microtesla mag_y_microtesla mag_z_microtesla accel_x accel_y accel_z
    gyro_x_deg_s gyro_y_deg_s gyro_z_deg_s pt3_adc pt4_adc rtd_adc #sv_open #mav_open
    #ssa_drogue_deployed #ssa_main_deployed #cmd_n1 #cmd_n2 #cmd_n3 #cmd_n4 #cmd_a1 #cmd_a2
    #cmd_a3 #airbrake_state predicted_apogee h_acc_mm v_acc_mm vel_n vel_e vel_d g_speed
    s_acc_mm_s head_acc_deg1e5 #fix_type head_mot_deg1e5 blims_motor_position #blims_phase_id
    blims_pid_p blims_pid_i blims_bearing_deg #blims_loiter_step blims_heading_des_deg
    blims_heading_error_deg blims_error_integral blims_dist_to_target blims_target_lat_deg
    blims_target_lon_deg blims_wind_from_deg /device_uptime
"""
FIELDS = _ORDER.split()
LACKING = (
    "airbrake_deployment",
    "blims_brakeline_diff_in",
    "blims_upwind_lat_deg",
    "blims_upwind_lon_deg",
    "blims_downwind_lat_deg",
    "blims_downwind_lon_deg",
)


class Splitter:
    """Bytes to numbers."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[list[float]]:
        """The numbers of each line that is complete now."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        found = []
        for line in lines:
            try:
                found.append([float(text) for text in line.split(b",")[1:]])
            except ValueError:
                pass  # a cut line
        return found


def main() -> None:
    """Publish until the end of the process."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    publisher = Node("bare").create_publisher(Telem, "umbilical/telem", QoSProfile(depth=10))
    message = Telem(layout="telem57_airbrake_state")
    for name in LACKING:
        setattr(message, name, math.nan)
    whole = [(i, name[1:]) for i, name in enumerate(FIELDS) if name[0] == "#"]
    plain = [(i, name) for i, name in enumerate(FIELDS) if name[0] not in "#/"]
    splitter = Splitter()
    port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
    while True:
        for numbers in splitter.feed(os.read(port, 4096)):
            if len(numbers) != len(FIELDS):
                continue  # the port was opened within it
            for i, name in plain:
                setattr(message, name, numbers[i])
            for i, name in whole:
                setattr(message, name, int(numbers[i]))
            message.device_uptime = numbers[-1] / 1000.0
            message.sequence += 1
            seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
            message.header.stamp = Time(sec=seconds, nanosec=nanoseconds)
            publisher.publish(message)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass  # the usual way to end it
