"""An executor: a program that arms, takes off, flies modes one after the other, and lands."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractAsyncContextManager
from typing import ClassVar, Literal, Protocol, TypeAlias

from msggen.flight.actions import Actions
from msggen.flight.errors import FlightError
from msggen.flight.mode import Mode
from msggen.flight.overrides import Deferral, Keeps, Overrides
from msggen.flight.usage import Hinted
from msggen.flight.vtol import TRANSITION

Start: TypeAlias = Literal["armed", "selected", "registered"]
"""When `run` starts: when the vehicle is armed in the mode, when the mode is selected, or after registration."""


class Registered(Protocol):
    """The connection of a registered executor to the vehicle."""

    actions: Actions
    overrides: Overrides

    async def fly(self, mode: type[Mode] | Mode) -> None:
        """Fly a mode, and wait for its end."""


class Executor(Hinted):
    """A sequence of modes. A subclass sets the mode that it belongs to, and defines the method `run`.

    Selecting its mode puts the executor in charge, and it stays in charge while it lets PX4 or other modes fly. A pilot
    or a ground station that selects another mode ends it at once. A failsafe also ends it: when the failsafe clears,
    `run` starts again.
    """

    mode: ClassVar[type[Mode] | Mode]
    """The mode that a user selects to start the executor, as a class or an object. `run` need not fly it."""
    starts: ClassVar[Start] = "armed"
    is_resumed: bool = False
    """Whether it continues the flight of an earlier program that was killed: the vehicle may be in the air."""
    keeps: ClassVar[Keeps] = Keeps()
    """What PX4 leaves unchanged while the executor is in charge."""
    _charge: Registered | None = None

    async def run(self) -> None:
        """Fly the sequence. It is cancelled when the executor is no longer in charge.

        If it raises an exception, its mode counts as failed, and the vehicle returns home.
        """
        raise NotImplementedError

    async def arm(self) -> None:
        """See `Actions.arm`."""
        await self._actions.arm()

    async def disarm(self) -> None:
        """See `Actions.disarm`."""
        await self._actions.disarm()

    async def takeoff(self, altitude: float | None = None, *, above_sea: float | None = None) -> None:
        """See `Actions.takeoff`. Afterwards, PX4 stays in Takeoff until the next mode."""
        await self._actions.takeoff(altitude, above_sea=above_sea)

    async def land(self) -> None:
        """See `Actions.land`."""
        await self._actions.land()

    async def rtl(self) -> None:
        """See `Actions.return_home`."""
        await self._actions.return_home()

    async def to_fixed_wing(self, *, timeout: float = TRANSITION) -> None:
        """See `Actions.to_fixed_wing`."""
        await self._actions.to_fixed_wing(timeout=timeout)

    async def to_multicopter(self, *, timeout: float = TRANSITION) -> None:
        """See `Actions.to_multicopter`."""
        await self._actions.to_multicopter(timeout=timeout)

    async def set_actuators(self, values: Mapping[int, float]) -> None:
        """See `Actions.set_actuators`."""
        await self._actions.set_actuators(values)

    async def fly(self, mode: type[Mode] | Mode | None = None) -> None:
        """Fly a registered mode, by default the executor's own, and wait for its end.

        Raises what `fly` of the mode raises, RefusedError, NoAnswerError, NotReachedError if the mode is left early,
        and FlightError for a mode that is not registered.
        """
        await self._own.fly(self.mode if mode is None else mode)

    async def wait_disarmed(self) -> None:
        """Wait until the vehicle is disarmed."""
        await self._actions.wait_disarmed()

    def deferring_failsafes(self, seconds: float) -> AbstractAsyncContextManager[Deferral]:
        """Defer failsafes: `async with self.deferring_failsafes(30) as deferral`.

        The time in s starts with the first reason for a failsafe. PX4 acts when it is over, or when the block ends. Not
        deferred are: a mode that cannot run, limits of fence, wind and flight time, failed motors, a broken battery.

        Raises ValueError, NoAnswerError, and FlightError if a failsafe is already active.
        """
        return self._own.overrides.deferring(seconds)

    @property
    def is_registered(self) -> bool:
        """Whether a flight has registered it."""
        return self._charge is not None

    @property
    def _actions(self) -> Actions:
        return self._own.actions

    @property
    def _own(self) -> Registered:
        if self._charge is None:
            name = type(self).__name__
            raise FlightError(f"executor {name} is not registered: `await flight.add(...)` registers it")
        return self._charge
