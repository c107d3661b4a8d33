"""The way of each vehicle to a place."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from msggen.flight.errors import NotReachedError, UnsupportedError
from msggen.flight.estimates import checked_estimate, is_estimate, is_landed
from msggen.flight.feeds import ANY_MODE
from msggen.flight.places import Vector, check_within, wrapped
from msggen.flight.rovers import NEAR, to_place
from msggen.flight.sending import Registered
from msggen.flight.setpoints import finite
from msggen.flight.states import is_on_wings, is_rover, title_of
from msggen.flight.wings import Way
from msggen.messages.setpoints import FIXED_WING, GOTO, ROVER_POSITION

_NEAR = 0.5
"""The distance in m at which a multicopter has reached a place."""
_SLOW = 0.5
"""The speed in m/s below which a place is reached."""
_TURNED = math.radians(10)
NO_LIFT = (
    "does not lift a vehicle off the ground: take off first, `await flight.takeoff(5.0)`, or "
    "`await self.takeoff(5.0)` in an executor"
)


class Goto(NamedTuple):
    """The arguments of `Mode.goto`, with the place and the heading in NED."""

    place: Vector
    heading: float | None
    max_speed: float | None
    max_climb: float | None
    max_turn_rate: float | None
    airspeed: float | None
    within: float | None

    def check(self) -> None:
        """Raise ValueError for what no vehicle can fly."""
        finite([] if self.heading is None else [self.heading], "a heading")
        limits = [each for each in (self.max_speed, self.max_climb, self.max_turn_rate) if each is not None]
        if not all(each > 0.0 for each in finite(limits, "limits")):
            raise ValueError(f"expected limits above 0, got {limits}")
        finite([] if self.airspeed is None else [self.airspeed], "an airspeed")
        if self.within is not None:
            check_within(self.within)

    async def run(self, own: Registered, name: str) -> None:
        """Go there, and return when the place is reached. See `Mode.goto`."""
        status = own.feeds["vehicle_status"].latest
        if is_rover(status):
            self._check_takes(status, "max_speed")
            own.fence.check_goto(self.place._replace(z=math.nan))
            await self._drive(own)
            return
        own.fence.check_goto(self.place)
        if is_landed(own.feeds):
            raise NotReachedError(f"{name} is on the ground, and goto {NO_LIFT}")
        if is_on_wings(status):
            self._check_takes(status, "airspeed")
            await self._glide(own)
        else:
            self._check_takes(status, "heading", "max_speed", "max_climb", "max_turn_rate")
            await self._fly(own)

    def _check_takes(self, status: Any, *names: str) -> None:
        """Raise UnsupportedError for an argument that is given and that the vehicle cannot follow."""
        known = {"place", "within", *names}
        wrong = next((name for name, value in self._asdict().items() if value is not None and name not in known), None)
        if wrong is not None:
            how = "in forward flight" if status.is_vtol and is_on_wings(status) else "here"
            raise UnsupportedError(
                f"goto of {title_of(status)} takes no {wrong} {how}: it takes {', '.join([*names, 'within'])}"
            )

    async def _fly(self, own: Registered) -> None:
        yaw, near = self.heading, _NEAR if self.within is None else self.within
        values = {
            "position": self.place,
            "flag_control_heading": yaw is not None,
            "heading": yaw or 0.0,
            "flag_set_max_horizontal_speed": self.max_speed is not None,
            "max_horizontal_speed": self.max_speed or 0.0,
            "flag_set_max_vertical_speed": self.max_climb is not None,
            "max_vertical_speed": self.max_climb or 0.0,
            "flag_set_max_heading_rate": self.max_turn_rate is not None,
            "max_heading_rate": self.max_turn_rate or 0.0,
        }
        own.send_each(GOTO, {GOTO.topic: values})

        def is_reached(estimate: Any) -> bool:
            if is_on_wings(own.feeds["vehicle_status"].latest):
                raise NotReachedError("the flight to a place was not completed: the vehicle flies on its wings now")
            is_near = math.dist((estimate.x, estimate.y, estimate.z), self.place) < near
            is_slow = math.hypot(estimate.vx, estimate.vy, estimate.vz) < _SLOW
            return (
                is_estimate(estimate)
                and is_near
                and is_slow
                and (yaw is None or abs(wrapped(estimate.heading - yaw)) < _TURNED)
            )

        reached = own.feeds["vehicle_local_position"].following(is_reached)
        await own.feeds.within(ANY_MODE, reached, "the flight to a place", may_land=False)

    async def _glide(self, own: Registered) -> None:
        airspeed = math.nan if self.airspeed is None else self.airspeed
        way = Way(own.feeds, self.place, airspeed=airspeed, within=self.within)
        own.guide(FIXED_WING, way)
        reached = own.feeds["vehicle_local_position"].following(way.is_reached)
        await own.feeds.within(ANY_MODE, reached, "the flight to a place", may_land=False)

    async def _drive(self, own: Registered) -> None:
        near = NEAR if self.within is None else self.within
        own.send_each(ROVER_POSITION, to_place(checked_estimate(own.feeds), self.place, self.max_speed))

        def is_reached(estimate: Any) -> bool:
            is_near = math.dist((estimate.x, estimate.y), self.place[:2]) < near
            return is_estimate(estimate) and is_near and math.hypot(estimate.vx, estimate.vy) < _SLOW

        reached = own.feeds["vehicle_local_position"].following(is_reached)
        await own.feeds.within(ANY_MODE, reached, "the drive to a place")
