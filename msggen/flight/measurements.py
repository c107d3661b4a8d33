"""Measurements of a program for PX4's estimator: what a camera, motion capture or a beacon sees.

`flight.measure` sends them, and tells whether EKF2 fuses them. EKF2 drops what it cannot use without a word, so that
here it is an error, or a warning if it passes. See docs/measurements.md.
"""

from __future__ import annotations

import asyncio
import math
import time as clocks
from collections.abc import Sequence
from contextlib import suppress
from logging import getLogger
from typing import Any, Final, NamedTuple

from msggen.flight.errors import FlightError, UnsupportedError
from msggen.flight.feeds import UTC, Connection, Feed, Feeds, Topics, filled
from msggen.flight.measured import Measuring, Sample
from msggen.messages.measurements import (
    GLOBAL,
    LOCAL,
    LONGEST_START,
    NEAREST,
    OLDEST,
    PARTS,
    PLACE,
    SLOWEST,
    Part,
    reason,
)

LOGGER = getLogger("msggen.flight")
_FUTURE: Final = 0.01
"""How far ahead in s the clock of a camera may be."""
_OTHER_CLOCK: Final = 60.0
"""The age in s from which on a time is that of another clock, or in another unit."""
_RECENT: Final = 1.0
"""The time in s for which a measurement counts as sent."""
_START: Final = 1.0
"""The time in s within which EKF2 begins to fuse."""
_SILENT: Final = 3.0
"""The time in s without an EstimatorStatusFlags after which it tells nothing any more. PX4 publishes it at 1 Hz."""
_REMIND: Final = 10.0
"""The time in s between two warnings of the same kind."""
_LOOK: Final = 0.05
_SETTLED: Final = 0.5
"""The time in s after which PX4 has seen in its checks that there is a position: it looks at 10 Hz."""


class NotFusedError(FlightError):
    """EKF2 does not use measurements. `state` has the reasons."""

    def __init__(self, state: Sequence[Fusion]) -> None:
        """Take what is known of each part that was sent."""
        self.state = tuple(state)
        open_ones = [f"{each.part} is not fused: {each.reason}" for each in state if not each.is_fused]
        super().__init__("; ".join(open_ones) or "no measurements were sent: send them while this waits")


class Fusion(NamedTuple):
    """Whether EKF2 uses a part of the measurements."""

    part: str
    """position, height, velocity, attitude, or place on earth."""
    is_fused: bool
    reason: str
    """Why not, as far as it is known. "" if it is fused."""


class Measurements(Measuring):
    """Sends measurements, and tells whether EKF2 uses them: `flight.measure`."""

    def __init__(self, connection: Connection, feeds: Feeds) -> None:
        self._connection, self._feeds = connection, feeds
        self._topics = Topics(connection.package)
        self._tracks: dict[tuple[str, int], _Track] = {}
        self._flags: Feed | None = None
        self._once: set[Part] = set()
        """The parts that were fused before."""

    @property
    def time(self) -> int:
        """The time now in us, as PX4 expects it of a measurement: UTC, or since boot if clocks are not synchronized."""
        feed = self._feeds["vehicle_local_position"]
        if feed.latest is None or feed.latest.timestamp >= UTC:
            return clocks.time_ns() // 1000
        return int(feed.latest.timestamp) + round(feed.age * 1e6)

    @property
    def state(self) -> tuple[Fusion, ...]:
        """Each part of the measurements of the last second: whether EKF2 fuses it, and if not, the likely reason."""
        return tuple(
            self._fusion(part, track)
            for track in self._tracks.values()
            for part in PARTS
            if track.age(part, self.time) < _RECENT
        )

    async def fused(self, timeout: float = 5.0) -> None:
        """Wait until EKF2 has fused all that is sent for 0.5 s, so that the vehicle can be armed: at most `timeout` s.

        Another task sends the measurements meanwhile. Raises NotFusedError with the likely reasons.
        """
        if not timeout > 0.0:
            raise ValueError(f"expected `timeout` above 0 s, got {timeout:g}")
        loop = asyncio.get_running_loop()
        since = loop.time()
        end = since + timeout
        while loop.time() < since + _SETTLED:
            state = self.state
            if not state or not all(each.is_fused for each in state):
                since = loop.time()
                if since >= end:
                    raise NotFusedError(state)
            await asyncio.sleep(_LOOK)

    def _send(self, sample: Sample) -> bool:
        cls = self._topics.incoming(sample.topic)
        identity = int(sample.values.get("id", 0))
        if identity > 1 and not self._has_ids:
            raise UnsupportedError("the release has one source of global positions: PX4 v1.18 has `source_id`")
        if self._flags is None:
            with suppress(UnsupportedError):
                self._flags = self._feeds["estimator_status_flags"]
                self._flags.call(self._look)
        now = self.time
        stamp = now if sample.time is None else sample.time
        _check_time(stamp, now)
        key = sample.topic, identity
        track = self._tracks.get(key) or _Track()
        if track.is_of_other_clock(now):
            track = _Track(track.resets)
        self._tracks[key] = track
        track.resets += sample.is_reset
        if not track.take(sample, stamp, now):
            return False
        counter = {"reset_counter": track.resets & 0xFF, "lat_lon_reset_counter": track.resets & 0xFF}
        message = filled(cls, timestamp=now, timestamp_sample=stamp, **sample.values, **counter)
        self._connection.publish(sample.topic, message)
        track.newest.update(dict.fromkeys(sample.parts, (message, self._feeds["vehicle_local_position"].latest)))
        return True

    @property
    def _has_ids(self) -> bool:
        return any(field.name == "id" for field in self._topics.incoming(GLOBAL).__msg__.fields)

    def _look(self, flags: Any) -> None:
        self._once.update(part for part in PARTS if getattr(flags, part.flag))

    def _fusion(self, part: Part, track: _Track) -> Fusion:
        feed, problem = self._flags, self._connection.problem
        flags = None if feed is None or feed.age > _SILENT else feed.latest
        is_fused = flags is not None and getattr(flags, part.flag)
        if problem and not is_fused:
            why = f"messages to the vehicle do not get through: {problem}"
        elif flags is None:
            why = "the vehicle does not publish estimator_status_flags"
        else:
            why = "" if is_fused else track.problem(part, self.time)
            if not why and part in track.newest:
                sent, place = map(_values, track.newest[part])
                why = reason(part, sent, _values(flags), place, was_fused=part in self._once)
        return Fusion(part.name, is_fused=not why, reason=why)


def _values(message: Any) -> dict[str, Any]:
    """Return the values of a message, none if there is none."""
    return {} if message is None else {field.name: getattr(message, field.name) for field in message.__msg__.fields}


class _Track:
    """The measurements of a source. Times are in us."""

    def __init__(self, resets: int = 0) -> None:
        self.resets = resets
        self.newest: dict[Part, tuple[Any, Any]] = {}
        """The newest message with each part, and the VehicleLocalPosition when it was sent, if it was known."""
        self._sent: dict[Part, int] = {}
        """When each part was sent last."""
        self._begun: dict[Part, int] = {}
        """Since when it has been sent, without a pause of 1 s."""
        self._newest: int | None = None
        self._interval = 0
        self._dropped: tuple[int, str] | None = None
        self._warned: dict[str, int] = {}

    def is_of_other_clock(self, now: int) -> bool:
        """Whether the clock has gone back since, as that of a vehicle does that restarts."""
        return self._newest is not None and now < self._newest - _RECENT * 1e6

    def age(self, part: Part, now: int) -> float:
        """Return how many s ago a part was given last, also one that was not sent."""
        return (now - self._sent[part]) / 1e6 if part in self._sent else math.inf

    def take(self, sample: Sample, stamp: int, now: int) -> bool:
        """Return whether a measurement is to be sent."""
        for part in sample.parts:
            if self.age(part, now) > _RECENT:
                self._begun[part] = now
            self._sent[part] = now
        kind, text = self._refusal(stamp, now)
        if kind:
            self._dropped = now, text
            self._warn(kind, f"a measurement was left out: {text}", now)
            return False
        if self._newest is not None:
            self._interval = stamp - self._newest
            if LONGEST_START < self._interval / 1e6 < _RECENT and sample.topic == LOCAL:
                self._warn("slow", f"measurements {self._slow}", now)
        self._newest = stamp
        return True

    @property
    def _slow(self) -> str:
        interval = self._interval / 1e6
        return f"come {interval:.2f} s apart: EKF2 starts to fuse them at {LONGEST_START:g} s ({SLOWEST:g} Hz) or less"

    def _refusal(self, stamp: int, now: int) -> tuple[str, str]:
        """Return the kind and the text of what makes a measurement useless, "" if there is nothing."""
        if now - stamp > OLDEST * 1e6:
            age = (now - stamp) / 1e6
            return "late", f"it is {age:.2f} s old, and EKF2 uses none that is older than {OLDEST:g} s"
        if self._newest is None or stamp >= self._newest + NEAREST * 1e6:
            return "", ""
        if stamp < self._newest:
            return "order", "it is older than the one before, and EKF2 takes them in their order"
        return "near", f"it is {(stamp - self._newest) / 1e3:.1f} ms after the one before, and EKF2 takes one in 10 ms"

    def problem(self, part: Part, now: int) -> str:
        """Return why EKF2 does not fuse a part, as far as the measurements tell that, or ""."""
        if self._dropped is not None and now - self._dropped[0] < _RECENT * 1e6:
            return self._dropped[1]
        if part is not PLACE and self._interval > LONGEST_START * 1e6:
            return f"measurements {self._slow}"
        begun = (now - self._begun[part]) / 1e6
        return f"it has been sent for {begun:.1f} s: EKF2 needs up to {_START:g} s" if begun < _START else ""

    def _warn(self, kind: str, text: str, now: int) -> None:
        if now - self._warned.get(kind, -UTC) > _REMIND * 1e6:
            self._warned[kind] = now
            LOGGER.warning("%s", text)


def _check_time(stamp: int, now: int) -> None:
    """Raise ValueError for a time in the future, and for that of another clock."""
    ahead = (stamp - now) / 1e6
    cure = "expected the us of `flight.measure.time`, such as `time=flight.measure.time - 30_000`"
    if ahead > _FUTURE:
        raise ValueError(f"the measurement is {ahead:g} s in the future: {cure}")
    if -ahead > _OTHER_CLOCK:
        raise ValueError(f"the measurement is {-ahead:,.0f} s old, by another clock or in another unit: {cure}")
