"""The estimator of a simulated vehicle, as far as measurements of programs go: when EKF2 fuses them, and what follows.

There is no filter: a measurement is compared with where the vehicle is. The rules are those of `msggen.messages.
measurements`, and the times were measured with PX4 v1.18. Times are in us.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, Protocol

from msggen.messages.measurements import (
    FRD,
    GLOBAL,
    HEIGHT,
    LOCAL,
    LONGEST_START,
    NEAREST,
    OLDEST,
    PLACE,
    POSITION,
    VELOCITY,
    YAW,
    Part,
    taken,
)
from msggen.sim.attitude import Vector, angles_of
from msggen.sim.autopilot import Autopilot
from msggen.sim.flight import Flight, wrapped
from msggen.sim.parameters import PARAMETERS
from msggen.sim.places import Home

_BEHIND = 150_000
"""How far the estimate lags behind: a measurement waits as long, so that late ones are used in their turn."""
_OLDEST, _NEAREST, _LONGEST_START = (round(each * 1e6) for each in (OLDEST, NEAREST, LONGEST_START))
_STOPPED, _PLACE_STOPPED = 500_000, 5_000_000
"""The time without measurements after which they count as ended, in the local frame and on earth."""
_PATIENCE = 1_000_000
"""The time for which measurements are rejected until the position is reset to them."""
_LOST = 4_600_000
"""The time after the last measurement when the position is no longer known."""
_MOST_RESETS = 5
"""In the air, since the measurements were last taken anew."""
_GATE, _VELOCITY_GATE, _YAW_GATE, _PLACE_GATE = 5.0, 3.0, 2.6, 3.0
"""How many standard deviations a measurement may differ from the estimate."""
_STATE_VARIANCE = 0.1
"""The variance of the estimate, which adds to that of the measurement."""
_LEAST, _PLACE_LEAST = 0.01, 0.81
"""The least variances of measurements: EKF2_EVP_NOISE, EKF2_EVV_NOISE, EKF2_EVA_NOISE, and EKF2_AGP_NOISE, squared."""
_GROWTH = 0.0013
"""By how much the variance of the position grows without measurements, in m^2/s."""
_FARTHEST = 1e6
"""The distance in m beyond which no measurement is near: places there cannot be told in degrees."""
_KEPT = 32
"""How many measurements wait at most."""
_BY_GPS = 0.29
"""The horizontal accuracy with GPS, in m."""
MEASURED = (POSITION, VELOCITY, PLACE)
"""The parts of which each makes the position known."""


class World(Protocol):
    """What measurements tell of: `msggen.sim.world.World`."""

    flight: Flight
    autopilot: Autopilot
    origin: Home
    has_origin: bool


class _Odometry(NamedTuple):
    time: int
    parts: frozenset[Part]
    frame: int
    position: Vector
    velocity: Vector
    yaw: float
    """NaN without an attitude. It turns FRD frames, also where it is not to be fused."""
    variances: tuple[float, float, float]
    """Of the horizontal position, of velocity and yaw."""
    resets: int


class _Place(NamedTuple):
    time: int
    place: Home
    variance: float
    resets: int


class External:
    """Takes measurements. `handlers` are by the names of topics in uORB."""

    def __init__(self, world: World, parameters: Mapping[str, float] = PARAMETERS, patience: int = 7_000_000) -> None:
        """Take the time for which places on earth are rejected before the position is reset to them."""
        self._world, self._parameters, self._place_patience = world, parameters, patience
        self._control = _bits(parameters.get("EKF2_EV_CTRL", 0.0))
        self.uses_gps = bool(_bits(parameters["EKF2_GPS_CTRL"]) & 1)
        self.fused: frozenset[Part] = frozenset()
        """The parts that are fused."""
        self.changes = self.position_resets = self.heading_resets = 0
        """How often `fused` has changed, and position and heading were reset."""
        self.move = (0.0, 0.0)
        """How far the last reset has moved the position, in m north and east."""
        self.is_aided = True
        """Whether something has made the position known within the last second."""
        self.is_yaw_aligned = True
        """Whether the heading is from north, and not that of an FRD frame."""
        self.handlers: Mapping[str, Callable[[Any, int], object]] = {LOCAL: self.take, GLOBAL: self.take_place}
        """Each takes a message, whose times are since boot. Only that of the measurement counts."""
        self._now, self._is_resting, self._has_gps = 0, True, True
        self._waiting: deque[_Odometry] = deque(maxlen=_KEPT)
        self._places: deque[_Place] = deque(maxlen=_KEPT)
        self._newest = self._before = -_STOPPED
        """The times of the newest measurement, and of the last one that was used."""
        self._place_heard = 0
        self._counter = self._place_counter = 0
        self._used: dict[Part, int] = {}
        """When each part was fused last."""
        self._resets = 0
        self._bias = (0.0, 0.0)
        """How far measurements are from the position while GPS decides it."""
        self._variance: float = _LEAST
        self._variance_time = 0

    # What arrives

    def take(self, message: Any, _: int) -> None:
        """Take a VehicleOdometry."""
        time = message.timestamp_sample
        if time < self._newest + _NEAREST:
            return
        self._newest = time
        parts = taken({name: getattr(message, name) for name in _FIELDS})
        yaw = angles_of(message.q, 0.0)[2] if YAW in parts else math.nan
        noises = (_noise(message.position_variance, 0, 1), _noise(message.velocity_variance, 0, 1, 2))
        found = _Odometry(
            time,
            frozenset(part for part in parts if part.bit & self._control),
            message.pose_frame,
            message.position,
            message.velocity,
            yaw,
            (*noises, _noise(message.orientation_variance, 2)),
            message.reset_counter,
        )
        self._waiting.append(found)

    def take_place(self, message: Any, _: int) -> None:
        """Take a VehicleGlobalPosition or, from v1.18 on, an AuxGlobalPosition."""
        place = Home(message.lat, message.lon, message.alt)
        if not self._is_on(getattr(message, "id", None)) or not place._replace(altitude=0.0).is_possible:
            return
        accuracy = float(message.eph)
        variance = max(_PLACE_LEAST, accuracy * accuracy) if math.isfinite(accuracy) else _PLACE_LEAST
        self._places.append(_Place(message.timestamp_sample, place, variance, message.lat_lon_reset_counter))

    def _is_on(self, identity: int | None) -> bool:
        """Whether a source of global positions is switched on. Before v1.18, there is one, which has no number."""
        if identity is None:
            return bool(_bits(self._parameters.get("EKF2_AGP_CTRL", 0.0)) & PLACE.bit)
        given = self._parameters
        slots = (f"EKF2_AGP{number}_" for number in range(4))
        return any(
            identity and identity == given.get(f"{slot}ID") and _bits(given[f"{slot}CTRL"]) & PLACE.bit
            for slot in slots
        )

    # Time

    def step(self, now: int, *, has_gps: bool, is_resting: bool) -> bool:
        """Move on to a time, and return whether measurements make the position known.

        `has_gps` says whether GPS decides the position, and `is_resting` whether the vehicle stands on the ground.
        """
        self._now, self._has_gps, self._is_resting = now, has_gps, is_resting
        if has_gps and not (self._waiting or self._places or self._used):  # nobody measures
            self.is_aided = True
            return False
        while self._waiting and self._waiting[0].time + _BEHIND <= now:
            found = self._waiting.popleft()
            if now - found.time < _OLDEST:
                self._look(found)
        while self._places and self._places[0].time + _BEHIND <= now:
            place = self._places.popleft()
            if now - place.time < _OLDEST:
                self._look_at_place(place)
        if self.fused:
            self._stop()
        self.is_aided = has_gps or not all(map(self._is_late, MEASURED))
        return any(now - self._used[part] < _LOST for part in MEASURED if part in self._used)

    def _stop(self) -> None:
        """End what has got no measurements for some time."""
        local = self.fused - {PLACE}
        if local and self._now - self._before > _STOPPED:
            self._end(local)
            if self._is_resting and not self._has_gps:
                self._reset(self._world.flight.position)  # EKF2 holds the place where it stands
        if PLACE in self.fused and self._now - self._place_heard > _PLACE_STOPPED:
            self._end({PLACE})

    @property
    def accuracy(self) -> float:
        """The horizontal accuracy in m: eph."""
        return _BY_GPS if self._has_gps else math.sqrt(2.0 * (self._variance + self._grown))

    @property
    def _grown(self) -> float:
        return _GROWTH * (self._now - self._variance_time) / 1e6

    @property
    def flags(self) -> Mapping[str, bool]:
        """What EstimatorStatusFlags tells of it."""
        return {
            **{part.flag: True for part in self.fused},
            "cs_yaw_align": self.is_yaw_aligned,
            "cs_inertial_dead_reckoning": not self.is_aided,
            "cs_valid_fake_pos": not self.is_aided and self._is_resting,
            "cs_fake_pos": not self.is_aided and not self._is_resting,
        }

    # Positions, velocities and headings in the local frame

    def _look(self, found: _Odometry) -> None:
        can_start = found.time - self._before < _LONGEST_START
        is_reset = found.resets != self._counter
        self._before, self._counter = found.time, found.resets
        self._end(self.fused - found.parts - {PLACE})
        if YAW in found.parts:
            self._look_at_yaw(found, can_start=can_start, is_reset=is_reset)
        if not self.is_yaw_aligned and found.frame != FRD:
            self._end({POSITION})
        elif POSITION in found.parts:
            self._look_at_position(found, can_start=can_start, is_reset=is_reset)
        if VELOCITY in found.parts:
            self._look_at_velocity(found, can_start=can_start)
        if HEIGHT in found.parts and (HEIGHT in self.fused or can_start):
            self._use(HEIGHT)

    def _look_at_yaw(self, found: _Odometry, *, can_start: bool, is_reset: bool) -> None:
        flight, is_turned = self._world.flight, found.frame == FRD
        if (YAW not in self.fused and not can_start) or (is_turned and self._has_gps):
            return
        error = wrapped(found.yaw - flight.yaw)
        is_near = abs(error) <= _YAW_GATE * math.sqrt(found.variances[2] + _STATE_VARIANCE)
        is_new = YAW not in self.fused or is_reset or self._is_late(YAW)
        if is_near or is_new:
            self._use(YAW)
        if is_new and (is_turned or not is_near):
            flight.yaw += error
            self.heading_resets += 1
            self.is_yaw_aligned = not is_turned

    def _look_at_position(self, found: _Odometry, *, can_start: bool, is_reset: bool) -> None:
        here = self._world.flight.position
        x, y, z = self._turned(found)
        goal = (x - self._bias[0], y - self._bias[1], z)
        distance = math.dist(goal[:2], here[:2])
        if distance > _FARTHEST:
            return
        if POSITION not in self.fused:
            if can_start:
                self._resets = 0
                self._go_to((x, y, z), found.variances[0])
        elif is_reset:
            self._go_to((x, y, z), found.variances[0])
        elif distance <= _GATE * math.sqrt(found.variances[0] + _STATE_VARIANCE):
            self._weigh(found.variances[0])
            self._use(POSITION)
        elif self._is_late(POSITION):
            self._resets += not self._is_resting
            if self._resets > _MOST_RESETS:
                self._end({POSITION})
            else:
                self._go_to((x, y, z), found.variances[0])

    def _go_to(self, measured: Vector, variance: float) -> None:
        """Begin anew at a measurement. With GPS, only its distance is learned."""
        here = self._world.flight.position
        if self._has_gps:
            self._bias = (measured[0] - here[0], measured[1] - here[1])
        else:
            self._bias = (0.0, 0.0)
            self._reset(measured)
            self._variance, self._variance_time = variance, self._now
        self._use(POSITION)

    def _turned(self, found: _Odometry) -> Vector:
        """Return a position in the frame of the estimate: an FRD frame is turned, unless the estimate is in it."""
        x, y, z = found.position
        if found.frame != FRD or math.isnan(found.yaw) or YAW in self.fused:
            return x, y, z
        turn = self._world.flight.yaw - found.yaw
        return x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn), z

    def _look_at_velocity(self, found: _Odometry, *, can_start: bool) -> None:
        """Compare the speed only, so that the frame does not matter."""
        error = abs(math.hypot(*found.velocity) - math.hypot(*self._world.flight.velocity))
        if error <= _VELOCITY_GATE * math.sqrt(found.variances[1] + _STATE_VARIANCE):
            if VELOCITY in self.fused or can_start:
                self._use(VELOCITY)
        elif VELOCITY in self.fused and self._is_late(VELOCITY):
            self._end({VELOCITY})

    # Places on earth

    def _look_at_place(self, found: _Place) -> None:
        world = self._world
        if not self.is_yaw_aligned:
            return
        if not world.has_origin:
            self._set_origin(found.place)
        self._place_heard = self._now
        north, east, _ = world.origin.local(found.place._replace(altitude=world.origin.altitude))
        is_reset = found.resets != self._place_counter
        self._place_counter = found.resets
        distance = math.dist((north, east), world.flight.position[:2])
        is_only = not self._has_gps and not self.fused & {POSITION}
        is_near = distance <= _PLACE_GATE * math.sqrt(found.variance + _STATE_VARIANCE)
        is_late = self._now - self._used.get(PLACE, 0) >= self._place_patience
        if is_near:
            self._use(PLACE)
        elif is_only and (is_reset or is_late or PLACE not in self.fused):
            self._reset((north, east, world.flight.position[2]))
            self._use(PLACE)
        elif PLACE in self.fused and (is_reset or is_late):
            self._end({PLACE})

    def _set_origin(self, place: Home) -> None:
        """Let the vehicle be at a place without a move in the local frame."""
        world = self._world
        x, y, z = world.flight.position
        altitude = place.altitude + z if Home(altitude=place.altitude).is_possible else world.origin.altitude
        world.origin = place._replace(altitude=altitude).place((-x, -y, 0.0))
        world.has_origin = True

    # The estimate

    def _is_late(self, part: Part) -> bool:
        return self._now - self._used.get(part, -_PATIENCE) >= _PATIENCE

    def _use(self, part: Part) -> None:
        self._used[part] = self._now
        if part not in self.fused:
            self.fused |= {part}
            self.changes += 1

    def _end(self, parts: frozenset[Part] | set[Part]) -> None:
        if self.fused & parts:
            self.is_yaw_aligned |= YAW in parts  # the magnetometer gives the heading again
            self.fused -= parts
            self.changes += 1

    def _weigh(self, variance: float) -> None:
        """Let the variance of the position fall by a measurement."""
        before = self._variance + self._grown
        self._variance, self._variance_time = before * variance / (before + variance), self._now

    def _reset(self, place: Vector) -> None:
        """Let the estimate of the position jump. The vehicle is flown by it, and its height stays."""
        flight = self._world.flight
        x, y, z = flight.position
        self.move = (place[0] - x, place[1] - y)
        flight.position = (place[0], place[1], z)
        self._world.autopilot.shift(*self.move)
        self.position_resets += 1


_FIELDS: Final = ("position", "pose_frame", "velocity", "velocity_frame", "q")


def _noise(variances: Vector, *axes: int) -> float:
    """Return the largest variance of some axes, at least that of the parameters, which count if any is not finite."""
    return max(_LEAST, *(variances[axis] for axis in axes)) if all(map(math.isfinite, variances)) else _LEAST


def _bits(value: float) -> int:
    return int(value) if math.isfinite(value) else 0
