"""Short flights for rules: topics whose values are functions of the time, in MCAP or, with parameters, a ULog."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from msggen import recordings
from msggen.analysis.finding import Findings
from msggen.analysis.findings import findings_of
from msggen.analysis.flight import flight_of
from msggen.analysis.rules.table import TOPICS
from support.log_files import definition_in
from support.report_flights import packed
from support.ulog import UlogWriter, formats_of, snake
from support.written import write_recording

Values = Callable[[float], Mapping[str, Any] | None]
"""The fields of a sample at a time in s, None for no sample."""
RATE = 10
"""The samples of each topic in a second."""
_CLASSES = {"sensor_gps": "SensorGps", "vehicle_gps_position": "SensorGps"}


def samples_of(package: Any, topics: Mapping[str, Values], end: float = 20.0) -> list[tuple[str, float, Any]]:
    """Return the name in uORB, the time in s and the message of each sample.

    `sensor_gps[1]` is an instance, which only a ULog can have.
    """
    found = []
    for index in range(round(end * RATE) + 1):
        time = index / RATE
        for topic, values in topics.items():
            fields = values(time)
            if fields is not None:
                name = topic.partition("[")[0]
                cls = getattr(package, _CLASSES.get(name) or "".join(map(str.capitalize, name.split("_"))))
                found.append((topic, time, cls(**{"timestamp": round(time * 1e6), **fields})))
    return found


def write_flight(
    path: Path,
    package: Any,
    topics: Mapping[str, Values],
    parameters: Mapping[str, float] | None = None,
    end: float = 20.0,
) -> Path:
    """Write a flight as MCAP, or as a ULog if there are parameters. `path` has no suffix. Return the path with it."""
    samples = samples_of(package, topics, end)
    if parameters is None:
        return write_recording(path.with_suffix(".mcap"), [(f"/fmu/out/{name}", *more) for name, *more in samples])
    return _write_ulog(path.with_suffix(".ulg"), samples, parameters)


def _write_ulog(path: Path, samples: list[tuple[str, float, Any]], parameters: Mapping[str, float]) -> Path:
    writer = UlogWriter(start=0)
    writer.information("uint32_t ver_sw_release", (0x011200FF).to_bytes(4, "little"))
    for name, value in parameters.items():
        writer.parameter(name, value)
    names = {name: type(message).__name__ for name, _, message in samples}
    numbers = {name: number for number, name in enumerate(names)}
    formats = {}
    for name, cls in names.items():
        found = formats_of(f"px4_msgs/msg/{cls}", definition_in("v1.18", cls))
        for inner, fields in found.items():
            writer.format(inner, fields)
        topic, _, instance = name.partition("[")
        writer.subscribe(numbers[name], topic, int(instance.rstrip("]") or 0))
        formats[name] = found[snake(cls)]
    for name, _, message in samples:
        writer.sample(numbers[name], packed(message, formats[name]))
    writer.write(path)
    return path


def findings_in(path: Path) -> Findings:
    """Return what the rules say about a recording."""
    with recordings.open(str(path)) as log:
        return findings_of(flight_of(log, TOPICS.__contains__))
