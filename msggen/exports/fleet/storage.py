"""Where a fleet is: in a folder of this machine, or one that several machines share, or in an object store.

Both have the same methods, so all else is the same code. Names are paths in the fleet, with `/` between folders.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from typing import IO, TypeAlias

from msggen.base.disk.files import flush
from msggen.base.disk.output import check_links, link_in
from msggen.base.disk.staging import clear, locked, make_folder, make_stage, write_if_changed, written_aside
from msggen.base.disk.urls import is_address, is_in_store
from msggen.exports.fleet.layout import STAGE, STATE, is_place, is_stage, run_of, topic_of
from msggen.exports.fleet.records import NOT_A_FLEET, TABLE, FleetError, decoded
from msggen.recordings.stores.errors import ChangedError, StoreError, store_error
from msggen.recordings.stores.store import Content, Store

_NO_FOLLOW = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_UNFIT = "the store refuses conditional puts, which keep two runs apart: choose another store"
_NEW = "new"
"""The folder in a stage of a folder that has the files."""


class RacedError(Exception):
    """A list that another run has replaced since it was read."""


class Disk:
    """A fleet in a folder. Methods raise OSError, and InputError for a folder that is a link."""

    def __init__(self, path: str) -> None:
        self.path = path

    def prepare(self) -> None:
        """Make the folders of a fleet."""
        self.check([STATE])
        make_folder(self._at(STATE))

    def others(self) -> list[str]:
        """Return what is in the folder beside the state of a fleet."""
        return sorted({*os.listdir(self.path)} - {STATE}) if os.path.isdir(self.path) else []

    def has(self, name: str) -> bool:
        """Whether there is a file."""
        return os.path.lexists(self._at(name))

    def read_list(self) -> Content | None:
        """Return the list, None if there is none."""
        try:
            with open(self._at(TABLE), "rb", opener=lambda path, _: os.open(path, _NO_FOLLOW)) as file:
                return Content(file.read(), {})
        except (FileNotFoundError, NotADirectoryError):
            return None

    def replace_list(self, data: bytes, known: Content | None) -> Content:
        """Replace the list in one step. Raises RacedError if it is not the known one any more."""
        with (
            written_aside({self._at(TABLE): data}, self._at(f"{STATE}/{os.urandom(4).hex()}{STAGE}")) as move,
            locked(self._at(STATE)),  # for the moment of the comparison and the rename only
        ):
            if self.read_list() != known:
                raise RacedError
            move()
        return Content(data, {})

    def write(self, name: str, data: bytes) -> None:
        """Write a small file of the state."""
        write_if_changed(self._at(f"{STATE}/{name}"), data)

    def places(self) -> dict[str, int]:
        """Return the sizes of the files of topics, by place. Links, and what is below one, are not."""
        with os.scandir(self.path) as topics:
            names = [each.name for each in topics if each.name[0] not in "._" and each.is_dir(follow_symlinks=False)]
        found: dict[str, int] = {}
        for topic in sorted(names):
            with os.scandir(self._at(topic)) as files:
                for each in sorted(files, key=lambda each: each.name):
                    if is_place(f"{topic}/{each.name}") and each.is_file(follow_symlinks=False):
                        found[f"{topic}/{each.name}"] = each.stat(follow_symlinks=False).st_size
        return found

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

    def stages(self) -> list[str]:
        """Return the runs that have a stage."""
        return _runs(os.listdir(self._at(STATE)) if self.has(STATE) else ())

    def begin(self, run: str) -> None:
        """Make the stage of a run, in which its files wait."""
        make_stage(self._at(f"{STATE}/{run}{STAGE}"))

    @contextmanager
    def stage(self, token: str) -> Iterator[str]:
        """Yield a new folder for files of a change, which is in the stage of its run."""
        folder = self._at(f"{STATE}/{run_of(token)}{STAGE}/{_NEW}/{token}")
        os.mkdir(folder)
        yield folder

    def settle(self, stage: str, names: Sequence[str]) -> list[str]:
        """Wait until files of a stage are kept. Return their names in the fleet."""
        flush([*(os.path.join(stage, name) for name in names), stage])
        front = os.path.relpath(stage, self.path).replace(os.sep, "/")
        return [f"{front}/{name}" for name in names]

    def move(self, staged: Mapping[str, str]) -> None:
        """Move staged files to their places."""
        topics = sorted({topic_of(place) for place in staged})
        check_links(self.path, topics)
        for topic in topics:
            make_folder(self._at(topic))
        for place, name in staged.items():
            os.replace(self._at(name), self._at(place))
        flush([self.path, *map(self._at, topics)])

    def delete(self, names: Iterable[str]) -> None:
        """Remove files, if they are there."""
        for name in names:
            if not link_in(self.path, os.path.dirname(name)):
                with suppress(FileNotFoundError):
                    os.unlink(self._at(name))

    def clear(self, run: str) -> None:
        """Remove the stage of a run. If it still writes there, the next run removes the rest."""
        with suppress(OSError):
            clear(self._at(f"{STATE}/{run}{STAGE}"))

    def _at(self, name: str) -> str:
        return os.path.join(self.path, *name.split("/"))


class Bucket:
    """A fleet in a store. Methods raise StoreError."""

    def __init__(self, address: str) -> None:
        self._store = Store(address)
        self.path = self._store.canonical(address)
        self._scratch: tempfile.TemporaryDirectory[str] | None = None
        """Copies of files of topics."""

    def prepare(self) -> None:
        """Raise StoreError if the store does not compare versions: then two runs could overwrite each other."""
        address = f"{self.path}/{STATE}/{os.urandom(4).hex()}{STAGE}/probe"
        try:
            known = self._store.create(address, b"1")
            self._refuses("If-None-Match", lambda: self._store.create(address, b"2"))
            self._store.save(address, b"3", over=known.version)
            self._refuses("If-Match", lambda: self._store.save(address, b"4", over=known.version))
        except StoreError as error:
            if "(501" in str(error.strerror):
                raise store_error(self.path, f"{_UNFIT}: {error.strerror}") from None
            raise
        self._store.delete([address])

    def _refuses(self, header: str, put: Callable[[], object]) -> None:
        with suppress(ChangedError):
            put()
            raise store_error(self.path, f"{_UNFIT}: it ignores {header}")

    def others(self) -> list[str]:
        """Return an object that is not of the state of a fleet, if there is one."""
        found = (each.address[len(self.path) + 1 :] for each in self._store.below(self.path))
        return list(islice((name for name in found if not name.startswith(f"{STATE}/")), 1))

    def has(self, name: str) -> bool:
        """Whether there is an object."""
        return self._store.has(f"{self.path}/{name}")

    def read_list(self) -> Content | None:
        """Return the list, None if there is none."""
        return self._store.load(f"{self.path}/{TABLE}")

    def replace_list(self, data: bytes, known: Content | None) -> Content:
        """Replace the list in one step. Raises RacedError if it is not the known one any more."""
        address = f"{self.path}/{TABLE}"
        try:
            return self._store.save(address, data, over=known.version) if known else self._store.create(address, data)
        except ChangedError:
            raise RacedError from None

    def write(self, name: str, data: bytes) -> None:
        """Write a small object of the state."""
        self._store.save(f"{self.path}/{STATE}/{name}", data)

    def places(self) -> dict[str, int]:
        """Return the sizes of the files of topics, by place."""
        found = {each.address[len(self.path) + 1 :]: each.size for each in self._store.below(self.path)}
        return {place: size for place, size in sorted(found.items()) if is_place(place)}

    def open(self, place: str) -> IO[bytes]:
        """Open a copy of a file of a topic, which stays as long as this object."""
        self._scratch = self._scratch or _temporary_folder()
        copy = _copy_of(self._scratch.name, place)
        if not os.path.exists(copy):
            os.makedirs(os.path.dirname(copy), exist_ok=True)
            self._store.fetch(f"{self.path}/{place}", f"{copy}.part")
            os.replace(f"{copy}.part", copy)
        return open(copy, "rb")

    def check(self, topics: Iterable[str]) -> None:
        """Do nothing: a store has no links."""

    def stages(self) -> list[str]:
        """Return the runs that have a stage."""
        front = f"{self.path}/{STATE}"
        return _runs(each.address[len(front) + 1 :].partition("/")[0] for each in self._store.below(front))

    def begin(self, run: str) -> None:
        """Do nothing: a store has no folders."""

    @contextmanager
    def stage(self, token: str) -> Iterator[str]:
        """Yield a new folder of this computer for files of a change, which `settle` puts into the store."""
        with _temporary_folder() as folder:
            stage = os.path.join(folder, token)
            os.mkdir(stage)
            yield stage

    def settle(self, stage: str, names: Sequence[str]) -> list[str]:
        """Put files of a stage into the store. Return their names in the fleet."""
        token = os.path.basename(stage)
        placed = [f"{STATE}/{run_of(token)}{STAGE}/{token}/{name}" for name in names]
        for name, place in zip(names, placed, strict=True):
            self._store.replace(os.path.join(stage, name), f"{self.path}/{place}")
        return placed

    def move(self, staged: Mapping[str, str]) -> None:
        """Copy staged objects to their places within the store. `delete` removes them."""
        self._store.copy([(f"{self.path}/{name}", f"{self.path}/{place}") for place, name in staged.items()])

    def delete(self, names: Iterable[str]) -> None:
        """Delete objects, if they are there, and their copies here."""
        each = list(names)
        if each:
            self._store.delete([f"{self.path}/{name}" for name in each])
        if self._scratch:
            for name in each:
                with suppress(OSError):
                    os.unlink(_copy_of(self._scratch.name, name))

    def clear(self, run: str) -> None:
        """Delete the stage of a run."""
        front = f"{self.path}/{STATE}/"
        own = [each.address for each in self._store.below(f"{front}{run}{STAGE}")]
        if own:
            self._store.delete(own)


Storage: TypeAlias = Disk | Bucket


def storage_of(fleet: str) -> Storage:
    """Return the storage of a fleet. Raises StoreError, and ModuleNotFoundError without the extra, for a store."""
    return Bucket(fleet) if is_in_store(fleet) else Disk(fleet)


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


def _runs(names: Iterable[str]) -> list[str]:
    return sorted({name.removesuffix(STAGE) for name in names if is_stage(name)})


def _copy_of(folder: str, place: str) -> str:
    return os.path.join(folder, *place.split("/"))


def _temporary_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="msggen-", ignore_cleanup_errors=True)
