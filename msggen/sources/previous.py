"""The sources at a revision of a repository, with those of its folders that the revision has."""

from __future__ import annotations

import os

from msggen.sources.file import File
from msggen.sources.finding import Sources, find_sources, join_package, open_tree, split_package
from msggen.sources.revision import kept_or_revised, split_revision


def at_revision(px4: str, folders: tuple[str, ...], topics: str | None, release: str | None) -> Sources:
    """Return the sources that `find_sources` returns, with `folders` and `topics` at the revision that `px4` names.

    Folders outside of that repository are read as they are. Raises InputError.
    """
    repository, revision = split_revision(px4)
    if not revision:
        return find_sources(px4, folders, topics, release)
    earlier = tuple(_folder(text, repository, revision) for text in folders)
    bridge: File | str | None = topics
    if topics is not None:
        bridge = _bridge(kept_or_revised(os.path.dirname(topics) or os.curdir, repository, revision), topics)
    return find_sources(px4, earlier, bridge, release)


def _folder(text: str, repository: str, revision: str) -> str:
    package, folder = split_package(text)
    return join_package(package, kept_or_revised(folder, repository, revision))


def _bridge(folder: str, topics: str) -> File | str:
    tree, name = open_tree(folder), os.path.basename(topics)
    return File(tree.place(name), name, tree) if tree.is_file(name) else topics
