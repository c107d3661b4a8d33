"""A slow and obvious reader of MCAP files that are not damaged, record by record; and values of other libraries."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np


class Message(NamedTuple):
    """A message of a file."""

    channel: int
    topic: str
    log_time: int
    publish_time: int
    payload: bytes


def messages(data: bytes) -> list[Message]:
    """Return the messages of a file in the order of the file."""
    topics: dict[int, str] = {}
    return list(_messages(data, 8, topics))


def _messages(data: bytes, place: int, topics: dict[int, str]) -> Iterator[Message]:
    while place + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, place)
        record = data[place + 9 : place + 9 + length]
        place += 9 + length
        if len(record) < length or opcode == 15:
            return
        if opcode == 4:
            (number, _, size) = struct.unpack_from("<HHI", record)
            topics[number] = record[8 : 8 + size].decode()
        elif opcode == 5:
            number, _, log_time, publish_time = struct.unpack_from("<HIQQ", record)
            yield Message(number, topics[number], log_time, publish_time, record[22:])
        elif opcode == 6:
            yield from _messages(_decompressed(record), 0, topics)


def _decompressed(record: bytes) -> bytes:
    (size,) = struct.unpack_from("<I", record, 28)
    kind, data = record[32 : 32 + size], record[32 + size + 8 :]
    if kind == b"zstd":
        import zstandard

        found: Any = zstandard.ZstdDecompressor().decompressobj().decompress(data)
        return bytes(found)
    if kind == b"lz4":
        import lz4.frame

        return bytes(lz4.frame.decompress(data))
    return data


def flat(message: Any, path: str = "") -> dict[str, Any]:
    """Return the values of a message of another library by the names of our columns."""
    found: dict[str, Any] = {}
    for name in getattr(message, "__slots__", None) or vars(message):
        value, label = getattr(message, name), path + name
        if name.startswith("_") or any(each.isupper() for each in name):
            continue  # a constant
        if hasattr(value, "__slots__") or hasattr(value, "__msgtype__"):
            found |= flat(value, f"{label}.")
        elif isinstance(value, (list, tuple, np.ndarray)) and len(value) and hasattr(value[0], "timestamp"):
            for index, each in enumerate(value):
                found |= flat(each, f"{label}[{index}].")
        elif isinstance(value, (list, tuple, np.ndarray, bytes)):
            found |= {f"{label}[{index}]": each for index, each in enumerate(value)}
        else:
            found[label] = value
    return found
