"""The modes and executors of a program: registering, registering again after a restart, and unregistering them."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from logging import getLogger
from typing import Any, Final, NamedTuple

from msggen.flight.actions import Actions
from msggen.flight.checks import Answers
from msggen.flight.commands import Commands
from msggen.flight.connection import Connection, Topics
from msggen.flight.declared import check_executor, check_mode
from msggen.flight.errors import FlightError, NoAnswerError, RegistrationError, RestartedError, report, watched
from msggen.flight.executor import Executor
from msggen.flight.feeds import Feeds
from msggen.flight.followers import check_kinds
from msggen.flight.limits import Fence
from msggen.flight.link import LinkConnection, Need
from msggen.flight.memory import Memory
from msggen.flight.mode import Mode
from msggen.flight.overrides import Overrides, check_overrides
from msggen.flight.registration import ARMED, Ids, Registrar, Wanted
from msggen.flight.restarts import Restarts
from msggen.flight.resuming import FRESH, Resuming
from msggen.flight.running_executor import Charge
from msggen.flight.running_mode import ActiveMode
from msggen.flight.states import is_armed, is_disarmed, name_of
from msggen.messages.commands import OF_EXECUTOR
from msggen.messages.setpoints import SENT

LOGGER = getLogger("msggen.flight")
_READY = 1.0
"""The time in s to wait until the vehicle has read the first reply of a mode: it asks every 0.3 s."""
_APART = 0.02
"""The time in s between two unregistrations: PX4's queue holds one, and PX4 reads it within 10 ms."""
_AGAIN = 1.0
_ALWAYS: Final = (
    Need("in", "register_ext_component_request"),
    Need("out", "register_ext_component_reply"),
    Need("in", "unregister_ext_component"),
    Need("out", "arming_check_request"),
    Need("in", "arming_check_reply"),
    Need("in", "mode_completed"),
)
_CONFIGURATION: Final = (
    Need("in", "setpoint_config"),
    Need("out", "setpoint_config_reply"),
    Need("in", "config_control_setpoints"),
)
"""Needed as far as the release has them."""
_OF_EXECUTORS: Final = Need("in", "vehicle_command_mode_executor")
NEEDED: Final = (
    *_ALWAYS,
    *_CONFIGURATION,
    _OF_EXECUTORS,
    *(Need("in", topic) for kind in SENT for topic in kind.topics),
)
"""All topics that modes and executors can need."""


class Part(NamedTuple):
    """A mode, and the executor that it belongs to."""

    mode: Mode
    executor: Executor | None

    @property
    def wanted(self) -> Wanted:
        """The registration to request."""
        mode, executor = self.mode, self.executor
        return Wanted(
            mode.name,
            executor=executor is not None,
            replaces=mode.replaces,
            is_immediate=executor is not None and executor.starts == "registered",
            is_selectable=mode.is_selectable,
        )


def _needs_of(connection: Connection, parts: list[Part]) -> Iterator[Need]:
    """Yield the topics that modes and executors need."""
    topics = Topics(connection.package)
    yield from _ALWAYS
    yield from (each for each in _CONFIGURATION if topics.has(*each))
    for topic in {topic for part in parts for kind in part.mode.setpoints for topic in kind.topics}:
        yield Need("in", topic)
    if any(part.executor is not None for part in parts):
        yield _OF_EXECUTORS


class Parts:
    """The modes and executors that a program has registered."""

    def __init__(self, connection: Connection, feeds: Feeds, sender: Commands, fence: Fence, *, resume: bool) -> None:
        self.connection, self._feeds, self._commands, self._fence = connection, feeds, sender, fence
        self._registrar = Registrar(connection, feeds)
        self._resume = resume
        self._is_closed = False
        self.replacements: dict[int, int] = {}
        """The nav_states of own modes that replace PX4 modes, by those of the PX4 modes."""
        self._parts: list[Part] = []
        self._modes: dict[type[Mode], ActiveMode] = {}
        self._charges: list[Charge] = []
        self._answers: Answers | None = None
        self._restarts: Restarts | None = None
        identity = connection.identity if isinstance(connection, LinkConnection) else ""
        self._memory = Memory(identity) if identity else None
        self._renewal: asyncio.Task[None] | None = None
        self._registered: dict[str, Ids] = {}
        """The ids of this program. At its end, another thread may unregister them."""
        self._lock = threading.Lock()

    async def add(self, parts: list[Part]) -> None:
        """See `Flight.add`."""
        for part in parts:
            self._check(part)
        if isinstance(self.connection, LinkConnection):
            self.connection.check(_needs_of(self.connection, parts))
        added: list[Part] = []
        try:
            for part in parts:
                await self._add(part)
                added.append(part)
        except BaseException:
            for part in added:
                self._drop(part.mode)
            raise
        self._parts += added

    def _check(self, part: Part) -> None:
        """Raise an error before anything is sent."""
        mode, executor = part.mode, part.executor
        if self._is_closed:
            raise FlightError("the flight has ended")
        if any(each.mode.name == mode.name for each in self._parts):
            raise RegistrationError(f"a mode with the name {mode.name!r} is registered already")
        check_mode(mode, is_owned=executor is not None)
        if executor is not None:
            check_executor(executor)
        self._fence.tightened(mode.limits).check_kinds(mode.setpoints)
        self._registrar.request(part.wanted)
        topics = Topics(self.connection.package)
        check_kinds(mode.name, mode.setpoints, self._feeds["vehicle_status"].latest)
        for topic in (topic for kind in mode.setpoints for topic in kind.topics):
            topics.incoming(topic)
        for each in (mode, executor):
            if each is not None:
                check_overrides(topics, each.keeps)

    async def settle(self) -> None:
        """Wait until all unregistrations are sent."""
        await self._registrar.settle()

    @property
    def is_urgent(self) -> bool:
        """Whether a program may have been killed just now at this vehicle. Then this one must answer at once."""
        return self._memory is not None and self._memory.is_interrupted(FRESH)

    def find(self, mode: type[Mode] | Mode) -> ActiveMode:
        """Return a registered mode. Raises FlightError if it is not registered."""
        found = self._modes.get(mode if isinstance(mode, type) else type(mode))
        if found is None:
            raise FlightError(f"mode {mode.name!r} is not registered: `await flight.add(...)` registers it")
        return found

    def find_executor(self, executor: type[Executor] | Executor) -> Charge:
        """Return an executor that is registered. Raises FlightError."""
        cls = executor if isinstance(executor, type) else type(executor)
        found = next((each for each in self._charges if type(each.executor) is cls), None)
        if found is None:
            raise FlightError(f"executor {cls.__name__} is not registered: `await flight.add(...)` registers it")
        return found

    def mode_name(self) -> str:
        """Return the name of the mode that flies the vehicle."""
        status = self._feeds["vehicle_status"].latest
        own = {each.ids.mode: each.ids.name for each in self._modes.values()}
        return "" if status is None else own.get(status.nav_state) or name_of(status.nav_state)

    def owner_of(self, active: ActiveMode) -> Charge | None:
        """Return the executor that a mode belongs to."""
        return next((each for each in self._charges if each.ids is active.ids), None)

    def follow(self, status: Any) -> None:
        """Start and end executors and modes. Executors come first, so that one that ends does not see its mode end."""
        if self._restarts is not None:
            self._restarts.take(status)
        for charge in [*self._charges]:
            charge.follow(status)
        for active in [*self._modes.values()]:
            active.follow(status)
        if self._memory is not None:
            for active in self._modes.values():
                self._memory.write(active.ids, status)
            self._memory.touch()

    def stop(self) -> None:
        """Stop all modes and executors, and send nothing."""
        for charge in self._charges:
            charge.close()
        for active in self._modes.values():
            active.close()
            if self._answers is not None:
                self._answers.remove(active.ids.check)
        self._charges.clear()
        self._modes.clear()
        self.replacements.clear()

    def close(self) -> None:
        """Stop all modes and executors, and unregister them."""
        self._is_closed = True
        if self._renewal is not None:
            self._renewal.cancel()
        self.stop()
        self.unregister()
        for each in (self._answers, self._restarts):
            if each is not None:
                each.close()
        self._parts.clear()

    def unregister(self) -> None:
        """Unregister all modes. Can be called from any thread, and several times."""
        is_link = isinstance(self.connection, LinkConnection)
        with self._lock:
            while self._registered:
                _, ids = self._registered.popitem()
                with suppress(FlightError):
                    self._registrar.unregister(ids)
                if self._memory is not None:
                    self._memory.write(ids, None, is_over=True)
                    self._memory.release(ids.name)
                if is_link and self._registered:
                    time.sleep(_APART)

    async def _add(self, part: Part, *, is_again: bool = False) -> None:
        """Register a mode, or continue with the ids of an earlier program. With `is_again`, always register."""
        answers, restarts = self._watch()
        resuming = Resuming(self._memory, self._feeds, answers, self._registrar, resume=self._resume)
        try:
            ids = None if is_again else await resuming.ids_of(part.mode)
            is_resumed = ids is not None
            if ids is None:
                await self._check_disarmed(part.mode.name)
                ids = await self._registrar.register(part.wanted)
        except BaseException:
            if self._memory is not None:
                self._memory.release(part.mode.name)
            raise
        self._registered[ids.name] = ids
        if self._memory is not None:  # at once: a program can be killed before the next VehicleStatus
            self._memory.write(ids, self._feeds["vehicle_status"].latest)
        active = self._begin(part, ids, is_resumed=is_resumed)
        resuming.tell_slot(ids)
        restarts.begin()
        if is_resumed:
            return
        try:
            await active.configuration.check(part.mode.setpoints)
            await active.overrides.begin()
            charge = self.owner_of(active)
            if charge is not None:
                await charge.overrides.begin()
            await self._until_ready(active)
        except BaseException:
            if self._modes.get(type(part.mode)) is active:
                self._drop(part.mode)
            raise

    async def _check_disarmed(self, name: str) -> None:
        """Raise RegistrationError while the vehicle is armed."""
        with suppress(TimeoutError):  # then, PX4 decides
            if is_armed(await self._feeds["vehicle_status"].wait(lambda _: True, _READY)):
                raise RegistrationError(f"{name}: {ARMED}")

    def _watch(self) -> tuple[Answers, Restarts]:
        if self._answers is None or self._restarts is None:
            self._answers = Answers(self.connection, self._feeds)
            self._restarts = Restarts(self._feeds, self._mask, self._lose)
        return self._answers, self._restarts

    def _begin(self, part: Part, ids: Ids, *, is_resumed: bool) -> ActiveMode:
        own = Actions(self._commands, self._feeds, self._fence, self.replacements)
        active = ActiveMode(part.mode, ids, self.connection, self._feeds, self._fence, own)
        part.mode.is_resumed = is_resumed
        self._modes[type(part.mode)] = active
        if part.mode.replaces is not None:
            self.replacements[part.mode.replaces] = ids.mode
        self._watch()[0].add(ids.check, active.verdict)
        if part.executor is not None:
            part.executor.is_resumed = is_resumed
            actions = Actions(self._commands, self._feeds, self._fence, self.replacements, ids.executor)
            overrides = Overrides(self.connection, self._feeds, OF_EXECUTOR, ids.executor, part.executor.keeps)
            self._charges.append(Charge(part.executor, ids, actions, overrides, self.find))
        return active

    def _drop(self, mode: Mode) -> None:
        """Unregister a mode that cannot be flown, unless the flight has ended or the vehicle has restarted."""
        active = self._modes.pop(type(mode), None)
        if active is None:
            return
        charge = self.owner_of(active)
        if charge is not None:
            charge.close()
            self._charges.remove(charge)
        active.close()
        self.replacements.pop(-1 if mode.replaces is None else mode.replaces, None)
        self._watch()[0].remove(active.ids.check)
        with self._lock:
            self._registered.pop(active.ids.name, None)
        self._registrar.unregister(active.ids)
        if self._memory is not None:
            self._memory.release(active.ids.name)

    async def _until_ready(self, active: ActiveMode) -> None:
        """Wait until the vehicle has read the first reply of a mode. Until then, it refuses to arm in the mode."""
        bit = 1 << active.ids.mode
        with suppress(TimeoutError):  # the conditions of the mode are not met
            await self._feeds["failsafe_flags"].following(lambda flags: not flags.mode_req_other & bit, _READY)

    # after a restart

    def _mask(self) -> int:
        return sum(1 << active.ids.check for active in self._modes.values())

    def _lose(self, why: str) -> None:
        """End all modes, because the vehicle no longer knows their ids, and register them again."""
        LOGGER.warning("%s: all modes are registered again", why)
        for active in self._modes.values():
            active.lose(RestartedError(f"{why}, so mode {active.mode.name!r} has ended"))
        self.stop()
        self._remove_selected()
        with self._lock:
            self._registered.clear()
        if self._renewal is None or self._renewal.done():
            self._renewal = watched(
                self._renew(),
                "msggen flight renewal",
                lambda _, error: report("the modes could not be registered again", error),
            )

    def _remove_selected(self) -> None:
        """Unregister what the vehicle keeps although it does not answer, because it is selected."""
        status = self._feeds["vehicle_status"].latest
        for ids in self._registered.values():
            if status is not None and status.nav_state_user_intention == ids.mode:
                self._registrar.unregister(ids)

    async def _renew(self) -> None:
        for part in self._parts:
            while type(part.mode) not in self._modes:
                try:
                    await self._add_again(part)
                except NoAnswerError:  # the vehicle is still starting
                    await asyncio.sleep(_AGAIN)
                except FlightError as error:
                    report(f"mode {part.mode.name!r} could not be registered again", error)
                    break

    async def _add_again(self, part: Part) -> None:
        try:
            await self._add(part, is_again=True)
        except RegistrationError:
            status = self._feeds["vehicle_status"]
            if is_disarmed(status.latest):
                raise
            await status.wait(is_disarmed)
            await self._add(part, is_again=True)
