"""Installs the package as colcon expects it: programs in lib/msggen_ros, launch files in share/msggen_ros."""

from setuptools import setup

NAME = "msggen_ros"

setup(
    name=NAME,
    version="1.0.0",
    description="A PX4 vehicle in ROS 2 without an agent",
    license="BSD-3-Clause",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/px4.launch.py"]),
    ],
    install_requires=["msggen", "setuptools"],
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "relay = msggen_ros.commands:relay",
            "doctor = msggen_ros.commands:doctor",
            "offboard = msggen_ros.offboard:main",
        ]
    },
)
