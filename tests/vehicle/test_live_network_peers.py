"""Tests of a network with a tool of others that has the form of rmw_zenoh, and its configuration of Zenoh."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from support.flying import until
from support.interpreters import environment
from support.networked import CALM, networked
from support.repository import ROOT

pytest.importorskip("zenoh")


@pytest.mark.night
def test_zenoh_ros2_sdk_lists_reads_and_publishes(px4_types: Any, tmp_path: Path) -> None:
    python = environment(sys.executable, tmp_path / "sdk", "zenoh-ros2-sdk==0.1.8") / "python"
    program = ROOT / "tests" / "support" / "other_zenoh_tool.py"
    with networked(px4_types, [CALM._replace(sync="short")]) as space:
        until(lambda: len(space.network._flows) == 31)
        command = [str(python), str(program), space.url.rpartition(":")[2]]
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, cwd=tmp_path) as process:
            assert process.stdin is not None
            assert process.stdout is not None
            found = json.loads(process.stdout.readline())
            until(lambda: "/fmu/in/offboard_control_mode" in space.simulator.vehicles[0].received)
            process.stdin.close()
        assert not space.network.refusals.counts
    assert set(found["names"]) >= {endpoint.ros_name for endpoint in px4_types.topics.ENDPOINTS}
    assert (found["node"], found["qos"]) == ("msggen_1", "2::,:,:,:,,")
    assert found["hash"] == px4_types.VehicleAttitude.__msg__.type_hash
    assert abs(found["timestamp"] / 1e6 - time.time()) < 60.0
    assert found["q"] == [1.0, 0.0, 0.0, 0.0]
