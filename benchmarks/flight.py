"""The recordings that recordings.py reads: a flight of seeded samples, in MCAP, a database of rosbag2 and a ULog."""

from __future__ import annotations

import importlib
import struct
import sys
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from environment import ROOT

sys.path[:0] = [str(ROOT / "generated"), str(ROOT / "tests")]

RATES = {
    "VehicleAttitude": 100,
    "VehicleLocalPosition": 100,
    "VehicleOdometry": 100,
    "SensorCombined": 200,
    "VehicleStatus": 2,
    "VehicleGlobalPosition": 50,
    "BatteryStatus": 1,
    "EstimatorStatusFlags": 5,
    "VehicleControlMode": 2,
    "TimesyncStatus": 10,
    "VehicleLandDetected": 5,
    "FailsafeFlags": 5,
    "SensorGps": 10,
    "EscStatus": 50,
    "ActuatorMotors": 100,
    "VehicleThrustSetpoint": 50,
    "VehicleRatesSetpoint": 30,
    "ManualControlSetpoint": 20,
}
"""The topics of the file, in Hz."""
COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
CHUNK = 768 << 10
"""The size of rosbag2's chunks in bytes."""
START = 1_700_000_000_000_000


class Topic(NamedTuple):
    """A topic with seeded samples that change as those of a flight."""

    name: str
    cls: Any
    times: list[int]
    """In us."""
    payloads: list[bytes]

    @property
    def path(self) -> str:
        """The topic in ROS 2."""
        return f"/fmu/out/{self.name.lower()}"


def flight(seconds: float) -> list[Topic]:
    """Return the topics of a flight."""
    package: Any = importlib.import_module("px4_types")
    return [_topic(name, getattr(package, name), rate, round(rate * seconds)) for name, rate in RATES.items()]


def _topic(name: str, cls: Any, rate: int, count: int) -> Topic:
    rows = np.zeros(count, cls.dtype())
    random = np.random.default_rng(3)
    for field in rows.dtype.names or ():
        shape, kind = rows[field].shape, rows.dtype[field].base.kind
        if kind == "f":
            rows[field] = np.cumsum(random.normal(size=shape), axis=0)
        elif kind in "ui":
            rows[field] = random.integers(0, 5, shape)
    rows["timestamp"] = (np.arange(count) * 1e6 / rate).astype(np.uint64) + START
    return Topic(name, cls, rows["timestamp"].tolist(), cls.encode_batch(rows))


def _events(topics: list[Topic]) -> list[tuple[int, int, bytes]]:
    """Return time in us, number of the topic and payload of all samples, by time."""
    found = [
        (time, number, payload)
        for number, topic in enumerate(topics)
        for time, payload in zip(topic.times, topic.payloads, strict=True)
    ]
    return sorted(found, key=lambda event: event[0])


def beginning(topics: list[Topic]) -> list[Topic]:
    """Return topics with their first samples only."""
    return [topic._replace(times=topic.times[:10], payloads=topic.payloads[:10]) for topic in topics]


def write_mcap(path: str, topics: list[Topic], compression: str) -> None:
    """Write a recording in MCAP."""
    with open(path, "wb") as file:
        writer = McapWriter(file, compression=COMPRESSIONS[compression], chunk_size=CHUNK)
        writer.start("ros2")
        channels = []
        for topic in topics:
            definition = topic.cls.__msg__.definition.encode()
            schema = writer.register_schema(f"px4_msgs/msg/{topic.name}", "ros2msg", definition)
            channels.append(writer.register_channel(topic.path, "cdr", schema))
        for time_, number, payload in _events(topics):
            writer.add_message(channels[number], time_ * 1000, payload, time_ * 1000)
        writer.finish()


def write_db3(path: str, topics: list[Topic]) -> None:
    """Write a database of rosbag2."""
    from support.databases import Stored, write_database

    stored = [
        Stored(number, topic.path, f"px4_msgs/msg/{topic.name}", topic.cls.__msg__.definition)
        for number, topic in enumerate(topics, 1)
    ]
    rows = ((number + 1, time_ * 1000, payload) for time_, number, payload in _events(topics))
    write_database(Path(path), stored, rows)


def write_ulog(path: str, topics: list[Topic]) -> None:
    """Write a ULog with the topics and times, and random values."""
    from support.ulog import UlogWriter, formats_of, size_of, snake

    writer = UlogWriter()
    formats: dict[str, str] = {}
    for topic in topics:
        formats |= formats_of(f"px4_msgs/msg/{topic.name}", topic.cls.__msg__.definition)
    for name, fields in formats.items():
        writer.format(name, fields)
    for number, topic in enumerate(topics):
        writer.subscribe(number, snake(topic.name))
    sizes = [size_of(formats, snake(topic.name), with_end=False) for topic in topics]
    random = Random(3)  # noqa: S311 - no secret
    for time_, number, _ in _events(topics):
        writer.sample(number, struct.pack("<Q", time_ - START) + random.randbytes(sizes[number] - 8))
    writer.write(Path(path))
