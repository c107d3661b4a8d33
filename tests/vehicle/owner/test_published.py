"""Tests of what programs on a shared link send to a vehicle, for those who ask: programs, and commands."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import main
from msggen.live import TopicError, Vehicle
from msggen.vehicle.owned.unix import UnixLink
from support.fake_link import FakeLink
from support.link_records import nothing_is_left
from support.served import served

WAIT = 10.0
SETPOINT = "/fmu/in/trajectory_setpoint"


@pytest.fixture
def link(px4_types: Any) -> FakeLink:
    return FakeLink(px4_types)


@pytest.fixture
def path(link: FakeLink, tmp_path: Path) -> Iterator[Path]:
    """The socket of an owner with a vehicle."""
    path = tmp_path / "link.socket"
    with nothing_is_left(), served(link, path):
        link.connect()
        yield path


@pytest.fixture
def sender(path: Path, px4_types: Any) -> Iterator[Vehicle]:
    """A program that publishes, 50 times a second."""
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        vehicle.every(50.0, px4_types.TrajectorySetpoint(timestamp=7, yaw=0.5))
        yield vehicle


@pytest.mark.usefixtures("sender")
@pytest.mark.parametrize("name", [SETPOINT, "endpoint"])
def test_a_program_reads_what_others_publish(path: Path, px4_types: Any, name: str) -> None:
    topic = px4_types.topics.in_.trajectory_setpoint if name == "endpoint" else name
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        vehicle.wait_connected(WAIT)
        assert vehicle.is_shared
        setpoint = vehicle.subscribe(topic).wait_for(lambda each: each.yaw, WAIT)
        assert setpoint == px4_types.TrajectorySetpoint(timestamp=7, yaw=0.5)
        (publisher,) = vehicle.publishers
        assert (publisher.topic, publisher.pid) == (SETPOINT, os.getpid())


@pytest.mark.usefixtures("sender")
def test_a_watch_has_the_directions_that_it_asks_for(link: FakeLink, path: Path, px4_types: Any) -> None:
    heard: dict[str, set[str]] = {"out": set(), "in": set(), "both": set()}
    with Vehicle(UnixLink(str(path)), px4_types) as vehicle:
        remote = vehicle.wait_connected(WAIT)
        for direction, names in heard.items():
            vehicle.watch(lambda route, *_, names=names: names.add(route.direction), direction)  # type: ignore[arg-type]
        setpoints = vehicle.subscribe(SETPOINT)
        for _, setpoint in zip(range(4), setpoints):  # noqa: B905 - the second one has no end
            assert setpoint.yaw == 0.5  # the owner has taken what was asked before it
            link.sample(remote, px4_types.VehicleStatus(timestamp=1))
    assert heard == {"out": {"out"}, "in": {"in"}, "both": {"out", "in"}}


def test_a_program_that_owns_its_link_hears_no_other(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link, px4_types) as vehicle:
        link.connect()
        assert not vehicle.is_shared
        assert vehicle.publishers == ()
        with pytest.raises(TopicError, match="what other programs send can be read on a link that they share"):
            vehicle.subscribe(SETPOINT)
        with pytest.raises(TopicError, match="what other programs send"):
            vehicle.watch(print, "both")
        with pytest.raises(ValueError, match="expected out, in or both as direction, got 'up'"):
            vehicle.watch(print, "up")  # type: ignore[arg-type]


@pytest.mark.usefixtures("sender")
def test_commands_show_what_programs_send(path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    url = f"unix://{path}"
    assert main(["topic", "echo", "trajectory_setpoint", "--field", "yaw", "--once", "--link", url]) == 0
    assert capsys.readouterr().out == "0.5  # rad NED\n---\n"
    assert main(["topic", "hz", SETPOINT, "-n", "2", "--link", url]) == 0
    assert "average rate: " in capsys.readouterr().out
    file = str(tmp_path / "both.mcap")
    assert main(["record", "--direction", "in", "--for", "1", "-o", file, "--link", url]) == 0
    assert main(["log", "info", file, "--json"]) == 0
    topics = json.loads(capsys.readouterr().out.partition("\n{")[2].join(["{", ""]))["topics"]
    assert [each["name"] for each in topics] == [SETPOINT]


def test_topic_info_names_the_programs_that_publish(
    path: Path, sender: Vehicle, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    url = f"unix://{path}"
    assert main(["topic", "info", "offboard_control_mode", "--link", url]) == 0
    assert "published by  no program on this link" in capsys.readouterr().out
    with Vehicle(UnixLink(str(path)), px4_types) as other:
        other.wait_connected(WAIT)
        other.publish(px4_types.TrajectorySetpoint())
        other.subscribe(SETPOINT).wait_for(bool, WAIT)
        assert sender.is_shared
        assert main(["topic", "info", SETPOINT, "--link", url, "--json"]) == 0
        publishers = json.loads(capsys.readouterr().out)["publishers"]
        assert [each["pid"] for each in publishers] == [os.getpid()] * 2
        assert main(["topic", "info", SETPOINT, "--link", url]) == 0
        assert "2 programs, and PX4 takes the samples of all: " in capsys.readouterr().out
