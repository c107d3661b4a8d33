"""Recordings for tests: topics of PX4 with seeded payloads, and topics with strings and sequences."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any

from mcap.writer import CompressionType, Writer

from support.recordings import START

TOPICS = ("vehicle_status", "sensor_combined", "esc_status", "battery_status")
_MESSAGES = ("VehicleStatus", "SensorCombined", "EscStatus", "BatteryStatus")
_SEPARATOR = "=" * 80
TEXTS = (
    "/texts",
    "demo/msg/Texts",
    f"string name\nfloat64[] values\nPoint[] points\n{_SEPARATOR}\nMSG: demo/Point\nfloat32 x\nstring label\n",
)
"""A topic, its type and its definition, with all that has no fixed size."""


def write_flight(path: Path, package: Any, count: int = 300, seed: int = 17, start: int = START) -> Path:
    """Write `count` samples of each of TOPICS, a few of TEXTS, and of a topic in JSON, 10 ms apart."""
    chance = Random(seed)  # noqa: S311 - no secret
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=20_000, compression=CompressionType.ZSTD)
        writer.start("ros2", "test")
        payloads: list[tuple[int, Any]] = []
        for topic, name in zip(TOPICS, _MESSAGES, strict=True):
            info = package.by_type(f"px4_msgs/msg/{name}").__msg__
            schema = writer.register_schema(info.ros_type, "ros2msg", info.definition.encode())
            metadata = {"topic_type_hash": info.type_hash}
            number = writer.register_channel(f"/fmu/out/{topic}", "cdr", schema, metadata)
            size = info.cdr_size
            payloads.append((number, lambda index, size=size: _static(index, size, chance)))
        schema = writer.register_schema(TEXTS[1], "ros2msg", TEXTS[2].encode())
        payloads.append((writer.register_channel(TEXTS[0], "cdr", schema), _texts))
        schema = writer.register_schema("demo", "jsonschema", b"{}")
        payloads.append((writer.register_channel("/json", "json", schema), lambda index: json.dumps(index).encode()))
        for index in range(count):
            for place, (number, payload) in enumerate(payloads):
                time = start + index * 10_000_000 + place * 1000
                writer.add_message(number, time, payload(index), time - 500)
        writer.finish()
    return path


def _static(index: int, size: int, chance: Random) -> bytes:
    """Return a sample whose first field, `timestamp`, counts. The other values are random bytes."""
    return b"\0\1\0\0" + struct.pack("<Q", 1_000_000 + index * 10_000) + chance.randbytes(size - 8)


def _texts(index: int) -> bytes:
    data = bytearray()
    _put_text(data, f"name {index} ü")
    values = [index / 2] * (index % 3)
    data += b"\0" * (-len(data) % 4) + struct.pack("<I", len(values))
    if values:
        data += b"\0" * (-len(data) % 8) + struct.pack(f"<{len(values)}d", *values)
    data += b"\0" * (-len(data) % 4) + struct.pack("<I", index % 2)
    if index % 2:
        data += struct.pack("<f", 1.5)
        _put_text(data, "label")
    return b"\0\1\0\0" + bytes(data)


def _put_text(data: bytearray, text: str) -> None:
    raw = text.encode() + b"\0"
    data += b"\0" * (-len(data) % 4) + struct.pack("<I", len(raw)) + raw


def same_columns(one: Any, other: Any, keys: Sequence[tuple[str, int]] | None = None) -> None:
    """Check that two recordings have the same topics, times and values, bit for bit."""
    first, second = one.load(), other.load()
    assert first.keys() == second.keys()
    for key in first if keys is None else keys:
        columns, others = first[key].columns(), second[key].columns()
        assert list(columns) == list(others)
        assert (first[key].log_times == second[key].log_times).all()
        for name, values in columns.items():
            assert values.dtype == others[name].dtype
            assert values.tobytes() == others[name].tobytes() or str(values.tolist()) == str(others[name].tolist()), (
                name
            )
