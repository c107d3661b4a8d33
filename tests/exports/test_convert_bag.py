"""Tests of conversions of rosbag2: definitions that are not in the recording, and qualities of service."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from msggen import recordings
from msggen.cli import main
from msggen.exports.convert import convert, join
from msggen.exports.fleet import update
from msggen.recordings.files.rosbag2.qos import QOS, numbered
from support.databases import Stored, write_database
from support.recordings import START

NAME = "/fmu/out/vehicle_status_v4"
NAMED = """- history: keep_all
  depth: 10
  reliability: reliable
  durability: 'volatile'
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: manual_by_topic
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
"""
"""As rosbag2 writes it from version 9 of its metadata on."""
NUMBERED = (
    NAMED.replace("keep_all", "2").replace("reliable", "1").replace("'volatile'", "2").replace("manual_by_topic", "3")
)


def write_bag(path: Path, px4_types: Any, **values: Any) -> Path:
    info = px4_types.VehicleStatus.__msg__
    chance = Random(1)  # noqa: S311 - no secret
    rows = [(1, START + number, b"\0\1\0\0" + bytes(info.cdr_size - 1) + chance.randbytes(1)) for number in range(20)]
    return write_database(path, [Stored(1, NAME, info.ros_type, **values)], rows)


def metadata_of(path: Path) -> dict[str, dict[str, str]]:
    with path.open("rb") as file:
        return {each.name: each.metadata for each in make_reader(file).iter_metadata()}


def test_definitions_that_are_not_in_the_recording_are_told(px4_types: Any, tmp_path: Path) -> None:
    path = write_bag(tmp_path / "flight.db3", px4_types)
    with recordings.open(path, px4_types) as log:
        notes = log.notes
        for format_ in ("mcap", "rosbag2", "parquet"):
            assert convert(log, str(tmp_path / format_), format=format_).notes == notes
    assert metadata_of(tmp_path / "mcap")["msggen.definitions"] == {"topics": NAME, "notes": notes[0]}
    assert notes[0].endswith("as asked for")


def test_recorded_definitions_have_no_notes(px4_types: Any, tmp_path: Path) -> None:
    path = write_bag(tmp_path / "flight.db3", px4_types, definition=px4_types.VehicleStatus.__msg__.definition)
    with recordings.open(path, px4_types) as log:
        assert convert(log, str(tmp_path / "copy.mcap"), format="mcap").notes == []
    assert metadata_of(tmp_path / "copy.mcap").keys() == {"rosbag2"}


def test_commands_tell_where_definitions_are_from(
    px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_bag(tmp_path / "flight.db3", px4_types)
    note = "1 topic has no definition in the recording; 1 taken from v1.18"
    assert main(["log", "info", "flight.db3"]) == 0
    assert note in capsys.readouterr().out
    assert main(["log", "show", "flight.db3", "vehicle_status", "--count", "1"]) == 0
    assert f"flight.db3: {note}" in capsys.readouterr().err
    assert main(["log", "convert", "flight.db3", "-o", "tables"]) == 0
    assert f"flight.db3: {note}" in capsys.readouterr().err
    assert main(["log", "cut", "flight.db3", "--stop", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["notes"][0].startswith(note)


def test_a_fleet_tells_where_definitions_are_from(px4_types: Any, tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    path = write_bag(tmp_path / "logs" / "flight.db3", px4_types)
    (found,) = update(str(tmp_path / "logs"), str(tmp_path / "fleet")).document()["lent"]
    assert found["path"] == str(path)
    assert "v1.18" in found["notes"][0]


@pytest.mark.parametrize("given", [NAMED, NUMBERED])
def test_qualities_of_service_are_copied(px4_types: Any, tmp_path: Path, given: str) -> None:
    """In a form that all releases of ROS 2 read."""
    definition = px4_types.VehicleStatus.__msg__.definition
    path = write_bag(tmp_path / "flight.db3", px4_types, definition=definition, qos=given)
    with recordings.open(path) as log:
        convert(log, str(tmp_path / "copy.mcap"), format="mcap")
        convert(log, str(tmp_path / "copy"), format="rosbag2")
    with recordings.open(tmp_path / "copy.mcap") as log:
        join([log, log], str(tmp_path / "twice.mcap"))
    for name in ("copy.mcap", "copy", "twice.mcap"):
        with AnyReader([tmp_path / name]) as bag:
            (connection,) = bag.connections
            ext: Any = connection.ext
            (found,) = ext.offered_qos_profiles
            kinds = found.history, found.reliability, found.durability, found.liveliness
            assert [each.name for each in kinds] == ["KEEP_ALL", "RELIABLE", "VOLATILE", "MANUAL_BY_TOPIC"]
    with (tmp_path / "copy.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        assert [each.metadata["offered_qos_profiles"] for each in summary.channels.values()] == [NUMBERED]
    assert metadata_of(tmp_path / "copy.mcap")["rosbag2"] == {"serialized_metadata": ""}


def test_numbers_of_qualities_of_service_stay() -> None:
    assert numbered(QOS) == QOS
    assert numbered(NUMBERED) == NUMBERED
    assert yaml.safe_load(numbered(NAMED)) == yaml.safe_load(NUMBERED)
    assert numbered("") == ""
