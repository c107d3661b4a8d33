"""An executor: a program that arms, takes off, flies modes one after the other, and lands."""

from __future__ import annotations

import asyncio
import math
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias

from msggen.flight import commands
from msggen.flight.errors import FlightError, NotReachedError, RefusedError
from msggen.flight.mode import Mode

if TYPE_CHECKING:
    from msggen.flight.charge import Charge

Start: TypeAlias = Literal["armed", "selected", "registered"]
"""When `run` begins: when the vehicle is armed in its mode, when its mode is selected, or once it is registered."""

TAKEOFF, LAND, RETURN = 17, 18, 5
"""The nav_states of PX4's modes."""
_ENTERED = 1.0
"""The time in s within which the vehicle shows a mode that it has accepted."""


class Executor:
    """A sequence of modes. A subclass has the mode that it belongs to, and the method `run`.

    It is in charge while its mode is selected. A pilot or a ground station that selects another mode ends it at once.
    """

    mode: ClassVar[type[Mode]]
    """The mode that a user selects to start it. It may be flown or not."""
    starts: ClassVar[Start] = "armed"
    _charge: Charge | None = None

    async def run(self) -> None:
        """Do what is to be done. It is cancelled when the executor is no longer in charge."""
        raise NotImplementedError

    async def arm(self) -> None:
        """Arm the vehicle. Raises RefusedError with what the vehicle shows."""
        await self._send(commands.ARM_DISARM, 1.0, what="arm")
        await self._status(lambda status: bool(status.arming_state == status.ARMING_STATE_ARMED), "armed")

    async def disarm(self) -> None:
        """Disarm the vehicle on the ground. Raises RefusedError in the air."""
        await self._send(commands.ARM_DISARM, 0.0, what="disarm")
        await self.wait_disarmed()

    async def takeoff(self, altitude: float | None = None) -> None:
        """Take off to an altitude in m above the ground of the start, by default to MIS_TAKEOFF_ALT. Wait for the end.

        Raises RefusedError, and NotReachedError if another mode is selected before.
        """
        above_sea = math.nan if altitude is None else await self._sea_level() + altitude
        await self._finish(TAKEOFF, commands.TAKEOFF, *[math.nan] * 6, above_sea, what="take off")

    async def land(self) -> None:
        """Land where the vehicle is, and wait until it has landed. Raises RefusedError and NotReachedError."""
        await self._finish(LAND, commands.LAND, what="land")

    async def rtl(self) -> None:
        """Return to the home position, and wait until the vehicle has landed.

        Raises RefusedError and NotReachedError.
        """
        await self._finish(RETURN, commands.RETURN, what="return")

    async def fly(self, mode: type[Mode] | Mode | None = None) -> None:
        """Fly a mode that is registered, by default its own one, and wait for its end.

        Raises what its `fly` raises, RefusedError, and FlightError for a mode that is not registered.
        """
        active = self._own.find(self.mode if mode is None else mode)
        flown: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        active.flown = flown
        try:
            if not active.is_active:
                await self._send(commands.SET_NAV_STATE, float(active.ids.mode), what=f"mode {active.mode.name!r}")
            else:
                active.restart()
            await flown
        finally:
            active.flown = None

    async def wait_disarmed(self) -> None:
        """Wait until the vehicle is disarmed."""
        await self._own.feeds["vehicle_status"].wait(
            lambda status: bool(status.arming_state != status.ARMING_STATE_ARMED)
        )

    async def _finish(self, mode: int, command: int, *parameters: float, what: str) -> None:
        """Let PX4 fly one of its modes, and wait for its end."""
        completed = asyncio.get_running_loop().create_task(self._completed(mode))
        try:
            await self._send(command, *parameters, what=what)
            await completed
        finally:
            completed.cancel()

    async def _send(self, command: int, *parameters: float, what: str) -> None:
        await self._own.commands.send(command, *parameters, executor=self._own.ids.executor, what=what)

    async def _completed(self, mode: int) -> None:
        """Wait until a mode of PX4 has reached its end. Old messages do not count: it has to be the mode before."""
        feeds = self._own.feeds
        status = feeds["vehicle_status"]
        await status.wait(lambda each: bool(each.nav_state == mode))
        found = await feeds["mode_completed"].following(lambda each: bool(each.nav_state == mode))
        if found.result:
            raise NotReachedError(f"mode {mode} has ended with result {found.result}")

    async def _status(self, condition: Any, what: str) -> None:
        try:
            await self._own.feeds["vehicle_status"].wait(condition, _ENTERED)
        except TimeoutError:
            raise FlightError(f"the vehicle has accepted the command, and does not become {what}") from None

    async def _sea_level(self) -> float:
        """Return the altitude of the origin of the local frame above mean sea level in m."""
        found = await self._own.feeds["vehicle_local_position"].wait(lambda each: bool(each.z_global), 1.0)
        return float(found.ref_alt)

    @property
    def _own(self) -> Charge:
        if self._charge is None:
            raise RefusedError(f"executor {type(self).__name__}", 1, ["it is not registered"])
        return self._charge
