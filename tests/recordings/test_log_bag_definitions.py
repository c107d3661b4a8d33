"""Tests of recordings without definitions: those of a package, a folder, or an embedded release are used."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any

import pytest

import msggen
import msggen.definitions.identity
from msggen import recordings
from msggen.base.diagnostics import InputError
from msggen.cli import main
from msggen.generate.cache import package_from, package_of
from msggen.recordings.decode.schemas import definition_of, read_schema, type_hash_of
from msggen.sources.embedded import EMBEDDED
from msggen.sources.finding import find_sources
from support.databases import Stored, write_database
from support.firmware_trees import write_tree
from support.recordings import START

RELEASES = EMBEDDED[1:]
NAMES = ("vehicle_status", "sensor_combined", "vehicle_odometry", "battery_status", "failsafe_flags")


def topics_of(package: Any) -> list[Any]:
    """Return some topics that a release publishes."""
    return [each for each in package.topics.out if each.uorb_topic in NAMES]


def write_release(
    path: Path, package: Any, *, has_hash: bool = False, further: Sequence[Stored] = (), namespace: str = "/uav_1"
) -> Path:
    """Write samples of a release without their definitions, as ROS 2 Humble does."""
    chance = Random(1)  # noqa: S311 - no secret
    topics, rows = list(further), []
    for number, each in enumerate(topics_of(package), 1):
        info = each.message.__msg__
        topics.append(
            Stored(number, f"{namespace}{each.ros_name}", info.ros_type, type_hash=info.type_hash if has_hash else "")
        )
        for index in range(20):
            payload = b"\0\1\0\0" + chance.randbytes(info.cdr_size)
            rows.append((number, START + index * 1000 + number, payload + bytes(-len(payload) % 4)))
    return write_database(path, topics, rows, version=4 if has_hash else 2)


def check(log: recordings.Log, package: Any) -> None:
    """Check that the samples are decoded by the definitions of a package."""
    assert set(log.load()) == {topic.name for topic in log.topics}
    for each in topics_of(package):
        samples = log.samples(f"/uav_1{each.ros_name}")
        assert len(samples) == 20
        assert samples.array.dtype.names == tuple(field.name for field in each.message.__msg__.fields)
        assert type_hash_of(samples.topic.ros_type, samples.topic.definition) == each.message.__msg__.type_hash
    assert log.problems == []


@pytest.mark.parametrize("release", RELEASES)
def test_the_release_is_found(release: str, tmp_path: Path) -> None:
    package = package_of(release)
    log = recordings.open(write_release(tmp_path / "x.db3", package))
    check(log, package)
    (note,) = log.notes
    assert f"{len(topics_of(package))} topics have no definitions in the recording" in note
    assert f"taken from {release}, the embedded release that fits best" in note


def test_definitions_can_be_named(tmp_path: Path) -> None:
    package = package_of("v1.16")
    path = write_release(tmp_path / "x.db3", package)
    for definitions in (package, "v1.16"):
        log = recordings.open(path, definitions)
        check(log, package)
        assert "as asked for" in log.notes[0]


def test_definitions_can_be_a_folder(tmp_path: Path) -> None:
    folder = tmp_path / "demo/msg"
    folder.mkdir(parents=True)
    (folder / "Wind.msg").write_text("uint64 timestamp\nfloat32 speed\n")
    path = write_database(
        tmp_path / "x.db3", [Stored(1, "/wind", "px4_msgs/msg/Wind")], [(1, START, b"\0\1\0\0" + bytes(12))], version=1
    )
    log = recordings.open(path, tmp_path / "demo")
    assert log["wind"].dtype.names == ("timestamp", "speed")


def test_unknown_definitions_are_an_error(tmp_path: Path) -> None:
    path = write_release(tmp_path / "x.db3", package_of("v1.16"))
    with pytest.raises(InputError, match=r"v1\.61"):
        recordings.open(path, "v1.61")


def test_a_definition_of_another_size_is_not_used(tmp_path: Path) -> None:
    old, new = package_of("v1.14"), package_of("v1.17")
    log = recordings.open(write_release(tmp_path / "x.db3", old), new)
    sizes = {each.uorb_topic: each.message.__msg__.cdr_size for each in topics_of(new)}
    differing = {each.uorb_topic for each in topics_of(old) if sizes[each.uorb_topic] != each.message.__msg__.cdr_size}
    assert differing
    assert {topic.uorb for topic in log.topics if not topic.definition} >= differing
    for name in differing:
        assert any(name in note and "does not fit its samples" in note for note in log.notes)
        with pytest.raises(recordings.RecordingError, match="has no definition"):
            log[name]


def test_type_hashes_decide(tmp_path: Path) -> None:
    package = package_of("v1.16")
    path = write_release(tmp_path / "x.db3", package, has_hash=True)
    check(recordings.open(path), package)
    assert recordings.open(path).notes
    log = recordings.open(path, "v1.14")
    for topic in log.topics:
        assert not topic.definition or type_hash_of(topic.ros_type, topic.definition) == topic.type_hash


def test_other_types_stay_without_definitions(tmp_path: Path) -> None:
    further = [Stored(90, "/chatter", "my_msgs/msg/Chatter"), Stored(91, "/json", "x/msg/Y", encoding="json")]
    package = package_of("v1.17")
    log = recordings.open(write_release(tmp_path / "x.db3", package, further=further))
    assert {topic.name for topic in log.topics if not topic.definition} == {"/chatter", "/json"}
    assert any("/chatter has no definition" in note for note in log.notes)
    path = write_database(tmp_path / "y.db3", further, [(90, START, b"\0\1\0\0\1\0\0\0\0")], version=1)
    nothing, hint = recordings.open(path).notes
    assert nothing == "1 topic has no definition in the recording, and no embedded release fits"
    assert hint.startswith("for the types of my_msgs, name the folder of their package, --msg-dir my_msgs=DIR, or ")


def test_topics_without_samples_are_told(tmp_path: Path) -> None:
    package = package_of("v1.17")
    further = [Stored(90, "/fmu/out/vehicle_attitude", "px4_msgs/msg/VehicleAttitude")]
    log = recordings.open(write_release(tmp_path / "x.db3", package, further=further))
    assert len(log["vehicle_attitude"]) == 0
    assert "not compared with samples: /fmu/out/vehicle_attitude" in log.notes


def test_a_recording_with_definitions_has_no_notes(tmp_path: Path) -> None:
    topic = Stored(1, "/wind", "px4_msgs/msg/Wind", "float32 speed\n")
    path = write_database(tmp_path / "x.db3", [topic], [(1, START, b"\0\1\0\0\0\0\x80?")])
    log = recordings.open(path, "v1.17")
    assert log["wind"]["speed"].tolist() == [1]
    assert log.notes == []


@pytest.mark.parametrize("release", EMBEDDED)
def test_all_definitions_of_a_release_are_written_and_read_again(release: str) -> None:
    """The type hash of what is read from the text is that of the catalog."""
    catalog = msggen.read(release)
    for message in catalog.uorb_messages:
        text = definition_of(catalog, message)
        again = read_schema(message.ros_type, text)
        assert [(one.name, one.value) for one in again.message.constants] == [
            (one.name, one.value) for one in message.constants
        ]
        assert type_hash_of(message.ros_type, text) == msggen.definitions.identity.type_hash(catalog, message)


def test_the_firmware_of_the_current_folder_lends_what_a_recording_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = write_tree(tmp_path / "fw", "v1.16", {"msg/versioned/VehicleStatus.msg": "\nuint32 swaps\n"})
    path = write_release(tmp_path / "x.db3", package_from(find_sources(str(tree))))
    monkeypatch.chdir(tree)
    assert main(["log", "info", str(path), "--json"]) == 0
    assert "the PX4-Autopilot tree in the current folder, which fits best" in capsys.readouterr().out
    assert main(["log", "show", str(path), "vehicle_status", "-n", "1"]) == 0
    assert "swaps" in capsys.readouterr().out
    monkeypatch.chdir(tmp_path)
    assert main(["log", "info", str(path), "--json"]) == 0
    assert "the embedded release that fits best" in capsys.readouterr().out


def test_a_release_that_fits_better_than_the_current_folder_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = write_tree(tmp_path / "fw", "v1.14")
    monkeypatch.chdir(tree)
    assert main(["log", "info", str(write_release(tmp_path / "x.db3", package_of("v1.17"))), "--json"]) == 0
    assert "v1.17, the embedded release that fits best" in capsys.readouterr().out
