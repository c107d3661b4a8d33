"""The example of a ROS 2 node, run in ROS 2 beside a participant of cyclonedds that looks like PX4 behind an agent.

rclpy comes from the package index. px4_msgs is compiled with the real types of the example's topics, and no others.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest

from support.dds_vehicle import domains, vehicle
from support.example_program import EXAMPLES, Program, interrupted
from support.repository import ROOT
from support.ros import compile_px4_msgs, ros_python

DOMAINS = domains(2)
NODE = EXAMPLES / "rclpy_node.py"


def test_the_page_shows_the_example() -> None:
    page = (ROOT / "docs" / "package.md").read_text(encoding="utf-8")
    section = page.split("\n## In a ROS 2 node\n")[1].split("\n## ")[0]
    (code,) = re.findall(r"^```python\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)
    assert code in NODE.read_text(encoding="utf-8")


@pytest.mark.slow  # installs ROS 2 in half a minute, and compiles for it
@pytest.mark.tools("g++")
def test_the_node_reads_and_writes_topics(px4_types: Any, tmp_path: Path) -> None:
    python = ros_python()
    px4_msgs = compile_px4_msgs(python, tmp_path, px4_types.VehicleStatus, px4_types.OffboardControlMode)
    domain = next(DOMAINS)
    variables = {
        "PYTHONPATH": os.pathsep.join([str(ROOT / "generated"), str(px4_msgs)]),
        "LD_LIBRARY_PATH": "",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(domain),
        "ROS_LOG_DIR": str(tmp_path),
    }
    with vehicle(domain, "", "vehicle_status,nav_state=14") as px4:
        node = Program(NODE.name, python=python, variables=variables)
        try:
            node.wait_for("^mode: OFFBOARD$")
            assert px4.stdout is not None
            topic, payload = px4.stdout.readline().split()
            assert topic == px4_types.topics.in_.offboard_control_mode.dds_name
            sent = px4_types.OffboardControlMode(position=True)
            assert px4_types.OffboardControlMode.decode(bytes.fromhex(payload)) == sent
            interrupted(node)
            assert node.printed == "mode: OFFBOARD\n"
        finally:
            node.end()
