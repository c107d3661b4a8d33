"""Tests of the programs of docs/ros2.md: samples cross DDS as bytes, and a vehicle gets what Offboard mode needs."""

from __future__ import annotations

import itertools
import math
import re
import subprocess
import sys
import textwrap
from typing import Any

import pytest

from support.examples import by_day
from support.repository import ROOT

PAGE = (ROOT / "docs" / "ros2.md").read_text(encoding="utf-8")
(OFFBOARD,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
EXAMPLE = (ROOT / "examples" / "dds_without_ros.py").read_text(encoding="utf-8")
DDS, _, READ = EXAMPLE.partition('if __name__ == "__main__":\n')
DOMAIN = 137
"""A DDS domain of its own, so that other programs on this machine do not take part."""

SET_UP = f"""
import sys
{DDS}
from px4_types import topics
domain = Domain({DOMAIN}, LOOPBACK)
participant = DomainParticipant({DOMAIN})
endpoint = topics.endpoint(sys.argv[1])
"""

WRITER = f"""{SET_UP}
publish = publisher_of(participant, endpoint)
for number in range(1, 600):
    publish(endpoint.message(timestamp=number))
    time.sleep(0.05)
"""

READER = f"""{SET_UP}
reader = reader_of(participant, endpoint)
found = []
for message in messages(reader, endpoint, 30):
    found.append(message)
    if len(found) == 3:
        break
first = found[0].timestamp
print(found == [endpoint.message(timestamp=first + step) for step in range(3)])
"""


@by_day("name", ["/fmu/out/vehicle_status_v4", "/fmu/out/wind", "/fmu/in/vehicle_command"], 2)
def test_samples_cross_dds_as_bytes(name: str) -> None:
    """The program of the page, once as PX4 and once as the application, in two processes on the loopback interface."""
    pytest.importorskip("cyclonedds")
    folder = ROOT / "generated"
    with subprocess.Popen([sys.executable, "-c", WRITER, name], cwd=folder) as writer:
        try:
            done = subprocess.run(
                [sys.executable, "-c", READER, name], cwd=folder, capture_output=True, text=True, check=False
            )
        finally:
            writer.kill()
    assert done.stdout == "True\n", done.stderr


def test_the_reading_program_reads_an_endpoint(px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    """Only DDS itself is replaced."""
    status = px4_types.VehicleStatus(arming_state=2, nav_state=14)
    asked: list[Any] = []
    names = {
        "Domain": lambda *given: asked.append(given),
        "DomainParticipant": lambda number: number,
        "LOOPBACK": "loopback",
        "topics": px4_types.topics,
        "reader_of": lambda *given: given,
        "messages": lambda reader, endpoint, _: [status] if reader == (0, endpoint) else [],
    }
    exec(textwrap.dedent(READ), names)  # noqa: S102 - our own text
    assert (asked, capsys.readouterr().out) == ([(0, "loopback")], "2 14\n")


def test_a_vehicle_gets_the_heartbeat_before_the_mode(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    names: dict[str, Any] = {}
    exec(OFFBOARD, names)  # noqa: S102 - our own text
    slept: list[float] = []
    monkeypatch.setattr(names["time"], "sleep", slept.append)
    sent: list[tuple[float, str, Any]] = []
    names["fly"](lambda endpoint, message: sent.append((sum(slept), endpoint.uorb_topic, message)), 4)
    for _, topic, message in sent:
        endpoint = getattr(px4_types.topics.in_, topic)
        assert endpoint.message.decode(message.encode()) == message
        assert message.timestamp == 0
    beats = [at for at, topic, _ in sent if topic == "offboard_control_mode"]
    commands = [(at, message) for at, topic, message in sent if topic == "vehicle_command"]
    assert max(after - before for before, after in itertools.pairwise(beats)) < 0.5
    assert commands[0][0] - beats[0] > 1
    (_, mode), (_, arm) = commands
    assert (mode.command, mode.param1, mode.param2) == (176, 1.0, 6.0)
    assert (arm.command, arm.param1, arm.param2) == (400, 1.0, 0.0)
    setpoint = next(message for _, topic, message in sent if topic == "trajectory_setpoint")
    assert all(map(math.isnan, (*setpoint.velocity, *setpoint.acceleration, setpoint.yawspeed)))
