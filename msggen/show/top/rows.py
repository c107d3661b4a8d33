"""The table: a row for each topic, measured, with the rate limit of the firmware's dds_topics.yaml.

Beside it are the state of the vehicle, from its newest VehicleStatus and BatteryStatus, and the rates of topics over
the last seconds.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from types import ModuleType
from typing import Any, NamedTuple

from msggen.link.link import Route
from msggen.messages.formats import member_name
from msggen.messages.names import stem_of, without_namespace
from msggen.vehicle.meter import Flow

STATUS, BATTERY = "/fmu/out/vehicle_status", "/fmu/out/battery_status"
"""The topics that tell it, without namespace and version."""
_NO_WARNING = "WARNING_NONE"


class Health(NamedTuple):
    """What is known of the state of a vehicle. Texts are "" and numbers NaN if it is not."""

    mode: str = ""
    """The flight mode: `AUTO_LOITER`."""
    arming: str = ""
    """`ARMED` or `DISARMED`."""
    is_failsafe: bool = False
    battery: float = math.nan
    """The charge that remains, from 0 to 1."""
    warning: str = ""
    """The warning of the battery, such as `LOW`, or ""."""


def health_of(status: Any, battery: Any) -> Health:
    """Return what messages tell. Each may be None, and of any release."""
    remaining = getattr(battery, "remaining", math.nan)
    warning = _member(battery, "warning")
    return Health(
        _member(status, "nav_state"),
        _member(status, "arming_state"),
        bool(getattr(status, "failsafe", False)),
        remaining if 0.0 <= remaining <= 1.0 else math.nan,  # PX4 sends -1 if it does not know
        "" if warning == _NO_WARNING else warning.removeprefix("WARNING_"),
    )


def _member(message: Any, name: str) -> str:
    """Return the name of the value of a field, its number if it has no name, or "" if there is no such field."""
    if not hasattr(message, name):
        return ""
    value = getattr(message, name)
    enum = message.__msg__.enum(name)
    return str(value) if enum is None else member_name(enum, value)


_REGULAR = 5
"""A topic with this many samples,"""
_PATIENCE = 2.0
"""over this time in s, has a usual interval."""
_LATE = 5.0
"""A topic is late after this many of its usual intervals, and after the time above."""
_PAUSE = 1.0
"""A topic has no rate after this time in s without a sample, and after two of its longest intervals: it has paused."""


class Row(NamedTuple):
    """A topic. Numbers are NaN where there is nothing to measure."""

    topic: str
    """The name in ROS 2, with the namespace and the version."""
    message: str
    """The name of the message: `VehicleStatus`."""
    rate: float
    """Samples a second, NaN also for a topic that has paused."""
    limit: float
    """The rate limit in dds_topics.yaml in Hz, NaN if it has none."""
    age: float
    """The time since the newest sample in s."""
    bandwidth: float
    """Bytes a second."""
    size: float
    """The bytes of the newest sample."""
    samples: int
    longest: float
    """The longest time between two samples in s."""
    state: str
    """`silent` without a sample, `late` after several intervals without one, else ""."""
    flow: Flow | None
    route: Route
    rates: Sequence[float] = ()
    """The samples in each of the last seconds, the oldest first."""


class Table(NamedTuple):
    """All topics that a vehicle publishes, in the order of their names."""

    rows: tuple[Row, ...]
    label: str
    """The firmware and the link, for people."""
    trouble: str = ""
    """Why nothing arrives, or "" as long as the vehicle is connected."""
    lost: int = 0
    """Samples that did not arrive."""
    notice: str = ""
    """The newest warning about the link."""
    health: Health = Health()

    @property
    def summary(self) -> str:
        """Return a line about all topics."""
        heard = sum(row.flow is not None for row in self.rows)
        late = sum(row.state == "late" for row in self.rows)
        parts = [
            f"{len(self.rows)} topics",
            f"{heard} heard",
            *([f"{late} late"] if late else []),
            f"{_sum(row.rate for row in self.rows):.0f} samples/s",
            f"{_sum(row.bandwidth for row in self.rows) / 1000:.1f} kB/s",
            f"{self.lost} lost",
        ]
        return ", ".join(parts)


def rows_of(
    routes: Iterable[Route], flows: Iterable[Flow], limits: Mapping[str, float], namespace: str, now: int
) -> tuple[Row, ...]:
    """Return the rows of all topics that a vehicle has or was heard on. `now` is of `time.time_ns`."""
    heard = {flow.route.name: flow for flow in flows}
    known = {route.name: route for route in routes if route.direction == "out"}
    every = {**known, **{name: flow.route for name, flow in heard.items()}}
    return tuple(
        _row(every[name], heard.get(name), limits.get(stem_of(without_namespace(name, namespace)), math.nan), now)
        for name in sorted(every)
    )


def _row(route: Route, flow: Flow | None, limit: float, now: int) -> Row:
    nan = math.nan
    age = nan if flow is None else max(0.0, (now - flow.last) / 1e9)
    runs = flow is not None and age <= max(_PAUSE, 2 * flow.longest)
    return Row(
        topic=route.name,
        message=route.ros_type.rpartition("/")[2],
        rate=flow.rate if flow and runs else nan,
        limit=limit,
        age=age,
        bandwidth=flow.bandwidth if flow and runs else nan,
        size=flow.size if flow else nan,
        samples=flow.samples if flow else 0,
        longest=flow.longest if flow else nan,
        state="silent" if flow is None else "late" if age > _longest_age(flow) else "",
        flow=flow,
        route=route,
    )


def _longest_age(flow: Flow) -> float:
    """Return the age in s after which a topic is late. Answers to something come when there is something."""
    seconds = (flow.last - flow.first) / 1e9
    if flow.samples < _REGULAR or seconds < _PATIENCE:
        return math.inf
    return max(_PATIENCE, _LATE * seconds / (flow.samples - 1))


def limits_of(package: ModuleType) -> dict[str, float]:
    """Return the rate limits in Hz that the package's dds_topics.yaml sets, by names without version."""
    endpoints: Any = package.topics.ENDPOINTS
    return {
        stem_of(endpoint.ros_name): endpoint.rate_limit_hz
        for endpoint in endpoints
        if endpoint.direction == "out" and endpoint.rate_limit_hz
    }


def as_document(table: Table) -> dict[str, Any]:
    """Return the table for JSON, in which what is not known is None or NaN. Units are in the keys."""
    return {
        "vehicle": table.label,
        "mode": table.health.mode or None,
        "arming": table.health.arming or None,
        "failsafe": table.health.is_failsafe,
        "battery": table.health.battery,
        "lost": table.lost,
        "topics": [
            {
                "topic": row.topic,
                "message": row.message,
                "rate_hz": row.rate,
                "limit_hz": row.limit,
                "age_s": row.age,
                "bandwidth_bytes_per_s": row.bandwidth,
                "size_bytes": row.size,
                "samples": row.samples,
                "longest_interval_s": row.longest,
                "state": row.state,
            }
            for row in table.rows
        ],
    }


def _sum(numbers: Iterable[float]) -> float:
    return sum(number for number in numbers if not math.isnan(number))


SECONDS = 20
"""The seconds that are kept."""
_SECOND = 1_000_000_000
_BLOCKS = "▁▂▃▄▅▆▇"
"""The heights of a rate. A full block would touch the line above."""


class _Counts:
    """The samples of a topic: all at a time in ns, and those until each of the last whole seconds."""

    def __init__(self, time: int, samples: int) -> None:
        self._time, self._samples = time, samples
        self._whole: deque[float] = deque(maxlen=SECONDS + 1)

    def add(self, time: int, samples: int) -> None:
        """Note the samples until a time. Between two times, they are taken to be evenly spaced."""
        first, last = self._time // _SECOND + 1, time // _SECOND
        for second in range(max(first, last - SECONDS), last + 1):
            share = (second * _SECOND - self._time) / (time - self._time)
            self._whole.append(self._samples + share * (samples - self._samples))
        self._time, self._samples = time, samples

    @property
    def rates(self) -> tuple[float, ...]:
        """The samples in each whole second, the oldest first."""
        return tuple(later - earlier for earlier, later in pairwise(self._whole))


class History:
    """Notes how many samples each topic has, and tells how many each second had."""

    def __init__(self) -> None:
        self._topics: dict[str, _Counts] = {}

    def add(self, rows: Iterable[Row], now: int) -> tuple[Row, ...]:
        """Note the samples of rows until `now`, of `time.time_ns`. Return the rows with their rates."""
        return tuple(self._noted(row, now) for row in rows)

    def _noted(self, row: Row, now: int) -> Row:
        counts = self._topics.setdefault(row.topic, _Counts(now, row.samples))
        counts.add(now, row.samples)
        return row._replace(rates=counts.rates)


def sparkline(rates: Sequence[float]) -> str:
    """Return rates as blocks, the highest for the largest rate. "" without a sample."""
    largest = max(rates, default=0.0)
    if largest <= 0:
        return ""
    return "".join(_BLOCKS[round(max(0.0, rate) / largest * (len(_BLOCKS) - 1))] for rate in rates)
