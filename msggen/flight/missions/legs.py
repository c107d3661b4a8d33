"""The mode of a mission: it flies from waypoint to waypoint."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

from msggen.flight.checks import GLOBAL_POSITION, Problem
from msggen.flight.errors import LimitError, NoAnswerError
from msggen.flight.estimates import is_landed
from msggen.flight.feeds import Feeds, first
from msggen.flight.missions.plan import Settings
from msggen.flight.mode import Mode
from msggen.flight.places import GlobalPlace, Vector, local_place, wrapped
from msggen.flight.states import is_on_wings, is_rover, types_of
from msggen.messages import earth
from msggen.messages.setpoints import FIXED_WING, GOTO, ROVER_POSITION, TRAJECTORY, Kind

_PASSED, _REACHED = 2.0, 1.0
"""The distances in m within which a waypoint is reached, if the vehicle goes on or stops there."""
_NO_COURSE = 0.1
"""The horizontal distance in m to a waypoint below which the direction to it says nothing."""
_TURNED = math.radians(3)
"""The change of the direction to a waypoint after which the vehicle is turned."""


_KINDS = (GOTO, TRAJECTORY, FIXED_WING, ROVER_POSITION)
"""By which vehicles go to places. Trajectory is for transitions of a VTOL."""


class Segment(NamedTuple):
    """Waypoints to fly to, one after the other."""

    places: Sequence[GlobalPlace]
    settings: Settings
    stops: bool
    """Whether the vehicle stops at the last one."""
    reached: Callable[[int], None]
    """Called with the number of each waypoint that is reached."""


class MissionMode(Mode):
    """Flies to the waypoints of a segment, which the executor of the mission sets."""

    requires = GLOBAL_POSITION
    segment: Segment
    unready: Callable[[], Sequence[str]]
    """Returns why the mission cannot be flown, as texts."""

    def meet(self, status: Any, takes: Callable[[Kind], bool]) -> None:
        """Declare the setpoints by which the vehicle goes to places: before v1.17, a VTOL hovers."""
        if status is not None:
            followed = [kind for kind in _KINDS if not types_of(status).isdisjoint(kind.followed_by)]
            vars(self)["setpoints"] = tuple(filter(takes, followed)) or tuple(followed)  # an error names the release

    @property
    def is_driving(self) -> bool:
        """Whether the vehicle is a rover, as far as that is known."""
        return self.is_registered and self.feeds.shows(is_rover)

    @property
    def is_on_ground(self) -> bool:
        """Whether the vehicle is on the ground, as far as that is known."""
        return self.is_registered and is_landed(self.feeds)

    @property
    def feeds(self) -> Feeds:
        """The messages of the vehicle."""
        return self._own.feeds

    def problems(self) -> list[Problem]:
        """Let PX4 not enter the mode while the mission cannot be flown."""
        reasons = self.unready()
        return [Problem("mission_not_ready", text=", ".join(reasons))] if reasons else []

    def beyond(self, places: Iterable[tuple[int, float, float, float]]) -> list[str]:
        """Return which items have places that `goto` would refuse, as texts.

        A place is the index of its item, the latitude, the longitude and the altitude, NaN for any. Nothing is found
        while the vehicle does not know where it is.
        """
        here = self.feeds["vehicle_local_position"].latest if self.is_registered else None
        found: list[str] = []
        if here is None or not (here.xy_global and here.z_global):
            return found
        for index, latitude, longitude, altitude in places:
            north, east = earth.local((here.ref_lat, here.ref_lon), latitude, longitude)
            down = math.nan if is_rover(self._status) else here.ref_alt - altitude
            try:
                self._own.fence.check_goto(Vector(north, east, down))
            except LimitError as error:
                found.append(f"item {index} is {error}")
            except NoAnswerError:  # there is no home position yet
                break
        return found

    def unfit(self, speeds: Iterable[float | None]) -> list[str]:
        """Return which speeds between waypoints the vehicle does not have, as texts."""
        is_known = self.is_registered and self._status is not None
        found: list[str] = []
        for speed in (each for each in speeds if is_known and each is not None):
            try:
                if is_on_wings(self._status):
                    self._own.fence.ranges.check({FIXED_WING.topics[1]: {"equivalent_airspeed": speed}})
                elif is_rover(self._status):
                    self._own.fence.ranges.check({ROVER_POSITION.topic: {"cruising_speed": speed}})
            except ValueError as error:
                found.append(f"horizontalVelocity: {error}")
        return found

    async def fly(self) -> None:
        """Fly the segment."""
        places, settings, stops, reached = self.segment
        for number, place in enumerate(places):
            is_end = stops and number == len(places) - 1
            await self._fly_to(place, settings, _REACHED if is_end else _PASSED)
            reached(number)

    async def _fly_to(self, place: GlobalPlace, settings: Settings, within: float) -> None:
        """Go to a place, and return when it is near. A vehicle that can turn on the spot faces the place."""
        if is_on_wings(self._status):  # it arrives by a radius of its own
            await self.goto(place, airspeed=settings.horizontal_velocity)
            return
        goal = await local_place(self.feeds, place, "ned")
        limits: dict[str, Any] = {"max_speed": settings.horizontal_velocity}
        is_level, rate = is_rover(self._status), settings.max_heading_rate
        turns = not is_level and rate != 0.0
        if not is_level:
            limits["max_climb"] = settings.vertical_velocity
        if turns and rate is not None:
            limits["max_turn_rate"] = math.radians(rate)
        while True:
            heading = course(await self.position(), goal) if turns else None
            arriving = self.feeds["vehicle_local_position"].following(
                partial(_is_due, goal, within, heading, is_level=is_level, turns=turns)
            )
            await first(self.goto(place, heading=heading, within=within, **limits), arriving)
            if _apart(await self.position(), goal, is_level=is_level) < within:
                return

    @property
    def _status(self) -> Any:
        return self.feeds["vehicle_status"].latest


def course(here: Vector, goal: Vector) -> float | None:
    """Return the heading in rad from one place to another, None if they are above each other."""
    north, east = goal.x - here.x, goal.y - here.y
    return math.atan2(east, north) if math.hypot(north, east) > _NO_COURSE else None


def _is_due(  # noqa: PLR0913 - a place, and what counts
    goal: Vector,
    within: float,
    heading: float | None,
    estimate: Any,
    *,
    is_level: bool = False,
    turns: bool = True,
) -> bool:
    """Whether a VehicleLocalPosition is near a place, or shows it in another direction than `heading`.

    With `is_level`, the height does not count. The direction does only if the vehicle `turns`.
    """
    here = Vector(estimate.x, estimate.y, estimate.z)
    now = course(here, goal) if turns else None
    if _apart(here, goal, is_level=is_level) < within:
        return True
    return now != heading if now is None or heading is None else abs(wrapped(now - heading)) > _TURNED


def _apart(one: Vector, other: Vector, *, is_level: bool) -> float:
    return math.dist(one[:2], other[:2]) if is_level else one.distance(other)
