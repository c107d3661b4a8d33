"""A mission as an executor: it flies the items, goes on after an interruption, and handles failures."""

from __future__ import annotations

import asyncio
import math
import os
from collections.abc import Callable, Coroutine, Iterator, Mapping
from inspect import iscoroutinefunction
from logging import getLogger
from types import new_class
from typing import Any

from msggen.base.diagnostics import InputError
from msggen.flight.errors import FlightError, NotReachedError, report
from msggen.flight.estimates import is_landed
from msggen.flight.executor import Executor
from msggen.flight.feeds import first
from msggen.flight.missions.built_in import BUILT_IN, TAKEOFF, is_built_in, settings_of, takeoff_problems
from msggen.flight.missions.handler import (
    Action,
    Arguments,
    Function,
    FunctionAction,
    Handler,
    MissionError,
    Progress,
    StateFile,
)
from msggen.flight.missions.legs import MissionMode
from msggen.flight.missions.plan import ON_FAILURE, ON_RESUME, RESERVED, RESUMING, ActionItem, Plan, Waypoint
from msggen.flight.missions.reading import parse_mission, read_mission
from msggen.flight.setpoints import check_seconds
from msggen.flight.states import is_disarmed

LOGGER = getLogger("msggen.flight")
_DEEPEST = 11
"""How often `onFailure` is called because it fails itself."""
_GRACE = 0.5
"""The time in s in which a mode ends because the vehicle is disarmed."""
_LOOK = 0.5
"""The period in s at which the file is looked at, and whether the mission is ready."""


class Mission(Executor):
    """A mission of waypoints and actions, with a mode of its name. It begins when the vehicle is armed in the mode.

    `actions` are those of the program, by the names that the file uses: objects of `Action`, or `async def` functions
    of a Handler and the arguments. They replace built-in ones of the same name; None removes one. `state` is a file
    that notes how far the mission has come. `on_progress` gets the index of each item that begins and, at the end, the
    number of items.
    """

    def __init__(
        self,
        plan: Plan | None,
        *,
        name: str = "Mission",
        actions: Mapping[str, Action | Function | None] | None = None,
        state: str | os.PathLike[str] | None = None,
        on_progress: Callable[[int], None] | None = None,
    ) -> None:
        """Take a plan, which is checked as a file that has `plan.dump()`, or None for one that is set later.

        Raises InputError, TypeError for what is no action, ValueError for a name of an action that is reserved, and
        FlightError if `state` is another file.
        """
        self._given = {} if actions is None else dict(actions)
        merged = {**BUILT_IN, **self._given}
        self._table = {key: _action(key, each) for key, each in merged.items() if each is not None}
        self._mode = new_class("MissionMode", (MissionMode,), {"name": name})()
        self._mode.unready = self._told_unready
        vars(self)["mode"] = self._mode  # that of this mission: several can be registered
        self._state = None if state is None else StateFile(os.fspath(state))
        self._progress = Progress(self._save, on_progress)
        self._handler: Handler | None = None
        self._abortion: asyncio.Future[None] | None = None
        self._told: tuple[str, ...] = ()
        self._due = -math.inf
        """When `unready` is looked at again. The vehicle asks several times a second."""
        self._path = ""
        self._seen: tuple[int, ...] = ()
        """What the file was like when it was read."""
        self._set(plan)

    @classmethod
    def load(  # noqa: PLR0913 - keywords, each of which has a default
        cls,
        path: str | os.PathLike[str],
        *,
        name: str | None = None,
        actions: Mapping[str, Action | Function | None] | None = None,
        state: str | os.PathLike[str] | None = None,
        on_progress: Callable[[int], None] | None = None,
        waits: bool = False,
    ) -> Mission:
        """Read a mission file. Its name is that of the file without the suffix.

        With `waits`, the file can be missing. Then the mission is not ready until `follow` has read it.

        Raises InputError, whose diagnostics have the places in the file, and FlightError if `state` is another file.
        """
        path = os.fspath(path)
        stem = os.path.splitext(os.path.basename(path))[0]
        seen = _stamp(path)
        plan = None if waits and not seen else _read(path, {} if actions is None else actions)
        made = cls(plan, name=name or stem, actions=actions, state=state, on_progress=on_progress)
        made._path, made._seen = path, seen
        return made

    @property
    def plan(self) -> Plan:
        """The items of the mission, none if there is no plan yet. It can be set while the mission is not flown."""
        return self._plan

    @plan.setter
    def plan(self, plan: Plan) -> None:
        if self.is_running:
            raise FlightError(f"mission {self._mode.name!r} is flown: set another plan when it has ended")
        self._set(plan)

    def _set(self, plan: Plan | None) -> None:
        if plan is not None:
            plan, _ = parse_mission(plan.dump(), f"mission {self._mode.name}", self._given)  # checks it as a file
        self._plan = plan = plan or Plan(())
        self._checksum = plan.checksum
        found = self._state.load(self._checksum) if self._state is not None else None
        is_within = found is not None and found[0] < len(plan.items)
        self._progress.restore(*(found if found is not None and is_within else (None, {})))

    async def follow(self, period: float = _LOOK) -> None:
        """Read the file again when it changes, until this is cancelled. It is looked at with a period in s.

        A broken file is told, and the mission stays as it was. One that is flown changes when it has ended.

        Raises FlightError for a mission that was not loaded from a file, and ValueError.
        """
        if not self._path:
            raise FlightError(f"mission {self._mode.name!r} has no file to follow: `Mission.load(path)` reads one")
        check_seconds(period, "a period")
        while True:
            await asyncio.sleep(period)
            found = _stamp(self._path)
            if found == self._seen or self.is_running:
                continue
            self._seen = found
            try:
                self.plan = _read(self._path, self._given)
            except InputError as error:
                LOGGER.warning("the mission stays as it was: %s", error)
            else:
                LOGGER.info("mission %s: %d items, read again", self._mode.name, len(self._plan.items))

    @property
    def index(self) -> int | None:
        """The index of the current item, None if the mission begins with the first one the next time."""
        return self._progress.index

    @property
    def is_running(self) -> bool:
        """Whether the mission is flown."""
        return self._handler is not None

    @property
    def unready(self) -> tuple[str, ...]:
        """Why the mission cannot begin, each text once."""
        if not self._plan.items:
            return ("there is no plan yet",)
        found: list[str] = []
        for item in self._plan.items:
            if isinstance(item, ActionItem):
                found += self._table[item.name].problems(item.document)
        found += self._mode.unfit(each.horizontal_velocity for each in settings_of(self._plan, self._table))
        found += takeoff_problems(self._plan, self._given, self._progress.index or 0, self._mode)
        return tuple(dict.fromkeys([*found, *self._mode.beyond(self._places())]))

    def _places(self) -> Iterator[tuple[int, float, float, float]]:
        """Yield the places of items that are known before the flight."""
        for index, item in enumerate(self._plan.items):
            if isinstance(item, Waypoint):
                yield index, item.place.latitude, item.place.longitude, item.place.altitude
            elif is_built_in(item, self._given, TAKEOFF) and "altitude" in item.arguments:
                yield index, math.nan, math.nan, item.arguments["altitude"]

    def _told_unready(self) -> tuple[str, ...]:
        """Return `unready` before the mission, and log it when it has changed."""
        if self.is_running:
            return ()
        now = asyncio.get_running_loop().time()
        if now < self._due:
            return self._told
        found, self._due = self.unready, now + _LOOK
        if found != self._told:
            self._told = found
            state = f"is not ready: {', '.join(found)}" if found else "is ready"
            LOGGER.warning("mission %s %s", self._mode.name, state)
        return self._told

    def abort(self) -> None:
        """Let the mission fail, with the reason `other`."""
        if self._abortion is not None and not self._abortion.done():
            self._abortion.set_exception(MissionError("other", "the program has aborted the mission", self.index))

    async def run(self) -> None:
        """Fly the mission. See Executor."""
        self._progress.settings = self._plan.defaults
        handler = self._renewed()
        self._abortion = asyncio.get_running_loop().create_future()
        try:
            await first(self._fly(handler), self._abortion, self._until_disarmed())
        except Exception as error:
            failure = self._failure(error)
            if is_disarmed(self._mode.feeds["vehicle_status"].latest):
                raise self._disarmed() from error
            await self._fail(failure)
        finally:
            self._abortion = None
            self._end()

    async def _fly(self, handler: Handler) -> None:
        if self.unready:
            raise MissionError("noValidMission", ", ".join(self.unready))
        is_resuming = await self._resume(handler)
        while handler.index < len(self._plan.items):
            await self._run_item(handler, {RESUMING: True} if is_resuming else {})
            is_resuming = False
        if self._mode.is_active:
            await handler.vehicle.hold()
        LOGGER.info("mission %s is completed", self._mode.name)

    async def _run_item(self, handler: Handler, more: Arguments) -> None:
        """Run the current item, or waypoints up to the next action, and make what follows the current item."""
        start = handler.index
        item = self._plan.items[start]
        if isinstance(item, ActionItem):
            await handler.run_action(item.name, {**item.document, **more})
            self._progress.index = handler.index + 1
            return
        waypoints, following = self._plan.segment(start)
        stop = not following or any(self._table[each.name].stops(each.document) for each in following)

        def reach(number: int) -> None:
            self._progress.index = start + number + 1

        await handler.fly_to([each.place for each in waypoints], stop=stop, reached=reach)

    async def _until_disarmed(self) -> None:
        """Raise NotReachedError when the vehicle is disarmed: that interrupts the mission."""
        await self._mode.feeds["vehicle_status"].following(is_disarmed)
        await asyncio.sleep(_GRACE)  # a landing that is completed by that ends the mission instead
        raise self._disarmed()

    def _disarmed(self) -> NotReachedError:
        error = NotReachedError(f"mission {self._mode.name!r} was interrupted: the vehicle is disarmed")
        error.is_handled = True
        return error

    async def _resume(self, handler: Handler) -> bool:
        """Begin the mission, or go on. Return whether the current item runs once more."""
        index = self._progress.index
        self._progress.index = index or 0
        if index is None:
            return False
        stored = self._progress.stored
        if ON_RESUME in self._table:
            await handler.run_action(ON_RESUME, {**stored.pop(ON_RESUME, {}), "action": "resume"})
        if self._progress.index != index:
            stored.clear()
            return False
        for name in [*stored]:
            arguments = stored.pop(name)  # the action stores them again
            if name in self._table:
                await handler.run_action(name, arguments)
        return True

    async def _fail(self, failure: MissionError) -> None:
        """Call `onFailure`, and raise the error: handled, or for the vehicle to return home."""
        raised = failure
        for level in range(1, _DEEPEST + 1):
            LOGGER.error("mission %s has failed (%s): %s", self._mode.name, failure.reason, failure)
            self._deactivate()
            handler = self._renewed()
            index = {} if self.index is None else {"currentIndex": self.index}
            if ON_FAILURE not in self._table:
                break
            try:
                await handler.run_action(ON_FAILURE, {"reason": failure.reason, "recursionLevel": level, **index})
            except Exception as error:  # noqa: BLE001 - as above
                failure = self._failure(error)
            else:
                raised.is_handled = True
                break
        raise raised

    def _failure(self, error: Exception) -> MissionError:
        if isinstance(error, MissionError):
            return error
        if isinstance(error, FlightError):
            return MissionError("modeFailure", str(error), self.index)
        report(f"an action of mission {self._mode.name!r} has failed", error)
        return MissionError("other", f"{type(error).__name__}: {error}", self.index)

    def _renewed(self) -> Handler:
        """Return a new handler, and end the one before."""
        if self._handler is not None:
            self._handler.end()
        self._handler = Handler(self._plan, self._table, self._progress, self, self._mode)
        return self._handler

    def _end(self) -> None:
        """Note how far the mission has come, and end what its actions have left."""
        index, last = self._progress.index, len(self._plan.items) - 1
        if index is not None and (index > last or (index == last and self._is_on_ground())):
            self._progress.clear()
        elif index is not None and ON_RESUME in self._table:
            arguments = {"action": "storeState"}
            _run_at_once(self._table[ON_RESUME].run(self._renewed(), arguments))
        self._deactivate()
        if self._handler is not None:
            self._handler.end()
        self._handler = None

    def _deactivate(self) -> None:
        for name, action in self._table.items():
            try:
                action.deactivate()
            except Exception as error:  # noqa: BLE001 - as above
                report(f"`deactivate` of action {name!r} has failed", error)

    def _is_on_ground(self) -> bool:
        try:
            return is_landed(self._mode.feeds)
        except FlightError:  # the flight has ended
            return False

    def _save(self) -> None:
        if self._state is not None:
            self._state.save(self._checksum, self._progress.index, self._progress.stored)


def _action(name: str, given: Action | Function) -> Action:
    if name.startswith(RESERVED):
        raise ValueError(f"action {name!r}: names with {RESERVED!r} are reserved")
    if isinstance(given, Action):
        return given
    if not iscoroutinefunction(given):
        raise TypeError(f"action {name!r}: expected an `async def` function or an object of Action, got {given!r}")
    return FunctionAction(given)


def _read(path: str, actions: Mapping[str, object]) -> Plan:
    plan, warnings = read_mission(path, actions)
    for each in warnings:
        LOGGER.warning("%s", each)
    return plan


def _stamp(path: str) -> tuple[int, ...]:
    """Return what differs for a file that was written again."""
    try:
        found = os.stat(path)
    except OSError:
        return ()
    return found.st_mtime_ns, found.st_size, found.st_ino


def _run_at_once(coroutine: Coroutine[Any, Any, None]) -> None:
    """Run a coroutine up to its first wait: the mission has lost the vehicle, and the program may be about to end."""
    try:
        coroutine.send(None)
    except StopIteration:
        return
    except Exception as error:  # noqa: BLE001 - whatever an action raises
        report("`onResume` has failed to store its state", error)
        return
    coroutine.close()
    LOGGER.warning("`onResume` waits while it stores its state: what follows is not done")
