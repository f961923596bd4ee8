"""Executable to_rosbag2: a recorded flight as a folder for `ros2 bag`."""

from functools import partial

from chute_ros.tools.entry import run

main = partial(run, "to_rosbag2", "to_rosbag2_command")

if __name__ == "__main__":
    main()
