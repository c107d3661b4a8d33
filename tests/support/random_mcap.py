"""MCAP files with samples of real messages, of text, and of a topic in JSON, as the writer of mcap makes them."""

from __future__ import annotations

import io
from random import Random
from typing import Any

from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter

from support.recordings import START

NAMES = ("VehicleStatus", "SensorGps", "EscStatus", "FailsafeFlags")
TEXTS = "string text\nint32[] numbers\nPoint[] points\nPoint[2] two\nuint16[<=3] few\nfloat64 last\n"
TEXTS += "=" * 80 + "\nMSG: our_msgs/Point\nfloat32 x\nuint8 y\n"
WAYS: dict[str, dict[str, Any]] = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "none": {"compression": CompressionType.NONE},
    "without-chunks": {"use_chunking": False},
    "without-index": {"index_types": IndexType.NONE},
    "without-statistics": {"use_statistics": False, "compression": CompressionType.NONE},
    "without-repeated-schemas": {"repeat_schemas": False},
}


def texts_payload(chance: Random) -> bytes:
    """Return a sample of TEXTS."""
    data = bytearray()

    def put(value: int, size: int) -> None:
        data.extend(bytes(-len(data) % size) + value.to_bytes(size, "little"))

    text = bytes(chance.choices(b"abc", k=chance.randrange(5)))
    put(len(text) + 1, 4)
    data.extend(text + b"\0")
    count = chance.randrange(3)
    put(count, 4)
    for _ in range(count):
        put(chance.randrange(1 << 32), 4)
    count = chance.randrange(3)
    put(count, 4)
    for _ in range(count + 2):
        put(chance.randrange(1 << 20), 4)
        put(chance.randrange(256), 1)
    count = chance.randrange(4)
    put(count, 4)
    for _ in range(count):
        put(chance.randrange(1 << 16), 2)
    put(chance.randrange(1 << 60), 8)
    return b"\0\1\0\0" + bytes(data)


def recording(package: Any, count: int, seed: int = 0, chunk: int = 2000, **options: Any) -> bytes:
    """Return a file with `count` samples of real messages, of text, and of a topic in JSON."""
    chance = Random(seed)  # noqa: S311 - no secret
    file = io.BytesIO()
    writer = McapWriter(file, chunk_size=chunk, **options)
    writer.start("ros2")
    channels: dict[str, int] = {}
    for name in NAMES:
        info = getattr(package, name).__msg__
        schema = writer.register_schema(info.ros_type, "ros2msg", info.definition.encode())
        channels[name] = writer.register_channel(f"/fmu/out/{name.lower()}", "cdr", schema)
    schema = writer.register_schema("our_msgs/msg/Texts", "ros2msg", TEXTS.encode())
    channels["texts"] = writer.register_channel("/texts", "cdr", schema)
    channels["strange"] = writer.register_channel("/strange", "json", 0)
    for number in range(count):
        name = chance.choice(list(channels))
        if name == "texts":
            payload = texts_payload(chance)
        elif name == "strange":
            payload = b"{}"
        else:
            cls = getattr(package, name)
            body = chance.randbytes(cls.__msg__.cdr_size)
            body = bytes(each & 1 for each in body) if chance.random() < 0.5 else bytes(len(body))
            surplus = bytes(chance.randrange(4))
            payload = cls.decode(b"\0\1\0\0" + body).encode() + surplus
        time = START + number * 1000 - chance.choice((0, 0, 5500))
        writer.add_message(channels[name], time, payload, time - 10)
    writer.finish()
    return file.getvalue()
