"""Recordings in MCAP for tests, with any definitions, times and payloads."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from mcap.writer import Writer

from msggen import recordings
from msggen.recordings import Log
from msggen.sources.embedded import Releases
from msggen.sources.released import embedded
from support.ulog import UlogWriter, content_of, formats_of, size_of, snake


@dataclass
class Written:
    """A topic to be written. A sample has a log time and a publish time in ns, and a payload."""

    topic: str
    ros_type: str
    definition: str
    samples: Sequence[tuple[int, int, bytes]] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)
    encoding: str = "cdr"
    format: str | None = None
    """The format of the definition. By default `ros2msg`, or none for a definition that is empty."""


def write_log(path: Path, topics: Iterable[Written], **options: Any) -> Path:
    """Write a recording in MCAP in the order of the log times, and return its path."""
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start("ros2", "tests")
        rows = []
        for each in topics:
            format_ = ("ros2msg" if each.definition else "") if each.format is None else each.format
            schema = writer.register_schema(each.ros_type, format_, each.definition.encode())
            channel = writer.register_channel(each.topic, each.encoding, schema, dict(each.metadata))
            rows += [(log_time, channel, publish_time, payload) for log_time, publish_time, payload in each.samples]
        for log_time, channel, publish_time, payload in sorted(rows, key=lambda row: row[0]):
            writer.add_message(channel, log_time, payload, publish_time)
        writer.finish()
    return path


START = 10**18
"""The log time of the first sample of `foos`, in ns."""
TYPE = "our_msgs/msg/Foo"
FOO = "uint64 timestamp\nfloat32 x\n"


def foo(time: int, x: float = 0.0) -> bytes:
    """Return a sample of FOO."""
    return b"\0\1\0\0" + struct.pack("<Qf", time, x)


def foos(topic: str, times: Iterable[int], definition: str = FOO, **options: Any) -> Written:
    """Return a topic of FOO with samples at times in ms."""
    samples = [(START + time * 10**6, START, foo(time, float(time))) for time in times]
    return Written(topic, TYPE, definition, samples, **options)


def opened(folder: Path, *topics: Written, **options: Any) -> Log:
    """Return a recording of topics in a folder."""
    return recordings.open(write_log(folder / "flight.mcap", topics, **options))


def definition_in(release: str, name: str) -> str:
    """Return the definition of a message in an embedded release as `ros2msg`, with all that it nests."""
    releases = Releases()
    found = embedded(release, name)
    assert found is not None
    _, own = releases.file(release, f"{name}.msg")
    inner = [each.name for each in found.catalog.nested_all(found.message)]
    nested = (f"{'=' * 80}\nMSG: px4_msgs/{each}\n{releases.file(release, f'{each}.msg')[1]}" for each in inner)
    return own + "".join(nested)


def write_ulog_of(  # noqa: PLR0913 - named options
    release: str, names: Sequence[str], path: Path, *, count: int = 3, version: str = "", boot: int = 0
) -> str:
    """Write a ULog with the definitions of a release and samples of random bytes, and return its path.

    `version` is the firmware that it tells: "v1.16.0". `boot` is when the vehicle started, in us since 1970.
    """
    writer = UlogWriter()
    if version:
        writer.information("uint32_t ver_sw_release", bytes([255, *map(int, reversed(version[1:].split(".")))]))
    if boot:
        writer.information("uint64_t boot_time_utc_us", struct.pack("<Q", boot))
    formats = {}
    for name in names:
        formats.update(formats_of(f"px4_msgs/msg/{name}", definition_in(release, name)))
    for name, text in formats.items():
        writer.format(name, text)
    for number, name in enumerate(names):
        writer.subscribe(number, snake(name))
    random = Random(7)  # noqa: S311 - no secret
    for index in range(count):
        for number, name in enumerate(names):
            writer.sample(number, content_of(random, size_of(formats, snake(name), with_end=False), 1000 * index))
    return writer.write(path)


def example_flight(folder: Path, package: Any) -> None:
    """Write `flight.ulg` and `flight.mcap`: 20 s of a flight with v1.16, as the vehicle and a computer recorded it.

    The computer receives each second attitude, 2 to 4 ms later.
    """
    boot, utc = 5_000_000_000, 1_790_000_000_000_000_000
    chance = Random(16)  # noqa: S311 - no secret
    cdr: dict[str, list[tuple[int, int, bytes]]] = {"VehicleAttitude": [], "VehicleLocalPosition": []}
    ulog = UlogWriter()
    for name in cdr:
        for format_name, fields in formats_of(f"px4_msgs/msg/{name}", definition_in("v1.16", name)).items():
            ulog.format(format_name, fields)
    ulog.information("uint32_t ver_sw_release", (0x011000FF).to_bytes(4, "little"))
    ulog.subscribe(0, "vehicle_attitude")
    for number in range(1000):
        now = boot + number * 20_000_000
        quaternion = tuple(chance.uniform(-1, 1) for _ in range(4))
        values = (*quaternion, 0.0, 0.0, 0.0, 0.0, 0)
        ulog.sample(0, struct.pack("<QQ8fB", now // 1000, now // 1000, *values))
        if number % 2:
            told, received = (now + utc) // 1000, now + utc + chance.randrange(2_000_000, 4_000_000)
            sample = package.VehicleAttitude(timestamp=told, timestamp_sample=told, q=quaternion)
            cdr["VehicleAttitude"].append((received, received, sample.encode()))
        if number % 10 == 5:
            position = package.VehicleLocalPosition(timestamp=(now + utc) // 1000 - 3000, z=-number / 100)
            cdr["VehicleLocalPosition"].append((now + utc, now + utc, position.encode()))
    ulog.write(folder / "flight.ulg")
    topics = [
        Written(f"/fmu/out/{topic}", f"px4_msgs/msg/{name}", definition_in("v1.16", name), cdr.get(name, ()))
        for topic, name in (
            ("airspeed_validated", "AirspeedValidated"),
            ("vehicle_attitude", "VehicleAttitude"),
            ("vehicle_local_position", "VehicleLocalPosition"),
            ("wind", "Wind"),
        )
    ]
    write_log(folder / "flight.mcap", topics)
