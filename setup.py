"""Installs the ROS package chute_ros; its dependencies are in package.xml."""

from glob import glob

from setuptools import find_packages, setup

NAME = "chute_ros"

setup(
    name=NAME,
    version="0.1.0",
    description="Supervises and fires a drone's parachute over MAVLink, DroneCAN or serial",
    maintainer="chute_ros maintainers",
    maintainer_email="maintainers@chute-ros.org",
    license="Apache-2.0",
    packages=find_packages(include=[NAME, NAME + ".*"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
        ("share/" + NAME + "/launch", glob("launch/*.py")),
        ("share/" + NAME + "/config", glob("config/*.yaml")),
        ("share/" + NAME + "/config", glob("config/*.xml")),
        ("share/" + NAME + "/config/profiles", glob("config/profiles/*.yaml")),
        ("share/" + NAME + "/config/security", glob("config/security/*.xml")),
    ],
    zip_safe=False,
    install_requires=["setuptools"],
    # colcon looks here to know that the tests are run with pytest.
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": [
            "mavlink_parachute = chute_ros.nodes.mavlink_parachute:main",
            "upf_can = chute_ros.nodes.upf_can:main",
            "umbilical = chute_ros.nodes.umbilical:main",
            "safety_supervisor = chute_ros.nodes.safety_supervisor:main",
            "sim_mavlink_parachute = chute_ros.sim.sim_mavlink_parachute:main",
            "sim_upf = chute_ros.sim.sim_upf:main",
            "sim_autopilot = chute_ros.sim.sim_autopilot:main",
            "sim_flight_computer = chute_ros.sim.sim_flight_computer:main",
            "demo = chute_ros.tools.demo:main",
            "replay = chute_ros.tools.replay:main",
            "report = chute_ros.tools.report:main",
            "campaign = chute_ros.tools.campaign:main",
        ],
    },
)
