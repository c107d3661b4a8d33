"""The files that an editor has open: their texts are read instead of those on disk."""

from __future__ import annotations

import os
from typing import TypeAlias

from msggen.sources.file import File
from msggen.sources.finding import Sources
from msggen.sources.tree import Folder

Buffers: TypeAlias = dict[str, bytes]
"""The texts of open files, by absolute path."""


class BufferedFolder(Folder):
    """A folder on disk, with the texts of open files."""

    def __init__(self, path: str, buffers: Buffers) -> None:
        super().__init__(path)
        self._buffers = buffers

    def read(self, name: str) -> bytes:
        """Return the bytes of `name`. Raises InputError."""
        open_text = self._buffers.get(os.path.abspath(self.place(name)))
        return super().read(name) if open_text is None else open_text


def buffered(sources: Sources, buffers: Buffers) -> Sources:
    """Return `sources` whose folders are buffered."""
    trees: dict[int, BufferedFolder] = {}

    def of(file: File) -> File:
        if file.tree is None:
            folder, name = os.path.split(file.path)
            return file._replace(tree=BufferedFolder(folder, buffers), name=name)
        if isinstance(file.tree, Folder) and not isinstance(file.tree, BufferedFolder):
            return file._replace(tree=trees.setdefault(id(file.tree), BufferedFolder(file.tree.path, buffers)))
        return file

    return sources._replace(
        messages=tuple(map(of, sources.messages)),
        services=tuple(map(of, sources.services)),
        bridge=sources.bridge and of(sources.bridge),
        zenoh=sources.zenoh and of(sources.zenoh),
    )
