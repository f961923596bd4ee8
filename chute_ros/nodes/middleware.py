"""How the middleware repairs what a network loses: at once, unless the user says otherwise."""

from __future__ import annotations

import os

from chute_ros.nodes.config_folder import config_folder

#: Where Fast DDS looks for settings, by its major version, and what is shipped for it.
_SETTINGS = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": "fastrtps.xml",  # 2: Jazzy
    "FASTDDS_DEFAULT_PROFILES_FILE": "fastdds.xml",  # 3: Kilted
}


def set_up_middleware() -> None:
    """Before rclpy.init, for this process and those that it starts. Another middleware does not
    look at it."""
    if not any(name in os.environ for name in _SETTINGS):
        for name, file in _SETTINGS.items():
            os.environ[name] = str(config_folder() / file)
