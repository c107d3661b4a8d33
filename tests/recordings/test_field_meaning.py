"""Tests of what recorded fields mean: their units, and the names of their values, by the release of the firmware."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from msggen import recordings
from msggen.cli.commands.log.fields import field_objects
from msggen.exports.convert import convert
from msggen.recordings.columns.annotations import annotations_of
from msggen.recordings.columns.text import Printer
from msggen.recordings.decode.schemas import content_of, read_schema
from msggen.recordings.log import plot
from msggen.sources.embedded import EMBEDDED, Releases, nearest_first
from support.examples import by_day
from support.log_files import definition_in
from support.ulog import UlogWriter, formats_of

RELEASES = Releases()


def without_constants(definition: str) -> str:
    """Return a definition as that of a ULog: without constants and comments, and in another order."""
    own, *nested = (
        "\n".join(reversed([code for line in part.splitlines() if "=" not in (code := line.partition("#")[0])]))
        for part in definition.split(f"{'=' * 80}\n")
    )
    heads = [part.splitlines()[-1] for part in nested]
    texts = ["\n".join([head, *part.splitlines()[:-1]]) for head, part in zip(heads, nested, strict=True)]
    return f"\n{'=' * 80}\n".join([own, *texts])


@cache
def messages_of(release: str) -> list[tuple[str, str, str]]:
    """Return the ROS types of a release, with its definitions and the same ones as those of a ULog."""
    return list(_messages_of(release))


def _messages_of(release: str) -> Iterator[tuple[str, str, str]]:
    for file in sorted(RELEASES.names(release)):
        path, _ = RELEASES.file(release, file)
        if path.startswith("msg/") and path.count("/") < 3 and "old" not in path:
            name = file.removesuffix(".msg")
            definition = definition_in(release, name)
            yield f"px4_msgs/msg/{name}", definition, without_constants(definition)


def names_in(ros_type: str, definition: str, firmware: str = "") -> dict[str, Mapping[int, str]]:
    found = annotations_of(ros_type, definition, firmware)
    return {name: each.members for name, each in found.items() if each.members}


@by_day("release", EMBEDDED, 4)
def test_names_of_values_are_those_of_the_firmware(release: str) -> None:
    count = 0
    for ros_type, definition, bare in messages_of(release):
        own = names_in(ros_type, definition)
        assert names_in(ros_type, bare, f"{release}.3") == own, ros_type
        count += len(own)
    assert count > 80


@by_day("release", EMBEDDED[:0:-1], 4)
def test_without_a_firmware_names_are_those_of_the_newest_release_with_the_same_fields(release: str) -> None:
    definitions = {each: {name: text for name, text, _ in messages_of(each)} for each in EMBEDDED}
    differing = 0
    for ros_type, definition, bare in messages_of(release):
        same = (
            each
            for each in EMBEDDED
            if ros_type in definitions[each] and fields(ros_type, definitions[each][ros_type]) == fields(ros_type, bare)
        )
        newest = next(same)
        found = names_in(ros_type, bare)
        if "=====" not in bare:  # a message with the same fields can nest others
            assert found == names_in(ros_type, definitions[newest][ros_type]), ros_type
        differing += found != names_in(ros_type, definition)
    assert differing


@cache
def fields(ros_type: str, definition: str) -> frozenset[object]:
    schema = read_schema(ros_type, definition)
    return content_of(schema.catalog, schema.message)


def test_a_message_with_other_fields_has_names_only_if_the_firmware_is_known() -> None:
    bare = without_constants(definition_in("v1.14", "ActionRequest")) + "\nuint8 other"
    ros_type = "px4_msgs/msg/ActionRequest"
    assert names_in(ros_type, bare) == {}
    assert names_in(ros_type, bare, "v1.9.0")["source"][0] == "RC_STICK_GESTURE"
    assert names_in(ros_type, bare, "v1.20.1-rc2")["source"][0] == "STICK_GESTURE"
    assert annotations_of(ros_type, bare)["timestamp"].unit == "us"


@pytest.mark.parametrize(
    ("version", "nearest"),
    [
        ("v1.16.0", "v1.16"),
        ("v1.15.0-beta", "v1.15"),
        ("v1.8.2", EMBEDDED[-1]),
        ("v0.3.0", EMBEDDED[-1]),
        ("v1.99.0", EMBEDDED[0]),
        ("v2.0.0", EMBEDDED[0]),
        ("", EMBEDDED[0]),
    ],
)
def test_the_nearest_release_is_first(version: str, nearest: str) -> None:
    found = nearest_first(version)
    assert found[0] == nearest
    assert sorted(found) == sorted(EMBEDDED)


@pytest.mark.parametrize(
    ("version", "name"), [(0x010E03FF, "RC_STICK_GESTURE"), (0x010900FF, "RC_STICK_GESTURE"), (None, "STICK_GESTURE")]
)
def test_all_that_tells_names_tells_the_same(version: int | None, name: str, tmp_path: Path) -> None:
    writer = UlogWriter()
    definition = definition_in("v1.14", "ActionRequest")
    for format_name, text in formats_of("px4_msgs/msg/ActionRequest", definition).items():
        writer.format(format_name, text)
    if version is not None:
        writer.information("uint32_t ver_sw_release", struct.pack("<I", version))
    writer.subscribe(0, "action_request")
    for second in range(1, 4):
        writer.sample(0, struct.pack("<Q3B", second * 1_000_000, 0, 0, 0))
    path = writer.write(tmp_path / "a.ulg")
    with recordings.open(path) as log:
        convert(log, str(tmp_path / "a.mcap"), format="mcap")
        convert(log, str(tmp_path / "a"), format="parquet")
    assert enum_of(pq.read_schema(tmp_path / "a" / "action_request.parquet"))["0"] == name
    for each in (path, str(tmp_path / "a.mcap")):
        with recordings.open(each) as log:
            topic, samples = log.topic("action_request"), log.samples("action_request")
            assert next(one for one in field_objects(topic) if one["name"] == "source")["values"]["0"] == name
            for shown in (samples, samples.choose(["source"])):
                assert f"source: 0 ({name})" in next(Printer(topic).texts(shown)).splitlines()
            assert enum_of(samples.table().schema)["0"] == name
            (series,) = plot.read_series(log, ["action_request.source"])
            assert [band.name for band in series.bands] == [name]


def enum_of(schema: Any) -> dict[str, str]:
    found: dict[str, str] = json.loads(schema.field("source").metadata[b"enum"])
    return found


def test_units_come_from_the_recording_or_from_a_release() -> None:
    own = annotations_of("px4_msgs/msg/VehicleLocalPosition", "float32 z # [ft] height\nfloat32 x\nfloat32 other")
    assert {name: each.unit for name, each in own.items()} == {"z": "ft", "x": "m", "other": ""}
    assert own["x"].frame == "NED"
    foreign = annotations_of("my_msgs/msg/VehicleLocalPosition", "float32 z # [m] height\nfloat32 x")
    assert {name: each.unit for name, each in foreign.items()} == {"z": "m", "x": ""}


def test_names_of_values_of_the_recording_have_priority() -> None:
    text = "uint8 NAVIGATION_STATE_MANUAL = 3\nuint8 NAVIGATION_STATE_HOVER = 4\nuint8 nav_state"
    for firmware in ("", "v1.16.0"):
        assert names_in("px4_msgs/msg/VehicleStatus", text, firmware) == {"nav_state": {3: "MANUAL", 4: "HOVER"}}


def test_flags_and_nested_fields(px4_types: Any) -> None:
    esc = px4_types.EscStatus.__msg__
    assert annotations_of(esc.ros_type, esc.definition)["esc.esc_rpm"].unit == "rpm"
    local = px4_types.VehicleLocalPosition.__msg__
    flags = annotations_of(local.ros_type, local.definition)["dist_bottom_sensor_bitfield"]
    assert flags.is_flags
    assert flags.members == {0: "NONE", 1: "RANGE", 2: "FLOW"}


def test_definitions_that_cannot_be_read_have_no_annotations() -> None:
    assert annotations_of("px4_msgs/msg/VehicleStatus", "nonsense[") == {}
