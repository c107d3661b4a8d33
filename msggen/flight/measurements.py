"""Measurements of a program for PX4's estimator: what a camera, motion capture or a beacon sees.

`flight.measure` sends them, and tells whether EKF2 fuses them. EKF2 drops what it cannot use without a word, so that
here it is an error, or a warning if it passes. See docs/measurements.md.
"""

from __future__ import annotations

import asyncio
import math
import operator
import time as clocks
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from logging import getLogger
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from msggen.base.diagnostics import suggestion
from msggen.flight.connection import Connection, Topics, filled
from msggen.flight.elsewhere import Hinted
from msggen.flight.errors import FlightError, UnsupportedError
from msggen.flight.feeds import Feed, Feeds
from msggen.flight.places import GlobalPlace, OnEarth
from msggen.flight.setpoints import finite
from msggen.flight.space import three
from msggen.flight.usage import MEASURED, ON_EARTH, explained
from msggen.messages.measurements import (
    BODY_FRD,
    FRD,
    GLOBAL,
    HEIGHT,
    LOCAL,
    LONGEST_START,
    NEAREST,
    NED,
    OLDEST,
    PARTS,
    PLACE,
    POSITION,
    SLOWEST,
    SOURCES,
    UNKNOWN,
    VELOCITY,
    YAW,
    Part,
    reason,
)

PoseFrame: TypeAlias = Literal["ned", "enu", "frd", "flu"]
"""Axes of positions and attitudes: of the earth, or of a level frame whose x axis points anywhere."""
VelocityFrame: TypeAlias = Literal["ned", "enu", "frd", "flu", "body_frd", "body_flu"]
"""The same, and those of the vehicle."""
Source: TypeAlias = Literal["unknown", "gnss", "vision", "pseudolites", "terrain", "magnetic", "estimator", "leo"]
"""What measures a place on earth: SOURCE_* of AuxGlobalPosition."""
Variance: TypeAlias = float | Sequence[float]
"""One for all axes, or one for each."""

LOGGER = getLogger("msggen.flight")
_UTC: Final = 10**15
"""Times below, in us, are times since boot."""
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
_ROUGHLY: Final = 0.01
"""How far from 1 the length of a quaternion may be, which is normalized then."""
_NONE: Final = (math.nan, math.nan, math.nan)
_BEST: Final = 100
"""`quality` of VehicleOdometry, which EKF2_EV_QMIN asks for."""


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


Vector3: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]


class _Axes(NamedTuple):
    """A frame, and its conversion to that of PX4. Each conversion is its own inverse."""

    number: int
    vector: Callable[[Vector3], Vector3]
    attitude: Callable[[Quaternion], Quaternion]


def _same(values: Any) -> Any:
    return values


def _enu(vector: Vector3) -> Vector3:
    x, y, z = vector
    return y, x, -z


def _flu(vector: Vector3) -> Vector3:
    x, y, z = vector
    return x, -y, -z


def _enu_attitude(q: Quaternion) -> Quaternion:
    """Convert a rotation from FLU to ENU to one from FRD to NED, or back."""
    w, x, y, z = (each * math.sqrt(0.5) for each in q)
    return w + z, x + y, x - y, w - z


def _flu_attitude(q: Quaternion) -> Quaternion:
    w, x, y, z = q
    return w, x, -y, -z


AXES: Final[Mapping[str, _Axes]] = MappingProxyType(
    {
        "ned": _Axes(NED, _same, _same),
        "enu": _Axes(NED, _enu, _enu_attitude),
        "frd": _Axes(FRD, _same, _same),
        "flu": _Axes(FRD, _flu, _flu_attitude),
        "body_frd": _Axes(BODY_FRD, _same, _same),
        "body_flu": _Axes(BODY_FRD, _flu, _flu_attitude),
    }
)
"""The frames by their names."""
_POSES: Final = tuple(name for name, axes in AXES.items() if axes.number != BODY_FRD)


class Sample(NamedTuple):
    """A measurement that is right in itself."""

    topic: str
    parts: tuple[Part, ...]
    values: Mapping[str, Any]
    time: int | None
    """When it was measured, in us. None: now."""
    is_reset: bool
    is_ned: bool = True


class Measuring(Hinted):
    """Takes measurements."""

    @explained(MEASURED)
    def local(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        *,
        position: Sequence[float] | None = None,
        variance: Variance | None = None,
        velocity: Sequence[float] | None = None,
        velocity_variance: Variance | None = None,
        attitude: Sequence[float] | None = None,
        attitude_variance: Variance | None = None,
        frame: PoseFrame = "ned",
        velocity_frame: VelocityFrame | None = None,
        time: int | None = None,
        reset: bool = False,
    ) -> bool:
        """Send where the vehicle is (m), how fast (m/s), and its attitude: any of them, each with its variance.

        A variance is one number, or one for each axis, in m^2, m^2/s^2 and rad^2 (roll, pitch, yaw of the vehicle).
        EKF2 does not take less than EKF2_EVP_NOISE, EKF2_EVV_NOISE and EKF2_EVA_NOISE squared. `attitude` is a
        quaternion w, x, y, z from the body (FRD; FLU in "enu" and "flu") to `frame`. "frd" and "flu" are level, with an
        x axis that points anywhere. `velocity_frame` is `frame` by default, or "body_frd" or "body_flu".

        `time` is when it was measured, in us of `flight.measure.time`, by default now. `reset` says that the source has
        jumped, such as after it has found its place in its map again.

        Return whether it was sent. One that EKF2 would not use, because it is older than 0.3 s, or not 0.01 s after the
        one before, is left out with a warning. Raises ValueError for what is no measurement, and UnsupportedError.
        """
        return self._send(
            _local_sample(
                {
                    "position": (position, variance, frame),
                    "velocity": (velocity, velocity_variance, velocity_frame or frame),
                },
                (attitude, attitude_variance, frame),
                time,
                is_reset=reset,
            )
        )

    @explained(ON_EARTH)
    def on_earth(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
        accuracy: float,
        altitude_accuracy: float | None = None,
        source_id: int = 1,
        source: Source = "vision",
        time: int | None = None,
        reset: bool = False,
    ) -> bool:
        """Send where on earth the vehicle is: in degrees, and in m above mean sea level, which only sets the origin.

        `accuracy` is the horizontal standard deviation in m; EKF2 takes at least EKF2_AGP_NOISE, in v1.18
        EKF2_AGP0_NOISE. `source_id` is that of EKF2_AGP0_ID to EKF2_AGP3_ID in v1.18. The rest is as in `local`.
        """
        north, east, height = OnEarth(place, latitude, longitude, altitude).numbers("on_earth")
        (eph,) = _positive([accuracy], "accuracy")
        (epv,) = [math.nan] if altitude_accuracy is None else _positive([altitude_accuracy], "altitude_accuracy")
        if source not in SOURCES:
            raise ValueError(f"no source {source!r}{suggestion(source, SOURCES)}: there are {', '.join(SOURCES)}")
        if not 1 <= source_id <= 0xFF:  # noqa: PLR2004 - uint8
            raise ValueError(f"expected `source_id` from 1 to 255, got {source_id}")
        values = {
            "lat": north,
            "lon": east,
            "alt": math.nan if height is None else height,
            "eph": eph,
            "epv": epv,
            "id": source_id,
            "source": SOURCES.index(source),
        }
        return self._send(Sample(GLOBAL, (PLACE,), values, _whole(time), reset))

    def _send(self, sample: Sample) -> bool:
        """Send a measurement."""
        raise NotImplementedError


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
        if feed.latest is None or feed.latest.timestamp >= _UTC:
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
        track = self._tracks.setdefault((sample.topic, identity), _Track())
        track.resets += sample.is_reset
        if not track.take(sample, stamp, now):
            return False
        counter = {"reset_counter": track.resets & 0xFF, "lat_lon_reset_counter": track.resets & 0xFF}
        self._connection.publish(
            sample.topic, filled(cls, timestamp=now, timestamp_sample=stamp, **sample.values, **counter)
        )
        return True

    @property
    def _has_ids(self) -> bool:
        return any(field.name == "id" for field in self._topics.incoming(GLOBAL).__msg__.fields)

    def _look(self, flags: Any) -> None:
        self._once.update(part for part in PARTS if getattr(flags, part.flag))

    def _fusion(self, part: Part, track: _Track) -> Fusion:
        feed, problem = self._flags, self._connection.problem
        flags = None if feed is None or feed.age > _SILENT else feed.latest
        if flags is not None and getattr(flags, part.flag):
            return Fusion(part.name, is_fused=True, reason="")
        if problem:
            return Fusion(part.name, is_fused=False, reason=f"messages to the vehicle do not get through: {problem}")
        if flags is None:
            return Fusion(part.name, is_fused=False, reason="the vehicle does not publish estimator_status_flags")
        why = track.problem(part, self.time) or self._why(part, track, flags)
        return Fusion(part.name, is_fused=False, reason=why)

    def _why(self, part: Part, track: _Track, flags: Any) -> str:
        if part in self._once:
            return (
                "it was before: EKF2 leaves measurements that are too far from its estimate for their variance, and "
                "starts anew after some time, or at once with `reset`"
            )
        values = {field.name: getattr(flags, field.name) for field in flags.__msg__.fields}
        return reason(part, values, is_ned=track.is_ned, has_ids=self._has_ids, identity=track.identity)


class _Track:
    """The measurements of a source. Times are in us."""

    def __init__(self) -> None:
        self.resets = 0
        self.is_ned = True
        self.identity = 1
        self._sent: dict[Part, int] = {}
        """When each part was sent last."""
        self._begun: dict[Part, int] = {}
        """Since when it has been sent, without a pause of 1 s."""
        self._newest: int | None = None
        self._interval = 0
        self._dropped: tuple[int, str] | None = None
        self._warned: dict[str, int] = {}

    def age(self, part: Part, now: int) -> float:
        """Return how many s ago a part was given last, also one that was not sent."""
        return (now - self._sent[part]) / 1e6 if part in self._sent else math.inf

    def take(self, sample: Sample, stamp: int, now: int) -> bool:
        """Return whether a measurement is to be sent."""
        self.is_ned, self.identity = sample.is_ned, int(sample.values.get("id", 1))
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
        if now - self._warned.get(kind, -_UTC) > _REMIND * 1e6:
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


_Given: TypeAlias = tuple[Sequence[float] | None, Variance | None, str]


def _local_sample(vectors: Mapping[str, _Given], attitude: _Given, time: int | None, *, is_reset: bool) -> Sample:
    """Return a VehicleOdometry's values. Raises ValueError for what is no measurement."""
    values: dict[str, Any] = {"q": (*_NONE, math.nan), "angular_velocity": _NONE, "quality": _BEST}
    parts: list[Part] = []
    for name, (numbers, variance, frame) in vectors.items():
        axes = _axes(frame, _POSES if name == "position" else AXES)
        vector, variances = _measured(name, numbers, variance)
        is_given = numbers is not None
        spread = axes.vector(variances)
        values[name], values[f"{name}_variance"] = axes.vector(vector), tuple(map(abs, spread))
        values[_FRAME[name]] = axes.number if is_given else UNKNOWN
        parts += _PARTS[name] if is_given else ()
    numbers, variance, frame = attitude
    axes = _axes(frame, _POSES)
    quaternion = None if numbers is None else _unit(numbers)
    _, values["orientation_variance"] = _measured("attitude", None if quaternion is None else quaternion[1:], variance)
    if quaternion is not None:
        values.update(q=axes.attitude(quaternion), pose_frame=axes.number)
        parts.append(YAW)
    if not parts:
        raise ValueError("expected `position`, `velocity` or `attitude`, got none of them")
    return Sample(LOCAL, tuple(parts), values, _whole(time), is_reset, is_ned=values["pose_frame"] == NED)


_FRAME: Final = {"position": "pose_frame", "velocity": "velocity_frame"}
_PARTS: Final = {"position": (POSITION, HEIGHT), "velocity": (VELOCITY,)}
_VARIANCE: Final = {"position": "variance"}


def _axes(frame: str, known: Sequence[str] | Mapping[str, _Axes]) -> _Axes:
    if frame not in known:
        raise ValueError(f"no frame {frame!r}{suggestion(str(frame).lower(), known)}: there are {', '.join(known)}")
    return AXES[frame]


def _measured(name: str, numbers: Sequence[float] | None, variance: Variance | None) -> tuple[Vector3, Vector3]:
    """Return three numbers and their variances, NaN if nothing was given."""
    keyword = _VARIANCE.get(name, f"{name}_variance")
    if numbers is None:
        if variance is not None:
            raise ValueError(f"expected `{name}` with `{keyword}`, got the variance alone")
        return _NONE, _NONE
    found = tuple(math.nan if each is None else float(each) for each in numbers)
    if len(found) != 3 or not all(map(math.isfinite, found)):  # noqa: PLR2004 - x, y, z
        raise ValueError(
            f"expected three finite numbers for {name}, got {found}: EKF2 drops it without all of them, so give 0 and "
            f"a large `{keyword}` for an axis that is not measured"
        )
    if variance is None:
        raise ValueError(f"{name} needs `{keyword}`: one number, or one for each axis")
    variances = three(variance) if isinstance(variance, Iterable) else (float(variance),) * 3
    _positive(variances, keyword)
    return three(finite(found, name)), variances


def _positive(numbers: Sequence[float], name: str) -> Sequence[float]:
    if not all(each > 0.0 for each in finite(numbers, name)):
        raise ValueError(f"expected `{name}` above 0, got {', '.join(f'{each:g}' for each in numbers)}")
    return numbers


def _unit(numbers: Sequence[float]) -> Quaternion:
    """Return a quaternion of the length 1. Raises ValueError if it is another one."""
    found = tuple(map(float, numbers))
    length = math.hypot(*found)
    if len(found) != 4 or not abs(length - 1.0) < _ROUGHLY:  # noqa: PLR2004 - w, x, y, z
        raise ValueError(f"expected a unit quaternion w, x, y, z for attitude, got {found}")
    w, x, y, z = (each / length for each in found)
    return w, x, y, z


def _whole(time: int | None) -> int | None:
    """Return a time in us. 0 is none: PX4 would take it for the time of arrival."""
    if time is None:
        return None
    try:
        found = operator.index(time)
    except TypeError:
        raise TypeError(f"expected `time` in whole us, such as flight.measure.time, got {time!r}") from None
    if found <= 0:
        raise ValueError(f"expected `time` in us above 0, such as flight.measure.time, got {found}")
    return found
