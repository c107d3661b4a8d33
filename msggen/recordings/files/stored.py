"""Recordings in stores: copies on this computer, into which ranges are fetched before they are read."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING
from weakref import finalize

import numpy as np

from msggen.base.diagnostics import few
from msggen.base.disk.urls import is_in_store, shown_address
from msggen.base.recording_formats import FORMATS, format_named, unpacked
from msggen.recordings.files.mapped import copies
from msggen.recordings.files.paths import LOGS, METADATA, is_bag
from msggen.recordings.source.source import RecordingError
from msggen.recordings.stores.client import split
from msggen.recordings.stores.errors import MissingError, NoObjectError, StoreError, store_error
from msggen.recordings.stores.server import Stored
from msggen.recordings.stores.store import Store

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.source.source import Source

_BLOCK = 16 << 10
"""What is fetched is a number of these bytes: each request costs as much time as some of them."""
_FRONT = 4 * _BLOCK
"""The bytes that are fetched of each file, to know its format. They have the first records of an MCAP file."""
_GAP = 4
"""The blocks between two ranges that are fetched too, instead of a further request."""
_MOST_FILES = 1000
"""The files of a folder that are looked at."""
_LARGEST = 1 << 40
"""The most bytes of an object. A server can tell any size, and maps of files have limits."""


class Folder:
    """A folder of copies, which is removed when none of them is in use."""

    def __init__(self) -> None:
        self.path = tempfile.mkdtemp(prefix="msggen-")
        self._remove = finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class Copy:
    """A file in a folder of copies, as large as an object. Of its bytes, those that were fetched are right."""

    def __init__(self, store: Store, stored: Stored, folder: Folder, path: str) -> None:
        if stored.size > _LARGEST:
            raise store_error(stored.address, f"the object has {stored.size} bytes, more than {_LARGEST}")
        self.path = path
        self.shown = shown_address(stored.address)
        self._store, self._stored, self._folder = store, stored, folder
        self._has = np.zeros(-(-stored.size // _BLOCK), np.bool_)
        """Which blocks were fetched."""
        self._lock = Lock()
        with _making_room(stored.address), open(path, "wb") as file:
            file.truncate(stored.size)
        copies[os.path.realpath(path)] = self

    @property
    def is_whole(self) -> bool:
        """Whether all bytes were fetched."""
        return bool(self._has.all())

    def fetch(self, ranges: Iterable[tuple[int, int]]) -> None:
        """Fetch ranges, as far as they are within the file and were not fetched yet. Raises StoreError."""
        with self._lock:
            wanted = np.zeros_like(self._has)
            for start, stop in ranges:
                if start < stop:
                    wanted[max(start, 0) // _BLOCK : -(-stop // _BLOCK)] = True
            wanted &= ~self._has
            if not wanted.any():
                return
            spans = list(_spans(wanted))
            limits = [(start * _BLOCK, min(stop * _BLOCK, self._stored.size)) for start, stop in spans]
            with _making_room(self._stored.address), open(self.path, "r+b", buffering=0) as file:
                for start, data in self._store.read_all(self._stored, limits):
                    file.seek(start)
                    file.write(data)
            for start, stop in spans:
                self._has[start:stop] = True

    def begin(self, front: bytes) -> None:
        """Put the first bytes, a number of blocks or all of the file."""
        with _making_room(self._stored.address), open(self.path, "r+b") as file:
            file.write(front)
        self._has[: len(front) // _BLOCK if len(front) < self._stored.size else None] = True

    def fetch_all(self) -> None:
        """Fetch all bytes. Raises StoreError."""
        self.fetch([(0, self._stored.size)])


def open_stored(address: str, open_local: Callable[[str], list[Source]]) -> list[Source]:
    """Return the files of a recording in a store, or on a server. `open_local` opens what a path has.

    MCAP files are read in ranges, all others are copied whole. Raises StoreError, RecordingError, OSError, and
    ModuleNotFoundError without the extra.
    """
    folder = Folder()
    path, copies = _copied(Store(address), address, folder)
    shown = shown_address(address)
    try:
        sources = open_local(path)
    except RecordingError as error:
        raise RecordingError(str(error).replace(path, shown)) from None
    for source in sources:
        source.problems[:] = [each._replace(text=each.text.replace(path, shown)) for each in source.problems]
    del copies  # from here on, the files that are open keep them
    return sources


def _copied(store: Store, address: str, folder: Folder) -> tuple[str, Sequence[Copy]]:
    """Return the path of the copy of a recording, a file or a folder, and the copies of its files."""
    name = shown_address(address).rstrip("/").rpartition("/")[2]
    path = os.path.join(folder.path, local_name(name))
    missing = MissingError(errno.ENOENT, "there is no such folder", shown_address(address))
    if not _is_folder(address):
        try:
            return path, _copies_of_file(store, address, folder, path)
        except NoObjectError as error:
            missing = error
    found = _listed(store, address)
    if not found:
        raise missing
    return path, _copies_of_folder(store, address, found, folder, path)


def _copies_of_file(store: Store, address: str, folder: Folder, path: str) -> Sequence[Copy]:
    """Return a copy at `path`, and those of the logs of transactions beside it: a database may not have been closed."""
    copy, front = _begun(store, address, folder, path)
    is_database = front.startswith(FORMATS["db3"].front) and is_in_store(address)
    logs = [suffix for suffix in LOGS if is_database and store.has(address + suffix)]
    return [copy, *(_begun(store, address + suffix, folder, path + suffix)[0] for suffix in logs)]


def _copies_of_folder(store: Store, address: str, found: Sequence[Stored], folder: Folder, path: str) -> Sequence[Copy]:
    """Return copies of the files of a recording, in a folder at `path`."""
    os.mkdir(path)
    copies = [
        Copy(store, each, folder, os.path.join(path, local_name(each.address.rpartition("/")[2])))
        for each in found
        if _is_of_recording(each.address)
    ]
    for copy in copies:
        if os.path.basename(copy.path) == METADATA:
            copy.fetch_all()
    names = sorted({unpacked(os.path.basename(copy.path)) for copy in copies if format_named(copy.path)})
    if len(names) > 1 and not is_bag(path):
        shown = few([repr(name) for name in names])
        text = f"has several recordings and no {METADATA}: name one of {shown}"
        raise RecordingError(f"{shown_address(address)} {text}")
    for copy in copies:
        copy.fetch([(0, _FRONT)])
        _complete(copy)
    return copies


def _is_folder(address: str) -> bool:
    """Whether an address can only be that of a folder, as that of a bucket."""
    return address.endswith("/") or (is_in_store(address) and not split(address)[1])


def _listed(store: Store, address: str) -> Sequence[Stored]:
    """Return the objects of a folder, none on a server of HTTP."""
    try:
        found = store.folder(address)
    except StoreError as error:
        if "does not list" in (error.strerror or ""):
            return ()
        raise
    if len(found) > _MOST_FILES:
        raise store_error(address, f"the folder has {len(found)} files, expected one recording")
    return found


def _is_of_recording(address: str) -> bool:
    name = address.rpartition("/")[2]
    for suffix in LOGS:
        name = name.removesuffix(suffix)
    return name == METADATA or format_named(name) is not None


def _begun(store: Store, address: str, folder: Folder, path: str) -> tuple[Copy, bytes]:
    """Return a copy at `path` that has what is needed to open it, and its first bytes."""
    stored, front = store.look(address, _FRONT)
    copy = Copy(store, stored, folder, path)
    copy.begin(front)
    _complete(copy)
    return copy, front


def _complete(copy: Copy) -> None:
    """Fetch all of a file that is not read in ranges."""
    with open(copy.path, "rb") as file:
        front = file.read(len(FORMATS["mcap"].front))
    if front != FORMATS["mcap"].front:
        copy.fetch_all()


def local_name(name: str) -> str:
    """Return a name that a file of this computer can have."""
    return "".join("_" if each in '\0/\\:*?"<>|' else each for each in name) or "recording"


def _spans(wanted: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield the spans of blocks that are wanted, with small gaps in them."""
    places = np.flatnonzero(wanted)
    ends = np.flatnonzero(np.diff(places) > _GAP + 1)
    starts = places[np.concatenate([[0], ends + 1])]
    stops = places[np.concatenate([ends, [len(places) - 1]])] + 1
    yield from zip(starts.tolist(), stops.tolist(), strict=True)


@contextmanager
def _making_room(address: str) -> Iterator[None]:
    """Raise StoreError if the disk is full."""
    try:
        yield
    except StoreError:
        raise
    except OSError as error:
        text = f"what is read cannot be kept in {tempfile.gettempdir()}: {error.strerror}; TMPDIR names another folder"
        raise store_error(address, text) from None
