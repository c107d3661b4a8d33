"""Setpoints of aircraft that fly on wings: a course and an altitude, and the way to a place and around it."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from msggen.flight.braking import RADIUS, turn_radius
from msggen.flight.errors import NotReachedError
from msggen.flight.estimates import is_estimate, valid_estimate
from msggen.flight.feeds import Feeds
from msggen.flight.places import Frame, Vector, check_radians, heading_of, wrapped
from msggen.flight.sending import Sends
from msggen.flight.setpoints import Values, finite, in_range
from msggen.flight.states import is_on_wings
from msggen.flight.usage import WINGS, explained
from msggen.messages.setpoints import FIXED_WING

LEVEL: Final = 10.0
"""The difference in m up to which an altitude is reached: NAV_FW_ALT_RAD."""
_GRAVITY = 9.81
_AWAY = 4.0
"""How far it flies away from such a place, in radii of a turn with a bank of 45 degrees."""
_NEAREST = 10.0
"""The smallest distance in m at which a place is reached by default. Else, it is the radius of a turn."""
_NAN: Final = math.nan
_LATERAL, _LONGITUDINAL, _LATERAL_LIMITS, _LONGITUDINAL_LIMITS = FIXED_WING.topics
_DEFAULTS: Final[Values] = MappingProxyType(
    {
        _LATERAL_LIMITS: {"lateral_accel_max": _NAN},
        _LONGITUDINAL_LIMITS: dict.fromkeys(
            (
                "pitch_min",
                "pitch_max",
                "throttle_min",
                "throttle_max",
                "climb_rate_target",
                "sink_rate_target",
                "speed_weight",
            ),
            _NAN,
        ),
    }
)
"""The limits of the vehicle's parameters. Without these messages, PX4 keeps those of the mode before."""


class Wings(NamedTuple):
    """What the wings are to do. Angles are in NED. NaN means that it is not controlled."""

    course: float = _NAN
    airspeed_direction: float = _NAN
    lateral_acceleration: float = _NAN
    altitude: float = _NAN
    height_rate: float = _NAN
    airspeed: float = _NAN
    throttle: float = _NAN

    @property
    def values(self) -> Values:
        """The fields of the messages."""
        return {
            _LATERAL: {
                "course": self.course,
                "airspeed_direction": self.airspeed_direction,
                "lateral_acceleration": self.lateral_acceleration,
            },
            _LONGITUDINAL: {
                "altitude": self.altitude,
                "height_rate": self.height_rate,
                "equivalent_airspeed": self.airspeed,
                "pitch_direct": _NAN,
                "throttle_direct": self.throttle,
            },
            **_DEFAULTS,
        }


class Winged(Sends):
    """Takes setpoints of aircraft that fly on wings."""

    @explained(WINGS)
    def fixed_wing(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        *,
        course: float | None = None,
        course_deg: float | None = None,
        airspeed_direction: float | None = None,
        airspeed_direction_deg: float | None = None,
        lateral_acceleration: float | None = None,
        altitude: float | None = None,
        height_rate: float | None = None,
        airspeed: float | None = None,
        throttle: float | None = None,
    ) -> None:
        """Send where an aircraft on wings flies, until the next setpoint: FixedWingLateral-, -LongitudinalSetpoint.

        One of `course`, over ground in rad or degrees, and `airspeed_direction`, through the air, in `frame`. A
        `lateral_acceleration` in m/s², to the right, is added, or is the whole turn: 0.0 is straight on.

        `altitude` in m above mean sea level, or `height_rate` in m/s, upwards: by default, the aircraft keeps its
        height. `airspeed` in m/s is the equivalent airspeed, by default FW_AIRSPD_TRIM: PX4 raises it to
        FW_AIRSPD_MIN, and reduces it to FW_AIRSPD_MAX. `throttle` from 0 to 1 overrides PX4's.

        Raises ValueError, LimitError, UnsupportedError for another vehicle, FlightError for a VTOL in a transition, and
        NotReachedError if the mode does not fly.
        """
        given = {
            "course": _angle(course, course_deg, self.frame, "course"),
            "airspeed_direction": _angle(airspeed_direction, airspeed_direction_deg, self.frame, "airspeed_direction"),
            "lateral_acceleration": lateral_acceleration,
            "altitude": altitude,
            "height_rate": height_rate,
            "airspeed": airspeed,
            "throttle": throttle,
        }
        found = _checked({name: value for name, value in given.items() if value is not None})
        self._own.send_each(FIXED_WING, found.values)


def _checked(given: dict[str, float]) -> Wings:
    """Return what the wings are to do, with the values that are given. Raises ValueError."""
    for name, value in given.items():
        finite([value], f"`{name}`")
    if not given.keys() & {"course", "airspeed_direction", "lateral_acceleration"}:
        raise ValueError("expected a course, an airspeed_direction or a lateral_acceleration: 0.0 is straight on")
    for one, other in (("course", "airspeed_direction"), ("altitude", "height_rate")):
        if given.keys() >= {one, other}:
            raise ValueError(f"expected {one} or {other}, got both: PX4 would ignore the {one}")
    if "throttle" in given:
        in_range(given["throttle"], 0.0, "a throttle")
    return Wings(**({} if "altitude" in given else {"height_rate": 0.0}) | given)


def _angle(rad: float | None, deg: float | None, frame: Frame, name: str) -> float | None:
    """Return an angle that is given in rad or degrees, in NED. Raises ValueError if both are given."""
    if rad is not None and deg is not None:
        raise ValueError(f"expected {name} or {name}_deg, got both")
    finite([each for each in (rad, deg) if each is not None], f"`{name}`")
    if rad is not None:
        check_radians(rad, name)
    found = heading_of(rad, deg, frame)
    return None if found is None else wrapped(found)


class Way:
    """Guides an aircraft on wings to a place in NED, and then around it, because it cannot stop.

    A mode of a program gets no guidance of PX4, which ignores goto and trajectory setpoints of such vehicles there.
    """

    def __init__(self, feeds: Feeds, place: Vector, *, airspeed: float = _NAN, within: float | None = None) -> None:
        self._feeds, self._place, self._airspeed, self._within = feeds, place, airspeed, within
        self.is_there = within == math.inf
        """Whether it has been near the place, and flies around it."""
        self._leaves = False
        """Whether it flies away from a place inside its turn, around which it would fly for ever."""
        self._last = Wings(lateral_acceleration=0.0, height_rate=0.0)

    @classmethod
    def around(cls, feeds: Feeds, centre: Vector) -> Way:
        """Return a circle that begins at once."""
        return cls(feeds, centre, within=math.inf)

    def __call__(self) -> Values:
        """Return the setpoint. Without an estimate of the position, that is the last one: PX4 leaves the mode then."""
        estimate = valid_estimate(self._feeds)
        if estimate is not None:
            self._last = self._next(estimate)
        return self._last.values

    def is_reached(self, estimate: Any) -> bool:
        """Whether the place and its altitude are reached. Raises NotReachedError once the vehicle hovers."""
        if not is_on_wings(self._feeds["vehicle_status"].latest):
            raise NotReachedError("the flight to a place was not completed: the vehicle flies on its wings no more")
        return self.is_there and is_estimate(estimate) and abs(estimate.z - self._place.z) < LEVEL

    def _next(self, estimate: Any) -> Wings:
        north, east = self._place.x - estimate.x, self._place.y - estimate.y
        speed, track = math.hypot(estimate.vx, estimate.vy), math.atan2(estimate.vy, estimate.vx)
        distance, bearing = math.hypot(north, east), math.atan2(east, north)
        near = max(_NEAREST, turn_radius(speed)) if self._within is None else self._within
        self.is_there = self.is_there or distance < near
        sea = estimate.ref_alt if estimate.z_global else 0.0
        wings = Wings(altitude=sea - self._place.z, airspeed=self._airspeed)
        if self.is_there:
            return _around(wings, distance, bearing, speed)
        turn = speed * speed / _GRAVITY
        if distance < 2.0 * turn * abs(math.sin(bearing - track)):
            self._leaves = True
        elif distance > _AWAY * turn:
            self._leaves = False
        return wings._replace(course=track if self._leaves else bearing)


def _around(wings: Wings, distance: float, bearing: float, speed: float) -> Wings:
    """Return the setpoint of a circle around a place to the right, as PX4's Hold flies it."""
    off = distance - RADIUS
    course = wrapped(bearing - math.pi / 2 + math.atan2(off, RADIUS / 2))
    is_on_circle = abs(off) < RADIUS / 2
    return wings._replace(course=course, lateral_acceleration=speed * speed / RADIUS if is_on_circle else _NAN)


def circle_centre(estimate: Any) -> Vector:
    """Return the centre of the circle to the right that an aircraft begins where it is."""
    track = math.atan2(estimate.vy, estimate.vx)
    return Vector(estimate.x - RADIUS * math.sin(track), estimate.y + RADIUS * math.cos(track), estimate.z)


def thrust_vector(feeds: Feeds, share: float) -> tuple[float, float, float]:
    """Return the thrust from 0 to 1 in FRD: forward on wings, else upward."""
    return (share, 0.0, 0.0) if feeds.shows(is_on_wings) else (0.0, 0.0, -share)
