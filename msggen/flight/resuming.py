"""The ids of modes and checks in a folder of the user, with which a program continues that was killed.

There is a file for each vehicle and name. The program that has registered it holds a lock, so that two cannot. The
modification time of the file, on the monotonic clock, is when the program last heard the vehicle.
"""

from __future__ import annotations

import asyncio
import json
import math
import os
import time
from contextlib import suppress
from hashlib import blake2b
from logging import getLogger
from typing import IO, Any, Final, NamedTuple

from msggen.base.checked import UnexpectedError, field, parsed, real, row, text, truth, whole
from msggen.base.disk.reading import read_bytes
from msggen.flight.checks import Answers, Check, Verdict
from msggen.flight.errors import NoAnswerError, RegistrationError
from msggen.flight.feeds import UTC, Feeds
from msggen.flight.mode import Mode, needs_of
from msggen.flight.registration import NONE, Ids, Registrar
from msggen.flight.states import is_disarmed
from msggen.link.session_files import boot_id, is_own, records_folder, replace_stamped, set_aside, stamp
from msggen.messages.nav_states import EXTERNAL

try:
    import fcntl
except ImportError:  # Windows: two programs are not told apart
    fcntl = None  # type: ignore[assignment]

LOGGER = getLogger("msggen.flight")
_VERSION: Final = 2
_SUFFIX: Final = ".json"
_LATEST: Final = (1 << 64) - 1
"""The largest timestamp of a vehicle in us."""
_CHECKS: Final = 32
"""The bits of ArmingCheckRequest.valid_registrations_mask."""
_LARGEST_EXECUTOR: Final = 127
"""RegisterExtComponentReply.mode_executor_id is an int8."""
_TOUCH = 0.5
"""The period in s at which a program notes that it is alive."""
FRESH = 2.0
"""The age in s up to which the ids of an earlier program are surely valid: no vehicle restarts faster."""
_HEARD = 2.0
_REMOVED = 0.05
"""The time in s within which a vehicle removes a mode."""
_SAME = 1.0
"""By how many s the time of a boot may differ: messages take different times. A restart takes longer."""
_TRIES = 3
_ASKED = 0.5
"""The time in s to wait for an arming-check request: the vehicle sends one every 0.3 s."""


class Remembered(NamedTuple):
    """What is known of a mode from an earlier program."""

    ids: Ids
    armed_time: int
    """`armed_time` of VehicleStatus, since boot, by which a boot of the vehicle is recognized. 0 if it was disarmed."""
    mode_time: int
    """`nav_state_timestamp` of VehicleStatus, for the same purpose."""
    booted: float
    """The time in s of the monotonic clock at which the vehicle has booted, for the same purpose. NaN if unknown."""
    age: float
    """The time in s since that program was last alive, or infinity if the computer has restarted since."""
    is_over: bool
    """Whether the program itself has unregistered its mode."""


class Memory:
    """The ids that one vehicle has assigned to the modes of a program."""

    def __init__(self, vehicle: str) -> None:
        """Take a text that identifies the vehicle, "" to note nothing. Nothing is read."""
        self._folder = os.path.join(os.path.dirname(records_folder()), "flights")
        self._vehicle = vehicle
        self._boot = boot_id()
        self._locks: dict[str, IO[bytes]] = {}
        self._written: dict[str, dict[str, Any]] = {}
        self._touched = 0.0
        self._is_told = False

    def claim(self, name: str) -> Remembered | None:
        """Return what an earlier program has noted for a name, and lock the name.

        Raises RegistrationError if a running program flies this mode.
        """
        if not self._vehicle:
            return None
        try:
            os.makedirs(self._folder, mode=0o700, exist_ok=True)
            if not is_own(self._folder):
                raise PermissionError(f"others can write to {self._folder}")
            self._lock(name)
            return self._read(name)
        except OSError as error:
            self._tell(error)
            return None

    def is_interrupted(self, age: float) -> bool:
        """Whether a program was alive less than `age` s ago that has not ended its modes of this vehicle."""
        now = time.monotonic()
        with suppress(OSError), os.scandir(self._folder) as entries:
            recent = [each.path for each in entries if each.name.endswith(_SUFFIX) and now - each.stat().st_mtime < age]
            return bool(self._vehicle) and any(map(self._is_unfinished, recent))
        return False

    def write(self, ids: Ids, status: Any, *, is_over: bool = False) -> None:
        """Note the ids of a mode and the boot of the vehicle, unless this is already noted."""
        content = {
            "version": _VERSION,
            "vehicle": self._vehicle,
            "boot": self._boot,
            "ids": [*ids],
            "armed_time": int(getattr(status, "armed_time", 0)),
            "mode_time": int(getattr(status, "nav_state_timestamp", 0)),
            "is_over": is_over,
        }
        if not self._vehicle or self._written.get(ids.name) == content:
            return
        self._written[ids.name] = content
        try:
            replace_stamped(self._path(ids.name), json.dumps({**content, "booted": booted(status)}).encode())
        except OSError as error:
            self._tell(error)

    def touch(self) -> None:
        """Note that the program is alive, unless this was noted a short time ago."""
        now = time.monotonic()
        if now - self._touched >= _TOUCH:
            self._touched = now
            for name in self._written:
                stamp(self._path(name))

    def release(self, name: str) -> None:
        """Unlock a name for other programs."""
        self._written.pop(name, None)
        lock = self._locks.pop(name, None)
        if lock is not None:
            lock.close()

    def _lock(self, name: str) -> None:
        if fcntl is None or name in self._locks:
            return
        file = open(f"{self._path(name)}.lock", "ab+")  # noqa: SIM115 - it is open as long as the mode is flown
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            pid = file.read(20).decode("ascii", "replace")
            file.close()
            raise RegistrationError(f"process {pid} flies mode {name!r} of this vehicle: end it first") from None
        file.truncate(0)
        file.write(str(os.getpid()).encode())
        file.flush()
        self._locks[name] = file

    def _read(self, name: str) -> Remembered | None:
        path = self._path(name)
        try:
            content = parsed(read_bytes(path, follow=False))
            age = time.monotonic() - os.stat(path).st_mtime_ns / 1e9
            if field(content, "version") != _VERSION or field(content, "vehicle") != self._vehicle:
                return None
            ids = Ids(*row(field(content, "ids"), text, _check, _mode, _executor))
            if ids.name != name:
                return None
            is_same_boot = text(field(content, "boot")) == self._boot
            booted = real(field(content, "booted"), may_be_nan=True)
            return Remembered(
                ids,
                whole(field(content, "armed_time"), 0, _LATEST),
                whole(field(content, "mode_time"), 0, _LATEST),
                booted if is_same_boot else math.nan,
                age if is_same_boot and age >= 0 else math.inf,
                truth(field(content, "is_over")),
            )
        except FileNotFoundError:
            return None
        except (OSError, UnexpectedError) as error:
            state = "were damaged and set aside" if set_aside(path, error) else "cannot be read"
            LOGGER.warning("the ids of mode %r from an earlier program %s: %s: %s", name, state, path, error)
            return None

    def _is_unfinished(self, path: str) -> bool:
        with suppress(OSError, UnexpectedError):  # `claim` tells what is wrong with it
            content = parsed(read_bytes(path, follow=False))
            return bool(field(content, "vehicle") == self._vehicle and not truth(field(content, "is_over")))
        return False

    def _path(self, name: str) -> str:
        digest = blake2b(f"{self._vehicle}\n{name}".encode("utf-8", "backslashreplace"), digest_size=12)
        return os.path.join(self._folder, f"{digest.hexdigest()}{_SUFFIX}")

    def _tell(self, error: OSError) -> None:
        if not self._is_told:
            self._is_told = True
            LOGGER.warning("the next program cannot continue the modes of this one: %s", error)


def _check(value: Any) -> int:
    return whole(value, 0, _CHECKS - 1)


def _mode(value: Any) -> int:
    return whole(value, *((NONE, NONE) if value == NONE else (EXTERNAL[0], EXTERNAL[-1])))


def _executor(value: Any) -> int:
    return whole(value, -1, _LARGEST_EXECUTOR)


def booted(status: Any) -> float:
    """Return when a vehicle has booted, by the monotonic clock in s, or NaN if its timestamps do not tell that."""
    timestamp = getattr(status, "timestamp", UTC)
    return math.nan if timestamp >= UTC else time.monotonic() - timestamp / 1e6


class Resuming:
    """Looks for the ids of a mode or a check."""

    def __init__(self, memory: Memory, feeds: Feeds, answers: Answers, registrar: Registrar, *, resume: bool) -> None:
        self._memory, self._feeds, self._answers, self._registrar = memory, feeds, answers, registrar
        self._resume = resume
        self._found: Remembered | None = None

    async def ids_of(self, subject: Mode | Check) -> Ids | None:
        """Return the ids of a mode or a check if the vehicle still has them. None: it has to be registered.

        Raises RegistrationError if another program has registered it, or if the vehicle has left the mode in flight and
        the program was started without `resume`.
        """
        self._found = self._memory.claim(subject.name)
        found = self._found
        if found is None or found.is_over or (found.ids.mode == NONE) is not isinstance(subject, Check):
            return None
        if found.age < FRESH:  # at once, before anything else is known: PX4 waits for 1 s
            early = Verdict(can_run=False) if isinstance(subject, Check) else Verdict(requires=needs_of(subject))
            self._answers.add(found.ids.check, lambda: early, only_asked=True)
        ids = None
        try:
            ids = await self._resumed(found)
        except TimeoutError as error:
            raise NoAnswerError(f"no {error} within {_HEARD:.0f} s") from None
        finally:
            if ids is None:
                self._answers.remove(found.ids.check)
        return ids

    def tell_slot(self, ids: Ids) -> None:
        """Log a warning if a mode has another slot than before."""
        if self._found is not None and self._found.ids.mode != ids.mode:
            LOGGER.warning(
                "mode %r is mode %d of the vehicle and was %d before: another program has, or a killed program had, a "
                "mode of this name; a switch of a transmitter selects the old one",
                *(ids.name, ids.mode, self._found.ids.mode),
            )

    async def _resumed(self, found: Remembered) -> Ids | None:
        status = await self._feeds["vehicle_status"].wait(lambda _: True, _HEARD)
        if not _is_same_boot(found, status):
            return None
        if is_disarmed(status):
            await self._remove(found.ids)
            return None
        is_lost = await self._is_lost(found.ids)
        if is_lost and found.ids.mode == NONE:  # the vehicle takes no late replies
            return None
        if not is_lost or self._resume:
            return found.ids
        raise RegistrationError(
            f"{found.ids.name}: the vehicle has left this mode of an earlier program in flight. Use "
            "Flight(..., resume=True) to continue the mode, or let the vehicle land first"
        )

    async def _remove(self, ids: Ids) -> None:
        """Unregister a mode, and wait for the end of its requests: before that, its name would get another slot."""
        for _ in range(_TRIES):
            self._registrar.unregister(ids)
            await asyncio.sleep(_REMOVED)
            try:
                request = await self._feeds["arming_check_request"].following(lambda _: True, _ASKED)
            except TimeoutError:  # nothing else is registered
                return
            if not (hasattr(request, "valid_registrations_mask") and is_asked(request, ids.check)):
                return

    async def _is_lost(self, ids: Ids) -> bool:
        """Whether the vehicle no longer waits for the replies of a mode or a check."""
        if ids.mode != NONE:
            flags = await self._feeds["failsafe_flags"].wait(lambda _: True, _HEARD)
            if flags.mode_req_other >> ids.mode & 1:
                return True
        feed = self._feeds["arming_check_request"]
        with suppress(TimeoutError):
            request = feed.latest if feed.age < _ASKED else await feed.following(lambda _: True, _ASKED)
            return not is_asked(request, ids.check, unsaid=ids.mode != NONE)
        return True


def is_asked(request: Any, check: int, *, unsaid: bool = True) -> bool:
    """Whether a request is for a check. Before v1.17, requests do not say this."""
    mask = getattr(request, "valid_registrations_mask", None)
    return unsaid if mask is None else bool(mask >> check & 1)


def _is_same_boot(found: Remembered, status: Any) -> bool:
    """Whether the vehicle has not restarted since an earlier program has flown it."""
    if found.armed_time and status.armed_time:
        return bool(found.armed_time == status.armed_time)
    if found.age < FRESH or abs(found.booted - booted(status)) < _SAME:
        return True
    return bool(found.mode_time and found.mode_time == status.nav_state_timestamp)
