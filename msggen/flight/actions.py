"""What a vehicle is told to do, each of which returns when it is done: arm, take off, land, return, select a mode.

They are commands of a user, or of an executor.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any, Final

from msggen.flight import commands
from msggen.flight.commands import Commands
from msggen.flight.errors import FlightError, NoAnswerError, NotReachedError
from msggen.flight.feeds import Feeds

RETURN, HOLD, TAKEOFF, LAND = 5, 4, 17, 18
"""NAVIGATION_STATE_* of VehicleStatus."""
_MODES: Final = {
    "manual": 0,
    "altitude": 1,
    "position": 2,
    "mission": 3,
    "hold": HOLD,
    "return": RETURN,
    "descend": 12,
    "offboard": 14,
    "stabilized": 15,
    "takeoff": TAKEOFF,
    "land": LAND,
}
_ENTERED = 1.0
"""The time in s within which a vehicle shows what it has accepted: PX4 publishes its status at 2 Hz or more."""
_GRACE = 0.5
"""The time in s for which the end of a mode can be told after the mode was left."""
_NEAR = 1.0
"""The distance in m within which a place by latitude and longitude is reached."""
_SLOW = 0.5
_EARTH_RADIUS = 6_371_000.0


class Actions:
    """Actions of a user, or of the executor of an id."""

    def __init__(self, sender: Commands, feeds: Feeds, executor: int = 0) -> None:
        self._commands, self._feeds, self._executor = sender, feeds, executor

    async def arm(self) -> None:
        """Arm. Raises RefusedError with what the vehicle shows, and NoAnswerError."""
        await self._send(commands.ARM_DISARM, 1.0, what="arm")
        await self._until(lambda status: bool(status.arming_state == status.ARMING_STATE_ARMED), "armed")

    async def disarm(self) -> None:
        """Disarm on the ground. Raises RefusedError in the air, and NoAnswerError."""
        await self._send(commands.ARM_DISARM, 0.0, what="disarm")
        await self._until(lambda status: bool(status.arming_state != status.ARMING_STATE_ARMED), "disarmed")

    async def takeoff(self, altitude: float | None = None) -> None:
        """Take off, and return when the altitude is reached: in m above the start, by default MIS_TAKEOFF_ALT.

        The vehicle has to be armed, or it waits until it is. Raises RefusedError, NoAnswerError and NotReachedError.
        """
        above_sea = math.nan if altitude is None else await self._sea_level() + altitude
        await self._send(commands.TAKEOFF, *[math.nan] * 6, above_sea, what="take off")
        await self._completed(TAKEOFF, "the takeoff")

    async def land(self) -> None:
        """Land where the vehicle is, and return when it has landed. It disarms 2 s later (COM_DISARM_LAND).

        Raises RefusedError, NoAnswerError and NotReachedError.
        """
        await self._send(commands.LAND, what="land")
        await self._completed(LAND, "the landing")

    async def return_home(self) -> None:
        """Return to the home position, and return from here when the vehicle has landed there.

        Raises RefusedError, NoAnswerError and NotReachedError.
        """
        await self._send(commands.RETURN, what="return")
        await self._completed(RETURN, "the return")

    async def hold(self) -> None:
        """Let PX4 hold the vehicle where it is. Raises RefusedError and NoAnswerError."""
        await self.set_mode("hold")

    async def set_mode(self, mode: str | int) -> None:
        """Select a mode by its name, such as `hold` or `position`, or by its nav_state. Raises RefusedError.

        Raises ValueError for an unknown name, NoAnswerError, and FlightError if the mode is not entered.
        """
        number = _MODES.get(mode.lower()) if isinstance(mode, str) else mode
        if number is None:
            raise ValueError(f"expected one of the modes {', '.join(_MODES)}, or a nav_state, got {mode!r}")
        await self._send(commands.SET_NAV_STATE, float(number), what=f"mode {mode}")
        await self._until(lambda status: bool(status.nav_state_user_intention == number), f"in mode {mode}")

    async def goto(
        self, latitude: float, longitude: float, altitude: float | None = None, *, heading_deg: float = math.nan
    ) -> None:
        """Fly to a place in Hold mode, and return when it is reached: nearer than 1 m, slower than 0.5 m/s.

        Latitude and longitude are in degrees, the altitude in m above mean sea level, by default the present one.
        Raises RefusedError, NoAnswerError, and NotReachedError if another mode is selected on the way.
        """
        above_sea = math.nan if altitude is None else altitude
        values = -1.0, 1.0, math.nan, math.radians(heading_deg), latitude, longitude, above_sea
        await self._send(commands.REPOSITION, *values, what="go to a place")
        reached = self._feeds["vehicle_global_position"].following(
            lambda place: _is_near(place, latitude, longitude, altitude)
        )
        await self._before_left(HOLD, reached, "the flight to a place")
        slow = self._feeds["vehicle_local_position"].following(lambda each: math.hypot(each.vx, each.vy) < _SLOW)
        await self._before_left(HOLD, slow, "the flight to a place")

    async def wait_armed(self) -> None:
        """Wait until the vehicle is armed."""
        await self._feeds["vehicle_status"].wait(lambda status: bool(status.arming_state == status.ARMING_STATE_ARMED))

    async def wait_disarmed(self) -> None:
        """Wait until the vehicle is disarmed."""
        await self._feeds["vehicle_status"].wait(lambda status: bool(status.arming_state != status.ARMING_STATE_ARMED))

    # inside

    async def _send(self, command: int, *parameters: float, what: str) -> None:
        await self._commands.send(command, *parameters, executor=self._executor, what=what)

    async def _until(self, condition: Callable[[Any], bool], what: str) -> None:
        try:
            await self._feeds["vehicle_status"].wait(condition, _ENTERED)
        except TimeoutError:
            raise FlightError(f"the vehicle has accepted the command, but is not {what} after {_ENTERED:g} s") from None

    async def _completed(self, mode: int, what: str) -> None:
        """Wait until a mode of PX4 has reached its end. Messages from before it was entered do not count."""
        await self._until(lambda status: bool(status.nav_state == mode), f"in mode {mode}")
        completed = self._feeds["mode_completed"].following(lambda each: bool(each.nav_state == mode))
        found = await self._before_left(mode, completed, what)
        if found.result:
            raise NotReachedError(f"{what} has ended with result {found.result} of ModeCompleted")

    async def _before_left(self, mode: int, waiting: Any, what: str) -> Any:
        """Return what comes, unless the vehicle leaves a mode before. Raises NotReachedError then."""
        goal = asyncio.ensure_future(waiting)
        left = asyncio.ensure_future(
            self._feeds["vehicle_status"].following(lambda status: bool(status.nav_state != mode))
        )
        try:
            await asyncio.wait([goal, left], return_when=asyncio.FIRST_COMPLETED)
            if not goal.done():
                await asyncio.wait([goal], timeout=_GRACE)
            if not goal.done():
                raise NotReachedError(f"{what} has not ended: the vehicle is in mode {left.result().nav_state}")
            return goal.result()
        finally:
            for each in (goal, left):
                each.cancel()
            await asyncio.gather(goal, left, return_exceptions=True)

    async def _sea_level(self) -> float:
        """Return the altitude of the origin of the local frame above mean sea level in m."""
        try:
            found = await self._feeds["vehicle_local_position"].wait(lambda each: bool(each.z_global), _ENTERED)
        except TimeoutError:
            raise NoAnswerError("the vehicle does not know its altitude above sea level") from None
        return float(found.ref_alt)


def _is_near(place: Any, latitude: float, longitude: float, altitude: float | None) -> bool:
    north = math.radians(place.lat - latitude) * _EARTH_RADIUS
    east = math.radians(place.lon - longitude) * _EARTH_RADIUS * math.cos(math.radians(latitude))
    up = 0.0 if altitude is None else place.alt - altitude
    return math.hypot(north, east, up) < _NEAR
