"""The package that a sync updates or creates, and checks of its location."""

from __future__ import annotations

import os
import re
from typing import NamedTuple

from msggen.base.diagnostics import input_error
from msggen.base.disk.names import path_hint
from msggen.base.disk.output import check_links
from msggen.base.disk.record import read_record
from msggen.base.location import Location
from msggen.definitions.model import DEFAULT_PACKAGE
from msggen.definitions.parse.package_xml import package_name
from msggen.sources.finding import Sources
from msggen.sources.overlap import KINDS, source_around
from msggen.sources.tree import Folder

_NAME = r"[a-z][a-z0-9_]*"
"""The names of ROS packages."""


class Request(NamedTuple):
    """The package that the user names: its `path`, its `name` and where that was given, and whether it may be new."""

    path: str
    name: str = DEFAULT_PACKAGE
    create: bool = False
    name_place: Location = Location("--ros-package", 0)


class Target(NamedTuple):
    """A package: `path` as the user names it, `folder` without symbolic links, and its `name`."""

    path: str
    folder: str
    name: str
    is_new: bool = False

    def place(self, name: str) -> str:
        """Return the path of a file in the package, for messages to the user."""
        return os.path.join(self.path, *name.split("/"))


def default_name(path: str, *, create: bool) -> str:
    """Return the name of the package at `path` that nobody named: that of its folder if it is to be created.

    A package that msggen wrote keeps the name in its package.xml. Any other package is expected to be px4_msgs, so that
    no definition is written into a package by mistake.
    """
    folder = os.path.realpath(path)
    manifest = os.path.join(folder, "package.xml")
    if os.path.lexists(manifest):
        name = ""
        if read_record(folder).files:
            name = package_name(Folder(path).read("package.xml"), os.path.join(path, "package.xml"))
    else:
        name = os.path.basename(folder) if create else ""
    return name if re.fullmatch(_NAME, name) else DEFAULT_PACKAGE


def open_target(request: Request, sources: Sources) -> Target:
    """Return the package that `request` names. Raises InputError if it is not that package, or cannot be created."""
    path, name, create, place = request
    if not re.fullmatch(_NAME, name):
        text = f"'{name}' is not a valid name of a ROS package: expected lower case, digits and underscores"
        raise input_error(place.path, "S112", text, *place[1:])
    folder = os.path.realpath(path)
    _check_sources(path, folder, sources)
    if not os.path.lexists(os.path.join(folder, "package.xml")):
        _check_free(path, folder, create=create)
        _check_outside(path, folder, sources)
        return Target(path, folder, name, is_new=True)
    manifest = os.path.join(path, "package.xml")
    found = package_name(Folder(path).read("package.xml"), manifest)
    if found != name:
        hint = f"give its name with --ros-package {found}"
        hint += f", or create '{name}' in another folder" if create else ""
        raise input_error(manifest, "S112", f"this is the package '{found}', not '{name}': {hint}", 0)
    return Target(path, folder, name)


def _check_sources(path: str, folder: str, sources: Sources) -> None:
    """Raise InputError if the target is a tree of the firmware, or one of the sources."""
    if os.path.isdir(os.path.join(folder, "src", "modules")):
        raise input_error(path, "S111", "this is a PX4-Autopilot tree: expected a ROS package such as px4_msgs", 0)
    own = tuple(os.path.join(folder, kind, "") for kind in KINDS)
    for file in (*sources.messages, *sources.services):
        if isinstance(file.tree, Folder) and os.path.realpath(file.path).startswith(own):
            raise input_error(path, "S111", f"the package is also a source: it has {file.path}", 0)


def _check_outside(path: str, folder: str, sources: Sources) -> None:
    """Raise InputError if a new package would be inside the `msg` or `srv` of a source."""
    home = source_around(folder, sources)
    if home:
        raise input_error(path, "S111", f"this is inside {home}, a folder of a source: choose another folder", 0)


def _check_free(path: str, folder: str, *, create: bool) -> None:
    """Raise InputError unless `create` is set and the folder is new, or empty and not the current one."""
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise input_error(path, "S111", "not a folder: expected a ROS package such as px4_msgs", 0)
    exists = os.path.isdir(folder)
    if not create:
        near = "" if exists else path_hint(path)
        problem = "no package.xml here" if exists else "no such folder"
        text = f"{problem}: expected a ROS package such as px4_msgs, or --create to create one"
        text = f"{problem}{near} --create creates a new package" if near else text
        raise input_error(path, "S111", text, 0)
    check_links(path, [""])
    if exists and os.listdir(folder):
        raise input_error(
            path, "S111", "--create needs a new or an empty folder: this one has files but no package.xml", 0
        )
    if exists and os.path.samefile(folder, os.curdir):
        text = "--create cannot replace the current folder: run it from another folder, with the path of this one"
        raise input_error(path, "S111", text, 0)
