"""How the middleware repairs what a network loses: at once, unless the user says otherwise."""

from __future__ import annotations

import os

from chute_ros.nodes.config_folder import config_folder

#: Where Fast DDS looks for settings, and what is shipped for it: from version 3 (Kilted) on, and
#: in version 2.
_SETTINGS = ("FASTDDS_DEFAULT_PROFILES_FILE", "fastdds.xml")
_SETTINGS_2 = ("FASTRTPS_DEFAULT_PROFILES_FILE", "fastrtps.xml")
_WITH_VERSION_2 = ("humble", "iron", "jazzy")


def set_up_middleware() -> None:
    """Before rclpy.init, for this process and those that it starts. Another middleware does not
    look at it."""
    if not any(name in os.environ for name, _ in (_SETTINGS, _SETTINGS_2)):
        # Version 3 reads the old variable as well, and does not understand the old file.
        old = os.environ.get("ROS_DISTRO") in _WITH_VERSION_2
        name, file = _SETTINGS_2 if old else _SETTINGS
        os.environ[name] = str(config_folder() / file)
