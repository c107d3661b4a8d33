"""Records of sessions in a folder of the user, with which the next program continues them.

There is a file for each link and client. It is replaced as a whole when the session changes. Its time of modification
tells when the client was heard last, of the monotonic clock: nobody sets that back, unlike the date.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from hashlib import blake2b
from types import MappingProxyType
from typing import Any, Final

from msggen.live.xrce.outbox import Address
from msggen.live.xrce.record import Record

VERSION: Final = 2
PATIENCE: Final = 7.0
"""Seconds after which a client that was not answered has left its session."""
TOUCH: Final = 2.0
"""Seconds between two notes of when clients were heard."""
_LONGEST: Final = 1 << 20
_FILES: Final = 1000
"""The most files of a folder that are looked at."""
_SUFFIX: Final = ".json"
_LARGEST: Final = {"key": 1 << 32, "session_id": 1 << 8, "mtu": 1 << 16, "next": 1 << 16}


class DamagedError(ValueError):
    """A file that is no record of this version."""


def records_folder() -> str:
    """Return the user's folder of records."""
    state = os.environ.get("XDG_STATE_HOME", "")
    if not os.path.isabs(state):
        state = os.path.expanduser(os.path.join("~", ".local", "state"))
    return os.path.join(state, "msggen", "sessions")


class Records:
    """The records of a link."""

    def __init__(self, folder: str, link: str, tell: Callable[[str], None]) -> None:
        """Make the records of a link with an address. Nothing is read. `tell` gets what the user should know, once."""
        self._folder = folder
        self._front = _digest(link) + "-"
        self._link = link
        self._tell = tell
        self._has_told = False
        self._boot = boot_id()
        self._heard: dict[Address, str] = {}
        """The clients that have a file, and its path."""
        self._touched = 0.0

    def load(self) -> list[Record]:
        """Return the records whose clients may still be there. Others are removed, and damaged ones set aside."""
        found: list[Record] = []
        if not is_own(self._folder):
            self._tell_once(f"the records of sessions are not used: others can write to {self._folder}")
            return found
        for path in self._paths():
            try:
                link, record, boot = unpack(_read(path))
                age = time.monotonic() - os.stat(path).st_mtime_ns / 1e9
            except (OSError, ValueError) as error:
                self._set_aside(path, error)
                continue
            if link == self._link and boot == self._boot and -1 < age < PATIENCE:
                self._heard[record.address] = path
                found.append(record)
            else:
                _remove(path)
        return found

    def write(self, changes: Iterable[tuple[Address, Record | None]]) -> None:
        """Write what `Agent.take_records` has told."""
        for address, record in changes:
            path = os.path.join(self._folder, f"{self._front}{_digest(repr(address))}{_SUFFIX}")
            if record is None:
                self._heard.pop(address, None)
                _remove(path)
            elif self._replace(path, pack(self._link, record, self._boot)):
                self._heard[address] = path

    def touch(self, heard: Iterable[Address], now: float, *, is_last: bool = False) -> None:
        """Note that clients were heard, unless that was noted a short time ago. `now` is of the monotonic clock."""
        if is_last or now - self._touched >= TOUCH:
            self._touched = now
            for address in heard:
                if address in self._heard:
                    _stamp(self._heard[address])

    def _paths(self) -> Iterator[str]:
        with suppress(OSError), os.scandir(self._folder) as entries:
            names = [entry.name for entry, _ in zip(entries, range(_FILES), strict=False)]
            for name in names:
                if name.startswith(self._front) and name.endswith(_SUFFIX):
                    yield os.path.join(self._folder, name)

    def _set_aside(self, path: str, error: Exception) -> None:
        """Rename a file that cannot be used, so that it is neither lost nor looked at again."""
        with suppress(OSError):
            os.replace(path, f"{path.removesuffix(_SUFFIX)}.damaged")
        self._tell_once(f"the record of a session was set aside, and the vehicle connects again: {path}: {error}")

    def _replace(self, path: str, data: bytes) -> bool:
        """Replace a file as a whole. Return whether that was possible."""
        temporary = ""
        try:
            os.makedirs(self._folder, mode=0o700, exist_ok=True)
            handle, temporary = tempfile.mkstemp(dir=self._folder, prefix=".")  # mode 0600
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            _stamp(temporary)
            os.replace(temporary, path)
        except OSError as error:
            if temporary:
                _remove(temporary)
            text = "the next program cannot continue the sessions of this one"
            self._tell_once(f"{text}: {self._folder} cannot be written: {error.strerror or error}")
            return False
        return True

    def _tell_once(self, text: str) -> None:
        if not self._has_told:
            self._has_told = True
            self._tell(text)


def pack(link: str, record: Record, boot: str) -> bytes:
    """Return the content of a file. `boot` identifies the start of this computer."""
    content = {
        "link": link,
        "boot": boot,
        **record._asdict(),
        "parts": [part.hex() for part in record.parts],
        "hashes": dict(record.hashes),
        "sizes": {str(number): size for number, size in record.sizes.items()},
    }
    return json.dumps({"version": VERSION, "digest": _digest(_canonical(content)), "record": content}).encode()


def unpack(data: bytes) -> tuple[str, Record, str]:
    """Return link, record and boot of the content of a file. Raises DamagedError."""
    try:
        whole = json.loads(data)
        version = whole["version"]
        content = whole["record"]
        if version != VERSION or _digest(_canonical(content)) != whole["digest"]:
            raise DamagedError(f"it has another version, {version!r:.20}" if version != VERSION else "it is damaged")
        address = content["address"]
        numbers = {name: _number(content[name], largest) for name, largest in _LARGEST.items()}
        record = Record(
            address=address if isinstance(address, str) else (str(address[0]), *map(int, address[1:])),
            parts=tuple(map(bytes.fromhex, content["parts"])),
            hashes=MappingProxyType({str(name): int(value) for name, value in content["hashes"].items()}),
            sizes=MappingProxyType({int(number): int(size) for number, size in content["sizes"].items()}),
            **numbers,
        )
        return str(content["link"]), record, str(content["boot"])
    except (AttributeError, IndexError, KeyError, RecursionError, TypeError, ValueError) as error:
        raise error if isinstance(error, DamagedError) else DamagedError("it is damaged") from None


def _number(value: Any, end: int) -> int:
    if not isinstance(value, int) or not 0 <= value < end:
        raise DamagedError("it is damaged")
    return value


def _canonical(content: Any) -> str:
    return json.dumps(content, sort_keys=True)


def _digest(text: str) -> str:
    return blake2b(text.encode("utf-8", "backslashreplace"), digest_size=12).hexdigest()


def is_own(folder: str) -> bool:
    """Whether nobody else can put a record into a folder, or it does not exist."""
    try:
        told = os.stat(folder)
    except OSError:
        return True
    return sys.platform == "win32" or (told.st_uid == os.getuid() and not told.st_mode & 0o022)


def _read(path: str) -> bytes:
    with open(path, "rb") as file:
        return file.read(_LONGEST)


def _remove(path: str) -> None:
    with suppress(OSError):
        os.unlink(path)


def _stamp(path: str) -> None:
    now = time.monotonic_ns()
    with suppress(OSError):
        os.utime(path, ns=(now, now))


def boot_id() -> str:
    """Return what identifies the start of this computer: the monotonic clock begins then."""
    with suppress(OSError), open("/proc/sys/kernel/random/boot_id", encoding="ascii") as file:
        return file.read(64).strip()
    return ""
