"""Records of sessions in a folder of the user, with which the next program continues them.

There is a file for each link and client. It is replaced as a whole when the session changes. Its time of modification
tells when the client was heard last, of the monotonic clock: nobody sets that back, unlike the date.
"""

from __future__ import annotations

import errno
import json
import os
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from hashlib import blake2b
from ipaddress import IPv4Address
from types import MappingProxyType
from typing import Any, Final

from msggen.base.checked import TIME, field, parsed, row, several, shortened, table, text, whole
from msggen.base.disk.reading import read_bytes
from msggen.link.xrce.outbox import Address
from msggen.link.xrce.record import Record

VERSION: Final = 3
PATIENCE: Final = 7.0
"""Seconds after which a client that was not answered has left its session."""
TOUCH: Final = 2.0
"""Seconds between two notes of when clients were heard."""
_LONGEST: Final = 1 << 20
_FILES: Final = 1000
"""The most files of a folder that are looked at."""
_SUFFIX: Final = ".json"
_BITS: Final = MappingProxyType({"key": 32, "session_id": 8, "mtu": 16, "next": 16, "hash": 32, "port": 16})
"""The bits of the numbers in a record."""


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
                link, record, boot = unpack(read_bytes(path, follow=False))
                age = time.monotonic() - os.stat(path).st_mtime_ns / 1e9
            except FileNotFoundError:  # another program has removed it
                continue
            except (OSError, ValueError) as error:
                self._leave(path, error)
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
                    stamp(self._heard[address])

    def _paths(self) -> Iterator[str]:
        with suppress(OSError), os.scandir(self._folder) as entries:
            names = [entry.name for entry, _ in zip(entries, range(_FILES), strict=False)]
            for name in names:
                if name.startswith(self._front) and name.endswith(_SUFFIX):
                    yield os.path.join(self._folder, name)

    def _leave(self, path: str, error: Exception) -> None:
        state = "was set aside" if set_aside(path, error) else "cannot be read"
        self._tell_once(f"the record of a session {state}, and the vehicle connects again: {path}: {error}")

    def _replace(self, path: str, data: bytes) -> bool:
        """Replace a file as a whole. Return whether that was possible."""
        try:
            os.makedirs(self._folder, mode=0o700, exist_ok=True)
            replace_stamped(path, data)
        except OSError as error:
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
        "samples": {name: [payload.hex(), time] for name, (payload, time) in record.samples.items()},
    }
    return json.dumps({"version": VERSION, "digest": _digest(_canonical(content)), "record": content}).encode()


def unpack(data: bytes) -> tuple[str, Record, str]:
    """Return link, record and boot of the content of a file. Raises DamagedError."""
    try:
        file = parsed(data)
        if field(file, "version") != VERSION:
            raise DamagedError(f"it has another version, {shortened(field(file, 'version'))}")
        content = field(file, "record")
        if _digest(_canonical(content)) != field(file, "digest"):
            raise DamagedError("it is damaged")
        link = text(field(content, "link"))
        record = Record(
            address=_address(field(content, "address"), link),
            parts=tuple(several(field(content, "parts"), _bytes)),
            hashes=MappingProxyType(table(field(content, "hashes"), lambda each: _number("hash", each))),
            samples=MappingProxyType(table(content.get("samples", {}), _sample)),
            **{name: _number(name, field(content, name)) for name in ("key", "session_id", "mtu", "next")},
        )
        return link, record, text(field(content, "boot"))
    except (ValueError, TypeError, RecursionError) as error:
        raise error if isinstance(error, DamagedError) else DamagedError(f"it is damaged: {error}") from None


def _address(value: Any, link: str) -> Address:
    """Return the address of a client: of a host and a port, or of a device as its link is."""
    if isinstance(value, str) and "://" not in link:
        return text(value)
    host, port = row(value, text, lambda each: _number("port", each, 1))
    return str(IPv4Address(host)), port


def _number(kind: str, value: Any, least: int = 0) -> int:
    return whole(value, least, (1 << _BITS[kind]) - 1)


def _bytes(value: Any) -> bytes:
    return bytes.fromhex(text(value, _LONGEST))


def _sample(value: Any) -> tuple[bytes, int]:
    payload, time = row(value, _bytes, lambda each: whole(each, 0, TIME))
    return payload, time


def _canonical(content: Any) -> str:
    return json.dumps(content, sort_keys=True)


def _digest(text: str) -> str:
    return blake2b(text.encode("utf-8", "backslashreplace"), digest_size=12).hexdigest()


def set_aside(path: str, error: Exception) -> bool:
    """Rename a file that is wrong itself, so that it is neither lost nor looked at again. Return whether it is wrong.

    It is if it is no regular file or its content is wrong. A full disk or a permission says nothing of it.
    """
    if isinstance(error, OSError) and error.errno != errno.EFBIG and is_regular(path):
        return False
    with suppress(OSError):
        os.replace(path, f"{path.removesuffix(_SUFFIX)}.damaged")
    return True


def is_regular(path: str) -> bool:
    """Whether a path is a regular file, or what it is cannot be seen."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except OSError:
        return True


def is_own(folder: str) -> bool:
    """Whether nobody else can put a record into a folder, or it does not exist."""
    try:
        told = os.stat(folder)
    except OSError:
        return True
    return sys.platform == "win32" or (told.st_uid == os.getuid() and not told.st_mode & 0o022)


def _remove(path: str) -> None:
    with suppress(OSError):
        os.unlink(path)


def replace_stamped(path: str, data: bytes) -> None:
    """Replace a file as a whole, with the time of the monotonic clock. Raises OSError."""
    handle, temporary = tempfile.mkstemp(dir=os.path.dirname(path), prefix=".")  # mode 0600
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        stamp(temporary)
        os.replace(temporary, path)
    except OSError:
        _remove(temporary)
        raise


def stamp(path: str) -> None:
    """Let a file have been modified now, by the monotonic clock."""
    now = time.monotonic_ns()
    with suppress(OSError):
        os.utime(path, ns=(now, now))


def boot_id() -> str:
    """Return what identifies the start of this computer: the monotonic clock begins then."""
    with suppress(OSError), open("/proc/sys/kernel/random/boot_id", encoding="ascii") as file:
        return file.read(64).strip()
    return ""
