"""Actions of a vehicle: arm, take off, land, return, select a mode. Each returns when it is done.

They are sent as commands of a user or of an executor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from logging import getLogger
from typing import Any

from msggen.flight.commands import Commands
from msggen.flight.errors import FlightError, LimitError, NotReachedError, UnsupportedError
from msggen.flight.estimates import is_known_in_air, is_known_landed, is_landed, valid_estimate
from msggen.flight.feeds import Condition, Feeds, first
from msggen.flight.limits import Fence
from msggen.flight.places import GlobalPlace, OnEarth, local_place, sea_level
from msggen.flight.setpoints import finite, in_range
from msggen.flight.states import described, is_armed, is_disarmed, is_on_wings, is_plane, is_rover, name_of
from msggen.flight.usage import ON_EARTH, Hinted, explained
from msggen.flight.vtol import TRANSITION, change, circling, must_change, until_disarmed
from msggen.messages import commands, earth
from msggen.messages.nav_states import EXTERNAL, HOLD, LAND, OFFBOARD, RETURN, SELECTABLE, TAKEOFF, mode_number

LOGGER = getLogger("msggen.flight")

_ENTERED = 3.0
"""The time in s within which the status shows the effect of a command: PX4 publishes it at 2 Hz or more."""
_NEAR = 1.0
"""The distance in m within which a place by latitude and longitude is reached."""
_SLOW = 0.5
_ON_WINGS = 100.0, 10.0
"""Within which an aircraft that circles a place has reached it, in m across and in height (NAV_FW_ALT_RAD)."""
_STANDS = 0.1
"""The speed in m/s below which a rover stands."""
_BRAKED = 20.0
"""The time in s within which a rover stands that brakes."""
_MOST_ACTUATORS = 6
UNDER_WAY = 1.5
"""The time in s for which a command that was sent can still take effect."""


class Actions(Hinted):
    """Actions of a user, or of the executor with an id."""

    def __init__(
        self, sender: Commands, feeds: Feeds, fence: Fence, replacements: Mapping[int, int], executor: int = 0
    ) -> None:
        """Take the nav_states of modes that replace others, by those of the others."""
        self._commands, self._feeds, self._fence = sender, feeds, fence
        self._replacements, self._executor = replacements, executor

    async def arm(self) -> None:
        """Arm. Raises RefusedError with the reasons that the vehicle reports, and NoAnswerError."""
        await self._send(commands.ARM_DISARM, 1.0, 0.0, what="arm", shown=is_armed)
        await self._until(is_armed, "armed")

    async def disarm(self) -> None:
        """Disarm on the ground. Raises RefusedError in the air, and NoAnswerError."""
        await self._send(commands.ARM_DISARM, 0.0, 0.0, what="disarm", shown=is_disarmed)
        await self._until(is_disarmed, "disarmed")

    async def takeoff(self, altitude: float | None = None, *, above_sea: float | None = None) -> None:
        """Take off, and return at an altitude in m above the ground, by default MIS_TAKEOFF_ALT.

        `above_sea` is an altitude in m above mean sea level instead.

        PX4 ends the takeoff within 0.8 m of that (NAV_MC_ALT_RAD), on wings within 10 m (NAV_FW_ALT_RAD). In the air,
        the altitude is above home. A vehicle that is as high already stays there, so a program that is started again
        does not climb twice.

        Raises ValueError, LimitError, UnsupportedError for a rover, FlightError if the vehicle is not armed or a
        failsafe flies it, RefusedError, NoAnswerError and NotReachedError.
        """
        if altitude is not None and above_sea is not None:
            raise ValueError("expected altitude or above_sea, got both")
        if altitude is not None and not finite([altitude], "an altitude")[0] > 0.0:
            raise ValueError(f"expected an altitude above the ground, got {altitude:g} m")
        finite([] if above_sea is None else [above_sea], "an altitude")
        await self._check_can_take_off()
        is_flying = self._is_flying()
        sea = goal = height = math.nan
        if altitude is not None or above_sea is not None:
            sea = await sea_level(self._feeds)
            height = self._feeds["vehicle_local_position"].latest.z
        if altitude is not None:
            goal = (self._fence.ground if is_flying else height) - altitude
        elif above_sea is not None:
            goal = sea - above_sea
            if not is_flying and goal >= height:
                raise ValueError(
                    f"expected an altitude above the ground, which is at {sea - height:.0f} m, got {above_sea:g} m"
                )
        if is_flying and (math.isnan(goal) or height <= goal + self._near):
            LOGGER.info("no takeoff: the vehicle is in the air")
            return
        await self._check_takeoff(goal)
        await self._send(commands.TAKEOFF, *[math.nan] * 6, sea - goal, what="take off", shown=self._is_in(TAKEOFF))
        try:
            await self._completed(TAKEOFF, "the takeoff")
        except NotReachedError:
            if not self._is_up(goal):  # the message that tells the end was lost
                raise

    async def _check_can_take_off(self) -> None:
        """Raise FlightError if the vehicle is not armed, and UnsupportedError for a rover."""
        await self._check_armed("take off")
        if self._feeds.shows(is_rover):
            raise UnsupportedError("a rover does not take off: arm it, and let it drive in a mode")

    async def _check_armed(self, what: str) -> None:
        """Raise FlightError if the vehicle is not armed."""
        with suppress(TimeoutError):  # the vehicle decides
            if is_disarmed(await self._feeds["vehicle_status"].wait(lambda _: True, _ENTERED)):
                raise FlightError(f"{what}: the vehicle is not armed: `await flight.arm()` or `wait_armed()`")

    def _is_flying(self) -> bool:
        """Whether the vehicle is in the air, as far as that is known. Raises FlightError in a failsafe."""
        status = self._feeds["vehicle_status"].latest
        if not is_known_in_air(self._feeds):
            return False
        if status.failsafe:
            raise FlightError(f"{described(status)}, in the air: select another mode first, such as `hold`")
        return True

    def _is_up(self, goal: float) -> bool:
        """Whether PX4 has gone on from a takeoff to Hold, at an altitude in the local frame, or NaN for any."""
        status, place = self._feeds["vehicle_status"].latest, valid_estimate(self._feeds)
        if status.nav_state != HOLD or place is None or is_landed(self._feeds):
            return False
        return math.isnan(goal) or bool(abs(place.z - goal) < self._near)

    @property
    def _near(self) -> float:
        """How far below the end of a takeoff it counts as done, in m."""
        return _ON_WINGS[1] if self._feeds.shows(is_on_wings) else _NEAR

    async def land(self) -> None:
        """Land where the vehicle is, and return when it has landed. It disarms 2 s later (COM_DISARM_LAND).

        A rover stops before, in Hold: PX4 takes one in Land for landed, and lets it drive on.

        Raises RefusedError, NoAnswerError and NotReachedError.
        """
        await self._check_armed("land")
        if self._feeds.shows(is_rover):
            await self.hold()
            await self._standing()
        await self._send(commands.LAND, what="land", shown=self._is_in(LAND))
        await self._landed(LAND, "the landing")

    async def return_home(self) -> None:
        """Fly to the home position and land. The call ends when the vehicle has landed.

        A plane can circle there, as RTL_LAND_DELAY says: the call also ends after two circles at one height.

        Raises RefusedError, NoAnswerError and NotReachedError.
        """
        await self._check_armed("return")
        await self._send(commands.RETURN, what="return", shown=self._is_in(RETURN))
        landed = self._landed(RETURN, "the return")
        await (first(landed, circling(self._feeds)) if self._feeds.shows(is_plane) else landed)

    async def _standing(self) -> None:
        """Wait until a rover stands. Raises NotReachedError."""
        local = self._feeds["vehicle_local_position"]
        slow = local.following(lambda each: math.hypot(each.vx, each.vy) < _STANDS, _BRAKED)
        try:
            await self._feeds.within(self._modes_for(HOLD), slow, "the stop before the landing")
        except TimeoutError:
            raise NotReachedError(f"the rover still drives after {_BRAKED:g} s in Hold") from None

    async def hold(self) -> None:
        """Let PX4 hold the vehicle where it is. Raises RefusedError and NoAnswerError."""
        await self.set_mode("hold")

    async def set_mode(self, mode: str | int) -> None:
        """Select a mode by its name, such as `hold` or `position`, or by its nav_state.

        Raises ValueError for an unknown name, RefusedError, NoAnswerError, and FlightError if the mode is not entered.
        """
        number = mode_number(mode) if isinstance(mode, str) else mode
        if number is None:
            raise ValueError(f"expected one of the modes {', '.join(SELECTABLE)}, or a nav_state, got {mode!r}")
        await self._select(number, str(mode))

    async def _select(self, number: int, name: str) -> None:
        """Select a mode by its nav_state, and wait until the vehicle shows it."""
        modes = self._modes_for(number)

        def is_selected(status: Any) -> bool:
            return status.nav_state_user_intention in modes

        await self._send(commands.SET_NAV_STATE, float(number), what=f"mode {name}", shown=is_selected)
        await self._until(is_selected, f"in mode {name}")

    @explained(ON_EARTH)
    async def goto(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
        heading_deg: float = math.nan,
    ) -> None:
        """Go to a place in Hold mode, and return when it is reached: nearer than 1 m, slower than 0.5 m/s.

        On wings, it is reached once the vehicle circles around it: nearer than 100 m, and within 10 m of the altitude.
        A rover goes there whatever the altitude.

        The place is a GlobalPlace, or keywords: latitude and longitude in degrees, and the altitude in m above mean sea
        level, by default the current one.

        Raises TypeError for numbers without names, ValueError, RefusedError, NoAnswerError, NotReachedError if another
        mode is selected on the way or the vehicle lands, LimitError as `Limits` says, and FlightError on the ground.
        """
        latitude, longitude, altitude = OnEarth(place, latitude, longitude, altitude).numbers("goto")
        is_driving = self._feeds.shows(is_rover)
        is_level = is_driving or altitude is None
        await self._check_place(GlobalPlace(latitude, longitude, altitude or 0.0), is_level=is_level)
        if is_landed(self._feeds) and not is_driving:
            raise FlightError("the vehicle is on the ground: take off first")
        above_sea = math.nan if altitude is None else altitude
        values = -1.0, 1.0, math.nan, math.radians(heading_deg), latitude, longitude, above_sea
        await self._send(commands.REPOSITION, *values, what="go to a place")
        goal = latitude, longitude, None if is_driving else altitude
        reached = self._feeds["vehicle_global_position"].following(
            lambda place: _is_near(place, *goal, *(_ON_WINGS if self._feeds.shows(is_on_wings) else (_NEAR, _NEAR)))
        )
        await self._feeds.within({HOLD}, reached, "the flight to a place", may_land=is_driving)
        if self._feeds.shows(is_on_wings):
            return
        slow = self._feeds["vehicle_local_position"].following(lambda each: math.hypot(each.vx, each.vy) < _SLOW)
        await self._feeds.within({HOLD}, slow, "the flight to a place", may_land=is_driving)

    @explained(ON_EARTH)
    async def set_home(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
    ) -> None:
        """Set the home position: to where the vehicle is, or to a place as in `goto`.

        Raises TypeError, ValueError, RefusedError and NoAnswerError.
        """
        what = "set the home position"
        where = OnEarth(place, latitude, longitude, altitude)
        if where == (None,) * 4:
            await self._send(commands.SET_HOME, 1.0, what=what)
        else:
            await self._send(commands.SET_HOME, 0.0, *[math.nan] * 3, *where.whole("set_home"), what=what)

    @explained(ON_EARTH)
    async def set_origin(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
    ) -> None:
        """Set the origin of the local frame to a place as in `goto`, for a vehicle without a global position.

        Raises TypeError, ValueError, RefusedError and NoAnswerError.
        """
        values = OnEarth(place, latitude, longitude, altitude).whole("set_origin")
        await self._send(commands.SET_ORIGIN, *[math.nan] * 4, *values, what="set the origin")

    # Of some vehicles

    async def to_fixed_wing(self, *, timeout: float = TRANSITION) -> None:
        """Let a VTOL change from hovering to forward flight, in a mode of PX4 such as Hold, and wait for the end.

        In a mode of a program, `await self.to_fixed_wing()` does that. `timeout` is in s.

        Raises UnsupportedError for another vehicle, FlightError on the ground, where the vehicle would flip over, in
        Offboard mode and in modes of programs, LimitError without room to circle within the limits, RefusedError as in
        Takeoff, NoAnswerError, and NotReachedError after a quad-chute and after `timeout`.
        """
        self._check_mode_of_px4("to_fixed_wing")
        if must_change(self._feeds, is_forward=True, seconds=timeout):
            await self._fence.check_change()
        await change(self._commands, self._feeds, is_forward=True, seconds=timeout)

    async def to_multicopter(self, *, timeout: float = TRANSITION) -> None:
        """Let a VTOL change from forward flight to hovering, as `to_fixed_wing` does. Raises as that does."""
        self._check_mode_of_px4("to_multicopter")
        await change(self._commands, self._feeds, is_forward=False, seconds=timeout)

    def _check_mode_of_px4(self, name: str) -> None:
        """Raise FlightError in a mode in which PX4 gives a transition no setpoints."""
        status = self._feeds["vehicle_status"].latest
        if status is not None and status.nav_state in {OFFBOARD, *EXTERNAL}:
            raise FlightError(
                f"mode {name_of(status.nav_state)} flies, in which PX4 does not guide a transition: "
                f"`await self.{name}()` in the mode, or `await flight.hold()` first"
            )

    async def set_actuators(self, values: Mapping[int, float]) -> None:
        """Set payload servos: the values from -1 to 1 of "Peripheral via Actuator Set" 1 to 6, by their numbers.

        The others stay as they are. Each value stays until it is changed, whatever the mode. PX4 acknowledges this also
        if no output has that function. Calls wait for each other, so that there are at most 10 a second.

        Raises ValueError, RefusedError and NoAnswerError.
        """
        numbers = range(1, _MOST_ACTUATORS + 1)
        if not values or not all(each in numbers for each in values):
            raise ValueError(f"expected the numbers of actuators from 1 to {_MOST_ACTUATORS}, got {[*values]}")
        parameters = [in_range(values[each], -1.0, "a value") if each in values else math.nan for each in numbers]
        await self._commands.pace_actuators()
        await self._commands.send(commands.SET_ACTUATORS, *parameters, 0.0, what="set actuators")

    async def wait_armed(self) -> None:
        """Wait until the vehicle is armed. Raises NoAnswerError if it is not heard for 10 s."""
        await self._feeds.while_heard(self._feeds["vehicle_status"].wait(is_armed))

    async def wait_disarmed(self) -> None:
        """Wait until the vehicle is disarmed. Raises NoAnswerError if it is not heard for 10 s.

        Raises FlightError if a plane stands for 10 s in a mode such as Hold, and has not flown: PX4 never disarms it.
        """
        await self._feeds.while_heard(self._feeds["vehicle_status"].wait(until_disarmed()))

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
        await self._until(self._is_in(mode), f"in mode {mode}")
        modes = self._modes_for(mode)
        completed = self._feeds["mode_completed"].following(lambda each: each.nav_state in modes)
        found = await self._feeds.within(modes, completed, what)
        if found.result:
            raise NotReachedError(f"{what} has failed: ModeCompleted has result {found.result}")

    async def _landed(self, mode: int, what: str) -> None:
        """Wait until a mode of PX4 that lands is completed. A vehicle that disarms on the ground has landed."""
        try:
            await self._completed(mode, what)
        except NotReachedError:
            if is_armed(self._feeds["vehicle_status"].latest) or not is_known_landed(self._feeds):
                raise

    def _modes_for(self, mode: int) -> frozenset[int]:
        """Return the nav_states that the vehicle can show for a mode."""
        return frozenset({mode, self._replacements.get(mode, mode)})

    def _is_in(self, mode: int) -> Condition:
        modes = self._modes_for(mode)
        return lambda status: status.nav_state in modes

    async def _check_takeoff(self, goal: float) -> None:
        """Raise LimitError for an altitude in the local frame that is too high, or NaN, which is not known."""
        if math.isinf(self._fence.limits.height):
            return
        if math.isnan(goal):
            raise LimitError("with a limit on the height, takeoff needs an altitude: MIS_TAKEOFF_ALT is not known")
        await self._fence.wait_for_home()
        self._fence.check_place((math.nan, math.nan, goal))

    async def _check_place(self, place: GlobalPlace, *, is_level: bool) -> None:
        """Raise LimitError for a place beyond the limits. The altitude does not count if the flight is level."""
        if not self._fence.limits.is_open:
            await self._fence.wait_for_home()
        north, east, down = await local_place(self._feeds, place, "ned")
        self._fence.check_goto((north, east, math.nan if is_level else down))


def _is_near(  # noqa: PLR0913, PLR0917 - a place, and how near
    place: Any, latitude: float, longitude: float, altitude: float | None, level: float, upright: float
) -> bool:
    north, east = earth.local((latitude, longitude), place.lat, place.lon)
    up = 0.0 if altitude is None else place.alt - altitude
    return math.hypot(north / level, east / level, up / upright) < 1.0
