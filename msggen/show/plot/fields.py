"""The numbers in messages that paths such as `vehicle_status.nav_state` name, and the newest samples of them.

Of samples, as many are kept as a window of time needs.
"""

from __future__ import annotations

import re
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import IntFlag
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.definitions.primitives import PRIMITIVES
from msggen.messages.places import Place, PlaceError, place_of, places_of
from msggen.recordings.columns.annotations import Annotation
from msggen.recordings.log.series import Series

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


MOST = 1_000_000
"""The most samples of a topic that are kept, however long the window is."""
_CODES = {"?": "B"}
"""The types of arrays, where they are not those of `struct`."""


class Samples:
    """Numbers of the messages of a topic, by time in s. Keeps `window` s, and the sample before them."""

    def __init__(self, numbers: Mapping[str, Number], window: float) -> None:
        """Make an empty one. The keys of `numbers` are the labels of its series."""
        self._numbers, self._window = numbers, window
        self._times = array("d")
        self._values: Sequence[array[Any]] = [array(_CODES.get(each.code, each.code)) for each in numbers.values()]

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time: float, message: Any) -> None:
        """Add a message, if it has all elements. If the clock was set back, those after it are forgotten."""
        try:
            found = [number.get(message) for number in self._numbers.values()]
        except IndexError:  # a sequence is shorter
            return
        self._keep(0, bisect_right(self._times, time))
        self._times.append(time)
        for values, value in zip(self._values, found, strict=True):
            values.append(value)
        old = max(bisect_left(self._times, time - self._window) - 1, len(self._times) - MOST)
        if old > len(self._times) // 2:  # seldom: the rest moves to the front
            self._keep(old, len(self._times))

    def _keep(self, begin: int, end: int) -> None:
        for values in (self._times, *self._values):
            del values[end:], values[:begin]

    def series(self, low: float, end: float) -> list[Series]:
        """Return the numbers from `low` to `end`, none if there are no samples. A value lasts until the next one."""
        if not self._times:
            return []
        times = np.array(self._times)
        return [
            Series(label, times, np.array(values, np.dtype(number.code)), number.annotation, end).since(low)
            for (label, number), values in zip(self._numbers.items(), self._values, strict=True)
        ]
