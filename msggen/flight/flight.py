"""A vehicle and the modes and executors of a program, from registration to the end."""

from __future__ import annotations

import asyncio
from contextlib import AbstractAsyncContextManager, suppress
from types import TracebackType
from typing import TYPE_CHECKING, Any

from msggen.flight.actions import Actions
from msggen.flight.active import ActiveMode
from msggen.flight.charge import Charge
from msggen.flight.checks import Answers
from msggen.flight.commands import Commands
from msggen.flight.connection import Connection
from msggen.flight.errors import FlightError, NoAnswerError, RegistrationError
from msggen.flight.executor import Executor
from msggen.flight.feeds import Feeds
from msggen.flight.mode import Mode
from msggen.flight.offboard import Offboard, offboard
from msggen.flight.registration import Registrar, Wanted
from msggen.flight.space import Frame
from msggen.flight.telemetry import Telemetry

if TYPE_CHECKING:
    from typing_extensions import Self

_HEARD = 5.0
"""The time in s within which a vehicle publishes its status."""
_READY = 1.0
"""The time in s within which the vehicle takes the first reply of a mode: it asks every 0.3 s."""
_NEEDED = ("vehicle_status", "vehicle_command_ack", "vehicle_local_position", "failsafe_flags", "mode_completed")


class Flight(Actions):
    """A vehicle that a program flies: by actions, by Offboard mode, and by modes and executors of its own.

    To be used with `async with`. At the end, all modes are unregistered.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        feeds = Feeds(connection)
        super().__init__(Commands(connection, feeds), feeds)
        self._modes: dict[type[Mode], ActiveMode] = {}
        self._charges: list[Charge] = []
        self._answers: Answers | None = None
        self.telemetry = Telemetry(self._feeds)
        self._registrar = Registrar(connection, self._feeds)

    async def __aenter__(self) -> Self:
        for topic in _NEEDED:
            self._feeds[topic]
        try:
            await self._feeds["vehicle_status"].wait(lambda _: True, _HEARD)
        except TimeoutError:
            raise NoAnswerError(f"no vehicle_status within {_HEARD:.0f} s") from None
        self._feeds["vehicle_status"].call(self._follow)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _follow(self, status: Any) -> None:
        """Let executors and modes begin and end. Executors are first: one that is ended does not see its mode end."""
        for charge in [*self._charges]:
            charge.follow(status)
        for active in [*self._modes.values()]:
            active.follow(status)

    def close(self) -> None:
        """Stop all, and unregister it."""
        for charge in self._charges:
            charge.close()
        for active in self._modes.values():
            active.close()
            self._registrar.unregister(active.ids)
        if self._answers is not None:
            self._answers.close()
        self._charges.clear()
        self._modes.clear()
        self._feeds.close()

    async def add(self, *parts: type[Mode | Executor] | Mode | Executor) -> None:
        """Register modes and executors, each as a class or an object. The mode of an executor is registered with it.

        Raises RegistrationError, UnsupportedError and NoAnswerError.
        """
        made = [each() if isinstance(each, type) else each for each in parts]
        executors = {each.mode: each for each in made if isinstance(each, Executor)}
        given = {type(each): each for each in made if isinstance(each, Mode)}
        modes = {owned: given.get(owned) or owned() for owned in executors} | given
        for cls, mode in modes.items():
            await self._register(mode, executors.get(cls))

    async def _register(self, mode: Mode, executor: Executor | None) -> None:
        if any(each.mode.name == mode.name for each in self._modes.values()):
            raise RegistrationError(f"a mode of the name {mode.name!r} is registered already")
        is_immediate = executor is not None and executor.starts == "registered"
        ids = await self._registrar.register(
            Wanted(
                mode.name,
                executor=executor is not None,
                replaces=mode.replaces,
                is_immediate=is_immediate,
                is_selectable=mode.is_selectable,
            )
        )
        active = ActiveMode(mode, ids, self._connection, self._feeds)
        self._modes[type(mode)] = active
        if self._answers is None:
            self._answers = Answers(self._connection, self._feeds)
        self._answers.add(ids.check, active.verdict)
        if executor is not None:
            actions = Actions(self._commands, self._feeds, ids.executor)
            self._charges.append(Charge(executor, ids, actions, self.find))
        await active.configuration.check(mode.setpoints)
        await self._until_ready(active)

    async def _until_ready(self, active: ActiveMode) -> None:
        """Wait until the vehicle has taken the first reply of a mode: before that it refuses to arm in it."""
        bit = 1 << active.ids.mode
        with suppress(TimeoutError):  # a mode whose conditions are not met
            await self._feeds["failsafe_flags"].following(lambda flags: not flags.mode_req_other & bit, _READY)

    async def set_mode(self, mode: str | int | type[Mode] | Mode) -> None:
        """Select a mode: one of PX4's by its name, such as `hold` or `position`, or by its nav_state, or one of `add`.

        Raises RefusedError with what the vehicle shows, ValueError for an unknown name, NoAnswerError, and FlightError.
        """
        await super().set_mode(self.find(mode).ids.mode if isinstance(mode, (Mode, type)) else mode)

    def find(self, mode: type[Mode] | Mode) -> ActiveMode:
        """Return a mode that is registered. Raises FlightError."""
        found = self._modes.get(mode if isinstance(mode, type) else type(mode))
        if found is None:
            raise FlightError(f"mode {mode.name!r} is not registered: `await flight.add(...)` registers it")
        return found

    def offboard(self, frame: Frame = "ned") -> AbstractAsyncContextManager[Offboard]:
        """Fly in Offboard mode: `async with flight.offboard() as setpoint`.

        The vehicle holds its place at first. At the end it is in Hold, unless a pilot has taken over. After an
        exception, PX4's failsafe for the lost signal follows (COM_OBL_RC_ACT).
        """
        return offboard(self._connection, self._feeds, self, frame)

    @property
    def feeds(self) -> Feeds:
        """The messages of the vehicle."""
        return self._feeds

    async def run(self) -> None:
        """Go on until the program is cancelled."""
        await asyncio.Event().wait()
