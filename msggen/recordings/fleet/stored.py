"""The storage of a fleet in an object store, with the methods of `Folder`.

Objects are put whole. What is added waits below the state, as in a folder, and is then copied within the store to its
place: engines that list the files of a topic see no file before it is part of the fleet. A store cannot change several
objects in one step: `FILES` lists the files of all topics, and is replaced after the new files are there and before the
old ones are deleted.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING

from msggen.recordings.fleet.folder import FILES, RUN, STATE, Changed
from msggen.recordings.fleet.layout import is_place, topic_of
from msggen.recordings.fleet.lease import Lease
from msggen.recordings.stores.store import Store

if TYPE_CHECKING:
    from obstore import UpdateVersion


class StoredFolder:
    """A fleet in a store. Methods raise StoreError."""

    is_in_store = True

    def __init__(self, address: str) -> None:
        self._store = Store(address)
        self.path = self._store.canonical(address)
        self.state = f"{self.path}/{STATE}"
        self._scratch = ""
        """The folder for copies of files of topics, as long as the lock is held, "" without it."""
        self._lease = Lease(self._store, f"{self.state}/{RUN}")
        self._versions: dict[str, UpdateVersion] = {}
        """Which versions of files of the state were read. They are replaced only if nobody else has."""
        self._published: bytes | None = None

    def make(self, *_: str) -> None:
        """Do nothing: a store has no folders."""

    def has_others(self) -> bool:
        """Whether the folder has files, but none of a fleet."""
        return self._store.has_below(self.path) and not self._store.has_below(self.state)  # another run may begin now

    @contextmanager
    def locked(self, waiting: Callable[[str], None]) -> Iterator[None]:
        """Hold the lock of the fleet. If another run has it, call `waiting` with its name, and wait."""
        with _temporary_folder() as folder, self._lease.held(waiting):
            self._scratch = folder
            try:
                yield
            finally:
                self._scratch = ""

    # the state: small files

    def names(self, folder: str = "") -> list[str]:
        """Return the names of what is in a folder of the state, sorted."""
        front = f"{self.state}/{folder}".rstrip("/")
        found = (each.address[len(front) + 1 :].partition("/")[0] for each in self._store.below(front))
        return sorted({*found})

    def read(self, name: str) -> bytes | None:
        """Return the contents of a file of the state, None if there is none."""
        found = self._store.load(f"{self.state}/{name}")
        if found is None:
            return None
        self._versions[name] = found.version
        return found.data

    def lines(self, name: str) -> Iterator[bytes]:
        """Yield the lines of a file of the state, none if there is none."""
        yield from (self.read(name) or b"").splitlines(keepends=True)

    def write(self, name: str, data: bytes) -> None:
        """Write a file of the state as a whole. `/` at the front: of the fleet.

        Raises ChangedError if another run has replaced it since it was read.
        """
        self._lease.check()
        address = f"{self.path}{name}" if name.startswith("/") else f"{self.state}/{name}"
        written = self._store.save(address, data, over=self._versions.get(name))
        if name in self._versions:
            self._versions[name] = written.version

    def delete(self, name: str) -> None:
        """Remove a file of the state, if it is there."""
        self._lease.check()
        self._store.delete([f"{self.state}/{name}"])

    # the files of topics

    def places(self) -> dict[str, int]:
        """Return the sizes of all files of topics, by path: `<topic>/<name>`."""
        found = {each.address[len(self.path) + 1 :]: each.size for each in self._store.below(self.path)}
        return {place: size for place, size in sorted(found.items()) if is_place(place)}

    def has(self, name: str) -> bool:
        """Whether there is a file."""
        return self._store.has(f"{self.path}/{name}")

    def open(self, place: str) -> IO[bytes]:
        """Open a copy of a file of a topic. It stays until the end of the run, or until the file is removed.

        Without the lock, the copy has no name.
        """
        if not self._scratch:
            with _temporary_folder() as folder:
                copy = os.path.join(folder, "copy")
                self._store.fetch(f"{self.path}/{place}", copy)
                return open(copy, "rb")
        copy = self._copy(place)
        if not os.path.exists(copy):
            os.makedirs(os.path.dirname(copy), exist_ok=True)
            self._store.fetch(f"{self.path}/{place}", f"{copy}.part")
            os.replace(f"{copy}.part", copy)
        return open(copy, "rb")

    def _copy(self, place: str) -> str:
        return os.path.join(self._scratch, *place.split("/"))

    def check(self, topics: Iterable[str]) -> None:
        """Do nothing: a store has no links."""

    @contextmanager
    def stage(self, _: str) -> Iterator[str]:
        """Yield a new folder of this computer for files of a change, which `settle` puts into the store."""
        with _temporary_folder() as folder:
            yield folder

    def settle(self, stage: str, staged: Sequence[str]) -> None:
        """Put files of a stage into the store."""
        for each in staged:
            self._store.replace(os.path.join(stage, os.path.basename(each)), f"{self.state}/{each}")

    def clear(self, name: str) -> None:
        """Remove a stage."""
        self._lease.check()
        self._store.delete([each.address for each in self._store.below(f"{self.state}/{name}")])

    def change(self, topics: Mapping[str, Changed], files: Iterable[str] | None) -> None:
        """Add and remove files of topics. `files` are those of the fleet afterwards, None if that is not the last one.

        What was done is not done again, so a change can be repeated after a kill.
        """
        self._lease.check()
        added = [each for topic in topics.values() for each in topic.added if each.staged]
        self._store.copy([(f"{self.state}/{each.staged}", f"{self.path}/{each.place}") for each in added])
        if files is not None:
            self.publish(files)
        removed = [place for topic in topics.values() for place in topic.removed]
        places = [*(f"{STATE}/{each.staged}" for each in added), *removed]
        if places:
            self._lease.check()
            self._store.delete([f"{self.path}/{place}" for place in places])
        for place in removed:
            with suppress(OSError):
                os.unlink(self._copy(place))

    def publish(self, files: Iterable[str]) -> None:
        """Replace the list of the files of topics."""
        data = _document(files)
        if data != self._published:
            self.write(FILES, data)
            self._published = data

    def files(self) -> list[str]:
        """Return the places of the files of topics, as listed at the end of the last change."""
        found = self._store.load(f"{self.state}/{FILES}")
        listed = _places(found.data) if found else None
        return list(self.places()) if listed is None else listed

    def flush(self, _: Sequence[str]) -> None:
        """Do nothing: what a store has acknowledged, it has."""


def _temporary_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="msggen-", ignore_cleanup_errors=True)


def _document(files: Iterable[str]) -> bytes:
    topics: dict[str, list[str]] = {}
    for place in sorted(files):
        topics.setdefault(topic_of(place), []).append(place)
    return (json.dumps({"topics": topics}) + "\n").encode()


def _places(data: bytes) -> list[str] | None:
    """Return the places in a list, None if it is damaged."""
    try:
        topics = json.loads(data)["topics"]
        places = [place for topic in topics.values() for place in topic]
    except (ValueError, RecursionError, LookupError, TypeError, AttributeError):
        return None
    return places if all(map(is_place, places)) else None
