"""Tests of the reader with files of other writers: rosbags, and mcap with all its options."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msggen.exports.player import endpoints_of
from msggen.recordings.log import opening
from msggen.recordings.source.source import RecordingError
from msggen.recordings.topics.choice import Choice
from support.recordings import START, Found, read_ours

STATUS, ODOMETRY = "/fmu/out/vehicle_status_v4", "/uav_1/fmu/out/vehicle_odometry"


def samples(package: Any) -> list[Found]:
    """Return samples of two topics, the later ones first within each pair."""
    types = {STATUS: package.VehicleStatus, ODOMETRY: package.VehicleOdometry}
    return [
        Found(name, START + number // 2 * 1000 - number % 2, types[name](timestamp=number).encode())
        for number, name in enumerate(itertools.islice(itertools.cycle(types), 60))
    ]


OPTIONS: list[dict[str, Any]] = [
    {},
    {"compression": CompressionType.LZ4, "chunk_size": 100},
    {"compression": CompressionType.NONE, "enable_crcs": False},
    {"use_chunking": False},
    {"index_types": IndexType.NONE},
    {"index_types": IndexType.CHUNK},
    {"repeat_channels": False},
    {"repeat_schemas": False},
    {"use_statistics": False},
    {"use_summary_offsets": False},
    {"use_chunking": False, "repeat_channels": False, "repeat_schemas": False, "use_statistics": False},
]


@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: ",".join(options) or "default")
def test_all_files_of_mcap_are_read(options: dict[str, Any], px4_types: Any, tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    expected = samples(px4_types)
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start("ros2")
        channels = {}
        for name, cls in ((STATUS, px4_types.VehicleStatus), (ODOMETRY, px4_types.VehicleOdometry)):
            info = cls.__msg__
            schema = writer.register_schema(info.ros_type, "ros2msg", info.definition.encode())
            channels[name] = writer.register_channel(name, "cdr", schema)
        strange = writer.register_channel("/fmu/out/strange", "json", 0)
        for found in expected:
            writer.add_message(channels[found.topic], found.time, found.payload, found.time)
            writer.add_message(strange, found.time, b"{}", found.time)
        writer.finish()
    log = opening.open(path)
    assert [topic.name for topic in log.topics] == ["/fmu/out/strange", STATUS, ODOMETRY]
    assert log.topic(STATUS).definition == px4_types.VehicleStatus.__msg__.definition
    assert [log.start, log.end] == [min(each.time for each in expected), max(each.time for each in expected)]
    assert read_ours(path) == sorted(expected, key=lambda each: each.time)
    late = [each for each in read_ours(path) if each.time >= START + 10_000 and each.topic == STATUS]
    start = (START + 10_000 - log.start) / 1e9
    assert [Found(*each) for each in log.payloads([STATUS], start=start)] == late
    with pytest.raises(RecordingError, match="has samples in 'json', expected cdr"):
        list(log.payloads(["strange"]))
    assert endpoints_of(log, Choice()).release == "v1.18"
    assert log.problems == []


def test_a_bag_of_ros_is_read(px4_types: Any, tmp_path: Path) -> None:
    store = get_typestore(Stores.EMPTY)
    info = px4_types.VehicleStatus.__msg__
    store.register(get_types_from_msg(info.definition, info.ros_type))
    expected = [each for each in samples(px4_types) if each.topic == STATUS]
    with RosbagsWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(STATUS, info.ros_type, typestore=store)
        for found in expected:
            writer.write(connection, found.time, found.payload)
    path = tmp_path / "bag" / "bag.mcap"
    assert read_ours(path) == expected
    endpoints = endpoints_of(opening.open(path), Choice())
    assert endpoints.hashes["vehicle_status"] == info.message_hash
