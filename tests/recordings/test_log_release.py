"""Tests of the release that a recording is from: each embedded release is found by its definitions."""

from __future__ import annotations

from pathlib import Path

import pytest

from msggen import recordings
from msggen.definitions.identity import message_hash, type_hash
from msggen.messages.firmware import releases
from msggen.recordings.definitions.release import Release, release_of
from msggen.recordings.log.origin import firmware_of
from msggen.sources.embedded import EMBEDDED
from msggen.sources.released import embedded
from support.log_files import Written, definition_in, write_log


def bridged(release: str) -> list[tuple[str, str]]:
    """Return the topics that a release publishes, with their messages."""
    rows = releases()[release].items()
    return [(name, row.message) for name, row in rows if name.startswith("/fmu/out/")]


def recorded(release: str) -> list[Written]:
    return [
        Written(name, f"px4_msgs/msg/{message}", definition_in(release, message)) for name, message in bridged(release)
    ]


def firmware(folder: Path, topics: list[Written]) -> Release:
    with recordings.open(write_log(folder / "flight.mcap", topics)) as log:
        return log.release()


@pytest.mark.parametrize("release", EMBEDDED)
def test_a_recording_is_from_the_release_that_has_all_its_definitions(release: str, tmp_path: Path) -> None:
    topics = recorded(release)
    found = firmware(tmp_path, topics)
    names = {message for _, message in bridged(release)}
    assert (found.release, found.releases, found.differing) == (release, (release,), ())
    assert set(found.messages) == names
    assert str(found) == f"{release} ({len(names)} of {len(names)} definitions)"


def test_type_hashes_are_enough(tmp_path: Path) -> None:
    topics = []
    for name, message in bridged("v1.16"):
        found = embedded("v1.16", message)
        assert found is not None
        topics.append(Written(name, f"px4_msgs/msg/{message}", "", metadata={"topic_type_hash": type_hash(*found)}))
    assert firmware(tmp_path, topics).releases == ("v1.16",)


def test_other_definitions_are_told(tmp_path: Path) -> None:
    topics = recorded("v1.17")
    for index in (0, 1):
        topics[index].definition = "uint64 timestamp\nfloat32 mine\n"
    topics.append(Written("/fmu/out/mine", "px4_msgs/msg/Mine", "uint64 timestamp\n"))
    topics.append(Written("/imu", "sensor_msgs/msg/Imu", "float64 x\n"))
    found = firmware(tmp_path, topics)
    changed = {topics[index].ros_type.rpartition("/")[2] for index in (0, 1)}
    assert found.release == "v1.17"
    assert set(found.differing) == {*changed, "Mine"}
    assert "Imu" not in found.messages
    total = len(found.messages)
    assert str(found) == f"v1.17 ({total - 3} of {total} definitions; others: {', '.join(found.differing)})"


def test_a_definition_of_several_releases_is_of_all_of_them(tmp_path: Path) -> None:
    topics = [Written("/fmu/out/wind", "px4_msgs/msg/Wind", definition_in("v1.17", "Wind"))]
    found = firmware(tmp_path, topics)
    hashes = {release: message_hash(*known) for release in EMBEDDED if (known := embedded(release, "Wind"))}
    same = [release for release, number in hashes.items() if number == hashes["v1.17"]]
    assert len(found.releases) > 1
    assert list(found.releases) == same
    assert str(found) == f"{' or '.join(found.releases)} (1 of 1 definition)"


def test_a_package_of_another_name_is_known_by_its_messages(tmp_path: Path) -> None:
    topics = recorded("v1.16")
    for each in topics:
        each.ros_type = each.ros_type.replace("px4_msgs", "my_msgs")
        each.definition = each.definition.replace("MSG: px4_msgs/", "MSG: my_msgs/")
    assert firmware(tmp_path, topics).releases == ("v1.16",)


@pytest.mark.parametrize("definition", ["", "uint8", "Unknown it\n", "float64 x\n"])
def test_recordings_of_other_things_are_from_no_release(definition: str, tmp_path: Path) -> None:
    found = firmware(tmp_path, [Written("/imu", "sensor_msgs/msg/Imu", definition)])
    assert (found.release, str(found)) == ("", "unknown firmware")


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0x011001FF, "v1.16.1 (0 of 1 definition; others: Wind)"),
        (0x011000C0, "v1.16.0-rc (nearest: NEAREST, 1 of 1 definition)"),
        (0x01110000, "v1.17.0-dev (nearest: NEAREST, 1 of 1 definition)"),
        (0x010D00FF, "v1.13.0 (nearest: NEAREST, 1 of 1 definition)"),
        (None, "NEAREST (1 of 1 definition)"),
        ("text", "NEAREST (1 of 1 definition)"),
    ],
)
def test_a_ulog_tells_its_version(number: object, text: str, tmp_path: Path) -> None:
    path = write_log(
        tmp_path / "flight.mcap", [Written("/fmu/out/wind", "px4_msgs/msg/Wind", definition_in("v1.14", "Wind"))]
    )
    with recordings.open(path) as log:
        nearest = " or ".join(log.release().releases)
        found = release_of(log.topics, firmware_of({"ver_sw_release": number}).release)
    if number == 0x011001FF:
        text = text if "v1.16" not in nearest else "v1.16.1 (1 of 1 definition)"
    assert str(found) == text.replace("NEAREST", nearest)
