"""What a simulated estimator is given: measurements, as far as it uses them, and the vehicle that they are of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple, Protocol

from msggen.messages.measurements import FASTEST, GATES, HEIGHT, PLACE, POSITION, VELOCITY, YAW, Part, frame_of, taken
from msggen.sim.attitude import Vector, angles_of
from msggen.sim.places import Home

_LEAST: Final = GATES[POSITION].least ** 2
_FIELDS: Final = ("position", "pose_frame", "velocity", "velocity_frame", "q")


class Pilot(Protocol):
    """What flies by the estimate."""

    def shift(self, move: Vector) -> None:
        """Move the places that it keeps with the estimate of the position."""


class Odometry(NamedTuple):
    """A VehicleOdometry. Times are in us."""

    time: int
    parts: frozenset[Part]
    frame: int
    position: Vector
    velocity: Vector
    velocity_frame: int
    yaw: float
    """NaN without an attitude. It turns FRD frames, also where it is not to be fused."""
    variances: Mapping[Part, float]
    resets: int
    quality: int


class Place(NamedTuple):
    """A VehicleGlobalPosition or, from v1.18 on, an AuxGlobalPosition."""

    time: int
    place: Home
    variance: float
    resets: int


def odometry_of(message: Any, time: int, control: int) -> Odometry:
    """Return what a message tells of a time. `control` has the bits of the parts that are switched on."""
    values = {name: getattr(message, name) for name in _FIELDS}
    parts = taken(values)
    if math.hypot(*message.velocity) > FASTEST:
        parts -= {VELOCITY}
    position, velocity = message.position_variance, message.velocity_variance
    variances = {
        POSITION: _noise(position, 0, 1),
        HEIGHT: _noise(position, 2),
        VELOCITY: _noise(velocity, 0, 1, 2),
        YAW: _noise(message.orientation_variance, 2),
    }
    return Odometry(
        time,
        frozenset(part for part in parts if part.bit & control),
        frame_of(values),
        message.position,
        message.velocity,
        message.velocity_frame,
        angles_of(message.q, 0.0)[2] if YAW in parts else math.nan,
        variances,
        message.reset_counter,
        message.quality,
    )


def place_of(message: Any) -> Place | None:
    """Return what a message tells, None if there is no such place."""
    place, accuracy = Home(message.lat, message.lon, message.alt), float(message.eph)
    if not place._replace(altitude=0.0).is_possible:
        return None
    return Place(message.timestamp_sample, place, accuracy * accuracy, message.lat_lon_reset_counter)


def is_on(parameters: Mapping[str, float], identity: int | None) -> bool:
    """Whether a source of global positions is switched on. Before v1.18, there is one, which has no number."""
    if identity is None:
        return bool(bits(parameters.get("EKF2_AGP_CTRL", 0.0)) & PLACE.bit)
    slots = (f"EKF2_AGP{number}_" for number in range(4))
    return any(
        identity and identity == parameters.get(f"{slot}ID") and bits(parameters[f"{slot}CTRL"]) & PLACE.bit
        for slot in slots
    )


def turned_by(vector: Vector, angle: float) -> Vector:
    """Return a vector turned around the vertical."""
    x, y, z = vector
    return x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle), z


def bits(value: float) -> int:
    """Return the bits of a parameter."""
    return int(value) if math.isfinite(value) else 0


def _noise(variances: Vector, *axes: int) -> float:
    """Return the largest variance of some axes. If any is not finite, that of the parameters counts: the least."""
    return max(_LEAST, *(variances[axis] for axis in axes)) if all(map(math.isfinite, variances)) else _LEAST
