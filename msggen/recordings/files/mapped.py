"""Files that are mapped into memory."""

from __future__ import annotations

import mmap
import os
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol
from weakref import WeakValueDictionary, ref

import numpy as np

from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from msggen.recordings.source.memory import Octets

_MOST = 32
"""How many files are mapped at a time. Each map has a descriptor, of which a process may have 256 or fewer."""
_mapped: deque[ref[MappedFile]] = deque()
"""The files that are mapped, the oldest map first."""


class Copy(Protocol):
    """A copy of an object in a store, of which ranges are fetched."""

    shown: str
    """The address of the object for people."""

    @property
    def is_whole(self) -> bool:
        """Whether all bytes were fetched."""

    def fetch(self, ranges: Iterable[tuple[int, int]]) -> None:
        """Fetch ranges, from an offset up to another one."""

    def fetch_all(self) -> None:
        """Fetch the whole file."""


copies: WeakValueDictionary[str, Copy] = WeakValueDictionary()
"""The copies that are in use, by their paths."""


class MappedFile:
    """A file that is read as if it were in memory. Raises RecordingError if it is empty, and OSError.

    Of many files, only the latest are mapped. The others are mapped again when they are read.

    The copy of an object in a store has only the bytes that were fetched. With `in_ranges`, the reader calls `need`
    before it reads, otherwise all are fetched here. Both raise OSError if the store does not send them.
    """

    def __init__(self, path: str, *, in_ranges: bool = False) -> None:
        self._path = os.path.abspath(path)
        self._map: mmap.mmap | None = None
        self._is_closed = False
        found = os.stat(path)
        self.size = found.st_size
        self._identity = found.st_ino, found.st_mtime_ns
        if not self.size:
            raise RecordingError(f"{path} is empty")
        self._copy = copies.get(os.path.realpath(path)) if copies else None
        self.shown = path if self._copy is None else self._copy.shown
        """The path, or the address of the object, for people."""
        if self._copy is not None and not in_ranges:
            self._copy.fetch_all()

    @property
    def is_partial(self) -> bool:
        """Whether the file is the copy of an object of which not all bytes were fetched."""
        return self._copy is not None and not self._copy.is_whole

    def need(self, ranges: Iterable[tuple[int, int]]) -> None:
        """Fetch ranges, from an offset up to another one, unless the file is on this computer."""
        if self._copy is not None:
            self._copy.fetch(ranges)

    def need_all(self) -> None:
        """Fetch the whole file."""
        if self._copy is not None:
            self._copy.fetch_all()

    @property
    def map(self) -> mmap.mmap:
        """The file. Raises RecordingError if it is closed or was cut off or replaced, and OSError."""
        found = self._map
        if found is None:
            found = self._map = self._mapped()
            _mapped.append(ref(self))
            while len(_mapped) > _MOST:
                oldest = _mapped.popleft()()
                if oldest is not None:
                    oldest._map = None  # noqa: SLF001 - views of it keep it open
        return found

    @property
    def octets(self) -> Octets:
        """The bytes of the file. Raises as `map` does."""
        return np.frombuffer(self.map, np.uint8)

    def check(self) -> None:
        """Raise RecordingError if the file is closed, or was cut off: reading what is missing would end the process."""
        if self.map.size() < self.size:
            raise RecordingError(f"{self.shown} was cut off while it was open")

    def close(self) -> None:
        """Close the file. Can be repeated."""
        self._is_closed = True
        self._copy = None
        found, self._map = self._map, None
        if found is not None:
            with suppress(BufferError):  # views of it keep it open
                found.close()

    def _mapped(self) -> mmap.mmap:
        if self._is_closed:
            raise RecordingError(f"{self.shown} is closed")
        with open(self._path, "rb") as file:
            found = os.fstat(file.fileno())
            if found.st_size < self.size:
                raise RecordingError(f"{self.shown} was cut off while it was open")
            # a file that grows has another time; some network file systems change the numbers of files
            if self._identity[0] != found.st_ino and self._identity[1] != found.st_mtime_ns:
                raise RecordingError(f"{self.shown} was replaced while it was open")
            return mmap.mmap(file.fileno(), self.size, access=mmap.ACCESS_READ)
