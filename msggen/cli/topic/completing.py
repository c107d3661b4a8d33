"""Completions of topics, fields, members and messages. They come from types, so no vehicle is needed."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from msggen.cli.call import service_of
from msggen.cli.link import expected_package
from msggen.cli.log.completing import recorded_fields, recorded_paths, recorded_topics
from msggen.cli.message import values_like

if TYPE_CHECKING:
    from msggen.live.messages.packages import Message, Way

_WORD = re.compile(r"[\w.\[\]]*\Z")
_COMPARED = re.compile(r"([\w.\[\]]+)\s*(?:[=!<>]=|[<>&]|(?:not\s+)?in\s*\([^()]*)\s*\Z")
"""The value whose enum has the members that come next: before `==`, or before `in (A, `."""


def topics(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield names of topics: those of uORB, or those of ROS 2 after a `/`. A topic to print is one of PX4."""
    if getattr(options, "file", None):
        yield from recorded_topics(prefix, options)
        return
    ways: tuple[str, ...] = ("out", "in")
    if hasattr(options, "filter") or hasattr(options, "topics"):
        ways = ("out",)
    elif hasattr(options, "values"):
        ways = ("in",)
    for endpoint in expected_package(options).topics.ENDPOINTS:
        if endpoint.direction in ways:
            yield endpoint.ros_name if prefix.startswith("/") else endpoint.uorb_topic


def messages(_: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the names of the messages of topics."""
    for endpoint in expected_package(options).topics.ENDPOINTS:
        yield endpoint.message_name


def fields(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of values of the topic."""
    if getattr(options, "file", None):
        yield from recorded_fields(prefix, options)
        return
    yield from _paths(prefix, _message(options))


def conditions(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield a condition with its last word completed: a field, a member of the enum of the other side, a function."""
    from msggen.live.messages.expression import FUNCTIONS
    from msggen.live.messages.places import PlaceError, place_of

    message = _message(options)
    found = _WORD.search(prefix)
    start, word = (prefix[: found.start()], found[0]) if found else (prefix, "")
    compared = _COMPARED.search(start)
    if compared is not None:
        try:
            enum = place_of(message, compared[1]).enum
        except PlaceError:
            return
        if enum is not None:
            yield from [f"{start}{name}" for name in enum.__members__]
            return
    yield from [f"{start}{name}" for name in _paths(word, message)]
    yield from [f"{start}{name}(" for name in FUNCTIONS]


def values(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield values in YAML with the last word completed, of the topic to publish or of the service to call."""
    if hasattr(options, "topic"):
        yield from values_like(prefix, _message(options, "in"))
    else:
        yield from values_like(prefix, service_of(options, expected_package(options)).Request)


def _message(options: argparse.Namespace, way: Way = "out") -> type[Message]:
    """Return the message of the topic in the options. Raises TopicError."""
    from msggen.live import TopicError
    from msggen.live.messages.lookup import named_topic

    message = named_topic(options.topic or "", way, expected_package(options), ()).message
    if message is None:
        raise TopicError(options.topic)
    return message


def _paths(prefix: str, message: type[Message]) -> Iterator[str]:
    from msggen.live.messages.places import PlaceError, place_of, places_of

    front, dot, last = prefix.rpartition(".")
    try:
        inner = place_of(message, front).nested if dot else message
    except PlaceError:
        return
    for place in places_of(inner) if inner else ():
        yield f"{front}{dot}{place.path}"
        if place.is_array and last.startswith(place.path):
            yield from [f"{front}{dot}{place.path}[{index}]" for index in range(place.field.length or 0)]


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
