"""The tables of a report: the parameters of a log, and its topics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log


class Parameter(NamedTuple):
    """A parameter, with texts for its values."""

    name: str
    value: str
    airframe: str
    """The default of the airframe, "" if the value is that."""
    firmware: str
    """The default of the firmware, "" if the value is that."""


class Change(NamedTuple):
    """A parameter that changed during the log."""

    time: float
    name: str
    before: str
    after: str


class TopicRow(NamedTuple):
    """A topic of the recording."""

    name: str
    type: str
    samples: str
    rate: str
    gaps: str


def parameters_of(log: Log) -> list[Parameter]:
    """Return the parameters that had other values than their defaults at the start."""
    facts = log.facts
    airframe, firmware = facts.tuned, facts.configured
    return [
        Parameter(name, number(facts.parameters[name]), _default(airframe, name), _default(firmware, name))
        for name in sorted({*airframe, *firmware})
    ]


def _default(defaults: Mapping[str, float], name: str) -> str:
    return number(defaults[name]) if name in defaults else ""


def changes_of(log: Log) -> list[Change]:
    """Return the parameters that changed during the log, in the order of time."""
    values = dict(log.parameters)
    found = []
    for time, name, value in log.facts.changed_parameters:
        before = values.get(name)
        found.append(Change((time - log.start) / 1e9, name, "" if before is None else number(before), number(value)))
        values[name] = value
    return found


def number(value: float) -> str:
    """Return the value of a parameter: floats with the digits that a float32 has."""
    return str(value) if isinstance(value, int) else f"{value:.7g}"


def value_text(value: str | float | None) -> str:
    """Return a value of one of two flights as it is shown: `-` if that flight does not tell it."""
    return "-" if value is None else value if isinstance(value, str) else number(value)


def topics_of(log: Log) -> list[TopicRow]:
    """Return the topics that have samples."""
    found = []
    for topic in log.topics:
        if not topic.count:
            continue
        gaps = topic.gaps
        longest = max((after - before for before, after in gaps), default=0) / 1e9
        text = f"{len(gaps):,}, up to {longest:.2f} s" if gaps else ""
        rate = f"{topic.rate:.1f}" if topic.rate else ""
        found.append(TopicRow(topic.label, topic.ros_type.rpartition("/")[2], f"{topic.count:,}", rate, text))
    return found
