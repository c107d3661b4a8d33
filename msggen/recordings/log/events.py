"""The events of PX4 in a recording, and the texts of its log with them.

Since v1.14, PX4 says most of what happened as samples of the topic `event`: a number and packed arguments. A ULog has
their metadata. PX4 sends some lines of the log as events, too: they end in a tab.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.base.diagnostics import counted, few
from msggen.recordings.decode.event_metadata import EventMetadataError, read_definitions
from msggen.recordings.log.decoded_events import ALL_LEVELS, decoded_events
from msggen.recordings.source.facts import Event, Text

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.decode.event_metadata import Definition
    from msggen.recordings.topics.topic import Topic

_METADATA = "metadata_events"
_MOST = 100_000
"""The number of events that are read: a flight has some hundreds."""
_SHOWN = 3
_NEAR = 10**9
"""How far in ns an event can be from the line of the log that says the same."""


class Packed(NamedTuple):
    """An event as PX4 sends it. The time is in ns."""

    time: int
    number: int
    sequence: int
    levels: int
    arguments: bytes


def has_events(topic: Topic) -> bool:
    """Whether a topic is that of PX4's events."""
    return topic.uorb.partition("#")[0] == "event" and topic.ros_type.endswith("/Event")


def read_events(
    topics: Iterable[Topic],
    decoded: Iterable[Topic],
    read: Callable[[Topic], Samples],
    information: Mapping[str, object],
) -> tuple[Sequence[Event], Sequence[str]]:
    """Return the events in some topics, by log time, with the metadata that a ULog has among its information.

    Return also why events are not decoded, a line each.

    Without samples or metadata, they are those in topics of `decoded` events, if there are any.
    """
    # those of one time stay in the order of the file
    samples = sorted((each for topic in topics for each in _samples(read(topic))), key=lambda each: each.time)
    if not samples or _METADATA not in information:
        known = sorted((each for topic in decoded for each in decoded_events(read(topic))), key=lambda each: each.time)
        if known or not samples:
            return known[:_MOST], list(_too_many(known))
    notes = list(_too_many(samples))
    del samples[_MOST:]
    numbers = {each.number for each in samples}
    try:
        definitions = read_definitions(metadata_in(information), numbers)
    except EventMetadataError as error:
        notes.append(f"{counted(len(samples), 'event')} not decoded: {_METADATA} {error}")
        return [event_of(each, None) for each in samples], notes
    events = [event_of(each, definitions.get(each.number)) for each in samples]
    return events, [*notes, *_left(events, definitions)]


def _too_many(events: Sequence[object]) -> Iterator[str]:
    """Yield a note if there are more events than are read."""
    if len(events) > _MOST:
        yield f"{counted(len(events) - _MOST, 'event')} left out: a recording has up to {_MOST}"


def with_events(lines: Sequence[Text], events: Sequence[Event]) -> Sequence[Text]:
    """Return the lines of a log and the events that users read, by time.

    Lines that were also sent as events are left out if there are decoded events at their time.
    """
    found = [Text(each.time, each.level, each.text, is_event=True) for each in events if each.is_text]
    if not found:
        return lines
    decoded = [each.time for each in events if each.is_text and each.group]
    kept = [line for line in lines if not (line.is_event and _is_near(decoded, line.time))]
    return sorted([*kept, *found], key=lambda text: text.time)


def _is_near(times: Sequence[int], time: int) -> bool:
    """Whether one of some times in order is near a time."""
    index = bisect_left(times, time - _NEAR)
    return index < len(times) and times[index] <= time + _NEAR


def _samples(samples: Samples) -> Iterator[Packed]:
    """Yield the samples of a topic, none if its fields are not those of Event.msg."""
    rows = samples.array
    fields = {"id": "u4", "event_sequence": "u2", "log_levels": "u1", "arguments": "u1"}
    names = rows.dtype.names or ()
    if any(name not in names or rows.dtype[name].base != np.dtype(kind) for name, kind in fields.items()):
        return
    if any((rows.dtype[name].ndim == 1) != (name == "arguments") for name in fields):
        return
    yield from map(
        Packed,
        samples.log_times.tolist(),
        rows["id"].tolist(),
        rows["event_sequence"].tolist(),
        rows["log_levels"].tolist(),
        map(bytes, np.ascontiguousarray(rows["arguments"])),
    )


def metadata_in(information: Mapping[str, object]) -> bytes:
    """Return the compressed metadata. Raises EventMetadataError."""
    found = information.get(_METADATA)
    if found is None:
        raise EventMetadataError(
            "is not in the recording; events/all_events.json.xz of the firmware's build has their texts"
        )
    parts = found[0] if isinstance(found, list) and found else found
    if isinstance(parts, bytes):
        return parts
    if not isinstance(parts, list) or not all(isinstance(part, bytes) for part in parts):
        raise EventMetadataError("is not bytes")
    return b"".join(parts)


def event_of(sample: Packed, definition: Definition | None) -> Event:
    """Return an event in words, as far as there is a definition."""
    time, number, sequence, levels, arguments = sample
    values = None if definition is None else definition.values(arguments)
    event = Event(time, number, sequence, _level(levels >> 4), _level(levels & 0xF), f"event 0x{number:08x}")
    if definition is None or values is None:
        return event
    text, description = definition.texts(values)
    return event._replace(
        text=text,
        name=definition.name,
        group=definition.group,
        description=description,
        arguments=dict(zip(definition.names, values, strict=True)),
    )


def _level(number: int) -> str:
    return ALL_LEVELS[number] if number < len(ALL_LEVELS) else "unknown"


def _left(events: Iterable[Event], definitions: Collection[int]) -> Iterator[str]:
    """Yield notes about the events that were not decoded."""
    left = [each for each in events if not each.group]
    unknown = [each.text for each in left if each.number not in definitions]
    short = [each.text for each in left if each.number in definitions]
    for found, reason in ((unknown, "does not have them"), (short, "has arguments that they do not have")):
        if found:
            names = few([name.removeprefix("event ") for name in dict.fromkeys(found)])
            yield f"{counted(len(found), 'event')} not decoded: {_METADATA} {reason}: {names}"
