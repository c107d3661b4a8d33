"""The function `read`, for programs that use msggen as a library."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TypeAlias

from msggen.base.location import Location
from msggen.definitions.model import Catalog
from msggen.sources.catalog import read_catalog
from msggen.sources.file import BoardOption
from msggen.sources.finding import find_sources, with_archived, with_board
from msggen.sources.inferred import with_inferred

Path: TypeAlias = str | os.PathLike[str]


def read(  # noqa: PLR0913 - keywords, each of which has a default
    source: Path | None = None,
    *,
    folders: Path | Iterable[Path] = (),
    topics: Path | None = None,
    release: str | None = None,
    board: Path | None = None,
    archived: bool = False,
    strict: bool = False,
) -> Catalog:
    """Read and check all definitions of a source, and return them as a catalog.

    `source` is a PX4-Autopilot tree, a px4_msgs package, a folder of `.msg` files, `folder@revision` of git, an
    archive of one of them, an embedded release such as "v1.16", or "installed" for the installed px4_msgs
    ("installed:NAME" for another package). Without `source` and `folders` it is the newest embedded release.

    `folders` contain further definitions. Those of another ROS package are "PKG=DIR", or a folder with a package.xml.
    `topics` is the dds_topics.yaml to use instead of the tree's own. `release` names the conventions to use instead of
    those that the tree shows. `board` keeps only the messages that this board of the firmware builds. With `archived`,
    the catalog also has the archived versions of the tree. With `strict`, warnings are errors.

    Raises InputError with all errors in the sources. Warnings and notes are in the catalog's `notices`. Settings in
    pyproject.toml are ignored.
    """
    further = (folders,) if isinstance(folders, (str, os.PathLike)) else folders
    sources = find_sources(
        None if source is None else os.fspath(source),
        tuple(os.fspath(folder) for folder in further),
        None if topics is None else os.fspath(topics),
        release,
        _argument("release"),
    )
    if board is not None:
        sources = with_board(sources, BoardOption(os.fspath(board), _argument("board")))
    if archived:
        sources = with_archived(sources, _argument("archived"))
    return with_inferred(read_catalog(sources._replace(strict=strict)), sources)


def _argument(name: str) -> Location:
    """Return the location of errors about an argument of `read`."""
    return Location(name, 0)
