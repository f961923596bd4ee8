"""Installs the ROS package chute_ros; its dependencies are in package.xml."""

from glob import glob

from setuptools import find_packages, setup

NAME = "chute_ros"
#: Node, which is its executable as well, and the folder of its link.
LINKS = {
    "mavlink_parachute": "mavlink",
    "upf_can": "upf",
    "umbilical": "umbilical",
    "relay": "relay",
}


def simulator(path: str) -> str:
    """The entry of the executable in this file."""
    *folders, name = path.removesuffix(".py").split("/")
    return f"{name} = {'.'.join(folders)}.{name}:main"


setup(
    name=NAME,
    version="0.1.0",
    description="Supervises and fires a drone's parachute: MAVLink, DroneCAN, serial, relay",
    maintainer="chute_ros maintainers",
    maintainer_email="maintainers@chute-ros.org",
    license="Apache-2.0",
    packages=find_packages(include=[NAME, NAME + ".*"]),
    package_data={f"{NAME}.tools.panel": ["panel.*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
        ("share/" + NAME + "/launch", glob("launch/*.py")),
        ("share/" + NAME + "/config", glob("config/*.yaml")),
        ("share/" + NAME + "/config", glob("config/*.xml")),
        ("share/" + NAME + "/config/layouts", glob("config/layouts/*")),
        ("share/" + NAME + "/config/profiles", glob("config/profiles/*.yaml")),
        ("share/" + NAME + "/config/vehicles", glob("config/vehicles/*.yaml")),
        ("share/" + NAME + "/config/security", glob("config/security/*.xml")),
    ],
    zip_safe=False,
    install_requires=["setuptools"],
    # colcon looks here to know that the tests are run with pytest.
    extras_require={"test": ["pytest"]},
    entry_points={
        # What a link is: chute_ros/links/api.py. Somebody's own package has entries of its own.
        "chute_ros.links": [f"{node} = {NAME}.links.{link}:LINK" for node, link in LINKS.items()],
        "console_scripts": [
            *(f"{node} = {NAME}.links.{link}.__main__:main" for node, link in LINKS.items()),
            *map(simulator, sorted(glob(f"{NAME}/**/sim_*.py", recursive=True))),
            "safety_supervisor = chute_ros.ros.safety_supervisor:main",
            "deploy_action = chute_ros.ros.deploy_action:main",
            "chute = chute_ros.tools.chute.__main__:main",
            "panel = chute_ros.tools.panel.__main__:main",
            "demo = chute_ros.tools.demo:main",
            "replay = chute_ros.tools.replay:main",
            "report = chute_ros.tools.report:main",
            "test_card = chute_ros.tools.test_card:main",
            "to_rosbag2 = chute_ros.tools.to_rosbag2:main",
            "judge_log = chute_ros.tools.judge_log.__main__:main",
            "conformance = chute_ros.tools.conformance:main",
            "campaign = chute_ros.tools.campaign:main",
        ],
    },
)
