"""A vehicle and the modes and executors of a program, from registration to the end: also one by a signal."""

from __future__ import annotations

import asyncio
import atexit
import signal
import threading
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from types import FrameType, MappingProxyType, ModuleType, TracebackType
from typing import TYPE_CHECKING, Any, Final

from msggen.flight.actions import Actions
from msggen.flight.checks import Check
from msggen.flight.commands import Commands
from msggen.flight.errors import FlightError, RegistrationError
from msggen.flight.estimates import is_landed
from msggen.flight.executor import Executor
from msggen.flight.feeds import Connection, Feeds
from msggen.flight.limits import NO_LIMITS, Fence, Limits
from msggen.flight.link import LinkConnection, Need, connected
from msggen.flight.measurements import Measurements
from msggen.flight.mode import Mode
from msggen.flight.offboard import Offboard, offboard
from msggen.flight.part import NEEDED, Part
from msggen.flight.places import Frame
from msggen.flight.registered import Parts
from msggen.flight.registration import Ids
from msggen.flight.running_mode import ActiveMode
from msggen.flight.setpoints import Ranges
from msggen.flight.states import is_armed
from msggen.flight.telemetry import Telemetry
from msggen.link.link_types import DEFAULT

if TYPE_CHECKING:
    from typing_extensions import Self, TypeIs

    from msggen.vehicle.vehicle import Vehicle

_TERMINATED = 128 + signal.SIGTERM
"""The exit code of a program that was ended by SIGTERM."""
_HEARD = 5.0
"""The time in s within which a vehicle publishes its status."""
_NEEDED: Final = (
    Need("out", "vehicle_status"),
    Need("out", "vehicle_command_ack"),
    Need("out", "vehicle_local_position"),
    Need("out", "failsafe_flags"),
    Need("out", "mode_completed"),
    Need("in", "vehicle_command"),
)
_NOT_BEGUN = "the flight has not begun: `async with Flight(...) as flight`"
_OF_BEGUN = frozenset({"_commands", "_feeds", "_fence", "_replacements", "_executor", "measure", "telemetry"})


class Ending:
    """Tells the vehicle when a program ends, and cancels its task at SIGTERM.

    Signals are handled only if the event loop runs in the main thread. A SIGTERM handler of the program is kept.
    """

    def __init__(self, release: Callable[[], None]) -> None:
        """Take the function that tells the vehicle. It is called from any thread, and may be called several times."""
        self._release = release
        self._task = asyncio.current_task()
        self._loop = asyncio.get_running_loop()
        self.is_terminated = False

    def begin(self) -> None:
        """Start to watch for the end."""
        atexit.register(self._release)
        if threading.current_thread() is threading.main_thread():
            _handlers.add(self)

    def close(self) -> None:
        """Stop watching."""
        atexit.unregister(self._release)
        _handlers.remove(self)

    def leave(self, error: BaseException | None) -> None:
        """Raise SystemExit instead of the cancellation that SIGTERM has caused."""
        if self.is_terminated and isinstance(error, asyncio.CancelledError):
            raise SystemExit(_TERMINATED) from None

    def take(self, number: int) -> None:
        """Handle a signal. Another thread tells the vehicle: the program may hang or hold a lock of the link."""
        threading.Thread(target=self._release, name="msggen flight end", daemon=True).start()
        if number == signal.SIGTERM and self._task is not None:
            self.is_terminated = True
            self._loop.call_soon_threadsafe(self._task.cancel)


class _Handlers:
    """The handlers of signals, while there are flights in the main thread."""

    def __init__(self) -> None:
        self._endings: list[Ending] = []
        self._before: dict[int, Any] = {}

    def add(self, ending: Ending) -> None:
        """Install the handlers for the first flight."""
        self._endings.append(ending)
        if len(self._endings) > 1:
            return
        for number in (signal.SIGINT, signal.SIGTERM):
            before = signal.getsignal(number)
            if (number == signal.SIGINT and callable(before)) or before is signal.SIG_DFL:
                self._before[number] = before
                signal.signal(number, self._take)

    def remove(self, ending: Ending) -> None:
        """Restore the previous handlers after the last flight."""
        if ending not in self._endings:
            return
        self._endings.remove(ending)
        if self._endings:
            return
        for number, before in self._before.items():
            if signal.getsignal(number) == self._take:
                signal.signal(number, before)
        self._before.clear()

    def _take(self, number: int, frame: FrameType | None) -> None:
        before = self._before.get(number)
        for ending in [*self._endings]:
            ending.take(number)
        if callable(before):
            before(number, frame)


_handlers = _Handlers()


class Flight(Actions):
    """A vehicle that a program flies: with actions, in Offboard mode, or with its own modes and executors.

    Use it with `async with`. All modes are unregistered at the end, also after an exception, Ctrl-C or SIGTERM.

    `vehicle` is an address as for `Vehicle`, a Vehicle, or a Connection such as a simulated vehicle. `types` is the
    generated package, by default that of the Vehicle. With several packages, the first one that has the definitions of
    the vehicle is used.

    If several vehicles are at an address, `key` (UXRCE_DDS_KEY) or `namespace` says which one flies: without them, that
    is an error.

    `parameters` are those of the vehicle that limit setpoints, such as `{"FW_AIRSPD_MIN": 7.0}`: PX4 does not tell
    them. A setpoint beyond one is an error, and beyond the default of one that is not given, a warning.

    If a program was killed and is back within about 1 s, it continues to fly its modes. With `resume`, it also
    continues if the vehicle has left them meanwhile: the vehicle enters them again at once.
    """

    def __init__(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        vehicle: str | Vehicle | Connection = DEFAULT,
        types: ModuleType | Sequence[ModuleType] | None = None,
        *,
        key: int | None = None,
        namespace: str | None = None,
        limits: Limits = NO_LIMITS,
        parameters: Mapping[str, float] = MappingProxyType({}),
        resume: bool = False,
    ) -> None:
        self._key, self._namespace, self._ranges = key, namespace, Ranges(parameters)
        self._vehicle, self._types, self._limits, self._resume = vehicle, types, limits, resume
        self._parts: Parts | None = None
        self._connection: Connection | None = None
        self._in_offboard = asyncio.Lock()

    async def __aenter__(self) -> Self:
        """Wait for the vehicle. Raises FlightError for an address that cannot be opened, and the errors of `add`."""
        if self._parts is not None or self._connection is not None:
            raise FlightError("a flight is used once: make another one")
        self._ending = Ending(self._release)
        self._ending.begin()
        try:
            await self._open()
        except BaseException as error:
            await self._end(error)
            raise
        return self

    async def _open(self) -> None:
        connection = self._connection = await connected(
            *(self._vehicle, self._types, _NEEDED, NEEDED), key=self._key, namespace=self._namespace
        )
        feeds = Feeds(connection)
        sender = Commands(connection, feeds)
        fence = Fence(feeds, self._limits, self._ranges)
        parts = self._parts = Parts(connection, feeds, sender, fence, resume=self._resume)
        super().__init__(sender, feeds, fence, parts.replacements)
        self.telemetry = Telemetry(feeds)
        self.measure = Measurements(connection, feeds)
        for need in _NEEDED:
            if need.direction == "out":
                feeds[need.topic]
        is_landed(feeds)  # so that it is known before it is needed
        feeds["vehicle_status"].call(parts.follow)
        if parts.is_urgent:
            return
        if isinstance(connection, LinkConnection):
            await connection.wait_alone()
        try:
            await feeds["vehicle_status"].following(lambda _: True, _HEARD)  # one from before tells nothing
        except TimeoutError:
            raise feeds.no_answer(f"no vehicle_status within {_HEARD:.0f} s") from None

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._end(error)

    async def _end(self, error: BaseException | None) -> None:
        self.close()
        if self._parts is not None:
            await self._parts.settle()
            self._feeds.close()
        if isinstance(self._connection, LinkConnection):
            await self._connection.close()
        self._ending.leave(error)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name in _OF_BEGUN:
                raise FlightError(_NOT_BEGUN)
            return super().__getattr__(name)

    def _release(self) -> None:
        if self._parts is not None:
            self._parts.unregister()

    def close(self) -> None:
        """Stop all modes and executors, and unregister them."""
        if self._parts is not None:
            self._commands.close()
            self._parts.close()
        self._ending.close()

    async def add(self, *parts: type[Mode | Executor | Check] | Mode | Executor | Check) -> None:
        """Register modes, executors and checks, each as a class or an object. An executor comes with its mode.

        Raises RegistrationError, NoAnswerError, and UnsupportedError if the vehicle lacks messages or has other
        definitions of them.
        """
        made = [each() if isinstance(each, type) else each for each in parts]
        owned = [(each, _mode_of(each)) for each in made if isinstance(each, Executor)]
        made += [mode for _, mode in owned if isinstance(mode, Mode) and mode not in made]
        executors = {mode if isinstance(mode, type) else type(mode): each for each, mode in owned}
        given = {type(each): each for each in made if isinstance(each, Mode)}
        checks = {type(each): each for each in made if isinstance(each, Check)}
        if len(executors) + len(given) + len(checks) < len(made):
            raise RegistrationError(
                "expected one object of each mode and one executor for it, and one object of each check: use subclasses"
            )
        modes = {cls: given.get(cls) or cls() for cls in executors} | given
        added = [Part(mode, executors.get(cls)) for cls, mode in modes.items()]
        await self._own.add(added + [Part(each) for each in checks.values()])

    async def set_mode(self, mode: str | int | type[Mode | Executor] | Mode | Executor) -> None:
        """Select a mode: by its name in PX4, such as `hold` or `position`, by its nav_state, or a registered mode.

        Raises RefusedError with the reasons that the vehicle reports, ValueError for an unknown name, NoAnswerError,
        and FlightError.
        """
        if isinstance(mode, (str, int)):
            await super().set_mode(mode)
        else:
            ids = self._ids_of(mode)
            await self._select(ids.mode, ids.name)

    async def fly(self, part: type[Mode | Executor] | Mode | Executor) -> None:
        """Select a registered mode, or the mode of a registered executor, and wait for its end.

        If it flies already, and nobody waits for it, this waits for that end: arming starts the mode that is selected.

        Afterwards, the vehicle holds its place in this mode. An executor leaves it where its `run` ends.

        Raises what `fly` or `run` raises, RefusedError, NoAnswerError, NotReachedError if the mode is left early or the
        executor is no longer in charge, and FlightError for a mode that is not registered, and while the vehicle is
        disarmed.
        """
        if _is_executor(part):
            await self._own.find_executor(part).wait_end(self)
            return
        active = self.find(part)
        owner = self._own.owner_of(active)
        if owner is not None:
            name = type(owner.executor).__name__
            raise FlightError(f"mode {active.mode.name!r} belongs to executor {name}: `await flight.fly({name})`")
        await active.run(self)

    def find(self, mode: type[Mode] | Mode) -> ActiveMode:
        """Return a registered mode. Raises FlightError if it is not registered."""
        return self._own.find(mode)

    def _ids_of(self, part: type[Mode | Executor] | Mode | Executor) -> Ids:
        return self._own.find_executor(part).ids if _is_executor(part) else self.find(part).ids

    @property
    def _own(self) -> Parts:
        if self._parts is None:
            raise FlightError(_NOT_BEGUN)
        return self._parts

    @asynccontextmanager
    async def offboard(self, frame: Frame = "ned") -> AsyncIterator[Offboard]:
        """Fly in Offboard mode: `async with flight.offboard() as setpoint`.

        The vehicle first holds its place. At the end, it switches to Hold, unless a pilot has taken over. After an
        exception, PX4's failsafe for a lost Offboard signal follows (COM_OBL_RC_ACT).

        Raises RefusedError, NoAnswerError, and FlightError during another `offboard()` block.
        """
        connection = self._own.connection
        if self._in_offboard.locked():
            raise FlightError("the flight is in an `offboard()` block already: use its setpoint, or end it first")
        async with self._in_offboard, offboard(connection, self._feeds, self, self._fence, frame) as setpoint:
            yield setpoint

    @property
    def is_armed(self) -> bool:
        """Whether the vehicle is armed."""
        return self._feeds.shows(is_armed)

    @property
    def mode(self) -> str:
        """The name of the mode that flies the vehicle: one of PX4's, such as `hold`, or one of `add`."""
        return self._own.mode_name()

    @property
    def problem(self) -> str:
        """Why messages do not get through to the vehicle, "" if they do: see `Vehicle.problem`."""
        return self._own.connection.problem

    @property
    def feeds(self) -> Feeds:
        """The messages of the vehicle."""
        return self._feeds

    async def run(self) -> None:
        """Wait until the program is cancelled."""
        await asyncio.Event().wait()


def _is_executor(part: type[Mode | Executor] | Mode | Executor) -> TypeIs[type[Executor] | Executor]:
    return issubclass(part if isinstance(part, type) else type(part), Executor)


def _mode_of(executor: Executor) -> type[Mode] | Mode:
    mode: type[Mode] | Mode | None = getattr(executor, "mode", None)
    if mode is None:
        name = type(executor).__name__
        raise RegistrationError(f"executor {name} has no mode: set its `mode`, which users select to start it")
    return mode
