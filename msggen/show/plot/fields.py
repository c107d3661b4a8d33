"""The numbers in messages that paths such as `vehicle_status.nav_state` name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from enum import IntFlag
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.definitions.primitives import PRIMITIVES
from msggen.messages.places import Place, PlaceError, place_of, places_of
from msggen.recordings.columns.annotations import Annotation

if TYPE_CHECKING:
    from msggen.messages.packages import Message

_PATH = re.compile(r"(?P<topic>[^.\[\]]+)\.(?P<field>.+)")
_INSTANCE = re.compile(r"(?P<topic>[^.\[\]]+)\[(?P<instance>[^\]]*)\](?P<rest>.*)")


class FieldPath(NamedTuple):
    """A path of the command line. The topic ends at the first `.`."""

    text: str
    topic: str
    field: str


class Number(NamedTuple):
    """A number in the messages of a class."""

    path: str
    """The path in the message: `position[2]`."""
    get: Callable[[Any], Any]
    """Returns the value in a message."""
    code: str
    """The type, as the character in `struct` formats."""
    annotation: Annotation


def parse_path(text: str) -> FieldPath:
    """Return the topic and the field in a path. Raises PlaceError."""
    found = _PATH.fullmatch(text)
    if found is not None:
        return FieldPath(text, found["topic"], found["field"])
    instance = _INSTANCE.fullmatch(text)
    if instance is not None:
        hint = f"{instance['topic']}{instance['instance']}{instance['rest']}"
        raise PlaceError(
            f"'{text}' has the number of an instance: dds_topics.yaml gives each instance a topic, as in '{hint}'"
        )
    raise PlaceError(f"expected TOPIC.FIELD, found '{text}'")


def numbers_of(message: type[Message], path: FieldPath) -> list[Number]:
    """Return the numbers that a path names: one, or all of an array or a nested message. Raises PlaceError."""
    found = [_number(place) for place in _leaves(message, place_of(message, path.field)) if not place.is_text]
    if not found:
        raise PlaceError(f"'{path.text}' has no fixed size, or is text, and is not drawn")
    return found


def field_names(message: type[Message]) -> list[str]:
    """Return the names of the fields of a message."""
    return [place.path for place in places_of(message)]


def _leaves(message: type[Message], place: Place) -> Iterator[Place]:
    """Yield the values in a value that are neither arrays nor messages. Those in a sequence are left out."""
    nested = place.nested
    if place.is_array:
        for index in range(place.field.length or 0):
            yield from _leaves(message, place_of(message, f"{place.path}[{index}]"))
    elif nested is not None:
        for inner in places_of(nested):
            yield from _leaves(message, place_of(message, f"{place.path}.{inner.path}"))
    else:
        yield place


def _number(place: Place) -> Number:
    enum, field = place.enum, place.field
    members = {} if enum is None else {each.value: name for name, each in reversed(list(enum.__members__.items()))}
    is_flags = enum is not None and issubclass(enum, IntFlag)
    return Number(
        place.path,
        place.get,
        PRIMITIVES[place.base].code,
        Annotation(field.unit, field.frame, members, is_flags),
    )
