"""The estimator of a simulated vehicle, as far as measurements of programs go: when EKF2 fuses them, and what follows.

There is no filter: a measurement is compared with where the vehicle is. The rules are those of `msggen.messages.
measurements`, and the times were measured with PX4 v1.18. Times are in us.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

from msggen.messages.measurements import (
    BODY_FRD,
    FRD,
    GATES,
    GLOBAL,
    HEIGHT,
    LOCAL,
    LONGEST_START,
    NEAREST,
    OLDEST,
    PLACE,
    POSITION,
    STARTING,
    VELOCITY,
    YAW,
    Part,
)
from msggen.sim.attitude import Vector, added, from_body
from msggen.sim.commander.rules import Rules
from msggen.sim.external_inputs import Odometry, Pilot, Place, bits, is_on, odometry_of, place_of, turned_by
from msggen.sim.flight import Flight, wrapped
from msggen.sim.places import Home

_BEHIND = 150_000
"""How far the estimate lags behind: a measurement waits as long, so that late ones are used in their turn."""
_OLDEST, _NEAREST, _LONGEST_START = (round(each * 1e6) for each in (OLDEST, NEAREST, LONGEST_START))
_STOPPED, _PLACE_STOPPED = 500_000, 5_000_000
"""The time without measurements after which they count as ended, in the local frame and on earth."""
_PATIENCE, _HEIGHT_PATIENCE = 1_000_000, 5_000_000
"""The time for which measurements are rejected until EKF2 begins anew at them: no_aid_timeout_max, and that of heights,
hgt_fusion_timeout_max."""
_LOST = 4_600_000
"""The time after the last measurement when the position is no longer known."""
_MOST_RESETS = 5
"""In the air, since the measurements were last taken anew."""
EPV, EVH, EVV, HEADING_VARIANCE = 0.05, 0.13, 0.03, 0.0006
"""The accuracy of height and velocity in m and m/s, and the variance of the heading, as VehicleLocalPosition tells."""
_OWN: Final[Mapping[Part, float]] = {HEIGHT: EPV**2, VELOCITY: max(EVH**2 / 2, EVV**2), YAW: HEADING_VARIANCE}
"""The variances of the estimate along each axis. That of the position changes."""
_LEAST: Final = GATES[POSITION].least ** 2
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
_BY_CAMERA = 3
"""The value of EKF2_HGT_REF with which local measurements decide the height."""


class External:
    """Takes measurements. `handlers` are by the names of topics in uORB."""

    def __init__(self, flight: Flight, pilot: Pilot, parameters: Mapping[str, float], rules: Rules) -> None:
        """Take the motion, the pilot, the parameters and the rules of the vehicle."""
        self._flight, self._pilot = flight, pilot
        self._parameters, self._place_patience = parameters, rules.auxiliary_patience
        self._control = bits(parameters.get("EKF2_EV_CTRL", 0.0))
        self._least_quality = bits(parameters["EKF2_EV_QMIN"])
        self._delay = bits(parameters["EKF2_EV_DELAY"] * 1e3)
        self._is_reference = parameters["EKF2_HGT_REF"] == _BY_CAMERA
        self.uses_gps = bool(bits(parameters["EKF2_GPS_CTRL"]) & 1)
        self.fused: frozenset[Part] = frozenset()
        """The parts that are fused."""
        self.changes = self.position_resets = self.height_resets = self.heading_resets = 0
        """How often `fused` has changed, and position, height and heading were reset."""
        self.move = (0.0, 0.0)
        """How far the last reset has moved the position, in m north and east."""
        self.drop: float | None = None
        """The same of the height, down."""
        self.rejects_yaw = False
        """Whether the last heading was too far from the estimate."""
        self.is_aided = True
        """Whether something has made the position known within the last second."""
        self.is_yaw_aligned = True
        """Whether the heading is from north, and not that of an FRD frame."""
        self.handlers: Mapping[str, Callable[[Any, int], object]] = {LOCAL: self.take, GLOBAL: self.take_place}
        """Each takes a message, whose times are since boot. Only that of the measurement counts."""
        self._now, self._is_resting, self._has_gps = 0, True, True
        self._waiting: deque[Odometry] = deque(maxlen=_KEPT)
        self._places: deque[Place] = deque(maxlen=_KEPT)
        self._newest = self._before = -_STOPPED
        """The times of the newest measurement, and of the last one that was used."""
        self._place_heard = 0
        self._counter = self._place_counter = 0
        self._used: dict[Part, int] = {}
        """When each part was fused last."""
        self._resets: dict[Part, int] = {}
        self._can_start = self._is_reset = False
        """Whether a part may begin with the measurement that is looked at, and whether its source has jumped."""
        self._bias = (0.0, 0.0)
        """How far measurements are from the position while GPS decides it."""
        self._height_bias = 0.0
        """The same of the height."""
        self._variance: float = _LEAST
        self._variance_time = 0

    # What arrives

    def take(self, message: Any, _: int) -> None:
        """Take a VehicleOdometry."""
        time = message.timestamp_sample - self._delay
        if time < self._newest + _NEAREST:
            return
        self._newest = time
        self._waiting.append(odometry_of(message, time, self._control))

    def take_place(self, message: Any, _: int) -> None:
        """Take a VehicleGlobalPosition or, from v1.18 on, an AuxGlobalPosition."""
        found = place_of(message)
        if found is not None and is_on(self._parameters, getattr(message, "id", None)):
            self._places.append(found)

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
                self._go(0.0, 0.0)  # EKF2 holds the place where it stands
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
            "reject_yaw": self.rejects_yaw,
        }

    # Positions, velocities and headings in the local frame

    def _look(self, found: Odometry) -> None:
        self._is_reset = found.resets != self._counter
        if self._least_quality > 0 and found.quality < self._least_quality:
            if self._is_reset:
                self._end(self.fused - {PLACE})
            return
        self._can_start = found.time - self._before < _LONGEST_START
        self._before, self._counter = found.time, found.resets
        self._end(self.fused - found.parts - {PLACE})
        looks = ((YAW, self._look_at_yaw), (VELOCITY, self._look_at_velocity), (POSITION, self._look_at_position))
        for part, look in (*looks, (HEIGHT, self._look_at_height)):
            if part in found.parts:
                look(found)

    def _judge(self, part: Part, begin: Callable[[], None], *, is_near: bool, may_start: bool = True) -> None:
        """Use a measurement of a part, reject it, or begin anew at it: at its start, and when its source has jumped."""
        if part not in self.fused:
            if self._can_start and may_start:
                self._resets[part] = 0
                begin()
                self._use(part)
        elif self._is_reset:
            begin()
            self._use(part)
        elif is_near:
            self._use(part)
        elif self._now - self._used[part] >= (_HEIGHT_PATIENCE if part is HEIGHT else _PATIENCE):
            self._resets[part] += not self._is_resting
            if part is HEIGHT or self._resets[part] > _MOST_RESETS:
                self._end({part})
            else:
                begin()
                self._use(part)

    def _width(self, part: Part, variance: float) -> float:
        own = self._own_variance if part in {POSITION, PLACE} else _OWN[part]
        return GATES[part].width(variance, own)

    def _then(self, time: int) -> tuple[Vector, Vector, float]:
        """Return position, velocity and heading at the time of a measurement."""
        flight, behind = self._flight, (self._now - time) / 1e6
        position = tuple(here - each * behind for here, each in zip(flight.position, flight.velocity, strict=True))
        velocity = tuple(
            each - change * behind for each, change in zip(flight.velocity, flight.acceleration, strict=True)
        )
        return position, velocity, flight.yaw - flight.rates[2] * behind  # type: ignore[return-value]

    def _look_at_yaw(self, found: Odometry) -> None:
        is_turned = found.frame == FRD
        if is_turned and self._has_gps and self.is_yaw_aligned:
            self._end({YAW})
            return
        error = wrapped(found.yaw - self._then(found.time)[2])
        is_near = abs(error) <= self._width(YAW, found.variances[YAW])
        self.rejects_yaw = not is_near

        def begin() -> None:
            if is_turned or not (is_near and self.is_yaw_aligned):
                self._flight.yaw += error
                self.heading_resets += 1
            if YAW not in self.fused:  # what begins in FRD turns the estimate into that frame
                self.is_yaw_aligned = not is_turned

        is_free = is_near or is_turned or self._is_resting or not self.is_yaw_aligned
        self._judge(YAW, begin, is_near=is_near, may_start=is_free)

    def _look_at_position(self, found: Odometry) -> None:
        if found.frame != FRD and not self.is_yaw_aligned:
            self._end({POSITION})
            return
        here = self._then(found.time)[0]
        x, y, _ = self._from_level(found.position, found) if found.frame == FRD else found.position
        off = x - self._bias[0] - here[0], y - self._bias[1] - here[1]
        if math.hypot(*off) > _FARTHEST:
            return
        is_near = max(map(abs, off)) <= self._width(POSITION, found.variances[POSITION])
        if is_near and POSITION in self.fused and not self._is_reset:
            self._weigh(found.variances[POSITION])

        def begin() -> None:
            """Begin anew at a measurement. With GPS, only its distance is learned."""
            if self._has_gps:
                self._bias = x - here[0], y - here[1]
            else:
                self._bias = 0.0, 0.0
                self._go(x - here[0], y - here[1])
                self._variance, self._variance_time = found.variances[POSITION], self._now

        self._judge(POSITION, begin, is_near=is_near)

    def _look_at_height(self, found: Odometry) -> None:
        """Only the reference moves the estimate. The distance of other heights is learned."""
        down, here = found.position[2], self._then(found.time)[0][2]
        off = down - self._height_bias - here
        if abs(off) > _FARTHEST:
            return

        def begin() -> None:
            self._height_bias = 0.0 if self._is_reference else down - here
            if self._is_reference:
                self._drop(down - here)

        self._judge(HEIGHT, begin, is_near=abs(off) <= self._width(HEIGHT, found.variances[HEIGHT]))

    def _from_level(self, vector: Vector, found: Odometry) -> Vector:
        """Turn a vector of an FRD frame, unless the estimate is in it."""
        if math.isnan(found.yaw) or YAW in self.fused:
            return vector
        return turned_by(vector, self._flight.yaw - found.yaw)

    def _look_at_velocity(self, found: Odometry) -> None:
        flight, has_others = self._flight, self._has_gps or bool(self.fused & {POSITION, PLACE})
        if found.velocity_frame == BODY_FRD:
            velocity = from_body(flight.quaternion, found.velocity)
        elif found.velocity_frame == FRD:
            velocity = self._from_level(found.velocity, found)
        elif self.is_yaw_aligned:
            velocity = found.velocity
        else:
            self._end({VELOCITY})
            return
        own = self._then(found.time)[1]
        off = max(abs(there - here) for there, here in zip(velocity, own, strict=True))
        width = self._width(VELOCITY, found.variances[VELOCITY])

        def begin() -> None:
            if not has_others and not self._is_resting:
                flight.velocity = velocity

        may_start = not has_others or off <= width * STARTING
        self._judge(VELOCITY, begin, is_near=off <= width, may_start=may_start)

    # Places on earth

    def _look_at_place(self, found: Place) -> None:
        if not self.is_yaw_aligned:
            return
        if not self._flight.has_origin:
            self._set_origin(found.place)
        self._place_heard, origin = self._now, self._flight.origin
        north, east, _ = origin.local(found.place._replace(altitude=origin.altitude))
        is_reset = found.resets != self._place_counter
        self._place_counter = found.resets
        here, width = self._then(found.time)[0], self._width(PLACE, found.variance)
        is_near = max(abs(north - here[0]), abs(east - here[1])) <= width
        is_free = not self._place_patience or not (self._has_gps or POSITION in self.fused)
        is_late = self._now - self._used.get(PLACE, 0) >= self._place_patience
        if is_near:
            self._use(PLACE)
        elif is_free and (is_reset or is_late or PLACE not in self.fused):
            self._go(north - here[0], east - here[1])
            self._use(PLACE)
        elif PLACE in self.fused and (is_reset or is_late):
            self._end({PLACE})

    def _set_origin(self, place: Home) -> None:
        """Let the vehicle be at a place without a move in the local frame."""
        flight = self._flight
        x, y, z = flight.position
        altitude = place.altitude + z if Home(altitude=place.altitude).is_possible else flight.origin.altitude
        flight.origin, flight.has_origin = place._replace(altitude=altitude).place((-x, -y, 0.0)), True

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
            self.rejects_yaw &= YAW not in parts
            self.fused -= parts
            self.changes += 1

    def _weigh(self, variance: float) -> None:
        """Let the variance of the position fall by a measurement."""
        before = self._variance + self._grown
        self._variance, self._variance_time = before * variance / (before + variance), self._now

    @property
    def _own_variance(self) -> float:
        """The variance of the position along an axis."""
        return self.accuracy * self.accuracy / 2.0

    def _go(self, north: float, east: float) -> None:
        """Let the estimate of the position jump. The vehicle is flown by it."""
        self.move = north, east
        self.position_resets += 1
        self._shift((north, east, 0.0))

    def _drop(self, down: float) -> None:
        """Let that of the height jump. The ground moves with it."""
        self.drop = down
        self.height_resets += 1
        self._flight.ground += down
        self._shift((0.0, 0.0, down))

    def _shift(self, move: Vector) -> None:
        self._flight.position = added(self._flight.position, move)
        self._pilot.shift(move)
