"""The files of a source: a folder on disk, or a snapshot of a git revision or an archive.

A `Folder` reads from disk on demand. A `Snapshot` has its files in memory, so no work tree is changed and no archive
is unpacked.
"""

from __future__ import annotations

import os
import posixpath
from collections.abc import Callable, Mapping
from typing import TypeAlias

from msggen.base.diagnostics import input_error
from msggen.base.disk.reading import LARGEST, TOO_LARGE, read_bytes

_MAX_LINKS = 40
_LONGEST_NAME = 1024
_MOST_FOLDERS = 64
"""Maximum length of a name, and of folders in it. Other files of a snapshot are left out; none of them is read."""

_MOST_READ = 2**28
"""Maximum number of bytes that are read of one revision or archive. A firmware tree needs 2 MB."""

Wanted: TypeAlias = Callable[[str], bool]
"""A predicate of file names: whether the contents of the file are needed."""

More: TypeAlias = Callable[[Wanted], Mapping[str, bytes]]
"""A function that reads further contents from the origin of a snapshot."""


class Folder:
    """A folder on disk. Names are relative to it, with `/` between folders."""

    def __init__(self, path: str) -> None:
        self.path = path

    def names(self, folder: str) -> list[str]:
        """Return the names of the files and folders in `folder`, sorted. A missing folder has none."""
        try:
            return sorted(os.listdir(os.path.join(self.path, folder)))
        except (FileNotFoundError, NotADirectoryError):
            return []
        except OSError as error:
            raise input_error(self.path, "S101", error.strerror or str(error), 0) from None

    def is_folder(self, name: str) -> bool:
        """Return whether a folder of that name exists."""
        return os.path.isdir(os.path.join(self.path, *name.split("/")))

    def is_file(self, name: str) -> bool:
        """Return whether a file of that name exists."""
        return os.path.isfile(os.path.join(self.path, *name.split("/")))

    def place(self, name: str) -> str:
        """Return the path of `name`, to open it and to show it to the user."""
        return os.path.join("" if self.path == os.curdir else self.path, *name.split("/"))

    def read(self, name: str) -> bytes:
        """Return the bytes of `name`. Raises InputError."""
        path = self.place(name)
        try:
            return read_bytes(path)
        except OSError as error:
            raise input_error(path, "S101", error.strerror or str(error), 0) from None


class TooMuchError(Exception):
    """An error: a file is too large, or all files together are."""


class Amount:
    """The number of bytes read so far of a revision or an archive."""

    def __init__(self) -> None:
        self._sum = 0

    def add(self, name: str, size: int) -> None:
        """Add the size of a file. Raises TooMuchError."""
        self._sum += size
        if size > LARGEST:
            raise TooMuchError(f"'{name}' is {TOO_LARGE}")
        if self._sum > _MOST_READ:
            raise TooMuchError(f"its definitions are larger than {_MOST_READ // 2**20} MiB, the limit for all files")


class Snapshot:
    """The files of a revision or an archive.

    `files` has the contents and `links` the targets of symbolic links, by name. The names that methods take are
    relative to the folder `base`, which is "" or ends in `/`; links may point out of it. `more` reads the contents of
    files that were not read at first. Errors show the `label`.
    """

    def __init__(
        self, label: str, files: Mapping[str, bytes], links: Mapping[str, str], base: str = "", more: More | None = None
    ) -> None:
        self.path = label
        self._files = {name: data for name, data in files.items() if _is_name(name)}
        self._more = more
        self._links = {name: target for name, target in links.items() if _is_name(name) and _is_name(target)}
        self._base = base
        self._folders: dict[str, set[str]] = {"": set()}
        for name in (*self._files, *self._links):
            parent, _, child = name.rpartition("/")
            while child and child not in self._folders.setdefault(parent, set()):
                self._folders[parent].add(child)
                parent, _, child = parent.rpartition("/")

    def names(self, folder: str) -> list[str]:
        """Return the names of the files and folders in `folder`, sorted. A missing folder has none."""
        return sorted(self._folders.get(self._resolve(folder), ()))

    def is_folder(self, name: str) -> bool:
        """Return whether a folder of that name exists."""
        return self._resolve(name) in self._folders

    def is_file(self, name: str) -> bool:
        """Return whether a file of that name exists."""
        return self._resolve(name) in self._files

    def place(self, name: str) -> str:
        """Return the path of `name` to show to the user. It cannot be opened."""
        return f"{self.path}/{name}"

    def read(self, name: str) -> bytes:
        """Return the bytes of `name`. Raises InputError."""
        found = self._resolve(name)
        if found not in self._files:
            raise input_error(self.place(name), "S101", "no such file", 0)
        return self._files[found]

    def include(self, is_wanted: Wanted) -> None:
        """Read the files that `is_wanted` selects and that were not read at first. Raises InputError."""
        if self._more:
            self._files = {**self._files, **self._more(is_wanted)}

    def _resolve(self, name: str) -> str:
        """Return the full name that `name` resolves to. Symbolic links are followed as in a file system."""
        name = (self._base + name).rstrip("/")
        for _ in range(_MAX_LINKS):
            parts = name.split("/")
            heads = ("/".join(parts[:end]) for end in range(1, len(parts) + 1))
            link = next((head for head in heads if head in self._links), None)
            if link is None:
                return name
            target = posixpath.join(posixpath.dirname(link), self._links[link])
            name = posixpath.normpath(posixpath.join(target, name[len(link) + 1 :]))
            name = "" if name == "." else name
        return name


def _is_name(name: str) -> bool:
    return len(name) <= _LONGEST_NAME and name.count("/") <= _MOST_FOLDERS


Tree = Folder | Snapshot


def is_wanted(name: str) -> bool:
    """Whether msggen may need the contents of `name`. A firmware tree has tens of thousands of other files."""
    known = (".msg", ".srv", "dds_topics.yaml", "dds_topics.h.em", "utilities.hpp", "package.xml", ".msggen.json")
    return name.endswith((*known, "msg/CMakeLists.txt")) or "translation_node/" in name
