"""An executor: a program that arms, takes off, flies modes one after the other, and lands; and what runs it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager, suppress
from logging import getLogger
from typing import Any, ClassVar, Literal, TypeAlias

from msggen.flight.actions import UNDER_WAY, Actions
from msggen.flight.errors import FlightError, NotReachedError, RefusedError, report, watched
from msggen.flight.mode import Mode
from msggen.flight.registration import Deferral, Ids, Keeps, Overrides
from msggen.flight.running_mode import ActiveMode
from msggen.flight.states import described, is_armed
from msggen.flight.usage import Hinted
from msggen.flight.vtol import TRANSITION
from msggen.messages.nav_states import LAND, RETURN

LOGGER = getLogger("msggen.flight")
Start: TypeAlias = Literal["armed", "selected", "registered"]
"""When `run` starts: when the vehicle is armed in the mode, when the mode is selected, or after registration."""


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
    _charge: Charge | None = None

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
    def _own(self) -> Charge:
        if self._charge is None:
            name = type(self).__name__
            raise FlightError(f"executor {name} is not registered: `await flight.add(...)` registers it")
        return self._charge


class Charge:
    """An executor with the ids that the vehicle has assigned."""

    def __init__(
        self,
        executor: Executor,
        ids: Ids,
        actions: Actions,
        overrides: Overrides,
        find: Callable[[type[Mode] | Mode], ActiveMode],
    ) -> None:
        self.executor, self.ids, self.actions, self.overrides, self.find = executor, ids, actions, overrides, find
        self._wanted: asyncio.Future[None] | None = None
        """What `run` returns or raises, for who waits for it."""
        self._task: asyncio.Task[None] | None = None
        self._ended: asyncio.Task[None] | None = None
        """The last run that was cancelled."""
        self._was_armed = False
        self._has_run = False
        """Whether `run` has begun since a user has selected the mode."""
        self._was_cut = False
        """Whether a failsafe has ended `run` in flight. `run` starts again if the failsafe clears in flight."""
        self._is_free = False
        """Whether `run` is under way, and nobody waits for its end."""
        self._was_own = self._flies_own = False
        """Whether its own mode was active, and whether the executor itself has selected it."""
        self._is_ready = False
        executor._charge = self  # noqa: SLF001 - its own part

    def begin(self, status: Any) -> None:
        """Follow the vehicle from now on: it has read the first reply of the mode, and can be armed in it."""
        was_ready, self._is_ready = self._is_ready, True
        if status is not None and not was_ready:
            self.follow(status)

    async def wait_end(self, actions: Actions) -> None:
        """Wait for the end of `run`, which may be under way: arming starts it. Else select its mode as a user does.

        A cancellation ends `run`: a mode of PX4 that it has selected goes on.

        Raises what `run` raises, and NotReachedError if the executor is no longer in charge.
        """
        joins = self._is_free
        self._finish(NotReachedError(f"{self._name} is started anew"))
        wanted = self._wanted = asyncio.get_running_loop().create_future()
        wanted.add_done_callback(lambda each: each.cancelled() or each.exception())  # perhaps nobody waits
        if self._task is None:
            self._has_run = False
            if self.executor.starts == "armed" and not self._was_armed:
                LOGGER.warning("%s starts when the vehicle is armed: see `starts`", self._name)
        try:
            if not joins:
                await actions._select(self.ids.mode, self.executor.mode.name)  # noqa: SLF001 - of the same library
            await self.find(self.executor.mode).feeds.while_heard(wanted)
        except BaseException:
            if self._wanted is wanted:
                self._wanted = None
                self._has_run = True
                self._stop()
            raise

    async def fly(self, mode: type[Mode] | Mode) -> None:
        """Fly a mode, and wait for its end."""
        active = self.find(mode)
        self._flies_own = active.ids == self.ids
        try:
            await active.run(self.actions)
        finally:
            self._flies_own = False

    def close(self) -> None:
        """End the executor."""
        self._stop()
        self._finish(FlightError(f"{self._name} is not registered any more"))
        self.overrides.close()
        self.executor._charge = None  # noqa: SLF001 - as above

    def follow(self, status: Any) -> None:
        """Start or stop the executor according to a VehicleStatus. One that PX4 puts in charge at once has to wait."""
        if not self._is_ready:
            return
        has_armed = self._was_armed = is_armed(status)
        is_chosen = self._is_chosen(status) and has_armed
        if status.executor_in_charge != self.ids.executor:
            self._was_cut = (self._was_cut or self._task is not None) and has_armed and bool(status.failsafe)
            self._has_run = self._has_run and bool(status.failsafe)  # not if a user has taken over
            self._stop(status)
        else:
            if is_chosen:
                self._stop(status)
                self._has_run = False
            self._was_cut = self._was_cut and has_armed
            if self._task is None and (not self._has_run or self._was_cut):
                self._begin(is_armed=has_armed)
        if self.executor.starts == "armed" and not has_armed:
            self._has_run = False

    def _is_chosen(self, status: Any) -> bool:
        """Whether a user has selected the mode of the executor while the executor flew another mode."""
        was_own, self._was_own = self._was_own, status.nav_state == self.ids.mode
        return self._was_own and not was_own and not self._flies_own

    def _begin(self, *, is_armed: bool) -> None:
        if is_armed or self.executor.starts != "armed":
            self._has_run, self._was_cut, self._is_free = True, False, self._wanted is None
            self.overrides.renew()
            self._task = watched(self._run(self._ended), type(self.executor).__name__, self._break)

    def _stop(self, status: Any = None) -> None:
        if self._task is not None:
            self._task.cancel()
            self._ended, self._task = self._task, None
            why = "" if status is None else f": {described(status)}"
            self._finish(NotReachedError(f"{self._name} is no longer in charge{why}"))

    def _finish(self, error: BaseException | None = None) -> None:
        """Tell who waits for the end of `run` how it has ended."""
        self._is_free = False
        wanted, self._wanted = self._wanted, None
        if wanted is not None and not wanted.done():
            wanted.set_result(None) if error is None else wanted.set_exception(error)

    @property
    def _name(self) -> str:
        return f"executor {type(self.executor).__name__}"

    async def _run(self, before: asyncio.Task[None] | None) -> None:
        """Run the executor, after the previous run has ended."""
        try:
            if before is not None:
                await asyncio.wait([before])
            await self.executor.run()
            if self._task is asyncio.current_task():
                self._finish()
        except asyncio.CancelledError:
            if self._task is not asyncio.current_task():  # the executor is no longer in charge
                raise
            await self._fail(FlightError(f"`run` of {self._name} was cancelled"))
        except (SystemExit, KeyboardInterrupt):
            raise
        except BaseException as error:  # noqa: BLE001 - whatever a program raises, also a failed test of pytest
            await self._end(error)
        finally:
            if self._task is asyncio.current_task():  # not yet the next one
                self._task = None

    async def _end(self, error: BaseException) -> None:
        """End the run with what the program has raised."""
        if self._task is not asyncio.current_task():
            if not isinstance(error, NotReachedError):
                report(f"{self._name} is no longer in charge, and its end has failed", error)
        elif getattr(error, "is_handled", False):
            self._finish(error)
        else:
            await self._fail(error)

    async def _fail(self, error: BaseException) -> None:
        """Return home: PX4's failsafe does this from the mode of the executor, a command from other modes."""
        self._finish(error)
        report(f"{self._name} has failed", error)
        with suppress(FlightError):  # it is not registered any more
            self.find(self.executor.mode).has_failed = self._was_armed or self.executor.starts != "armed"
        with suppress(TimeoutError, FlightError):
            await self.actions.wait_for_status(self._is_left_alone, UNDER_WAY)
            try:
                await self.actions.set_mode(RETURN)
            except RefusedError:
                await self.actions.set_mode(LAND)

    def _break(self, _task: asyncio.Task[None], error: BaseException) -> None:
        """Tell of an error that has ended the task of `run` and that nothing else has taken."""
        self._finish(error)
        report(f"{self._name} has failed, and its end, too", error)

    def _is_left_alone(self, status: Any) -> bool:
        """Whether the vehicle is armed in a mode in which it now gets no commands, such as Takeoff."""
        return is_armed(status) and status.nav_state not in {self.ids.mode, RETURN, LAND}
