"""Recordings for tests: samples, and what three independent readers find in a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from msggen.exports.writer import Channel
from msggen.link.link import Route
from msggen.recordings.log import opening

START = 1_790_000_000_000_000_000


class Found(NamedTuple):
    """A sample in a file."""

    topic: str
    time: int
    payload: bytes


def route_of(package: Any, topic: str, namespace: str = "") -> Route:
    """Return the route of a uORB topic that PX4 publishes."""
    each = next(each for each in package.topics.out if each.uorb_topic == topic)
    return Route(namespace + each.ros_name, each.message.__msg__.ros_type, "out", each.object_id)


def channel_of(package: Any, route: Route) -> Channel:
    """Return the channel of a route with the definitions of a package."""
    info = package.by_type(route.ros_type).__msg__
    return Channel(route.name, route.ros_type, info.definition, info.type_hash)


def read_mcap(path: str | Path) -> list[Found]:
    """Read a file with mcap."""
    with Path(path).open("rb") as file:
        return [
            Found(channel.topic, each.log_time, each.data) for _, channel, each in make_reader(file).iter_messages()
        ]


def read_rosbags(path: str | Path) -> list[Found]:
    """Read a file with rosbags."""
    with AnyReader([Path(path)]) as reader:
        return [Found(connection.topic, time, bytes(data)) for connection, time, data in reader.messages()]


def read_ours(path: str | Path) -> list[Found]:
    """Read a file as `msggen play` does."""
    with opening.open(path) as log:
        return [Found(*sample) for sample in log.payloads()]


READERS = (read_mcap, read_rosbags, read_ours)


def check_read(path: str | Path, expected: Sequence[Found]) -> None:
    """Check that all readers find the same samples, in the order of their times."""
    for read in READERS:
        assert read(path) == list(expected), read.__name__


def check_decoded(path: str | Path, package: ModuleType) -> int:
    """Check that mcap-ros2-support and rosbags decode to the values of a package by the schemas in the file.

    Returns the number of samples.
    """
    count = 0
    own: dict[tuple[str, int], list[Any]] = {}
    with Path(path).open("rb") as file:
        reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            expected = package.by_type(schema.name).decode(message.data)
            assert_same(decoded, expected)
            own.setdefault((channel.topic, message.log_time), []).append(expected)
            count += 1
    with AnyReader([Path(path)]) as bag:
        for connection, time, data in bag.messages():
            assert_same(bag.deserialize(data, connection.msgtype), own[connection.topic, time].pop(0))
    return count


def assert_same(theirs: Any, ours: Any) -> None:
    """Check that another library's message has the values of a generated message."""
    for field in ours.__msg__.fields:
        value, expected = getattr(theirs, field.name), getattr(ours, field.attribute)
        if hasattr(expected, "__msg__"):
            assert_same(value, expected)
        elif isinstance(expected, tuple) and expected and hasattr(expected[0], "__msg__"):
            for one, other in zip(value, expected, strict=True):
                assert_same(one, other)
        elif isinstance(expected, (int, float)):
            assert value == expected or (value != value and expected != expected)  # noqa: PLR0124 - NaN
        else:
            assert repr(list(value)) == repr(list(expected)) or all(
                one == other or (one != one and other != other)  # noqa: PLR0124
                for one, other in zip(value, expected, strict=True)
            )
