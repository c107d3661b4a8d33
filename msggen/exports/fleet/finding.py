"""Recordings below a folder, and how to tell that one has not changed."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from msggen.base.diagnostics import either
from msggen.base.disk.urls import is_address
from msggen.base.recording_formats import FORMATS
from msggen.exports.fleet.listing import State, copied, find_stored
from msggen.recordings.files.paths import is_always_whole, is_bag, is_named_as_recording
from msggen.recordings.source.source import RecordingError

_BLOCK = 1 << 20


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
        yield from (Found(address, listed=state) for address, state in sorted(find_stored(folder, without).items()))
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
    with copied(path) as found:
        yield found


def _files(path: str) -> list[str]:
    """Return the files of a recording: in a folder of rosbag2, ULogs are recordings of their own."""
    if not os.path.isdir(path):
        return [path]
    with os.scandir(path) as found:
        return sorted(entry.path for entry in found if entry.is_file() and not is_always_whole(entry.name))
