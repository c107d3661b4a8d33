"""Completions of topics, fields, members and messages. They need neither a vehicle nor an import."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from msggen.cli.commands.call import request_like
from msggen.cli.message import values_like
from msggen.cli.names import names_of

if TYPE_CHECKING:
    from msggen.cli.names import Field, Names
    from msggen.messages.packages import Way
    from msggen.recordings import Topic

_WORD = re.compile(r"[\w.\[\]]*\Z")
_COMPARED = re.compile(r"([\w.\[\]]+)\s*(?:[=!<>]=|[<>&]|(?:not\s+)?in\s*\([^()]*)\s*\Z")
"""The value whose enum has the members that come next: before `==`, or before `in (A, `."""


def topics(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield names of topics: those of uORB, or those of ROS 2 after a `/`.

    A topic to print is one that PX4 publishes, or, if its name begins so, one that programs publish to PX4.
    """
    if getattr(options, "file", None):
        yield from recorded_topics(prefix, options)
        return
    ways: tuple[str, ...] = ("out", "in")
    if hasattr(options, "filter") or hasattr(options, "topics"):
        ways = ("in",) if prefix.startswith("/fmu/in") else ("out",)
    elif hasattr(options, "values"):
        ways = ("in",)
    for endpoint in names_of(options).endpoints:
        if endpoint.direction in ways:
            yield endpoint.ros_name if prefix.startswith("/") else endpoint.uorb_topic
    if hasattr(options, "filter") and len(options.topics or ()) == 1:  # a condition behind a topic
        with suppress(KeyError):
            yield from conditions(prefix, options)


def messages(_: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the names of the messages of topics."""
    for endpoint in names_of(options).endpoints:
        yield endpoint.message.rpartition("/")[2]


def fields(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of values of the topic."""
    if getattr(options, "file", None):
        yield from recorded_fields(prefix, options)
        return
    names = names_of(options)
    yield from _paths(prefix, names, _fields(options, names))


def conditions(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield a condition with its last word completed: a field, a member of the enum of the other side, a function."""
    from msggen.messages.expression import FUNCTIONS

    names = names_of(options)
    own = _fields(options, names)
    found = _WORD.search(prefix)
    start, word = (prefix[: found.start()], found[0]) if found else (prefix, "")
    compared = _COMPARED.search(start)
    if compared is not None:
        front, _, last = compared[1].rpartition(".")
        members = names.fields_in(own, front)[last.partition("[")[0]].members
        if members:
            yield from [f"{start}{name}" for name in members]
            return
    yield from [f"{start}{name}" for name in _paths(word, names, own)]
    yield from [f"{start}{name}(" for name in FUNCTIONS]


def values(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield values in YAML with the last word completed, of the topic to publish or of the service to call."""
    names = names_of(options)
    own = _fields(options, names, "in") if hasattr(options, "topic") else request_like(options, names)
    yield from values_like(prefix, own, names)


def _fields(options: argparse.Namespace, names: Names, way: Way = "out") -> Mapping[str, Field]:
    """Return the fields of the topic in the options. Raises KeyError."""
    several = getattr(options, "topics", None)
    return names.fields_of_topic((several[0] if several else options.topic) or "", way)


def _paths(prefix: str, names: Names, own: Mapping[str, Field]) -> Iterator[str]:
    front, dot, last = prefix.rpartition(".")
    for name, field in names.fields_in(own, front).items():
        yield f"{front}{dot}{name}"
        if last.startswith(name):
            yield from [f"{front}{dot}{name}[{index}]" for index in range(field.length)]


def recorded_topics(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the names of the topics in the recording of the options: of uORB, or those in the file after a `/`."""
    from msggen import recordings

    with recordings.open(options.file) as log:
        for topic in log.topics:
            yield topic.name if prefix.startswith("/") else _numbered(topic)


def recorded_fields(_: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the columns of the topics in the options, or of all."""
    from msggen import recordings
    from msggen.recordings.columns.arrays import names_of

    with recordings.open(options.file) as log:
        chosen = [options.topic] if getattr(options, "topic", None) else getattr(options, "topics", None)
        for topic in log.chosen(chosen or None):
            yield from names_of(log.dtype(topic))


def recorded_paths(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of the columns of all topics: `vehicle_status.nav_state`."""
    if not hasattr(options, "file"):
        yield from _live_paths(prefix, options)
        return
    from msggen import recordings
    from msggen.recordings.columns.arrays import names_of

    with recordings.open(options.file) as log:
        for topic in log.chosen(None):
            name = topic.name if prefix.startswith("/") else _numbered(topic)
            yield from [f"{name}.{column}" for column in names_of(log.dtype(topic))]


def _live_paths(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of the fields of the topic in `prefix`, or of all that PX4 publishes."""
    topic, dot, path = prefix.partition(".")
    names = names_of(options)
    for each in [topic] if dot else topics(prefix, argparse.Namespace(**vars(options), topics=())):
        yield from [f"{each}.{rest}" for rest in _paths(path, names, names.fields_of_topic(each, "out"))]


def _numbered(topic: Topic) -> str:
    """Return the name of a topic in uORB, with its instance: `sensor_gps[1]`."""
    return f"{topic.uorb}[{topic.instance}]" if topic.instance else topic.uorb


COMPLETERS: Mapping[str, Callable[[str, argparse.Namespace], Iterator[str]]] = {
    "topic": topics,
    "topics": topics,
    "message_type": messages,
    "field": fields,
    "fields": recorded_paths,
    "filter": conditions,
    "values": values,
}
"""The completions of arguments by their names in argparse."""
