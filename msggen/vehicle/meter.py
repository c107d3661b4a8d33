"""How often the topics of a vehicle are published, how large they are, and when they were last heard."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple, TypeVar

from msggen.link.link import Route

WINDOW = 5.0
"""The seconds over which a rate is measured, by default."""

Value = TypeVar("Value")

_MOST = 10_000
"""The most samples that a window keeps: those of 5 s at 2 kHz."""


class Flow(NamedTuple):
    """What a meter knows of a topic. Rates are those of the window, and NaN with fewer than two samples in it."""

    route: Route
    samples: int
    """The samples since the meter began."""
    size: int
    """The bytes of the newest sample, with the encapsulation."""
    total: int
    """The bytes of all samples."""
    first: int
    """The arrival of the first sample in ns, of the clock `time.time_ns`."""
    last: int
    """The arrival of the newest sample."""
    rate: float
    """Samples a second."""
    bandwidth: float
    """Bytes a second."""
    shortest: float
    """The shortest time between two samples in s."""
    longest: float
    deviation: float
    """The standard deviation of the time between two samples in s."""
    payload: bytes
    """The newest sample."""
    window: int
    """The number of samples in the window."""
    mean_size: float
    """The mean size of the samples in the window in bytes, NaN if there are none."""
    smallest: int
    """The smallest size in the window, 0 if there are none."""
    largest: int


class _Topic:
    """The samples of a topic: arrivals in ns and sizes."""

    def __init__(self, route: Route, first: int) -> None:
        self.route = route
        self.first = first
        self.count = self.total = 0
        self.samples: deque[tuple[int, int]] = deque(maxlen=_MOST)
        self.payload = b""


class Meter:
    """Measures the topics of a vehicle. Give it to `Vehicle.watch`: `vehicle.watch(meter)`."""

    def __init__(self, window: float = WINDOW) -> None:
        self._window = round(window * 1e9)
        self._topics: dict[str, _Topic] = {}
        self._lock = threading.Lock()

    def __call__(self, route: Route, payload: bytes, time: int) -> None:
        """Count a sample."""
        known = self._topics.get(route.name)
        topic = known or _Topic(route, time)
        topic.count += 1
        topic.total += len(payload)
        topic.payload = payload
        topic.samples.append((time, len(payload)))
        forget(topic.samples, self._window)
        if known is None:
            with self._lock:
                self._topics[route.name] = topic  # now that it has a sample

    def flows(self, now: int) -> list[Flow]:
        """Return all topics that were heard, in the order of their first samples. `now` is of `time.time_ns`."""
        with self._lock:
            topics = tuple(self._topics.values())
        return [self._flow(topic, now) for topic in topics]

    def _flow(self, topic: _Topic, now: int) -> Flow:
        samples = tuple(topic.samples)  # in one step, because the thread of the link goes on
        last, size = samples[-1]
        inside = [sample for sample in samples if now - sample[0] <= self._window]
        gaps = [(later[0] - earlier[0]) / 1e9 for earlier, later in pairwise(inside)]
        sizes = [each for _, each in inside]
        rate = bandwidth = shortest = longest = deviation = float("nan")
        if gaps:
            span = sum(gaps)
            if span > 0:
                rate, bandwidth = len(gaps) / span, sum(each for _, each in inside[1:]) / span
            shortest, longest, deviation = min(gaps), max(gaps), deviation_of(gaps)
        return Flow(
            route=topic.route,
            samples=topic.count,
            size=size,
            total=topic.total,
            first=topic.first,
            last=last,
            rate=rate,
            bandwidth=bandwidth,
            shortest=shortest,
            longest=longest,
            deviation=deviation,
            payload=topic.payload,
            window=len(sizes),
            mean_size=sum(sizes) / len(sizes) if sizes else float("nan"),
            smallest=min(sizes, default=0),
            largest=max(sizes, default=0),
        )


def forget(samples: deque[tuple[int, Value]], window: int) -> None:
    """Remove the samples that arrived more than `window` ns before the newest one, or before the clock was set back.

    Each sample begins with its arrival in ns.
    """
    newest = samples[-1][0]
    while not newest - window <= samples[0][0] <= newest:
        samples.popleft()


def deviation_of(values: Sequence[float]) -> float:
    """Return the standard deviation of values, of which there is at least one."""
    mean = sum(values) / len(values)
    return float((sum((value - mean) ** 2 for value in values) / len(values)) ** 0.5)
