"""A digest of everything that an output depends on: msggen, its templates, the options, the sources."""

import os
from collections.abc import Collection, Iterable, Mapping
from hashlib import sha256

from msggen import __version__
from msggen.disk.resources import resource
from msggen.firmware.sources import Sources

_SUFFIXES = (".py", ".j2", ".css", ".js")


def digest_inputs(
    sources: Sources, contents: Mapping[str, bytes], options: Iterable[str], folders: Collection[str], templates: str
) -> str:
    """Return the digest for an output from `sources`, whose files have the `contents`, by path.

    `options` are texts that select the output. `folders` are those of msggen and of its `templates` that make it.
    """
    state = sha256()
    kind = f"{sources.own} {sources.is_tree} {sources.strict}"
    notices = (each.message for each in sources.notices)
    for part in (__version__, *options, sources.release or "", kind, *notices):
        state.update(part.encode() + b"\0")
    state.update(_digest_tool(folders, templates) + digest_files(sources, contents))
    return state.hexdigest()


def digest_files(sources: Sources, contents: Mapping[str, bytes]) -> bytes:
    """Return a digest of the files of `sources`: their packages, names and `contents`, by path."""
    state = sha256()
    for file in sources.files():
        data = contents[file.path]
        state.update(b"\0%s\0%s\0%d\0" % (file.package.encode(), os.fsencode(file.name), len(data)) + data)
    return state.digest()


def _digest_tool(used: Collection[str], templates: str) -> bytes:
    state = sha256()
    package = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    for root in (package, os.path.join(resource("templates"), templates)):
        for folder, folders, names in os.walk(root):
            folders[:] = sorted(name for name in folders if name in used)
            for name in sorted(names):
                if name.endswith(_SUFFIXES):
                    with open(os.path.join(folder, name), "rb") as stream:
                        state.update(name.encode() + b"\0" + stream.read())
    return state.digest()
