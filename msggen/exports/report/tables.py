"""The tables of a report: the parameters of a log, and its topics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log


def parameters_of(log: Log) -> list[dict[str, str]]:
    """Return the parameters that had other values than their defaults at the start, as texts.

    A default is "" if the value is that.
    """
    facts = log.facts
    airframe, firmware = facts.tuned, facts.configured
    return [
        {
            "name": name,
            "value": number(facts.parameters[name]),
            "airframe": _default(airframe, name),
            "firmware": _default(firmware, name),
        }
        for name in sorted({*airframe, *firmware})
    ]


def _default(defaults: Mapping[str, float], name: str) -> str:
    return number(defaults[name]) if name in defaults else ""


def changes_of(log: Log) -> list[dict[str, str | float]]:
    """Return the parameters that changed during the log, in the order of time, which is in s after the start."""
    values = dict(log.parameters)
    found: list[dict[str, str | float]] = []
    for time, name, value in log.facts.changed_parameters:
        before = values.get(name)
        texts = {"before": "" if before is None else number(before), "after": number(value)}
        found.append({"time": (time - log.start) / 1e9, "name": name, **texts})
        values[name] = value
    return found


def number(value: float) -> str:
    """Return the value of a parameter: floats with the digits that a float32 has."""
    return str(value) if isinstance(value, int) else f"{value:.7g}"


def value_text(value: str | float | None) -> str:
    """Return a value of one of two flights as it is shown: `-` if that flight does not tell it."""
    return "-" if value is None else value if isinstance(value, str) else number(value)


def topics_of(log: Log) -> list[dict[str, str]]:
    """Return the topics that have samples, as texts."""
    found = []
    for topic in log.topics:
        if not topic.count:
            continue
        gaps = topic.gaps
        longest = max((after - before for before, after in gaps), default=0) / 1e9
        text = f"{len(gaps):,}, up to {longest:.2f} s" if gaps else ""
        found.append(
            {
                "name": topic.label,
                "type": topic.ros_type.rpartition("/")[2],
                "samples": f"{topic.count:,}",
                "rate": f"{topic.rate:.1f}" if topic.rate else "",
                "gaps": text,
            }
        )
    return found
