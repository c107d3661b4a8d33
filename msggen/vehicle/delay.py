"""How old samples are when they arrive: the time since the `timestamp` in them."""

from __future__ import annotations

import struct
import threading
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from msggen.link.link import Route
from msggen.vehicle.meter import WINDOW, deviation_of, forget

if TYPE_CHECKING:
    from msggen.messages.packages import Message

STAMPS = ("timestamp", "timestamp_sample")
"""The fields with times. PX4 sends them as UTC in us (docs/wire.md, section 14)."""

UNSYNCHRONISED = 86_400.0
"""Delays above this, in s, show that the vehicle's time is not in sync with this computer: it counts from its start."""

_HEADER = 4
_STAMP = 8
"""The bytes of a uint64."""
_MOST = 10_000


class Delay(NamedTuple):
    """The delays of a field of a topic in the window, in s."""

    topic: str
    field: str
    """`timestamp`, or `timestamp_sample`."""
    window: int
    """The number of samples in the window, at least 1."""
    mean: float
    shortest: float
    longest: float
    deviation: float

    @property
    def is_in_sync(self) -> bool:
        """Whether the times can be those of a clock that is in sync with that of this computer."""
        return abs(self.mean) < UNSYNCHRONISED


class Delays:
    """Measures the delays of topics. Give it to `Vehicle.watch`: `vehicle.watch(delays)`.

    `message_of` returns the class of a route, or None if there is none. A `timestamp` of 0 is not counted, and neither
    is a sample that is too short.
    """

    def __init__(self, message_of: Callable[[Route], type[Message] | None], window: float = WINDOW) -> None:
        self._message_of, self._window = message_of, round(window * 1e9)
        self._offsets: dict[str, tuple[tuple[str, int], ...]] = {}
        self._samples: dict[tuple[str, str], deque[tuple[int, float]]] = {}
        self._lock = threading.Lock()

    def __call__(self, route: Route, payload: bytes, time: int) -> None:
        """Take a sample."""
        offsets = self._offsets.get(route.name)
        if offsets is None:
            offsets = self._offsets[route.name] = offsets_of(self._message_of(route))
        order = "<Q" if payload[1] & 1 else ">Q"
        for field, offset in offsets:
            stamp = struct.unpack_from(order, payload, offset)[0] if len(payload) >= offset + _STAMP else 0
            if stamp:
                with self._lock:
                    samples = self._samples.setdefault((route.name, field), deque(maxlen=_MOST))
                samples.append((time, (time - stamp * 1000) / 1e9))
                forget(samples, self._window)

    def delays(self, now: int) -> list[Delay]:
        """Return the delays in the window, in the order of the first samples. `now` is of `time.time_ns`."""
        with self._lock:
            every = [(key, tuple(samples)) for key, samples in self._samples.items()]
        found = []
        for (topic, field), samples in every:
            inside = [delay for time, delay in samples if now - time <= self._window]
            if inside:
                mean = sum(inside) / len(inside)
                found.append(Delay(topic, field, len(inside), mean, min(inside), max(inside), deviation_of(inside)))
        return found


def offsets_of(message: type[Message] | None) -> tuple[tuple[str, int], ...]:
    """Return the fields of a message with times, and their offsets in a sample with its header."""
    fields = () if message is None else message.__msg__.fields
    found = {field.name: field.offset for field in fields if field.type == "uint64" and field.offset is not None}
    return tuple((name, found[name] + _HEADER) for name in STAMPS if name in found)
