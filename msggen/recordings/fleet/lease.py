"""The lock of a fleet in a store: an object that one run creates, renews while it runs, and deletes at its end.

The store itself refuses to create an object that is there, and to replace another version of it. So of two runs, one
gets the lock. If a run is killed, its lock stays: another run takes it at once on the same machine, where it sees that
the process has ended, and otherwise when the lock was not renewed for a minute.
"""

from __future__ import annotations

import os
import platform
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from msggen.recordings.stores.errors import ChangedError, StoreError, store_error

if TYPE_CHECKING:
    from msggen.recordings.stores.store import Content, Store

_LIFE = 60.0
"""The seconds without a renewal after which another run takes the lock."""
_RENEWED = 15.0
"""The seconds between renewals."""
_TRUSTED = 30.0
"""The seconds after a renewal in which the run may write."""
_POLL = 1.0
"""The seconds between looks at the lock of another run."""
_CLOCK: int | None = getattr(time, "CLOCK_BOOTTIME", getattr(time, "CLOCK_MONOTONIC", None))
"""That of Linux, or of macOS. Windows has neither, and does not need one."""
_held: set[str] = set()
"""The owners whose locks this process has."""


class Lease:
    """The lock of a fleet. Methods raise StoreError."""

    def __init__(self, store: Store, address: str) -> None:
        self._store, self._address = store, address
        self._owner = f"process {os.getpid()} on {platform.node()}\n{_identity(os.getpid())}\n{os.urandom(8).hex()}"
        self._content: Content | None = None
        self._renewed = 0.0
        self._count = 0
        self._lock = threading.Lock()
        self._ended = threading.Event()

    @contextmanager
    def held(self, waiting: Callable[[str], None]) -> Iterator[None]:
        """Hold the lock. If another run has it, call `waiting` with its first line, and wait."""
        _held.add(self._owner)
        try:
            self._take(waiting)
            threading.Thread(target=self._renew_often, name="msggen lock", daemon=True).start()
            yield
        finally:
            self._ended.set()
            with suppress(StoreError):
                self._release()
            _held.discard(self._owner)

    def check(self) -> None:
        """Raise StoreError if another run may have taken the lock, as after a long sleep of this computer."""
        if _now() - self._renewed > _TRUSTED:
            self._renew()

    def _take(self, waiting: Callable[[str], None]) -> None:
        seen: Content | None = None
        since = _now()
        is_told = False
        while True:
            with suppress(ChangedError):
                self._keep(self._store.create(self._address, self._text()))
                self._probe()
                return
            found = self._store.load(self._address)
            if found is None:
                continue
            if seen is None or found.version != seen.version:
                seen, since = found, _now()
            if _is_dead(found.data) or _now() - since > _LIFE:
                with suppress(ChangedError):
                    self._keep(self._store.save(self._address, self._text(), over=found.version))
                    return
            if not is_told:
                waiting(found.data.decode(errors="replace").partition("\n")[0])
                is_told = True
            time.sleep(_POLL)

    def _probe(self) -> None:
        """Raise StoreError if the store ignores conditions."""
        with suppress(ChangedError):
            self._store.create(self._address, b"")
            self._store.delete([self._address])
            reason = "the store replaces objects that are to be new (If-None-Match): runs cannot lock the fleet"
            raise store_error(self._address, reason)

    def _renew_often(self) -> None:
        while not self._ended.wait(_RENEWED):
            with suppress(StoreError):  # `check` tells it
                self._renew()

    def _renew(self) -> None:
        with self._lock:
            if self._content is None or self._ended.is_set():
                return
            try:
                self._keep(self._store.save(self._address, self._text(), over=self._content.version))
            except ChangedError:
                raise store_error(self._address, "another run has taken the lock: run the same command again") from None

    def _release(self) -> None:
        with self._lock:
            if self._content is not None and _now() - self._renewed < _TRUSTED:
                self._store.delete([self._address])

    def _text(self) -> bytes:
        self._count += 1
        return f"{self._owner}\n{self._count}\n".encode(errors="replace")

    def _keep(self, content: Content) -> None:
        self._content, self._renewed = content, _now()


def _now() -> float:
    """Return the time in s of a clock that goes on while the computer sleeps: that of `time.monotonic` may not."""
    return time.clock_gettime(_CLOCK) if _CLOCK is not None else time.monotonic()


def _is_dead(data: bytes) -> bool:
    """Whether a lock is that of a process of this machine that has ended."""
    text = data.decode(errors="replace")
    owner, _, _ = text.rstrip("\n").rpartition("\n")
    lines = owner.split("\n")
    own = _identity(os.getpid()).split(" ")
    found = lines[1].split(" ") if len(lines) == 3 else []  # noqa: PLR2004 - of `Lease`
    if not own[0] or len(found) != len(own) or found[:2] != own[:2]:
        return False
    if found == own:
        return owner not in _held
    return not found[2].isdecimal() or _identity(int(found[2])).split(" ") != found


def _identity(number: int) -> str:
    """Return what tells a process from all others: the start of the system, its processes, and its own. Or ""."""
    try:
        with open("/proc/sys/kernel/random/boot_id", encoding="ascii") as file:
            boot = file.read().strip()
        with open(f"/proc/{number}/stat", encoding="ascii", errors="replace") as file:
            state, *values = file.read().rpartition(")")[2].split()
        return "" if state in "ZX" else f"{boot} {os.readlink('/proc/self/ns/pid')} {number} {values[18]}"
    except (OSError, IndexError):
        return ""
