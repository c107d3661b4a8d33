"""Recordings below a folder, of a disk or a store, and how to tell that one has not changed.

Stores have no folders. What is between the slashes of addresses is taken for them, and the rules are those of folders.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import NamedTuple

from msggen.base.diagnostics import either
from msggen.base.disk.urls import is_address
from msggen.base.recording_formats import FORMATS, format_named
from msggen.recordings.files.paths import (
    LOGS,
    METADATA,
    is_always_whole,
    is_bag,
    is_bag_of,
    is_marked,
    is_named_as_recording,
)
from msggen.recordings.files.stored import local_name
from msggen.recordings.source.source import RecordingError
from msggen.recordings.stores.client import split
from msggen.recordings.stores.errors import NoObjectError
from msggen.recordings.stores.server import Stored
from msggen.recordings.stores.store import Store

_BLOCK = 1 << 20
_DIGITS = 15
"""The hexadecimal digits of a digest that a number of a state has."""


class State(NamedTuple):
    """What tells whether a recording has changed. That of a folder is of all its files."""

    size: int
    """In bytes."""
    changed: int
    """The time of change in ns or, in a store, a number that is another one for each version."""


class Found(NamedTuple):
    """A recording, or something that may have been one."""

    path: str
    error: str = ""
    """Why it cannot be read: a link to a missing file, or a folder that may not be opened."""
    listed: State | None = None
    """The state of one in a store, as it was listed."""


class _Folder(NamedTuple):
    """A folder that is being searched."""

    identity: tuple[int, int]
    """Its device and its number there."""
    is_one: bool
    """Whether it is one recording itself."""
    entries: Iterator[os.DirEntry[str]]
    """Those that were not looked at yet, by name."""


def find_recordings(folder: str, *, without: str = "") -> Iterator[Found]:
    """Yield all recordings below a folder, sorted: files, and folders of rosbag2. Raises OSError for the folder itself.

    The folder can be a recording itself. ULogs in a folder of rosbag2, and recordings below it, are recordings of their
    own. Symbolic links to folders are not followed, nor folders that contain themselves, as by a junction of Windows.
    The folder `without` is left out. `folder` can be an address in a store.
    """
    if is_address(folder):
        yield from (Found(address, listed=state) for address, state in sorted(_stored_below(folder, without).items()))
        return
    left_out = _identity(without) if os.path.isdir(without) else None
    way = [_opened(folder)]  # no recursion: the system allows longer paths than Python nested calls
    if way[0].is_one:
        yield Found(folder)
    while way:
        entry = next(way[-1].entries, None)
        if entry is None:
            way.pop()
            continue
        try:
            if entry.is_dir(follow_symlinks=False):
                identity = _identity(entry.path)
                if identity != left_out and all(identity != each.identity for each in way):
                    way.append(_opened(entry.path))
                    if way[-1].is_one:
                        yield Found(entry.path)
            elif is_named_as_recording(entry.name) and (not way[-1].is_one or is_always_whole(entry.name)):
                yield from _found(entry)
        except OSError as error:
            yield Found(entry.path, f"cannot be read: {error.strerror}")


def checked(found: list[Found]) -> list[Found]:
    """Return what was found below a folder. Raises RecordingError if that is nothing."""
    if not found:
        suffixes = sorted((each.suffix for each in FORMATS.values()), reverse=True)
        raise RecordingError(f"there is no recording in this folder: no {either(suffixes)} file")
    return found


def _opened(folder: str) -> _Folder:
    """Begin to search a folder. Raises OSError."""
    is_one = is_bag(folder)
    with os.scandir(folder) as found:
        return _Folder(_identity(folder), is_one, iter(sorted(found, key=lambda entry: entry.name)))


def _identity(folder: str) -> tuple[int, int]:
    stat = os.stat(folder)
    return stat.st_dev, stat.st_ino


def _found(entry: os.DirEntry[str]) -> Iterator[Found]:
    """Yield a file or a link, unless it is something else."""
    if entry.is_file():
        yield Found(entry.path)
    elif entry.is_symlink() and not os.path.exists(entry.path):
        yield Found(entry.path, "cannot be read: this is a link to a missing file")


def state_of(path: str) -> State:
    """Return the state of a recording on this computer. Raises OSError."""
    stats = [os.stat(each) for each in _files(path)]
    return State(sum(each.st_size for each in stats), max((each.st_mtime_ns for each in stats), default=0))


def digest_of(path: str) -> str:
    """Return a digest of the contents of a recording, with the names of its files if it is a folder. Raises OSError."""
    if is_address(path):
        with at_hand(path) as (copy, _):
            return digest_of(copy)
    digest = hashlib.sha256()
    for each in _files(path):
        if each != path:
            digest.update(os.path.basename(each).encode(errors="surrogateescape") + b"\0")
        with open(each, "rb") as file:
            while block := file.read(_BLOCK):
                digest.update(block)
    return digest.hexdigest()


@contextmanager
def at_hand(path: str) -> Iterator[tuple[str, State]]:
    """Yield the path of a recording, and its state. One in a store is copied to a temporary folder. Raises OSError."""
    if not is_address(path):
        yield path, state_of(path)
        return
    with _copied(path) as found:
        yield found


def _files(path: str) -> list[str]:
    """Return the files of a recording: in a folder of rosbag2, ULogs are recordings of their own."""
    if not os.path.isdir(path):
        return [path]
    with os.scandir(path) as found:
        return sorted(entry.path for entry in found if entry.is_file() and not is_always_whole(entry.name))


def _stored_below(folder: str, without: str = "") -> dict[str, State]:
    """Return the states of all recordings below a folder of a store, by address. Raises StoreError.

    The folder `without` is left out.
    """
    store = Store(folder)
    folder = store.canonical(folder)
    folders: dict[str, dict[str, Stored]] = {}
    for each in store.below(folder):
        parent, _, name = each.address.rpartition("/")
        if not f"{parent}/".startswith(f"{without}/"):
            folders.setdefault(parent, {})[name] = each
    found: dict[str, State] = {}
    for parent, objects in folders.items():
        is_one = _is_bag(store, parent, objects)
        if is_one:
            found[parent] = _state(_parts(objects))
        for name, each in objects.items():
            if is_named_as_recording(name) and (not is_one or is_always_whole(name)):
                found[each.address] = _state([each])
    return found


def is_folder_in_store(address: str) -> bool:
    """Whether an address is that of a folder with recordings, and not of a recording. Raises StoreError."""
    store = Store(address)
    if not address.endswith("/") and store.canonical(address).count("/") > 2:  # noqa: PLR2004 - s3://bucket
        try:
            store.look(address)
        except NoObjectError:
            pass
        else:
            return False
    folder = store.canonical(address)
    objects = _by_name(store.folder(folder))
    return not _is_bag(store, folder, objects) and store.has_below(folder)


@contextmanager
def _copied(address: str) -> Iterator[tuple[str, State]]:
    """Yield the path of a copy of a recording, and its state. Errors have its address. Raises OSError."""
    store = _store(split(address)[0], _environment())
    with tempfile.TemporaryDirectory(prefix="msggen-", ignore_cleanup_errors=True) as folder:
        copy = os.path.join(folder, local_name(address.rpartition("/")[2]))
        try:
            parts = [store.fetch(address, copy)]
            _fetch_logs(store, address, copy)
        except NoObjectError:
            listed = _parts(_by_name(store.folder(address)))
            if not listed:
                raise
            os.mkdir(copy)
            parts = [_fetched(store, each.address, copy) for each in listed]
        try:
            yield copy, _state(parts)
        except RecordingError as error:
            raise RecordingError(str(error).replace(copy, address)) from None


@lru_cache
def _store(address: str, _: object) -> Store:
    return Store(address)


def _environment() -> object:
    """Return what credentials are taken from: a client is used for all recordings, as it takes long to make one."""
    return tuple(sorted(each for each in os.environ.items() if each[0].startswith("AWS_")))


def _fetched(store: Store, address: str, folder: str) -> Stored:
    return store.fetch(address, os.path.join(folder, local_name(address.rpartition("/")[2])))


def _is_bag(store: Store, folder: str, objects: Mapping[str, Stored]) -> bool:
    def has_mark() -> bool:
        found = store.load(objects[METADATA].address)
        return found is not None and is_marked(found.data)

    return is_bag_of(objects, folder.rpartition("/")[2], has_mark)


def _parts(objects: Mapping[str, Stored]) -> list[Stored]:
    """Return the files of a recording of rosbag2."""
    return [each for name, each in sorted(objects.items()) if not is_always_whole(name)]


def _fetch_logs(store: Store, address: str, copy: str) -> None:
    """Fetch the logs of transactions beside a database: it may not have been closed."""
    if format_named(address) is FORMATS["db3"]:
        for suffix in LOGS:
            if store.has(address + suffix):
                store.fetch(address + suffix, copy + suffix)


def _by_name(objects: Iterable[Stored]) -> dict[str, Stored]:
    return {each.address.rpartition("/")[2]: each for each in objects}


def _state(parts: Sequence[Stored]) -> State:
    """Return the state of a recording that has these files."""
    told = repr([each.tag or str(each.modified) for each in parts if each.size])  # an empty one has no tag when read
    return State(sum(each.size for each in parts), int(hashlib.sha256(told.encode()).hexdigest()[:_DIGITS], 16))
