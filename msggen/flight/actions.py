"""Actions of a vehicle: arm, take off, land, return, select a mode. Each returns when it is done.

They are sent as commands of a user or of an executor.
"""

from __future__ import annotations

import asyncio
import math
from contextlib import suppress
from typing import Any, Final

from msggen.flight import commands
from msggen.flight.commands import Commands
from msggen.flight.errors import FlightError, LimitError, NoAnswerError, NotReachedError
from msggen.flight.feeds import Condition, Feeds
from msggen.flight.limits import Fence
from msggen.flight.setpoints import finite

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
_ENTERED = 3.0
"""The time in s within which the status shows the effect of a command: PX4 publishes it at 2 Hz or more."""
_KNOWN = 1.0
"""The time in s to wait for the altitude of the vehicle."""
_GRACE = 0.5
"""The time in s for which the completion of a mode can still arrive after the mode was left."""
_NEAR = 1.0
"""The distance in m within which a place by latitude and longitude is reached."""
_SLOW = 0.5
_EARTH_RADIUS = 6_371_000.0


class Actions:
    """Actions of a user, or of the executor with an id."""

    def __init__(self, sender: Commands, feeds: Feeds, executor: int = 0, fence: Fence | None = None) -> None:
        self._commands, self._feeds, self._executor = sender, feeds, executor
        self._fence = Fence(feeds) if fence is None else fence

    async def arm(self) -> None:
        """Arm. Raises RefusedError with the reasons that the vehicle reports, and NoAnswerError."""
        await self._send(commands.ARM_DISARM, 1.0, 0.0, what="arm", shown=_is_armed)
        await self._until(_is_armed, "armed")

    async def disarm(self) -> None:
        """Disarm on the ground. Raises RefusedError in the air, and NoAnswerError."""
        await self._send(commands.ARM_DISARM, 0.0, 0.0, what="disarm", shown=_is_disarmed)
        await self._until(_is_disarmed, "disarmed")

    async def takeoff(self, altitude: float | None = None) -> None:
        """Take off, and return when the altitude is reached. It is in m above the start, by default MIS_TAKEOFF_ALT.

        A vehicle that is not armed takes off once it is armed. Raises RefusedError, NoAnswerError, NotReachedError, and
        LimitError.
        """
        if altitude is not None and not finite([altitude], "an altitude")[0] > 0.0:
            raise ValueError(f"expected an altitude above the start, got {altitude:g} m")
        await self._check_takeoff(altitude)
        above_sea = math.nan if altitude is None else await self._sea_level() + altitude
        await self._send(commands.TAKEOFF, *[math.nan] * 6, above_sea, what="take off", shown=_is_in(TAKEOFF))
        await self._completed(TAKEOFF, "the takeoff")

    async def land(self) -> None:
        """Land where the vehicle is, and return when it has landed. It disarms 2 s later (COM_DISARM_LAND).

        Raises RefusedError, NoAnswerError and NotReachedError.
        """
        await self._send(commands.LAND, what="land", shown=_is_in(LAND))
        await self._completed(LAND, "the landing")

    async def return_home(self) -> None:
        """Fly to the home position and land. The call ends when the vehicle has landed.

        Raises RefusedError, NoAnswerError and NotReachedError.
        """
        await self._send(commands.RETURN, what="return", shown=_is_in(RETURN))
        await self._completed(RETURN, "the return")

    async def hold(self) -> None:
        """Let PX4 hold the vehicle where it is. Raises RefusedError and NoAnswerError."""
        await self.set_mode("hold")

    async def set_mode(self, mode: str | int) -> None:
        """Select a mode by its name, such as `hold` or `position`, or by its nav_state.

        Raises ValueError for an unknown name, RefusedError, NoAnswerError, and FlightError if the mode is not entered.
        """
        number = _MODES.get(mode.lower()) if isinstance(mode, str) else mode
        if number is None:
            raise ValueError(f"expected one of the modes {', '.join(_MODES)}, or a nav_state, got {mode!r}")

        def is_selected(status: Any) -> bool:
            return bool(status.nav_state_user_intention == number)

        await self._send(commands.SET_NAV_STATE, float(number), what=f"mode {mode}", shown=is_selected)
        await self._until(is_selected, f"in mode {mode}")

    async def goto(
        self, latitude: float, longitude: float, altitude: float | None = None, *, heading_deg: float = math.nan
    ) -> None:
        """Fly to a place in Hold mode, and return when it is reached: nearer than 1 m, slower than 0.5 m/s.

        Latitude and longitude are in degrees, the altitude in m above mean sea level, by default the current one.
        Raises RefusedError, NoAnswerError, NotReachedError if another mode is selected on the way, and LimitError.
        """
        _place(latitude, longitude, altitude or 0.0)
        await self._check_place(latitude, longitude, altitude)
        above_sea = math.nan if altitude is None else altitude
        values = -1.0, 1.0, math.nan, math.radians(heading_deg), latitude, longitude, above_sea
        await self._send(commands.REPOSITION, *values, what="go to a place")
        reached = self._feeds["vehicle_global_position"].following(
            lambda place: _is_near(place, latitude, longitude, altitude)
        )
        await self._before_left(HOLD, reached, "the flight to a place")
        slow = self._feeds["vehicle_local_position"].following(lambda each: math.hypot(each.vx, each.vy) < _SLOW)
        await self._before_left(HOLD, slow, "the flight to a place")

    async def set_home(
        self, latitude: float | None = None, longitude: float | None = None, altitude: float | None = None
    ) -> None:
        """Set the home position: to where the vehicle is, or to a place in degrees and in m above mean sea level.

        Raises ValueError, RefusedError and NoAnswerError.
        """
        place = [each for each in (latitude, longitude, altitude) if each is not None]
        if not place:
            await self._send(commands.SET_HOME, 1.0, what="set the home position")
        elif len(place) < 3:  # noqa: PLR2004 - latitude, longitude, altitude
            raise ValueError("expected latitude, longitude and altitude, or none of them")
        else:
            _place(*place)
            await self._send(commands.SET_HOME, 0.0, *[math.nan] * 3, *place, what="set the home position")

    async def set_origin(self, latitude: float, longitude: float, altitude: float) -> None:
        """Set the origin of the local frame, for a vehicle without a global position.

        The origin is in degrees and in m above mean sea level. Raises ValueError, RefusedError and NoAnswerError.
        """
        _place(latitude, longitude, altitude)
        place = latitude, longitude, altitude
        await self._send(commands.SET_ORIGIN, *[math.nan] * 4, *place, what="set the origin")

    async def wait_armed(self) -> None:
        """Wait until the vehicle is armed."""
        await self._feeds["vehicle_status"].wait(_is_armed)

    async def wait_disarmed(self) -> None:
        """Wait until the vehicle is disarmed."""
        await self._feeds["vehicle_status"].wait(_is_disarmed)

    async def wait_for_status(self, condition: Condition, seconds: float) -> None:
        """Wait until a VehicleStatus meets a condition. Raises TimeoutError."""
        await self._feeds["vehicle_status"].wait(condition, seconds)

    # inside

    async def _send(self, command: int, *parameters: float, what: str, shown: Condition | None = None) -> None:
        await self._commands.send(command, *parameters, executor=self._executor, what=what, shown=shown)

    async def _until(self, condition: Condition, what: str) -> None:
        try:
            await self._feeds["vehicle_status"].wait(condition, _ENTERED)
        except TimeoutError:
            raise FlightError(f"the vehicle has accepted the command, but is not {what} after {_ENTERED:g} s") from None

    async def _completed(self, mode: int, what: str) -> None:
        """Wait until a mode of PX4 is completed. Messages from before the mode was entered do not count."""
        await self._until(_is_in(mode), f"in mode {mode}")
        completed = self._feeds["mode_completed"].following(lambda each: bool(each.nav_state == mode))
        found = await self._before_left(mode, completed, what)
        if found.result:
            raise NotReachedError(f"{what} has failed: ModeCompleted has result {found.result}")

    async def _before_left(self, mode: int, waiting: Any, what: str) -> Any:
        """Return the awaited message. Raises NotReachedError if the vehicle leaves a mode first."""
        goal = asyncio.ensure_future(waiting)
        left = asyncio.ensure_future(
            self._feeds["vehicle_status"].following(lambda status: bool(status.nav_state != mode))
        )
        try:
            await asyncio.wait([goal, left], return_when=asyncio.FIRST_COMPLETED)
            if not goal.done():
                await asyncio.wait([goal], timeout=_GRACE)
            if not goal.done():
                raise NotReachedError(f"{what} was not completed: the vehicle is in mode {left.result().nav_state}")
            return goal.result()
        finally:
            for each in (goal, left):
                each.cancel()
            await asyncio.gather(goal, left, return_exceptions=True)

    async def _check_takeoff(self, altitude: float | None) -> None:
        if math.isinf(self._fence.limits.height):
            return
        if altitude is None:
            raise LimitError("with a limit on the height, takeoff needs an altitude: MIS_TAKEOFF_ALT is not known")
        await self._wait_for_home()
        self._fence.check_place((math.nan, math.nan, -altitude))

    async def _check_place(self, latitude: float, longitude: float, altitude: float | None) -> None:
        if self._fence.limits.is_open:
            return
        await self._wait_for_home()
        origin = await self._origin()
        north = math.radians(latitude - origin.ref_lat) * _EARTH_RADIUS
        east = math.radians(longitude - origin.ref_lon) * _EARTH_RADIUS * math.cos(math.radians(origin.ref_lat))
        self._fence.check_place((north, east, math.nan if altitude is None else origin.ref_alt - altitude))

    async def _wait_for_home(self) -> None:
        with suppress(TimeoutError):  # the fence raises the error
            await self._feeds["home_position"].wait(lambda _: True, _ENTERED)

    async def _sea_level(self) -> float:
        """Return the altitude of the origin of the local frame above mean sea level in m."""
        return float((await self._origin()).ref_alt)

    async def _origin(self) -> Any:
        try:
            return await self._feeds["vehicle_local_position"].wait(lambda each: bool(each.z_global), _KNOWN)
        except TimeoutError:
            raise NoAnswerError("the vehicle does not know its altitude above sea level") from None


def _is_armed(status: Any) -> bool:
    return bool(status.arming_state == status.ARMING_STATE_ARMED)


def _is_disarmed(status: Any) -> bool:
    return bool(status.arming_state != status.ARMING_STATE_ARMED)


def _is_in(mode: int) -> Condition:
    return lambda status: bool(status.nav_state == mode)


def _place(latitude: float, longitude: float, altitude: float) -> None:
    """Raise ValueError for an impossible place."""
    finite([latitude, longitude, altitude], "a place")
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:  # noqa: PLR2004 - degrees
        raise ValueError(
            f"expected a latitude from -90 to 90 and a longitude from -180 to 180, got {latitude}, {longitude}"
        )


def _is_near(place: Any, latitude: float, longitude: float, altitude: float | None) -> bool:
    north = math.radians(place.lat - latitude) * _EARTH_RADIUS
    east = math.radians(place.lon - longitude) * _EARTH_RADIUS * math.cos(math.radians(latitude))
    up = 0.0 if altitude is None else place.alt - altitude
    return math.hypot(north, east, up) < _NEAR
