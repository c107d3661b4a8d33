"""Recordings in a store: found by a list of the objects below a folder, and copied to this computer as a whole.

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

from msggen.base.recording_formats import FORMATS, format_named
from msggen.recordings.files.paths import LOGS, METADATA, is_always_whole, is_bag_of, is_marked, is_named_as_recording
from msggen.recordings.files.stored import local_name
from msggen.recordings.source.source import RecordingError
from msggen.recordings.stores.client import split
from msggen.recordings.stores.errors import NoObjectError
from msggen.recordings.stores.server import Stored
from msggen.recordings.stores.store import Store


class State(NamedTuple):
    """What tells whether a recording has changed. That of a folder is of all its files."""

    size: int
    """In bytes."""
    changed: int
    """The time of change in ns or, in a store, a number that is another one for each version."""


_DIGITS = 15
"""The hexadecimal digits of a digest that a number of a state has."""


def find_stored(folder: str, without: str = "") -> dict[str, State]:
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


def is_folder(address: str) -> bool:
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
def copied(address: str) -> Iterator[tuple[str, State]]:
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
    told = repr([each.tag or str(each.modified) for each in parts])
    return State(sum(each.size for each in parts), int(hashlib.sha256(told.encode()).hexdigest()[:_DIGITS], 16))
