"""The tables of a report: where the log is from, its parameters, and its topics."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from msggen.analysis.recorded import Recorded
from msggen.base.diagnostics import counted
from msggen.base.recording_formats import FORMATS
from msggen.recordings.columns.annotations import annotation_of
from msggen.recordings.log.origin import time_of_day

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log


class Fact(NamedTuple):
    """What is known of the vehicle or the file."""

    name: str
    value: str


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


def facts_of(recorded: Recorded) -> Iterator[Fact]:
    """Yield what is known of the vehicle, its firmware and the file."""
    log = recorded.log
    yield Fact("Vehicle", _vehicle(recorded))
    hardware = [str(log.information.get(name, "")) for name in ("ver_hw", "ver_hw_subtype")]
    yield Fact("Board", ", ".join(filter(None, [*hardware, log.vehicle])))
    airframe = log.parameters.get("SYS_AUTOSTART")
    yield Fact("Airframe", "" if airframe is None else f"SYS_AUTOSTART {airframe:g}")
    branch = log.information.get("ver_sw_branch")
    commit = log.firmware.commit[:12]
    yield Fact("Firmware", str(log.release()))
    yield Fact("Commit", f"{commit} of {branch}" if commit and branch else commit)
    yield Fact(
        "System",
        " ".join(str(log.information.get(name, "")) for name in ("sys_name", "sys_os_name", "sys_mcu")).strip(),
    )
    start = time_of_day(log.start, log.utc_offset)
    yield Fact("Start", f"{start:%Y-%m-%d %H:%M:%S} UTC" if start else "")
    format_ = FORMATS[log.kind].name if log.kind in FORMATS else log.kind
    count = sum(topic.count > 0 for topic in log.topics)
    file = os.path.basename(os.path.abspath(log.path))
    yield Fact("File", f"{file}, {format_}, {counted(count, 'topic')} with samples")


def _vehicle(recorded: Recorded) -> str:
    """Return the kind of the vehicle, and its namespace."""
    samples = recorded.samples("vehicle_status")
    parts = []
    if samples is not None:
        names = samples.array.dtype.names or ()
        row = samples.array[-1]
        if "vehicle_type" in names:
            kinds = annotation_of(samples.topic, "vehicle_type").members
            kind = kinds.get(int(row["vehicle_type"]), f"type {row['vehicle_type']}")
            parts.append(kind.replace("_", " ").lower())
        if "is_vtol" in names and row["is_vtol"]:
            parts.append("VTOL")
    if recorded.namespace:
        parts.append(recorded.namespace)
    return ", ".join(parts)


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
