"""Where a package is, or is to be, and whether it can be there."""

from __future__ import annotations

import os
import re
from typing import NamedTuple

from msggen.diagnostics import input_error
from msggen.firmware.sources import Sources
from msggen.firmware.tree import Folder
from msggen.location import Location
from msggen.model import DEFAULT_PACKAGE
from msggen.parse.package_xml import package_name

KINDS = ("msg", "srv")
"""The folders of a package, and the suffixes of the definitions in them."""


class Request(NamedTuple):
    """The package that a user asks for: `name`, asked for at `name_place`, at `path`; with `create` it may be new."""

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
        """Return what names a file of the package to the user."""
        return os.path.join(self.path, *name.split("/"))


def open_target(request: Request, sources: Sources) -> Target:
    """Return the package that is asked for. Raises InputError where something else lies at its place."""
    path, name, create, place = request
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        text = f"'{name}' is no name of a ROS package: expected lower case, digits and underscores"
        raise input_error(place.path, "S112", text, *place[1:])
    folder = os.path.realpath(path)
    _check_sources(path, folder, sources)
    if not os.path.lexists(os.path.join(folder, "package.xml")):
        _check_free(path, folder, create=create)
        _check_outside(path, folder, sources)
        return Target(path, folder, name, is_new=True)
    manifest = os.path.join(path, "package.xml")
    with open(manifest, "rb") as stream:
        found = package_name(stream.read(), manifest)
    if found != name:
        hint = f": give its name with --ros-package {found}" if name == DEFAULT_PACKAGE else ""
        raise input_error(manifest, "S112", f"this is the package '{found}', not '{name}'{hint}", 0)
    return Target(path, folder, name)


def _check_sources(path: str, folder: str, sources: Sources) -> None:
    """The firmware is no target, nor is any folder that definitions are read from."""
    if os.path.isdir(os.path.join(folder, "src", "modules")):
        raise input_error(path, "S111", "this is a tree of the firmware: name the package that is to follow it", 0)
    own = tuple(os.path.join(folder, kind, "") for kind in KINDS)
    for file in (*sources.messages, *sources.services):
        if isinstance(file.tree, Folder) and os.path.realpath(file.path).startswith(own):
            raise input_error(path, "S111", f"the package is among its own sources: {file.path}", 0)


def _check_outside(path: str, folder: str, sources: Sources) -> None:
    """A new package has no place among definitions, in the `msg` or `srv` of a source."""
    for file in (*sources.messages, *sources.services):
        if not isinstance(file.tree, Folder):
            continue
        home = os.path.dirname(file.path)
        home = os.path.dirname(home) if os.path.basename(home) == "versioned" else home
        real = os.path.realpath(home)
        if os.path.basename(real) in KINDS and folder.startswith(os.path.join(real, "")):
            raise input_error(
                path, "S111", f"this is among the definitions of a source, in {home}: choose another place", 0
            )


def _check_free(path: str, folder: str, *, create: bool) -> None:
    """Where there is no package, one can be made only in a new or empty folder, and only if that is asked for."""
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise input_error(path, "S111", "not a folder: expected a ROS package such as px4_msgs", 0)
    exists = os.path.isdir(folder)
    if not create:
        what = "no package.xml here" if exists else "no such folder"
        raise input_error(path, "S111", f"{what}: expected a ROS package such as px4_msgs, or --create to make one", 0)
    if exists and os.listdir(folder):
        raise input_error(path, "S111", "the folder is neither empty nor a ROS package: --create leaves it alone", 0)
    if exists and os.path.samefile(folder, os.curdir):
        text = "--create replaces an empty folder, and this is the current one: call it from outside, by its name"
        raise input_error(path, "S111", text, 0)
