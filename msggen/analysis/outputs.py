"""What actuators were told, how much thrust it took to hover, and how far the estimator was from what was measured."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.analysis.finding import Unsaid
from msggen.analysis.recorded import Column, Recorded
from msggen.analysis.sampling import flown
from msggen.analysis.spans import Spans
from msggen.recordings.columns.annotations import annotation_of
from msggen.recordings.columns.ordered import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

_BINS = 50
"""The bins of a histogram."""
_LONGEST = 1.0
"""The time in s for which a value counts at most."""
_LARGEST = 1e9
"""Values beyond it are damaged."""
_OUTPUTS = ("actuator_motors", "control"), ("actuator_servos", "control"), ("actuator_outputs", "output")
"""The topics of outputs, and their fields. The last one is only used without the others."""
_THRUST = "vehicle_thrust_setpoint.xyz", "vehicle_attitude_setpoint.thrust_body", "vehicle_rates_setpoint.thrust_body"
"""Where the thrust is told, in FRD."""
_AID_SOURCES = "estimator_aid_src_"
_UNITS: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("hgt", "pos", "position", "beacon", "finder"), "m"),
        **dict.fromkeys(("vel", "airspeed"), "m/s"),
        **dict.fromkeys(("yaw", "heading", "sideslip"), "rad"),
        "flow": "rad/s",
        "drag": "m/s^2",
        "gravity": "",
        "mag": "Gauss",
    }
)
"""The units of innovations by the last word of their source, "" for a direction. One message is of many sources, so
definitions do not tell them."""
_INNOVATIONS, _RATIOS = "estimator_innovations", "estimator_innovation_test_ratios"

TOPICS = frozenset(
    {
        *(topic for topic, _ in _OUTPUTS),
        *(path.partition(".")[0] for path in _THRUST),
        *("hover_thrust_estimate", _INNOVATIONS, _RATIOS),
    }
)
"""The topics that this is from, beside those of the estimator's sources."""


def is_needed(name: str) -> bool:
    """Whether a topic tells actuators, thrust or innovations."""
    return name in TOPICS or name.startswith(_AID_SOURCES)


class Outputs(NamedTuple):
    """The outputs of a topic that are in use."""

    path: str
    """Topic and field: `actuator_motors.control`."""
    indices: tuple[int, ...]
    """The place in the field of each output, from 0."""
    times: NDArray[np.float64]
    """Of shape (n,), in s after the start of the recording."""
    values: NDArray[np.float64]
    """Of shape (m, n), NaN where an output is off: from -1 to 1 for motors and servos, or as actuators take them."""
    edges: NDArray[np.float64]
    """Of shape (51,): where the bins of the histogram begin and end."""
    shares: NDArray[np.float64]
    """Of shape (m, 50): the share of the time in flight in each bin."""

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the outputs, counted from 1 as in PX4's parameters: `motor 1`."""
        noun = self.path.partition(".")[0].removeprefix("actuator_").removesuffix("s")
        return tuple(f"{noun} {index + 1}" for index in self.indices)


class Thrust(NamedTuple):
    """The thrust upwards, against that at which the vehicle hovers. Thrust is from 0 to 1."""

    path: str
    times: NDArray[np.float64]
    """Of shape (n,), in s after the start of the recording."""
    values: NDArray[np.float64]
    """Of shape (n,): the setpoint of the thrust upwards, along the axis of the body."""
    estimate_times: NDArray[np.float64]
    """Of shape (m,), in s."""
    estimates: NDArray[np.float64]
    """Of shape (m,): the hover thrust as the vehicle estimates it, NaN where the estimate is not valid."""
    parameter: float
    """MPC_THR_HOVER, NaN if the recording does not have it."""
    edges: NDArray[np.float64]
    """Of shape (51,): where the bins of the histogram begin and end."""
    shares: NDArray[np.float64]
    """Of shape (50,): the share of the time in flight in each bin."""

    @property
    def hover(self) -> float:
        """The median of the estimates, or else the parameter."""
        known = self.estimates[np.isfinite(self.estimates)]
        return median(known) if len(known) else self.parameter

    @property
    def share_above(self) -> float:
        """The share of the time in flight with more thrust than to hover."""
        middles = (self.edges[1:] + self.edges[:-1]) / 2
        return float(self.shares[middles > self.hover].sum())

    @property
    def text(self) -> str:
        """The thrust in one line."""
        estimate = self.hover if np.isfinite(self.estimates).any() else np.nan
        known = (("the estimate", estimate), ("MPC_THR_HOVER", self.parameter))
        told = " and ".join(f"{value:.2f} by {name}" for name, value in known if np.isfinite(value))
        if not told:
            return "neither an estimate of the hover thrust nor MPC_THR_HOVER is known"
        above = f"more than {self.hover:.2f} for {self.share_above * 100:.0f} % of the flight"
        return f"the vehicle hovers with {told}; {above}"


class Innovation(NamedTuple):
    """What a sensor measured minus what the estimator expected. Beyond the gate, the estimator rejects it."""

    label: str
    """The source and its axis: `gnss_pos[0]`."""
    unit: str
    """`m/s`, "" for a source that is not known."""
    times: NDArray[np.float64]
    """Of shape (n,), in s after the start of the recording."""
    values: NDArray[np.float64]
    """Of shape (n,), in the unit."""
    gate: NDArray[np.float64]
    """Of shape (n,): the size up to which it is accepted, from the test ratio; NaN where one is 0."""

    @property
    def shares(self) -> NDArray[np.float64]:
        """Of shape (n,): the innovation in parts of its gate, from -1 to 1 where it is accepted."""
        return self.values / self.gate

    @property
    def text(self) -> str:
        """The innovation in one line."""
        beyond = np.abs(self.values) > self.gate
        largest = float(np.nanmax(np.abs(self.values)))
        return (
            f"{self.label}: up to {largest:.2g} {self.unit}".rstrip() + f", {beyond.mean() * 100:.0f} % beyond the gate"
        )


def outputs_of(recorded: Recorded, start: float | None = None, stop: float | None = None) -> list[Outputs]:
    """Return the outputs of motors and servos, or else those of PX4's drivers, between two times in s."""
    spans = flown(recorded, start, stop)
    found = [made for topic, field in _OUTPUTS[:-1] if (made := _outputs(recorded, topic, field, spans))]
    return found or [made for made in [_outputs(recorded, *_OUTPUTS[-1], spans)] if made]


def _outputs(recorded: Recorded, topic: str, field: str, spans: Spans) -> Outputs | None:
    columns = {}
    used = recorded.column(topic, "noutputs")
    width = recorded.width(topic, field)
    if used is not None and len(used.values):
        width = min(width, int(used.values.max()))
    for index in range(width):
        column = recorded.column(topic, f"{field}[{index}]")
        column = column and _usable(column)
        if column is not None and len(column.finite) and np.ptp(column.finite) > 0:
            columns[index] = column
    if not columns:
        return None
    values = np.stack([column.values for column in columns.values()])
    first = next(iter(columns.values()))
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    edges = np.linspace(min(low, 0.0), 1.0, _BINS + 1) if high <= 1 else np.linspace(low, high, _BINS + 1)
    shares = np.stack([_shares(column, edges, spans) for column in columns.values()])
    return Outputs(f"{topic}.{field}", tuple(columns), first.times, values, edges, shares)


def _usable(column: Column) -> Column:
    return column._replace(values=np.where(np.abs(column.values) < _LARGEST, column.values, np.nan))


def _shares(column: Column, edges: NDArray[np.float64], spans: Spans) -> NDArray[np.float64]:
    """Return the share of time in each bin: a value lasts until the next one, or for a second."""
    lasts = np.minimum(np.diff(column.times, append=column.times[-1]), _LONGEST)
    counted = column.is_within(spans) & np.isfinite(column.values)
    found, _ = np.histogram(column.values[counted], edges, weights=lasts[counted])
    whole = float(lasts[counted].sum())
    return found / whole if whole > 0 else found


def thrust_of(recorded: Recorded, start: float | None = None, stop: float | None = None) -> Thrust | Unsaid:
    """Return the thrust against that at which the vehicle hovers, between two times in s."""
    spans = flown(recorded, start, stop)
    for path in _THRUST:
        topic, _, field = path.partition(".")
        down = recorded.column(topic, f"{field}[2]")
        if down is None or not np.isfinite(down.values).any():
            continue
        up = _usable(down._replace(values=-down.values))
        if not (up.finite > 0).any():
            return Unsaid(f"{path}[2] has no thrust upwards: a vehicle with wings or wheels does not hover")
        hover = recorded.column("hover_thrust_estimate", "hover_thrust")
        hover = hover and hover.where(recorded.column("hover_thrust_estimate", "valid"))
        times, estimates = (hover.times, hover.values) if hover else (np.zeros(0), np.zeros(0))
        edges = np.linspace(0, 1, _BINS + 1)
        parameter = float(recorded.log.parameters.get("MPC_THR_HOVER", np.nan))
        return Thrust(path, up.times, up.values, times, estimates, parameter, edges, _shares(up, edges, spans))
    return Unsaid(f"the recording has no {', '.join(path.partition('.')[0] for path in _THRUST)}")


def innovations_of(recorded: Recorded) -> list[Innovation]:
    """Return the innovations of all sources that the estimator used, with their gates."""
    found = list(_of_sources(recorded))
    return found or list(_of_topic(recorded))


def _of_sources(recorded: Recorded) -> Iterator[Innovation]:
    for topic in sorted(recorded.topics):
        if topic.startswith(_AID_SOURCES):
            label = topic[len(_AID_SOURCES) :]
            unit = _UNITS.get(label.rpartition("_")[2], "")
            yield from _innovations(recorded, (topic, "innovation"), (topic, "test_ratio"), label, unit)


def _of_topic(recorded: Recorded) -> Iterator[Innovation]:
    samples = recorded.samples(_INNOVATIONS)
    for name in () if samples is None else samples.array.dtype.names or ():
        if not name.startswith("timestamp"):
            unit = annotation_of(samples.topic, name).unit if samples else ""
            yield from _innovations(recorded, (_INNOVATIONS, name), (_RATIOS, name), name, unit)


def _innovations(
    recorded: Recorded, innovation: tuple[str, str], ratio: tuple[str, str], label: str, unit: str
) -> Iterator[Innovation]:
    """Yield the innovations of a field: the root of a test ratio is the innovation in parts of its gate."""
    width = recorded.width(*innovation)
    for place in [f"[{index}]" for index in range(width)] or [""]:
        values, ratios = (recorded.column(topic, f"{field}{place}") for topic, field in (innovation, ratio))
        if values is None or ratios is None:
            continue
        values = _usable(values)
        if not np.nan_to_num(values.values).any():  # a source that was never used
            continue
        tested = ratios.at(values.times)
        gate = np.abs(values.values) / np.sqrt(np.where((tested > 0) & (values.values != 0), tested, np.nan))
        yield Innovation(f"{label}{place}", unit, values.times, values.values, gate)
