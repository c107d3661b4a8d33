"""Files that are mapped into memory."""

from __future__ import annotations

import mmap
import os
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING
from weakref import ref

import numpy as np

from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from msggen.recordings.source.memory import Octets

_MOST = 32
"""How many files are mapped at a time. Each map has a descriptor, of which a process may have 256 or fewer."""
_mapped: deque[ref[MappedFile]] = deque()
"""The files that are mapped, the oldest map first."""


class MappedFile:
    """A file that is read as if it were in memory. Raises RecordingError if it is empty, and OSError.

    Of many files, only the latest are mapped. The others are mapped again when they are read.
    """

    def __init__(self, path: str) -> None:
        self._shown = path
        self._path = os.path.abspath(path)
        self._map: mmap.mmap | None = None
        self._is_closed = False
        found = os.stat(path)
        self.size = found.st_size
        self._identity = found.st_ino, found.st_mtime_ns
        if not self.size:
            raise RecordingError(f"{path} is empty")

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
            raise RecordingError(f"{self._shown} was cut off while it was open")

    def close(self) -> None:
        """Close the file. Can be repeated."""
        self._is_closed = True
        found, self._map = self._map, None
        if found is not None:
            with suppress(BufferError):  # views of it keep it open
                found.close()

    def _mapped(self) -> mmap.mmap:
        if self._is_closed:
            raise RecordingError(f"{self._shown} is closed")
        with open(self._path, "rb") as file:
            found = os.fstat(file.fileno())
            if found.st_size < self.size:
                raise RecordingError(f"{self._shown} was cut off while it was open")
            # a file that grows has another time; some network file systems change the numbers of files
            if self._identity[0] != found.st_ino and self._identity[1] != found.st_mtime_ns:
                raise RecordingError(f"{self._shown} was replaced while it was open")
            return mmap.mmap(file.fileno(), self.size, access=mmap.ACCESS_READ)
