"""ULogs for tests: a writer, the formats and values of real definitions, and a small log with a bit of everything."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from msggen.recordings.decode.schemas import definitions_in
from msggen.recordings.files.ulog.messages import SYNC
from msggen.recordings.files.ulog.reader import MAGIC

TYPES = {"float32": "float", "float64": "double", "bool": "bool", "char": "char", "byte": "uint8_t"} | {
    f"{sign}int{bits}": f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)
}
SIZES = {name: int(re.sub(r"\D", "", name) or {"float": 32, "double": 64}.get(name, 8)) // 8 for name in TYPES.values()}
UTC = 1_790_000_000_000_000
"""The time in us since 1970 at which the vehicle of `write_ulog` started."""
COUNT = 200
"""How many samples each topic has there."""
_FORMATS = {
    "sensor_gps": "uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;uint8_t fix_type;uint8_t[7] _padding0",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t time_utc_usec;int32_t x;uint8_t fix_type;uint8_t[3] _padding",
    "esc_report": "uint64_t timestamp;int32_t esc_rpm;float esc_voltage;uint8_t esc_state;uint8_t[7] _padding0",
    "esc_status": "uint64_t timestamp;uint16_t counter;bool armed;uint8_t[5] _padding0;esc_report[3] esc",
    "actuator_outputs": "uint64_t timestamp;uint32_t noutputs;float[16] output;uint8_t[4] _padding0",
    "odd": "uint64_t timestamp;float hipower_5v__oc",
}
TOPICS = [
    ("sensor_gps", 0),
    ("sensor_gps", 1),
    ("vehicle_gps_position", 0),
    ("esc_status", 0),
    ("actuator_outputs", 0),
    ("odd", 0),
]
"""Its topics and instances."""
_SYNCS = 20
"""The samples between two sync messages."""
_FIELD = re.compile(r"^([\w/]+)(?:\[(\d+)\])? ([a-z]\w*)[ \t]*(?:#.*)?$", re.MULTILINE)


class UlogWriter:
    """A ULog in memory. Each method adds a message."""

    def __init__(
        self, *, flags: bool = True, version: int = 1, incompatible: bytes = bytes(8), start: int = 1_000_000
    ) -> None:
        self.data = bytearray(MAGIC + struct.pack("<BQ", version, start))
        if flags:
            self.message("B", bytes(8) + incompatible + bytes(24))

    def message(self, kind: str, content: bytes) -> None:
        """Add a message of any kind."""
        self.data += struct.pack("<HB", len(content), ord(kind)) + content

    def format(self, name: str, fields: str) -> None:
        """Add a format: `uint64_t timestamp;float[3] xyz`."""
        self.message("F", f"{name}:{fields};".encode())

    def subscribe(self, number: int, topic: str, instance: int = 0) -> None:
        """Let `number` stand for an instance of a topic."""
        self.message("A", struct.pack("<BH", instance, number) + topic.encode())

    def remove(self, number: int) -> None:
        """Let `number` stand for no topic."""
        self.message("R", struct.pack("<H", number))

    def sample(self, number: int, content: bytes) -> None:
        """Add a sample."""
        self.message("D", struct.pack("<H", number) + content)

    def sync(self) -> None:
        """Add a message that readers search."""
        self.data += SYNC

    def dropout(self, milliseconds: int) -> None:
        """Add a dropout."""
        self.message("O", struct.pack("<H", milliseconds))

    def text(self, level: int, microseconds: int, text: str, tag: int | None = None) -> None:
        """Add a text with a level from 0 to 7."""
        front = struct.pack("<B", ord("0") + level) + (b"" if tag is None else struct.pack("<H", tag))
        self.message("L" if tag is None else "C", front + struct.pack("<Q", microseconds) + text.encode())

    def information(self, key: str, value: bytes) -> None:
        """Add an information, such as `char[5] sys_name`."""
        self.message("I", bytes([len(key)]) + key.encode() + value)

    def part(self, key: str, value: bytes, *, continues: bool) -> None:
        """Add an information in several parts."""
        self.message("M", bytes([continues, len(key)]) + key.encode() + value)

    def parameter(self, name: str, value: float, *, default: int | None = None) -> None:
        """Add a parameter, or the default of one: of the firmware (1), of the airframe (2), or of both (3)."""
        key = f"{'int32_t' if isinstance(value, int) else 'float'} {name}"
        content = bytes([len(key)]) + key.encode() + struct.pack("<i" if isinstance(value, int) else "<f", value)
        self.message("P" if default is None else "Q", (b"" if default is None else bytes([default])) + content)

    def append_from_here(self, place: int = 0) -> None:
        """Tell in the flags that data was appended at the end of what there is now."""
        self.data[16 + 3 + 8] |= 1
        struct.pack_into("<Q", self.data, 16 + 3 + 16 + 8 * place, len(self.data))

    def write(self, path: Path) -> str:
        """Write the file, and return its path."""
        path.write_bytes(self.data)
        return str(path)


def snake(name: str) -> str:
    """Return `vehicle_status` for VehicleStatus."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def formats_of(ros_type: str, definition: str) -> dict[str, str]:
    """Return the formats of a message and of those that it nests, as PX4 writes them: large fields first, then padding.

    The last one is that of the message.
    """
    sizes: dict[str, int] = dict(SIZES)
    found = {}
    for key, text in reversed(definitions_in(ros_type, definition).items()):
        fields = [
            (TYPES.get(type_, snake(type_.rpartition("/")[2])), length, name)
            for type_, length, name in _FIELD.findall(text)
        ]
        fields.sort(key=lambda field: -min(sizes[field[0]], 8))
        texts: list[str] = []
        size = 0
        for type_, length, name in fields:
            align = min(sizes[type_] & -sizes[type_], 8)
            if size % align:
                texts.append(f"uint8_t[{-size % align}] _padding{len(texts)}")
                size += -size % align
            texts.append(f"{type_}[{length}] {name}" if length else f"{type_} {name}")
            size += sizes[type_] * int(length or 1)
        if size % 8:
            texts.append(f"uint8_t[{-size % 8}] _padding{len(texts)}")
        name = snake(key.rpartition("/")[2])
        sizes[name] = size + -size % 8
        found[name] = ";".join(texts)
    return found


def size_of(formats: Mapping[str, str], name: str, *, with_end: bool) -> int:
    """Return the size of the samples of a format, with or without the padding at their end. An independent count."""
    total = 0
    fields = formats[name].split(";")
    while not with_end and fields[-1].partition(" ")[2].startswith("_padding"):
        fields.pop()
    for field in fields:
        type_, length, _ = re.fullmatch(r"(\w+)(?:\[(\d+)\])? (\w+)", field).groups()  # type: ignore[union-attr]
        total += int(length or 1) * (SIZES.get(type_) or size_of(formats, type_, with_end=True))
    return total


def content_of(random: Random, size: int, microseconds: int) -> bytes:
    """Return a sample with a time in front."""
    return struct.pack("<Q", microseconds) + random.randbytes(size - 8)


def flight(px4_types: Any, names: Sequence[str], random: Random, *, count: int, is_padded: bool = False) -> UlogWriter:
    """Return a log of several messages. With `is_padded`, every second sample has the padding at its end."""
    writer = UlogWriter()
    formats: dict[str, str] = {}
    for name in names:
        info = getattr(px4_types, name).__msg__
        formats |= formats_of(info.ros_type, info.definition)
    for name, fields in formats.items():
        writer.format(name, fields)
    writer.information("char[3] sys_name", b"PX4")
    writer.parameter("MPC_XY_P", 0.5)
    topics = [(snake(name), instance) for name in names for instance in range(2)]
    for number, (topic, instance) in enumerate(topics):
        writer.subscribe(number, topic, instance)
    for index in range(count):
        number = random.randrange(len(topics))
        size, full = (size_of(formats, topics[number][0], with_end=with_end) for with_end in (False, True))
        padding = bytes(full - size) if is_padded and index % 2 else b""
        writer.sample(number, content_of(random, size, 1_000_000 + 1000 * index) + padding)
        if index % _SYNCS == 0:
            writer.sync()
    return writer


def write_ulog(path: Path, *, is_timed: bool = True, seed: int = 1, count: int = COUNT, version: int = 0) -> Path:
    """Write a log of `TOPICS`, with nested messages, padding, a parameter, a text and a dropout.

    `version` is that of the firmware: 0x011000FF for v1.16.0.
    """
    chance = Random(seed)  # noqa: S311 - no secret
    writer = UlogWriter()
    for name, fields in _FORMATS.items():
        writer.format(name, fields)
    writer.information("char[3] sys_name", b"PX4")
    if version:
        writer.information("uint32_t ver_sw_release", struct.pack("<I", version))
    writer.parameter("MC_P", 6.5)
    for number, (name, instance) in enumerate(TOPICS):
        writer.subscribe(number, name, instance)
    for index in range(count):
        for number, (name, _) in enumerate(TOPICS):
            time = 1_000_000 + index * 10_000 + number
            content = bytearray(content_of(chance, size_of(_FORMATS, name, with_end=False), time))
            if "gps" in name:
                content[8:16] = struct.pack("<Q", UTC + time if is_timed else 0)
                content[-1] = 3
            writer.sample(number, bytes(content))
        if index == count // 2:
            writer.text(4, 1_000_000 + index * 10_000, "café")
            writer.parameter("MC_P", 7.5)
            writer.dropout(12)
    return Path(writer.write(path))


def columns_of_pyulog(path: str) -> dict[tuple[str, int], dict[str, np.ndarray[Any, Any]]]:
    """Return what pyulog reads, in the order of the times, without padding."""
    from pyulog import ULog  # the benchmarks write ULogs without it

    found = {}
    for data in ULog(path).data_list:
        columns = {name: values for name, values in data.data.items() if "_padding" not in name}
        order = np.argsort(columns["timestamp"], kind="stable") if "timestamp" in columns else slice(None)
        found[data.name, data.multi_id] = {name: values[order] for name, values in columns.items()}
    return found


def differences(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> Iterator[str]:
    """Yield the columns that are not equal bit by bit. pyulog has bools and chars as bytes with a sign."""
    if list(ours) != list(theirs):
        yield f"{sorted(ours)} and {sorted(theirs)}"
    for name in ours.keys() & theirs.keys():
        column, other = ours[name], theirs[name]
        other = other != 0 if column.dtype == bool else other
        if column.tobytes() != other.tobytes() or column.itemsize != other.itemsize:
            yield name
