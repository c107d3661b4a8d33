"""A digest of everything that an output depends on: msggen, its templates, the options, the sources."""

import os
from collections.abc import Iterable, Mapping
from hashlib import sha256
from typing import Any

from msggen.base.disk.resources import PACKAGE, resource
from msggen.base.rooms import ROOMS, below
from msggen.base.version import __version__
from msggen.sources.finding import Sources

_SUFFIXES = (".py", ".j2", ".css", ".js")
_LEFT_OUT = ("__pycache__", "examples")


def digest_inputs(
    sources: Sources, contents: Mapping[str, bytes], options: Iterable[str], room: str, templates: str
) -> str:
    """Return the digest for an output from `sources`, whose files have the `contents`, by path.

    `options` are texts that select the output. The `room` of msggen makes it, with all rooms that it imports, from a
    folder of `templates`.
    """
    state = sha256()
    kind = f"{sources.own} {sources.is_tree} {sources.strict}"
    notices = (each.message for each in sources.notices)
    for part in (__version__, *options, sources.release or "", kind, *notices):
        state.update(part.encode() + b"\0")
    state.update(_digest_tool(room, templates) + digest_files(sources, contents))
    return state.hexdigest()


def digest_files(sources: Sources, contents: Mapping[str, bytes]) -> bytes:
    """Return a digest of the files of `sources`: their packages, names and `contents`, by path."""
    state = sha256()
    for file in sources.files():
        data = contents[file.path]
        state.update(b"\0%s\0%s\0%d\0" % (file.package.encode(), os.fsencode(file.name), len(data)) + data)
    return state.digest()


def _digest_tool(room: str, templates: str) -> bytes:
    state = sha256()
    for each in sorted(below(room)):
        place = os.path.join(PACKAGE, *each.split("."))
        _digest_folder(state, place) if os.path.isdir(place) else _digest_file(state, f"{place}.py")
    _digest_folder(state, os.path.join(resource("templates"), templates))
    return state.digest()


def _digest_folder(state: Any, folder: str) -> None:
    """Add the files of a folder, and of those in it that are not rooms of their own."""
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name)
        if name.endswith(_SUFFIXES):
            _digest_file(state, path)
        elif "." not in name and name not in _LEFT_OUT and not _is_room(path) and os.path.isdir(path):
            _digest_folder(state, path)


def _digest_file(state: Any, path: str) -> None:
    with open(path, "rb") as stream:
        state.update(os.path.basename(path).encode() + b"\0" + stream.read())


def _is_room(path: str) -> bool:
    """Whether a folder of msggen is a room of its own."""
    return os.path.relpath(path, PACKAGE).replace(os.sep, ".") in ROOMS
