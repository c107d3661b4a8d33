"""What is known of a vehicle and its recording: type, board, firmware, start."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import NamedTuple

from msggen.analysis.recorded import Recorded
from msggen.base.diagnostics import counted
from msggen.base.recording_formats import FORMATS
from msggen.recordings.columns.annotations import annotation_of
from msggen.recordings.log.origin import time_of_day


class Fact(NamedTuple):
    """What is known of the vehicle or the file."""

    name: str
    value: str


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
