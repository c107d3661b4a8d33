"""Plays a recording at the pace that Foxglove's playback controls ask for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from msggen.recordings.log.payloads import Sample


class State(NamedTuple):
    """Where a playback is. `time` is in ns since 1970, of the recording."""

    is_playing: bool
    time: int
    speed: float
    is_ended: bool


SLOWEST, FASTEST = 0.01, 100.0
"""The bounds of the speed."""

_MOST = 10_000
"""The most samples that are due at once: after a long pause of the computer, the playback goes on from there."""


class Playback:
    """A playback of the samples from `first` to `last`, which `read` yields from a time on, in order of their times.

    Samples that are older than `first` come at once. `now` is in ns of the monotonic clock, which the caller reads.
    Nothing is locked: one thread uses it.
    """

    def __init__(self, read: Callable[[int], Iterator[Sample]], first: int, last: int, now: int) -> None:
        self._read, self._first, self._last = read, first, last
        self._samples = read(first)
        self._next = next(self._samples, None)
        self._is_playing, self._speed = True, 1.0
        self._time, self._since = first, now

    def state(self, now: int) -> State:
        """Return where the playback is."""
        time = self._position(now)
        is_ended = self._next is None and time >= self._last
        return State(self._is_playing and not is_ended, time, self._speed, is_ended)

    def control(self, now: int, *, is_playing: bool, speed: float, seek: int | None) -> None:
        """Do what the controls ask for. `seek` is a time of the recording in ns, or None to stay."""
        self._time, self._since = self._position(now), now
        if is_playing and seek is None and self._next is None and self._time >= self._last:
            seek = self._first  # playing after the end begins anew
        self._is_playing = is_playing
        self._speed = min(max(speed, SLOWEST), FASTEST) if speed > 0 else self._speed
        if seek is not None:
            self._time = min(max(seek, self._first), self._last)
            self._samples = self._read(self._time)
            self._next = next(self._samples, None)

    def due(self, now: int) -> Iterator[Sample]:
        """Yield the samples whose time has come, at most 10,000."""
        time = self._position(now)
        for _ in range(_MOST):
            sample = self._next
            if sample is None or sample.time > time:
                return
            self._next = next(self._samples, None)
            yield sample
        if self._next is not None:
            self._time, self._since = max(self._next.time, self._first), now

    def _position(self, now: int) -> int:
        if not self._is_playing:
            return self._time
        return min(self._last, self._time + round((now - self._since) * self._speed))
