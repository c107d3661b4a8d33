"""What actions of a mission are, what they can do, and how far it has come: also in a file."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Coroutine, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from logging import getLogger
from typing import Any, ClassVar, Final, Literal, TypeAlias

from msggen.base.checked import UnexpectedError, field, fields, parsed, shortened, table, text, whole
from msggen.base.diagnostics import InputError, suggestion
from msggen.base.disk.files import flush
from msggen.base.disk.reading import read_bytes
from msggen.base.disk.staging import written_aside
from msggen.flight.actions import Actions
from msggen.flight.errors import FlightError, RefusedError, report
from msggen.flight.estimates import has_landed
from msggen.flight.executor import Executor
from msggen.flight.missions.legs import MissionMode, Segment
from msggen.flight.missions.plan import ActionItem, Plan, Settings
from msggen.flight.places import GlobalPlace

LOGGER = getLogger("msggen.flight")
_FORMAT: Final = "msggen mission state 1"
_MOST: Final = 1 << 31
_WRITER = ThreadPoolExecutor(1, "msggen mission")
"""Writes one state after the other, because a disk can take longer than the setpoints of a flight may wait. It ends its
work before the interpreter does."""

Arguments: TypeAlias = Mapping[str, Any]
Function: TypeAlias = "Callable[[Handler, Arguments], Coroutine[Any, Any, None]]"
Reason: TypeAlias = Literal["actionDoesNotExist", "noValidMission", "trajectoryFailure", "modeFailure", "other"]


class MissionError(FlightError):
    """A mission has failed. `index` is that of its item, None if it has not begun."""

    def __init__(self, reason: Reason, text: str, index: int | None = None) -> None:
        self.reason, self.index = reason, index
        super().__init__(text)


class Action:
    """An action of a mission. A subclass defines `run`. An `async def` function is an action with these defaults."""

    resumes_on_ground: ClassVar[bool] = False
    """Whether a mission that was interrupted in it, and has landed, goes on with it at once."""

    def problems(self, arguments: Arguments) -> Sequence[str]:  # noqa: ARG002 - for subclasses
        """Return why it cannot run, as texts for people. It is called several times a second before the mission.

        While there are any, PX4 does not enter the mode of the mission.
        """
        return ()

    def stops(self, arguments: Arguments) -> bool:  # noqa: ARG002 - for subclasses
        """Return whether the vehicle stops at the last waypoint before it."""
        return True

    async def run(self, handler: Handler, arguments: Arguments) -> None:
        """Run it. An exception fails the mission. It is cancelled if the mission is interrupted."""
        raise NotImplementedError

    def deactivate(self) -> None:
        """End what has outlasted `run`, such as a camera that takes photos: the mission was interrupted."""


class FunctionAction(Action):
    """An action that is an `async def` function."""

    def __init__(self, function: Function, *, stops: bool = True) -> None:
        self._function, self._stops = function, stops

    def stops(self, _: Arguments) -> bool:
        """See Action."""
        return self._stops

    async def run(self, handler: Handler, arguments: Arguments) -> None:
        """See Action."""
        await self._function(handler, arguments)


class Progress:
    """How far a mission has come. `changed` is called when what outlasts the program has changed."""

    def __init__(self, changed: Callable[[], None], moved: Callable[[int], None] | None) -> None:
        self.changed, self._moved = changed, moved
        self._index: int | None = None
        self.settings = Settings()
        self.stored: dict[str, Arguments] = {}
        """The arguments with which actions run again after an interruption, by their names."""

    @property
    def index(self) -> int | None:
        """The index of the current item, None before the mission."""
        return self._index

    @index.setter
    def index(self, index: int | None) -> None:
        self._index = index
        self.changed()
        if self._moved is not None and index is not None:
            try:
                self._moved(index)
            except Exception as error:  # noqa: BLE001 - whatever a program raises
                report("`on_progress` of a mission has failed", error)

    def restore(self, index: int | None, stored: Mapping[str, Arguments]) -> None:
        """Take what was noted before."""
        self._index, self.stored = index, dict(stored)

    def clear(self) -> None:
        """Begin with the first item the next time."""
        self.stored = {}
        self.index = None


class Handler:
    """What an action can do, until the mission is interrupted or fails. Then, each call raises FlightError."""

    def __init__(
        self, plan: Plan, actions: Mapping[str, Action], progress: Progress, executor: Executor, mode: MissionMode
    ) -> None:
        self._plan, self._actions, self._progress = plan, actions, progress
        self._executor, self._mode = executor, mode
        self.is_valid = True
        """Whether the mission still is where it was when the action began."""

    @property
    def plan(self) -> Plan:
        """The mission."""
        return self._plan

    @property
    def vehicle(self) -> Actions:
        """The actions of the executor: `takeoff`, `land`, `return_home`, `hold`, `set_mode`."""
        self._check()
        return self._executor._actions  # noqa: SLF001 - of the same library

    @property
    def index(self) -> int:
        """The index of the current item. After an action that sets it, the mission goes on with the item after it."""
        return self._progress.index or 0

    @index.setter
    def index(self, index: int) -> None:
        self._check()
        if not 0 <= index < len(self._plan.items):
            raise ValueError(f"expected an index below {len(self._plan.items)}, got {index}")
        self._progress.index = index

    @property
    def settings(self) -> Settings:
        """The limits of the flight to the next waypoints."""
        return self._progress.settings

    @settings.setter
    def settings(self, settings: Settings) -> None:
        self._check()
        self._progress.settings = settings

    def store(self, name: str, arguments: Arguments) -> None:
        """Let an action run again with these arguments when the mission goes on after an interruption.

        Raises TypeError and ValueError for arguments that are not JSON.
        """
        self._check()
        self._progress.stored[name] = json.loads(json.dumps(dict(arguments), allow_nan=False))
        self._progress.changed()

    def forget(self, name: str) -> None:
        """Undo `store`."""
        self._check()
        if self._progress.stored.pop(name, None) is not None:
            self._progress.changed()

    async def has_landed(self) -> bool:
        """Return whether the vehicle is on the ground. Raises NoAnswerError if it does not tell within 3 s."""
        return await has_landed(self._mode.feeds)

    async def run_action(self, name: str, arguments: Arguments | None = None) -> None:
        """Run another action. Raises MissionError if there is none of this name, and what it raises."""
        self._check()
        action = self._actions.get(name)
        if action is None:
            near = suggestion(name, self._actions)
            raise MissionError("actionDoesNotExist", f"there is no action {name!r}{near}", self._progress.index)
        LOGGER.info("mission %s: action %s", self._mode.name, name)
        await action.run(self, {} if arguments is None else arguments)

    async def fly_to(
        self, places: Sequence[GlobalPlace], *, stop: bool = True, reached: Callable[[int], None] = lambda _: None
    ) -> None:
        """Fly to places, one after the other, with the current settings. Without `stop`, do not stop at the last one.

        `reached` gets the number of each place that is reached, from 0 on. Raises MissionError, and RefusedError if
        the vehicle does not enter the mode of the mission.
        """
        self._check()
        if not places:
            return
        self._mode.segment = Segment(tuple(places), self.settings, stop, reached)
        try:
            await self._executor.fly(self._mode)
        except RefusedError:
            raise
        except FlightError as error:
            raise MissionError("trajectoryFailure", str(error), self._progress.index) from error

    @property
    def resumes_on_ground(self) -> bool:
        """Whether the current item is an action that goes on from the ground."""
        item = self._plan.items[self.index]
        return isinstance(item, ActionItem) and self._actions[item.name].resumes_on_ground

    def end(self) -> None:
        """Refuse each further call."""
        self.is_valid = False

    def _check(self) -> None:
        if not self.is_valid:
            raise FlightError(f"mission {self._mode.name!r} was interrupted or has failed: this action has ended")


class StateFile:
    """A file with the index and the stored actions of a mission. There is none before the mission and after its end."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._is_told = False

    def load(self, checksum: str) -> tuple[int, Mapping[str, Any]] | None:
        """Return what was saved of the mission with a checksum, None if nothing was.

        Raises FlightError for a file that was not written by `save`: it is not overwritten.
        """
        return _WRITER.submit(self._load, checksum).result()

    def save(self, checksum: str, index: int | None, stored: Mapping[str, Any]) -> None:
        """Save how far a mission has come, or remove the file if the index is None. Does not wait for the disk."""
        content = {"format": _FORMAT, "mission": checksum, "index": index, "actions": stored}
        _WRITER.submit(self._write, None if index is None else json.dumps(content, indent=1).encode())

    def _load(self, checksum: str) -> tuple[int, Mapping[str, Any]] | None:
        try:
            content = parsed(read_bytes(self._path))
            _check_format(content)
            index = whole(field(content, "index"), 0, _MOST)
            stored = table(field(content, "actions"), fields)
            return (index, stored) if text(field(content, "mission")) == checksum else None
        except FileNotFoundError:
            return None
        except (OSError, UnexpectedError) as error:
            raise FlightError(
                f"{self._path} is not the state of a mission ({error}): remove it, or choose another file as `state`"
            ) from None

    def _write(self, content: bytes | None) -> None:
        path = os.path.abspath(self._path)
        try:
            if content is not None:
                with written_aside({path: content}) as move_into_place:
                    move_into_place()
                return
            with suppress(FileNotFoundError):
                os.unlink(path)
                flush([os.path.dirname(path)])
        except (OSError, InputError) as error:
            if not self._is_told:
                LOGGER.warning("the state of the mission is not saved, so that no other program goes on: %s", error)
            self._is_told = True


def _check_format(content: object) -> None:
    found = field(content, "format")
    if found != _FORMAT:
        raise UnexpectedError(f"its format is {shortened(found)}")
