"""Where a fleet is: in a folder of this machine, or one that several machines share, or in an object store.

Both have the same methods, so all else is the same code. Names are paths in the fleet, with `/` between folders.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, TypeAlias

from msggen.base.disk.files import create_file, flush
from msggen.base.disk.output import check_links, link_in
from msggen.base.disk.staging import clear, locked, make_folder, make_stage, write_if_changed
from msggen.base.disk.urls import is_address, is_in_store
from msggen.exports.fleet.layout import STATE, is_stage, stage_of, topic_of
from msggen.exports.fleet.records import NOT_A_FLEET, TABLE, FleetError, decoded
from msggen.recordings.stores.errors import ChangedError, StoreError, store_error
from msggen.recordings.stores.store import Content, Store

_NO_FOLLOW = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_UNFIT = "the store refuses conditional puts, which keep two runs apart: choose another store"


class RacedError(Exception):
    """A list that another run has replaced since it was read."""


class Disk:
    """A fleet in a folder. Methods raise OSError, and InputError for a folder that is a link."""

    def __init__(self, path: str, run: str = "") -> None:
        self.path = path
        self._mark = stage_of(run)
        self._stage = self._at(f"{self._mark}/new")
        """Files of the run wait here, each in the folder of its topic, until they are moved: that takes a moment."""

    def prepare(self) -> None:
        """Make the folders of a fleet and of this run."""
        self.check([STATE])
        make_folder(self._at(STATE))
        make_stage(self._at(self._mark))

    def names(self) -> dict[str, int]:
        """Return what is in the folder, and below it files and stages of runs, with sizes. Links are not followed."""
        found: dict[str, int] = {}
        for entry in _entries(self.path) if os.path.isdir(self.path) else ():
            found[entry.name] = 0
            if entry.is_dir(follow_symlinks=False) and (entry.name == STATE or entry.name[0] not in "._"):
                for each in _entries(entry.path):
                    name = f"{entry.name}/{each.name}"
                    if each.is_file(follow_symlinks=False) or is_stage(name):
                        with suppress(FileNotFoundError):  # of a run that has just ended
                            found[name] = each.stat(follow_symlinks=False).st_size
        return found

    def read_list(self) -> Content | None:
        """Return the list, None if there is none."""
        try:
            with open(self._at(TABLE), "rb", opener=lambda path, _: os.open(path, _NO_FOLLOW)) as file:
                return Content(file.read(), {})
        except (FileNotFoundError, NotADirectoryError):
            return None

    def replace_list(self, data: bytes, known: Content | None) -> Content:
        """Replace the list in one step. Raises RacedError if it is not the known one any more."""
        new = os.path.join(self._stage, TABLE)
        create_file(new, data)
        flush([new])
        with locked(self._at(STATE)):  # for the moment of the comparison and the rename only
            if self.read_list() != known:
                raise RacedError
            os.replace(new, self._at(TABLE))
            flush([self.path])
        return Content(data, {})

    def write(self, name: str, data: bytes) -> None:
        """Write a small file of the state."""
        write_if_changed(self._at(f"{STATE}/{name}"), data)

    def open(self, place: str) -> IO[bytes]:
        """Open a file of a topic."""
        return open(self._at(place), "rb")

    def check(self, topics: Iterable[str]) -> None:
        """Raise InputError if the folder of a topic is a link or a file, PermissionError if it cannot be changed."""
        names = sorted({*topics})
        check_links(self.path, names)
        for name in names:
            if os.path.lexists(self._at(name)):
                make_folder(self._at(name))

    @contextmanager
    def stage(self) -> Iterator[str]:
        """Yield a folder in which files of this run can be written. Each waits there in the folder of its topic."""
        yield self._stage

    def keep(self, stage: str, places: Sequence[str]) -> None:
        """Wait until files of a stage are kept."""
        paths = [os.path.join(stage, place) for place in places]
        flush([*paths, *sorted({os.path.dirname(path) for path in paths})])

    def add(self, places: Sequence[str]) -> None:
        """Let files that are kept be in their places."""
        topics = sorted({topic_of(place) for place in places})
        check_links(self.path, topics)
        for topic in topics:
            make_folder(self._at(topic))
        for place in places:
            os.replace(os.path.join(self._stage, *place.split("/")), self._at(place))
        flush([self.path, *map(self._at, topics)])

    def delete(self, names: Iterable[str]) -> None:
        """Remove files and stages, if they are there. What is left of a stage because a run writes there stays."""
        for name in names:
            if is_stage(name):
                with suppress(OSError):
                    clear(self._at(name))
            elif not link_in(self.path, os.path.dirname(name)):
                with suppress(FileNotFoundError):
                    os.unlink(self._at(name))

    def close(self) -> None:
        """Remove the stage of this run."""
        self.delete([self._mark])

    def _at(self, name: str) -> str:
        return os.path.join(self.path, *name.split("/"))


class Bucket:
    """A fleet in a store. Methods raise StoreError."""

    def __init__(self, address: str, run: str = "") -> None:
        self._store = Store(address)
        self.path = self._store.canonical(address)
        self._probe = self._at(stage_of(run))
        self._scratch: tempfile.TemporaryDirectory[str] | None = None
        """Copies of files of topics."""

    def prepare(self) -> None:
        """Raise StoreError if the store does not compare versions: then two runs could overwrite each other."""
        try:
            known = self._store.save(self._probe, b"1", "create")
            self._refuses("If-None-Match", lambda: self._store.save(self._probe, b"2", "create"))
            self._store.save(self._probe, b"3", known.version)
            self._refuses("If-Match", lambda: self._store.save(self._probe, b"4", known.version))
        except StoreError as error:
            if "(501" in str(error.strerror):
                raise store_error(self.path, f"{_UNFIT}: {error.strerror}") from None
            raise
        self._store.delete([self._probe])

    def _refuses(self, header: str, put: Callable[[], object]) -> None:
        with suppress(ChangedError):
            put()
            raise store_error(self.path, f"{_UNFIT}: it ignores {header}")

    def names(self) -> dict[str, int]:
        """Return all objects, with their sizes."""
        return {each.address[len(self.path) + 1 :]: each.size for each in self._store.below(self.path)}

    def read_list(self) -> Content | None:
        """Return the list, None if there is none."""
        return self._store.load(self._at(TABLE))

    def replace_list(self, data: bytes, known: Content | None) -> Content:
        """Replace the list in one step. Raises RacedError if it is not the known one any more."""
        try:
            return self._store.save(self._at(TABLE), data, known.version if known else "create")
        except ChangedError:
            raise RacedError from None

    def write(self, name: str, data: bytes) -> None:
        """Write a small object of the state."""
        self._store.save(self._at(f"{STATE}/{name}"), data)

    def open(self, place: str) -> IO[bytes]:
        """Open a copy of a file of a topic, which stays as long as this object."""
        self._scratch = self._scratch or _temporary_folder()
        copy = _copy_of(self._scratch.name, place)
        if not os.path.exists(copy):
            os.makedirs(os.path.dirname(copy), exist_ok=True)
            self._store.fetch(self._at(place), f"{copy}.part")
            os.replace(f"{copy}.part", copy)
        return open(copy, "rb")

    def check(self, topics: Iterable[str]) -> None:
        """Do nothing: a store has no links."""

    @contextmanager
    def stage(self) -> Iterator[str]:
        """Yield a new folder of this computer for files of this run, which `keep` puts into the store."""
        with _temporary_folder() as folder:
            yield folder

    def keep(self, stage: str, places: Sequence[str]) -> None:
        """Put files of a stage into their places. Each is whole, and is part of the fleet once the list names it."""
        for place in places:
            self._store.put(_copy_of(stage, place), self._at(place), is_new=False)

    def add(self, places: Sequence[str]) -> None:
        """Do nothing: `keep` has put the files into their places."""

    def delete(self, names: Iterable[str]) -> None:
        """Delete objects, if they are there, and their copies here."""
        each = list(names)
        if each:
            self._store.delete([self._at(name) for name in each])
        if self._scratch:
            for name in each:
                with suppress(OSError):
                    os.unlink(_copy_of(self._scratch.name, name))

    def close(self) -> None:
        """Do nothing: the next run deletes what a failed one has left."""

    def _at(self, name: str) -> str:
        return f"{self.path}/{name}"


Storage: TypeAlias = Disk | Bucket


def storage_of(fleet: str, run: str = "") -> Storage:
    """Return the storage of a fleet, for a run that changes it.

    Raises StoreError, and ModuleNotFoundError without the extra, for a store.
    """
    return Bucket(fleet, run) if is_in_store(fleet) else Disk(fleet, run)


def files(fleet: str, topic: str = "") -> list[str]:
    """Return the paths or addresses of the files in the list of a fleet, of one topic or all, sorted.

    They have each row once. `topic` is the name of a folder in the fleet. Raises FleetError and OSError.
    """
    storage = storage_of(fleet)
    found = storage.read_list()
    if found is None:
        raise FleetError(NOT_A_FLEET)
    places = sorted({place for record in decoded(found.data).records for place in record.files})
    own = [place for place in places if topic in ("", topic_of(place))]
    return [f"{storage.path}/{each}" if is_in_store(fleet) else os.path.join(fleet, each) for each in own]


def absolute(path: str) -> str:
    """Return the absolute path of a folder, or an address without a slash at its end."""
    return path.rstrip("/") if is_address(path) else os.path.abspath(path)


def _entries(folder: str) -> list[os.DirEntry[str]]:
    with os.scandir(folder) as entries:
        return list(entries)


def _copy_of(folder: str, place: str) -> str:
    return os.path.join(folder, *place.split("/"))


def _temporary_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="msggen-", ignore_cleanup_errors=True)
