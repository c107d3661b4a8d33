"""The measurements that a program gives, in frames by name, and what is no measurement."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from msggen.base.diagnostics import suggestion
from msggen.flight.places import GlobalPlace, OnEarth, three, turned
from msggen.flight.setpoints import finite
from msggen.flight.usage import MEASURED, ON_EARTH, Hinted, explained
from msggen.messages.measurements import (
    BODY_FRD,
    FRD,
    GLOBAL,
    HEIGHT,
    LOCAL,
    NED,
    PLACE,
    POSITION,
    SOURCES,
    UNKNOWN,
    VELOCITY,
    YAW,
    Part,
)

PoseFrame: TypeAlias = Literal["ned", "enu", "frd", "flu"]
"""Axes of positions and attitudes: of the earth, or of a level frame whose x axis points anywhere."""
VelocityFrame: TypeAlias = Literal["ned", "enu", "frd", "flu", "body_frd", "body_flu"]
"""The same, and those of the vehicle."""
Source: TypeAlias = Literal["unknown", "gnss", "vision", "pseudolites", "terrain", "magnetic", "estimator", "leo"]
"""What measures a place on earth: SOURCE_* of AuxGlobalPosition."""
Variance: TypeAlias = float | Sequence[float]
"""One for all axes, or one for each."""

_ROUGHLY: Final = 0.01
"""How far from 1 the length of a quaternion may be, which is normalized then."""
_NONE: Final = (math.nan, math.nan, math.nan)
_BEST: Final = 100
"""`quality` of VehicleOdometry, which EKF2_EV_QMIN asks for."""

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
    return turned(vector, "enu")


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
        accuracy: float | None = None,
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
        if accuracy is None:
            raise ValueError("expected `accuracy`, the horizontal standard deviation in m: EKF2 weighs the place by it")
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
    return Sample(LOCAL, tuple(parts), values, _whole(time), is_reset)


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
            raise ValueError(
                f"expected `{name}` with `{keyword}`, got the variance alone: each part has one of its own"
            )
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
