"""What a program expects of a vehicle: topics and definitions, from a generated package or from definitions."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from types import ModuleType
from typing import Literal, NamedTuple

from msggen.definitions.identity import message_hash
from msggen.definitions.model import Catalog


class Definition(NamedTuple):
    """A message."""

    message_hash: int
    version: int
    is_stamped: bool
    """Whether it begins with a timestamp."""


class ExpectedTopic(NamedTuple):
    """A topic of the bridge, without namespace."""

    name: str
    direction: Literal["in", "out"]
    interval: float = 0.0
    """The shortest time in s between two samples, 0 if it is not limited."""


class Expected(NamedTuple):
    """The topics and definitions that a program was built with."""

    label: str
    """For people: `PX4 v1.18`, or the name of a package."""
    is_given: bool
    """Whether the user has named them. Otherwise they are those of the embedded release that the vehicle has."""
    messages: Mapping[str, Definition]
    topics: tuple[ExpectedTopic, ...] = ()
    """Empty if they are not known."""
    uorb: frozenset[str] = frozenset()
    """The names of all uORB topics."""


def expected_of(package: ModuleType, label: str, *, is_given: bool) -> Expected:
    """Return what a generated package tells."""
    tables = import_module(f"{package.__name__}.topics")
    messages = {}
    for endpoint in tables.ENDPOINTS:
        info = endpoint.message.__msg__
        is_stamped = bool(info.fields) and info.fields[0].name == "timestamp"
        name = info.ros_type.rpartition("/")[2]
        messages[name] = Definition(info.message_hash, info.message_version, is_stamped)
    topics = tuple(
        ExpectedTopic(endpoint.ros_name, endpoint.direction, (endpoint.publish_interval_ms or 0) / 1000)
        for endpoint in tables.ENDPOINTS
    )
    return Expected(label, is_given, messages, topics, frozenset(tables.UORB))


def expected_of_catalog(catalog: Catalog, label: str) -> Expected:
    """Return what definitions tell."""
    messages = {
        message.name: Definition(
            message_hash(catalog, message),
            message.message_version,
            bool(message.fields) and message.fields[0].name == "timestamp",
        )
        for message in catalog.uorb_messages
    }
    uorb = frozenset(topic for message in catalog.uorb_messages for topic in message.topic_names)
    return Expected(label, is_given=True, messages=messages, uorb=uorb)
