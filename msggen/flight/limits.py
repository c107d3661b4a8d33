"""Limits on height and distance, which are applied before a setpoint is sent.

A place beyond a limit is an error. Velocities and accelerations are reduced as the vehicle approaches a limit.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from msggen.flight.braking import HORIZON, RADIUS, allowed, braked_level, cut, leads_out, length, slowed_level, way_left
from msggen.flight.errors import LimitError, NoAnswerError, UnsupportedError
from msggen.flight.estimates import checked_estimate, valid_estimate
from msggen.flight.feeds import Feeds
from msggen.flight.places import Vector
from msggen.flight.setpoints import Messages, Ranges, Values
from msggen.flight.states import is_on_wings
from msggen.flight.usage import LIMITS, explained_class
from msggen.messages.setpoints import FIXED_WING, GOTO, ROVER, ROVER_POSITION, TRAJECTORY, Kind

_DISTANCE = 10_000.0
"""How far from home in m `goto` flies if no limit is set: farther away, latitude and longitude are probably others."""
_DEPTH = 1.0
"""How far below home in m `goto` flies if no limit is set: the estimate of the height drifts by as much."""
_HOME = 3.0
"""The time in s to wait for the home position."""
_UP: Final = Vector(0.0, 0.0, -1.0)
_LIMITED: Final = (GOTO, TRAJECTORY, FIXED_WING, *ROVER)
"""The kinds of setpoints whose places, velocities and accelerations are kept within limits."""
_LATERAL, _LONGITUDINAL, *_ = FIXED_WING.topics
_SPEED: Final = ROVER[1].topics[0]
_CIRCLE = 3.0
"""The lateral acceleration in m/s^2 with which such an aircraft circles if it does not know where it is."""
_ROOM = 100.0
"""The room in m around such a place: the radius, and what the aircraft is off when it comes to the circle."""
_SPARE = 10.0
"""How near such an aircraft may come to a limit in m, for gusts and what its turns are off."""
_CHANGE = 50.0
"""How far ahead a VTOL flies in m until its wings carry it: to VT_ARSP_TRANS, 10 m/s, or for VT_F_TR_OL_TM, 6 s."""


@explained_class(LIMITS)
@dataclass(frozen=True, kw_only=True)
class Limits:
    """How far a program may fly from the home position, in m. By default, there is no limit, except for `goto`.

    `goto` refuses places that are more than 10 km away or more than 1 m below home, unless `distance` or `depth` is
    set. Before PX4 v1.16, which does not publish the home position, the origin of the local frame counts instead.
    """

    height: float = math.inf
    """Above the home position."""
    distance: float = math.inf
    """From the home position, horizontally. A plane, which circles where it holds, needs 100 m."""
    depth: float = math.inf
    """Below the home position, for places of `goto` and altitudes of wings: where the ground falls away from home."""

    def __post_init__(self) -> None:
        """Raise ValueError unless all are positive."""
        for name in ("height", "distance", "depth"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name}: expected a positive number, got {getattr(self, name)!r}")

    @property
    def is_open(self) -> bool:
        """Whether there is no limit on setpoints."""
        return math.isinf(self.height) and math.isinf(self.distance)

    def tightened(self, other: Limits) -> Limits:
        """Return the limits within both."""
        names = ("height", "distance", "depth")
        return Limits(**{name: min(getattr(self, name), getattr(other, name)) for name in names})


NO_LIMITS: Final = Limits()


class _Here(NamedTuple):
    """The place relative to home, the velocity, the acceleration and the heading, in NED."""

    place: Vector
    velocity: Vector
    acceleration: Vector
    heading: float


class Fence:
    """Keeps setpoints within limits, and checks ranges. Without limits, it changes nothing. Vectors are in NED."""

    def __init__(self, feeds: Feeds, limits: Limits = NO_LIMITS, ranges: Ranges | None = None) -> None:
        self.limits, self._feeds = limits, feeds
        self.ranges = Ranges() if ranges is None else ranges
        self._has_home = feeds.has("home_position")
        try:
            for topic in ("home_position", "vehicle_local_position")[not self._has_home :]:
                feeds[topic]  # subscribe now, so that both are known when they are needed
        except UnsupportedError:  # the vehicle bridges fewer topics than its release
            if not limits.is_open:
                raise
            self._has_home = False

    def tightened(self, limits: Limits) -> Fence:
        """Return a fence that also enforces other limits."""
        return self if limits == NO_LIMITS else Fence(self._feeds, self.limits.tightened(limits), self.ranges)

    def check_kinds(self, kinds: Sequence[Kind]) -> None:
        """Raise UnsupportedError if limits cannot be enforced for a kind, and LimitError if a plane has no room."""
        found = [each.name for each in kinds if each not in _LIMITED]
        if found and not self.limits.is_open:
            raise UnsupportedError(
                f"limits cannot be enforced for {' and '.join(found)} setpoints: remove them from `setpoints`, "
                "or remove the limits and set those of PX4 (GF_MAX_HOR_DIST, GF_MAX_VER_DIST)"
            )
        if FIXED_WING in kinds and self.limits.distance < _ROOM and self._is_on_wings(is_plane=True):
            raise LimitError(
                f"the limit of {self.limits.distance:g} m is too small for a plane: it cannot stop, and circles with a "
                f"radius of {RADIUS:g} m, for which it needs {_ROOM:g} m"
            )

    def check(self, kind: Kind, values: Values) -> None:
        """Raise LimitError if a setpoint has a place beyond the limits, and the errors of `check_guided`.

        Raises NoAnswerError for an altitude if the vehicle does not know its own.
        """
        self.check_guided(kind, values)
        place = values[kind.topic].get("position")
        if kind == ROVER_POSITION:
            place = (*values[kind.topic]["position_ned"], math.nan)
        elif kind == FIXED_WING:
            place = (math.nan, math.nan, self._down_of(values[_LONGITUDINAL]["altitude"]))
            self._check_depth(place[2])
        if place is not None:
            self.check_place(place)

    def check_guided(self, kind: Kind, values: Values) -> None:
        """Raise the errors of a setpoint whose places are checked: of its kind, and ValueError of `Ranges`.

        Raises NoAnswerError for wings without a home position, if there are limits: they cannot stop without it.
        """
        self.check_kinds([kind])
        self.ranges.check(values)
        if kind == FIXED_WING and not self.limits.is_open:
            self._home()

    def _down_of(self, altitude: float) -> float:
        """Return an altitude above mean sea level in the local frame. Raises NoAnswerError if that is not known."""
        if math.isnan(altitude):
            return math.nan
        found = self._feeds["vehicle_local_position"].latest
        if found is None or not found.z_global:
            raise NoAnswerError(
                "the vehicle does not know its altitude above sea level, and would take this one as a height above "
                "where it was switched on: give a height_rate, or a place in the local frame to `goto`"
            )
        return float(found.ref_alt - altitude)

    def check_place(self, place: Sequence[float]) -> None:
        """Raise LimitError if a place is beyond the limits, and NoAnswerError if there is no home position."""
        if self.limits.is_open or all(map(math.isnan, place)):
            return
        if math.isnan(place[0]) != math.isnan(place[1]) and not math.isinf(self.limits.distance):
            raise LimitError("the distance cannot be limited if only one horizontal axis has a position: give both")
        x, y, z = _from_home(place, self._home())
        height, distance = (0.0 if math.isnan(z) else -z), length(x, y)
        if not height <= self.limits.height:
            raise LimitError(f"{height:.1f} m above home: the limit is {self.limits.height:g} m, and nothing was sent")
        if not distance <= self.limits.distance:
            raise LimitError(
                f"{distance:.1f} m from home: the limit is {self.limits.distance:g} m, and nothing was sent"
            )

    def check_goto(self, place: Sequence[float]) -> None:
        """Raise LimitError and NoAnswerError as `check_place`, and LimitError for a place that is probably a mistake.

        Such a place is more than 10 km from home, or more than 1 m below it, and `Limits` do not say that it is meant.
        """
        self.check_place(place)
        x, y, _ = _from_home(place, self._known_home() or Vector(0.0, 0.0, 0.0))
        distance = self.limits.distance
        if not (length(x, y) + _ROOM <= distance or math.isnan(x)) and self._is_on_wings():
            raise LimitError(
                f"{length(x, y):.1f} m from home: the limit is {distance:g} m, and the vehicle circles around the "
                f"place, for which it needs {_ROOM:g} m. Nothing was sent"
            )
        if math.isinf(distance) and not length(x, y) <= _DISTANCE:
            raise LimitError(
                f"{length(x, y) / 1e3:.0f} km from home: without `Limits(distance=...)`, goto flies "
                f"{_DISTANCE / 1e3:g} km at most, and nothing was sent"
            )
        self._check_depth(place[2])

    def _check_depth(self, z: float) -> None:
        """Raise LimitError for a place in the ground, as far as home tells."""
        down, depth = z - (self._known_home() or Vector(0.0, 0.0, 0.0)).z, self.limits.depth
        if down > (_DEPTH if math.isinf(depth) else depth):
            raise LimitError(
                f"{down:.1f} m below home, and nothing was sent: z points down in NED, and altitudes are above sea "
                "level; `Limits(depth=...)` allows places below home"
            )

    async def check_change(self) -> None:
        """Raise LimitError if a VTOL that changes to forward flight now could not circle within the limits then.

        Raises NoAnswerError, if there are limits, without a home position and without a valid estimate.
        """
        if math.isinf(self.limits.distance):
            return
        await self.wait_for_home()
        estimate, home = checked_estimate(self._feeds), self._home()
        x = estimate.x + _CHANGE * math.cos(estimate.heading) - home.x
        y = estimate.y + _CHANGE * math.sin(estimate.heading) - home.y
        if math.hypot(x, y) + _ROOM > self.limits.distance:
            raise LimitError(
                f"no room to change to forward flight: a VTOL flies {_CHANGE:g} m ahead, and needs {_ROOM:g} m around "
                f"that place to circle, which is {math.hypot(x, y):.1f} m from home: the limit is "
                f"{self.limits.distance:g} m"
            )

    def nearest(self, place: Sequence[float], *, is_circled: bool = False) -> Vector:
        """Return the place within the limits that is nearest to a place. The vehicle holds there, or circles there."""
        if self.limits.is_open:
            return Vector(*place)
        home = self._home()
        x, y, z = _from_home(place, home)
        distance, most = math.hypot(x, y), max(self.limits.distance - (_ROOM if is_circled else 0.0), 0.0)
        share = most * (1.0 - 1e-6) / distance if distance > most else 1.0
        return Vector(home.x + x * share, home.y + y * share, home.z + max(z, -self.limits.height))

    def shaped(self, messages: Messages) -> Messages:
        """Return setpoints whose velocity, acceleration, course and speed do not lead beyond the limits."""
        if self.limits.is_open:
            return messages
        here = self._here()
        return {topic: self._shape(topic, message, here) for topic, message in messages.items()}

    # inside

    def _shape(self, topic: str, message: Any, here: _Here | None) -> Any:
        found = copy.copy(message)
        distance = self.limits.distance
        if topic == TRAJECTORY.topic:
            found.velocity, found.acceleration = self._slowed(message.velocity, message.acceleration, here)
        elif topic == _SPEED:
            found.speed_body_x = 0.0 if here is None else _rolling(message.speed_body_x, here, distance)
        elif (
            topic == _LATERAL and not math.isinf(distance) and (here is None or leads_out(*here[:3], distance - _SPARE))
        ):
            found.course = math.nan if here is None else math.atan2(-here.place.y, -here.place.x)
            found.airspeed_direction, found.lateral_acceleration = math.nan, _CIRCLE if here is None else math.nan
        elif topic == _LONGITUDINAL:
            most = 0.0 if here is None else allowed(self.limits.height + here.place.z)
            found.height_rate = min(message.height_rate, most)
        return found

    def _slowed(
        self, velocity: Sequence[float], acceleration: Sequence[float], here: _Here | None
    ) -> tuple[Vector, Vector]:
        if here is None:  # it stops, because it could be anywhere
            return _stopped(velocity), _stopped(acceleration)
        height, distance = self.limits.height, self.limits.distance
        speed, pull = Vector(*velocity), Vector(*acceleration)
        if not math.isinf(height):
            most = allowed(height + here.place.z)
            speed, pull = cut(speed, _UP, most), cut(pull, _UP, (most + here.velocity.z) / HORIZON)
        if not math.isinf(distance):
            speed = slowed_level(speed, here.place, distance)
            pull = braked_level(pull, here.place, here.velocity, distance)
        return speed, pull

    async def wait_for_home(self) -> None:
        """Wait for some time until the home position is known, if there are limits that are measured from it."""
        if self._has_home and not self.limits.is_open:
            with suppress(TimeoutError):  # the check of a place raises the error
                await self._feeds["home_position"].wait(lambda each: bool(each.valid_lpos), _HOME)

    @property
    def ground(self) -> float:
        """How far home is below the origin of the local frame in m: 0 if it is not known."""
        return (self._known_home() or Vector(0.0, 0.0, 0.0)).z

    def _is_on_wings(self, *, is_plane: bool = False) -> bool:
        """Whether the vehicle flies on wings, and, with `is_plane`, always does."""
        return self._feeds.shows(lambda each: is_on_wings(each) and not (is_plane and each.is_vtol))

    def _home(self) -> Vector:
        found = self._known_home()
        if found is None:
            raise NoAnswerError("the vehicle has no home position, which limits are measured from")
        return found

    def _known_home(self) -> Vector | None:
        """Return the home position, or the origin of the local frame if the firmware does not publish it, as v1.15."""
        if not self._has_home:
            return Vector(0.0, 0.0, 0.0)
        home = self._feeds["home_position"].latest
        return Vector(home.x, home.y, home.z) if home is not None and home.valid_lpos else None

    def _here(self) -> _Here | None:
        found, home = valid_estimate(self._feeds), self._known_home()
        if found is None or home is None:
            return None
        place = _from_home((found.x, found.y, found.z), home)
        return _Here(place, Vector(found.vx, found.vy, found.vz), Vector(found.ax, found.ay, found.az), found.heading)


def _rolling(speed: float, here: _Here, distance: float) -> float:
    """Return the speed of a rover, reduced so that it can stop within the distance."""
    sign = math.copysign(1.0, speed)
    direction = Vector(sign * math.cos(here.heading), sign * math.sin(here.heading), 0.0)
    most = math.inf if math.isinf(distance) else allowed(way_left(direction, here.place, distance))
    return sign * min(abs(speed), most)


def _from_home(place: Sequence[float], home: Vector) -> Vector:
    x, y, z = place
    return Vector(x - home.x, y - home.y, z - home.z)


def _stopped(vector: Sequence[float]) -> Vector:
    x, y, z = (each if math.isnan(each) else 0.0 for each in vector)
    return Vector(x, y, z)
