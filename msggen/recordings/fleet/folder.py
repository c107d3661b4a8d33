"""The storage of a fleet: a folder of this machine, or one that several machines share.

Everything that a fleet reads and writes goes through the methods of `Folder`, or of `StoredFolder`, which has the same
ones for an object store.
"""

from __future__ import annotations

import os
import platform
import stat
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import IO, NamedTuple

from msggen.base.disk.files import flush
from msggen.base.disk.output import check_links, link_in
from msggen.base.disk.reading import read_bytes
from msggen.base.disk.staging import clear, locked, make_folder, make_stage, staging_folder, write_if_changed
from msggen.base.disk.swap import can_swap, flush_tree, keep_newer, link_or_copy, mirror, swap_folders
from msggen.recordings.fleet.layout import is_place

STATE = "_msggen"
"""The folder of the ledger. Engines skip names that begin with an underscore."""
STAGE = ".stage"
"""The suffix of a folder in which files are written before they are part of the fleet."""
RUN = "run.txt"
"""The file that names the process that changes the fleet."""
FILES = "files.json"
"""The file of the state of a fleet in a store that lists the files of each topic."""
_CONTENT = "new"
_GRACE = 0.02
"""How long in s the earlier folder of a topic stays after the swap."""
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


class Added(NamedTuple):
    """A file of a topic that is to be added."""

    place: str
    """Its path in the fleet: `<topic>/<name>.parquet`."""
    staged: str
    """Where it was written: a path in the folder of the state."""


class Changed(NamedTuple):
    """What changes in the folder of a topic."""

    added: list[Added]
    removed: list[str]
    """The places of files."""


def staged_name(token: str, path: str) -> str:
    """Return the path of a file in a stage as one in the folder of the state."""
    return f"{token}{STAGE}/{_CONTENT}/{os.path.basename(path)}"


class Folder:
    """A fleet in a folder."""

    is_in_store = False

    def __init__(self, path: str) -> None:
        self.path = path
        self.state = os.path.join(path, STATE)

    def make(self, *folders: str) -> None:
        """Create folders of the state. Raises OSError, and InputError for one that is a symbolic link."""
        names = [STATE, *(f"{STATE}/{name}" for name in folders)]
        check_links(self.path, names)
        for name in names:
            make_folder(os.path.join(self.path, name))

    def has_others(self) -> bool:
        """Whether the folder has files, but none of a fleet."""
        return not os.path.lexists(self.state) and os.path.isdir(self.path) and bool(os.listdir(self.path))

    @contextmanager
    def locked(self, waiting: Callable[[str], None]) -> Iterator[None]:
        """Hold the lock of the fleet. If another run has it, call `waiting` with its name, and wait."""
        with locked(self.state, lambda: waiting((self.read(RUN) or b"").decode(errors="replace").partition("\n")[0])):
            line = f"process {os.getpid()} on {platform.node()}\n"
            self.write(RUN, os.fsencode(line), flushed=False)
            try:
                yield
            finally:
                self.delete(RUN)

    # the state: small files

    def names(self, folder: str = "") -> list[str]:
        """Return the names of what is in a folder of the state, sorted; none if there is no such folder."""
        path = os.path.join(self.state, folder)
        return sorted(os.listdir(path)) if os.path.isdir(path) and not link_in(self.path, self._inner(folder)) else []

    def read(self, name: str) -> bytes | None:
        """Return the contents of a file of the state, None if it cannot be read: a link, a pipe, or too large."""
        try:
            return read_bytes(os.path.join(self.state, name), follow=False)
        except OSError:
            return None

    def lines(self, name: str) -> Iterator[bytes]:
        """Yield the lines of a file of the state of any size, none if it cannot be read."""
        try:
            handle = os.open(os.path.join(self.state, name), _FLAGS)
        except OSError:
            return
        with open(handle, "rb") as file:
            if stat.S_ISREG(os.fstat(handle).st_mode):
                with suppress(OSError):
                    yield from file

    def write(self, name: str, data: bytes, *, flushed: bool = True) -> None:
        """Write a file of the state as a whole, if it differs. `/` at the front: of the fleet. Raises OSError."""
        path = os.path.join(self.path, name[1:]) if name.startswith("/") else os.path.join(self.state, name)
        write_if_changed(path, data, flushed=flushed)

    def delete(self, name: str) -> None:
        """Remove a file of the state, if it is there and no folder."""
        path = os.path.join(self.state, name)
        if not link_in(self.path, os.path.dirname(self._inner(name))):
            with suppress(FileNotFoundError, IsADirectoryError, PermissionError):
                os.unlink(path)

    def _inner(self, name: str) -> str:
        return f"{STATE}/{name}" if name else STATE

    # the files of topics

    def places(self) -> dict[str, int]:
        """Return the sizes of all files of topics, by path: `<topic>/<name>`. Links, and what is below one, are not."""
        found: dict[str, int] = {}
        with os.scandir(self.path) as topics:
            names = [each.name for each in topics if each.name[0] not in "._" and each.is_dir(follow_symlinks=False)]
        for topic in sorted(names):
            with os.scandir(os.path.join(self.path, topic)) as files:
                for each in sorted(files, key=lambda each: each.name):
                    if each.is_file(follow_symlinks=False):
                        found[f"{topic}/{each.name}"] = each.stat(follow_symlinks=False).st_size
        return found

    def open(self, place: str) -> IO[bytes]:
        """Open a file of a topic. Raises OSError."""
        return open(os.path.join(self.path, place), "rb")

    def check(self, topics: Iterable[str]) -> None:
        """Raise InputError if the folder of a topic is a link or a file, PermissionError if it cannot be changed."""
        names = sorted({*topics})
        check_links(self.path, names)
        for name in names:
            path = os.path.join(self.path, name)
            if os.path.lexists(path):
                make_folder(path)

    @contextmanager
    def stage(self, token: str) -> Iterator[str]:
        """Yield a new folder for files of a change. It stays, unless there is an error. Raises OSError."""
        try:
            yield make_stage(os.path.join(self.state, token + STAGE))
        except BaseException:
            self.clear(token + STAGE)
            raise

    def settle(self, stage: str, staged: Sequence[str]) -> None:
        """Wait until files of a stage are on the disk."""
        flush([*(os.path.join(self.state, each) for each in staged), stage])

    def clear(self, name: str) -> None:
        """Remove a stage. A process of a run that was killed may still write there: the next run removes the rest."""
        with suppress(OSError):
            clear(os.path.join(self.state, name))

    def change(self, topics: Mapping[str, Changed], _: Iterable[str] | None) -> None:
        """Add and remove files, those of a topic in one step. Raises OSError, InputError if a folder there is a link.

        What was done is not done again, so a change can be repeated after a kill. What is removed can be in folders in
        that of the topic, which are removed if they are empty then.
        """
        for topic, changed in topics.items():
            self._change_topic(topic, *changed)
        added = (each for changed in topics.values() for each in changed.added)
        for stage in {each.staged.partition("/")[0] for each in added if each.staged}:
            self.clear(stage)

    def _change_topic(self, topic: str, added: Sequence[Added], removed: Sequence[str]) -> None:
        new = [each for each in added if self._is_waiting(each)]
        old = [place for place in removed if self.has(place)]
        if old:
            self._replace(topic, new, old)
        elif new:
            check_links(self.path, [topic])
            make_folder(os.path.join(self.path, topic))
            for each in new:
                os.replace(os.path.join(self.state, each.staged), os.path.join(self.path, each.place))

    def publish(self, _: Iterable[str]) -> None:
        """Remove the list of files that a fleet has if it was copied from a store."""
        if self.has(f"{STATE}/{FILES}"):
            self.delete(FILES)

    def files(self) -> list[str]:
        """Return the places of the files of topics."""
        return [place for place in self.places() if is_place(place)]

    def flush(self, topics: Sequence[str]) -> None:
        """Wait until the folders of topics are on the disk."""
        flush(
            path for path in (self.path, *(os.path.join(self.path, topic) for topic in topics)) if os.path.isdir(path)
        )

    def _is_waiting(self, added: Added) -> bool:
        return not os.path.lexists(os.path.join(self.path, added.place)) and self.has(f"{STATE}/{added.staged}")

    def has(self, name: str) -> bool:
        """Whether there is a regular file that is not below a link."""
        path = os.path.join(self.path, name)
        return not os.path.islink(path) and os.path.isfile(path) and not link_in(self.path, os.path.dirname(name))

    def _replace(self, topic: str, added: Sequence[Added], removed: Sequence[str]) -> None:
        """Build a new folder for a topic beside the current one, and swap them.

        If the system cannot swap folders, the old files are removed first: then rows are missing for a moment.
        """
        current = os.path.join(self.path, topic)
        files = {each.place: os.path.join(self.state, each.staged) for each in added}
        if can_swap(current) and self._swapped(topic, current, files, removed):
            return
        for place in removed:
            os.unlink(os.path.join(self.path, place))
        _remove_empty(self.path, removed)
        make_folder(current)
        for place, staged in files.items():
            os.replace(staged, os.path.join(self.path, place))

    def _swapped(self, topic: str, current: str, files: Mapping[str, str], removed: Sequence[str]) -> bool:
        """Swap the folder of a topic for one with other files. Return False if the system cannot."""
        with staging_folder(os.path.join(self.state, f"{topic}.swap{STAGE}")) as content:
            built = os.path.join(content, topic)
            mirror(current, built, [_inner(place) for place in removed])
            _remove_empty(built, [_inner(place) for place in removed])
            for place, staged in files.items():  # a link: the change is repeated if this run is killed
                link_or_copy(staged, os.path.join(built, _inner(place)))
            names = [_inner(place) for place in files]
            flush_tree(built, names)
            is_done = not swap_folders({current: built})
            if is_done and os.path.isdir(built):
                keep_newer(built, current, [*names, *(_inner(place) for place in removed)])
                time.sleep(_GRACE)  # a reader that has opened the folder and not listed it would find it empty
        return is_done


def _inner(place: str) -> str:
    """Return a path in the folder of its topic."""
    return place.partition("/")[2]


def _remove_empty(folder: str, files: Sequence[str]) -> None:
    """Remove the folders of files that are empty."""
    for name in files:
        parent = os.path.dirname(name)
        with suppress(OSError):  # the first one that is not empty ends it
            while parent:
                os.rmdir(os.path.join(folder, parent))
                parent = os.path.dirname(parent)
