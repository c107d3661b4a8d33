"""The modes, executors and checks of a program: registering, registering again after a restart, and unregistering."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from logging import getLogger
from typing import Any

from msggen.flight.actions import Actions
from msggen.flight.checks import Active, Answering, Answers, Check
from msggen.flight.commands import Commands
from msggen.flight.errors import FlightError, NoAnswerError, RegistrationError, RestartedError, report, watched
from msggen.flight.executor import Charge, Executor
from msggen.flight.feeds import Connection, Feeds, Topics
from msggen.flight.followers import check_kinds
from msggen.flight.limits import Fence
from msggen.flight.link import LinkConnection
from msggen.flight.mode import Mode
from msggen.flight.part import Part, check_check, check_executor, check_mode, needed_topics
from msggen.flight.registration import (
    ARMED,
    NONE,
    REPLY,
    ArmedError,
    Ids,
    Overrides,
    Registrar,
    check_overrides,
    ids_of,
)
from msggen.flight.restarts import Restarts
from msggen.flight.resuming import FRESH, Memory, Resuming, is_asked
from msggen.flight.running_mode import ActiveMode
from msggen.flight.states import is_armed, is_disarmed, name_of
from msggen.messages.commands import OF_EXECUTOR

LOGGER = getLogger("msggen.flight")
_READY = 1.0
"""The time in s to wait until the vehicle has read the first reply: it asks every 0.3 s."""
_READ = 0.1
"""The time in s within which the vehicle reads a reply."""
_APART = 0.02
"""The time in s between two unregistrations: PX4's queue holds one, and PX4 reads it within 10 ms."""
_AGAIN = 1.0


class Parts:
    """The modes, executors and checks that a program has registered."""

    def __init__(self, connection: Connection, feeds: Feeds, sender: Commands, fence: Fence, *, resume: bool) -> None:
        self.connection, self._feeds, self._commands, self._fence = connection, feeds, sender, fence
        sender.problems_in = self._problems_in
        self._registrar = Registrar(connection, feeds)
        self._resume = resume
        self._is_closed = False
        self.replacements: dict[int, int] = {}
        """The nav_states of own modes that replace PX4 modes, by those of the PX4 modes."""
        self._parts: list[Part] = []
        self._active: dict[type[Answering], Active] = {}
        self._charges: list[Charge] = []
        self._answers: Answers | None = None
        self._restarts: Restarts | None = None
        identity = connection.identity if isinstance(connection, LinkConnection) else ""
        self._memory = Memory(identity)
        self._renewal: asyncio.Task[None] | None = None
        self._registered: dict[str, Ids] = {}
        """The ids of this program. At its end, another thread may unregister them."""
        self._lock = threading.Lock()

    async def add(self, parts: list[Part]) -> None:
        """See `Flight.add`."""
        for part in parts:
            self._check(part)
        if isinstance(self.connection, LinkConnection):
            self.connection.check(needed_topics(self.connection, parts))
        added: list[Part] = []
        try:
            for part in parts:
                try:
                    await self._add(part)
                except ArmedError:
                    if not self._waits_for_landing(part.subject):
                        raise
                added.append(part)
        except BaseException:
            for part in added:
                self._drop(part.subject)
            raise
        self._begin_executors(self._feeds["vehicle_status"].latest)
        self._parts += added
        if any(type(part.subject) not in self._active for part in added):
            self._renew()

    def _begin_executors(self, status: Any) -> None:
        """Let executors follow the vehicle, once all that they can fly is registered."""
        for charge in self._charges:
            charge.begin(status)

    def _check(self, part: Part) -> None:
        """Raise an error before anything is sent."""
        mode, executor = part.subject, part.executor
        if self._is_closed:
            raise FlightError("the flight has ended")
        named = next((each.subject for each in self._parts if each.subject.name == mode.name), None)
        if named is not None:
            kind = "check" if isinstance(named, Check) else "mode"
            raise RegistrationError(f"a {kind} with the name {mode.name!r} is registered already")
        topics = Topics(self.connection.package)
        if isinstance(mode, Check):
            check_check(mode)
        else:
            status = self._feeds["vehicle_status"].latest
            mode.meet(status, topics.takes)
            check_mode(mode, is_owned=executor is not None)
            check_kinds(mode.name, mode.setpoints, status, topics)
            self._fence.tightened(mode.limits).check_kinds(mode.setpoints)
            check_overrides(topics, mode.keeps)
        if executor is not None:
            check_executor(executor)
            check_overrides(topics, executor.keeps)
        self._registrar.request(part.wanted)

    async def settle(self) -> None:
        """Wait until all unregistrations are sent."""
        await self._registrar.settle()

    @property
    def is_urgent(self) -> bool:
        """Whether a program may have been killed just now at this vehicle. Then this one must answer at once."""
        return self._memory.is_interrupted(FRESH)

    def find(self, mode: type[Mode] | Mode) -> ActiveMode:
        """Return a registered mode. Raises FlightError if it is not registered."""
        found = self._active.get(mode if isinstance(mode, type) else type(mode))
        if isinstance(found, ActiveMode):
            return found
        if found is not None:
            raise FlightError(f"{mode.name!r} is a check without a mode, and flies nothing")
        raise FlightError(f"mode {mode.name!r} is not registered: `await flight.add(...)` registers it")

    def find_executor(self, executor: type[Executor] | Executor) -> Charge:
        """Return an executor that is registered. Raises FlightError."""
        cls = executor if isinstance(executor, type) else type(executor)
        found = next((each for each in self._charges if executor in (each.executor, type(each.executor))), None)
        if found is None:
            raise FlightError(f"executor {cls.__name__} is not registered: `await flight.add(...)` registers it")
        return found

    def mode_name(self) -> str:
        """Return the name of the mode that flies the vehicle."""
        status = self._feeds["vehicle_status"].latest
        own = {each.ids.mode: each.ids.name for each in self._active.values()}
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
        for active in [*self._active.values()]:
            active.follow(status)
        for active in self._active.values():
            self._memory.write(active.ids, status)
        self._memory.touch()

    def stop(self) -> None:
        """Stop all modes, executors and checks, and send nothing."""
        self._forget([*self._active.values()])

    def _forget(self, gone: Sequence[Active]) -> None:
        """Stop some modes with their executors, and checks. Executors come first, as in `follow`."""
        ids = {each.ids for each in gone}
        for charge in [each for each in self._charges if each.ids in ids]:
            charge.close()
            self._charges.remove(charge)
        for active in gone:
            active.close()
            self._watch()[0].remove(active.ids.check)
            del self._active[type(active.subject)]
        modes = {each.mode for each in ids}
        for replaced in [each for each, own in self.replacements.items() if own in modes]:
            del self.replacements[replaced]

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
        """Unregister all modes and checks. Can be called from any thread, and several times."""
        is_link = isinstance(self.connection, LinkConnection)
        with self._lock:
            while self._registered:
                _, ids = self._registered.popitem()
                with suppress(FlightError):
                    self._registrar.unregister(ids)
                self._memory.write(ids, None, is_over=True)
                self._memory.release(ids.name)
                if is_link and self._registered:
                    time.sleep(_APART)

    async def _add(self, part: Part, *, is_again: bool = False) -> None:
        """Register a mode or a check, or continue with the ids of an earlier program: not with `is_again`."""
        answers, restarts = self._watch()
        resuming = Resuming(self._memory, self._feeds, answers, self._registrar, resume=self._resume)
        try:
            ids = None if is_again else await resuming.ids_of(part.subject)
            is_resumed = ids is not None
            if ids is None:
                await self._check_disarmed(part.subject.name)
                ids = await self._registrar.register(part.wanted)
        except BaseException:
            self._memory.release(part.subject.name)
            raise
        self._registered[ids.name] = ids
        status = self._feeds["vehicle_status"].latest
        self._memory.write(ids, status)  # at once: a program can be killed before the next VehicleStatus
        active = self._begin(part, ids, is_resumed=is_resumed)
        resuming.tell_slot(ids)
        restarts.begin()
        if is_resumed:
            self._begin_executors(None)
            return
        try:
            if isinstance(active, ActiveMode):
                await self._configure(active)
            await self._until_ready(active.ids)
        except BaseException:
            if self._active.get(type(part.subject)) is active:
                self._drop(part.subject)
            raise

    async def _configure(self, active: ActiveMode) -> None:
        await active.configuration.check(active.mode.setpoints)
        await active.overrides.begin()
        charge = self.owner_of(active)
        if charge is not None:
            await charge.overrides.begin()

    async def _check_disarmed(self, name: str) -> None:
        """Raise ArmedError while the vehicle is armed."""
        with suppress(TimeoutError):  # then, PX4 decides
            if is_armed(await self._feeds["vehicle_status"].wait(lambda _: True, _READY)):
                raise ArmedError(f"{name}: {ARMED}")

    def _waits_for_landing(self, subject: Mode | Check) -> bool:
        """Whether a check is registered later, because its program was killed and goes on with its modes in flight."""
        modes = [each.mode for each in self._active.values() if isinstance(each, ActiveMode)]
        if not (isinstance(subject, Check) and any(mode.is_resumed for mode in modes)):
            return False
        LOGGER.warning("the vehicle has removed check %r: it is registered again once disarmed", subject.name)
        return True

    def _watch(self) -> tuple[Answers, Restarts]:
        if self._answers is None or self._restarts is None:
            self._answers = Answers(self.connection, self._feeds)
            self._restarts = Restarts(self._feeds, self._mask, self._mask_of_checks, self._lose)
            self._feeds[REPLY].call(self._take_registration)
        return self._answers, self._restarts

    def _begin(self, part: Part, ids: Ids, *, is_resumed: bool) -> Active:
        mode = part.subject
        active: Active
        if isinstance(mode, Check):
            active = Active(mode, ids)
        else:
            own = Actions(self._commands, self._feeds, self._fence, self.replacements)
            active = ActiveMode(mode, ids, self.connection, self._feeds, self._fence, own)
            mode.is_resumed = is_resumed
            if mode.replaces is not None:
                self.replacements[mode.replaces] = ids.mode
        self._active[type(mode)] = active
        self._watch()[0].add(ids.check, active.verdict)
        if part.executor is not None:
            part.executor.is_resumed = is_resumed
            actions = Actions(self._commands, self._feeds, self._fence, self.replacements, ids.executor)
            overrides = Overrides(self.connection, self._feeds, OF_EXECUTOR, ids.executor, part.executor.keeps)
            self._charges.append(Charge(part.executor, ids, actions, overrides, self.find))
        return active

    def _drop(self, subject: Mode | Check) -> None:
        """Unregister a mode that cannot be flown, unless the flight has ended or the vehicle has restarted."""
        active = self._active.get(type(subject))
        if active is None:
            return
        self._forget([active])
        with self._lock:
            self._registered.pop(active.ids.name, None)
        self._registrar.unregister(active.ids)
        self._memory.release(active.ids.name)

    async def _until_ready(self, ids: Ids) -> None:
        """Wait until the vehicle has read the first reply. Until then, it refuses to arm: in any mode, for a check.

        In the meantime, PX4 can count it for the check 0, so the other modes are not ready either.
        """
        if ids.mode != NONE:
            bits = 1 << ids.mode | self._bits_of_runnable()
            with suppress(TimeoutError):  # the conditions of the mode are not met
                await self._feeds["failsafe_flags"].following(lambda flags: not flags.mode_req_other & bits, _READY)
            return
        with suppress(TimeoutError):
            await self._feeds["arming_check_request"].following(lambda each: is_asked(each, ids.check), _READY)
            await asyncio.sleep(_READ)

    def _bits_of_runnable(self) -> int:
        """Return the modes whose conditions are met, as bits."""
        modes = [(each.ids.mode, each.verdict()) for each in self._active.values() if each.ids.mode != NONE]
        return sum(1 << mode for mode, verdict in modes if verdict.can_run and not verdict.problems)

    def _problems_in(self, mode: int) -> list[str]:
        """Return the problems of the mode with a nav_state, and of checks without a mode."""
        reporting = [each for each in self._active.values() if each.ids.mode in {mode, NONE}]
        return [f"{each.ids.name!r} reports {found}" for each in reporting for found in each.verdict().problems]

    # after a restart

    def _mask(self) -> int:
        return sum(1 << active.ids.check for active in self._active.values())

    def _mask_of_checks(self) -> int:
        return sum(1 << active.ids.check for active in self._active.values() if active.ids.mode == NONE)

    def _take_registration(self, reply: Any) -> None:
        """Give up an id that the vehicle has assigned to somebody else, whose check would get the replies of two."""
        ids = ids_of(reply)
        own = (each.ids for each in self._active.values())
        if reply.success and any(each.check == ids.check and each != ids for each in own):
            self._lose(f"the vehicle has registered {ids.name!r} in its place", 1 << ids.check)

    def _lose(self, why: str, lost: int) -> None:
        """End modes and checks, because the vehicle no longer knows their ids, and register them again."""
        gone = [each for each in self._active.values() if lost >> each.ids.check & 1]
        LOGGER.warning("%s: registering %s again", why, ", ".join(repr(each.ids.name) for each in gone))
        for active in gone:
            active.lose(RestartedError(f"{why}, so mode {active.ids.name!r} has ended"))
        self._forget(gone)
        with self._lock:
            for active in gone:
                self._remove_selected(active.ids)
                self._registered.pop(active.ids.name, None)
        self._renew()

    def _remove_selected(self, ids: Ids) -> None:
        """Unregister a mode that the vehicle keeps although it does not answer, because it is selected."""
        if self._feeds.shows(lambda each: each.nav_state_user_intention == ids.mode):
            self._registrar.unregister(ids)

    def _renew(self) -> None:
        """Register what is missing, unless that is under way."""
        if self._renewal is None or self._renewal.done():
            self._renewal = watched(
                self._add_missing(),
                "msggen flight renewal",
                lambda _, error: report("the modes could not be registered again", error),
            )

    async def _add_missing(self) -> None:
        given_up: list[Part] = []
        while True:
            missing = [each for each in self._parts if type(each.subject) not in self._active and each not in given_up]
            if not missing:
                self._begin_executors(self._feeds["vehicle_status"].latest)
                return
            try:
                await self._add(missing[0], is_again=True)
            except NoAnswerError:  # the vehicle is still starting
                await asyncio.sleep(_AGAIN)
            except ArmedError:
                await self._feeds["vehicle_status"].wait(is_disarmed)
            except FlightError as error:
                report(f"{missing[0].subject.name!r} could not be registered again", error)
                given_up.append(missing[0])
