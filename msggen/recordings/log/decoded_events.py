"""The topic `/events` of files that are made of ULogs: events of PX4 with their texts, as ROS 2 has messages.

Programs that read MCAP or rosbag2 show it as it is: they have neither the metadata of events nor what decodes it.
"""

from __future__ import annotations

import json
from math import isfinite, nan
from typing import TYPE_CHECKING

from msggen.recordings.decode.event_metadata import LONGEST
from msggen.recordings.source.facts import LEVELS, Event
from msggen.recordings.source.source import SEPARATOR

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.topics.topic import Topic

TOPIC, TYPE = "/events", "msggen_msgs/msg/DecodedEvent"
_TEXTS = ("level", "external_level", "text", "name", "group", "description", "arguments")
DEFINITION = f"""# an event of PX4, decoded by msggen
builtin_interfaces/Time stamp
uint32 id               # as in px4_msgs/msg/Event, with the number of the component in the highest byte
uint16 sequence         # counts up, so that a gap is a lost event
string level            # in the vehicle's log: from emergency to debug, or protocol or disabled
string external_level   # for ground stations
string text             # what it says, "event 0x0112abcd" without metadata
string name             # "" without metadata, and so below
string group            # default for what users read, arming_check, health, calibration
string description      # more about it
string arguments        # as JSON, by name
{SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
ALL_LEVELS = (*LEVELS, "protocol", "disabled")
"""The levels of events, by their numbers."""


def is_decoded(topic: Topic) -> bool:
    """Whether a topic has decoded events."""
    return topic.ros_type == TYPE


def values_of(event: Event) -> tuple[str, ...]:
    """Return the fields of the message behind `sequence`."""
    arguments = arguments_json(event.arguments) if event.group else ""
    return (event.level, event.external_level, event.text, event.name, event.group, event.description, arguments)


def arguments_json(arguments: Mapping[str, int | float]) -> str:
    """Return arguments as JSON. Numbers that are not finite are null, as everywhere."""
    return json.dumps({name: value if isfinite(value) else None for name, value in arguments.items()})


def decoded_events(samples: Samples) -> Iterator[Event]:
    """Yield the events in a topic. What another program wrote with other fields is left out."""
    rows = samples.array
    names = rows.dtype.names or ()
    kinds = {"id": "u4", "sequence": "u2", **dict.fromkeys(_TEXTS, "O")}
    if any(name not in names or rows.dtype[name] != kind for name, kind in kinds.items()):
        return
    columns = [rows[name].tolist() for name in kinds]
    for time, number, sequence, *texts in zip(samples.log_times.tolist(), *columns, strict=True):
        if all(isinstance(each, str) for each in texts):
            level, external_level, text, name, group, description = map(_clean, texts[:-1])
            yield Event(
                time=time,
                number=number,
                sequence=sequence,
                level=_level(level),
                external_level=_level(external_level),
                text=text,
                name=name,
                group=group,
                description=description,
                arguments=_arguments(texts[-1]),
            )


def _level(name: str) -> str:
    return name if name in ALL_LEVELS else "unknown"


def _clean(text: str) -> str:
    """Return a text that can be encoded, not longer than those of metadata."""
    return text[:LONGEST].encode(errors="replace").decode()


def _arguments(text: str) -> Mapping[str, int | float]:
    """Return arguments, without values that are no numbers."""
    try:
        found = json.loads(text) if text else {}
    except (ValueError, RecursionError):
        return {}
    if not isinstance(found, dict):
        return {}
    numbers = {name: nan if value is None else value for name, value in found.items()}
    return {_clean(name): value for name, value in numbers.items() if type(value) is float or _is_integer(value)}


def _is_integer(value: object) -> bool:
    """Whether a value is an integer of 64 bits."""
    return type(value) is int and -(1 << 63) <= value < 1 << 64
