"""The layout of a tree: the places of its definitions, its bridge and its other inputs."""

import os
from collections.abc import Iterator

from msggen.base.diagnostics import Diagnostic, counted
from msggen.base.location import Location
from msggen.sources.file import File
from msggen.sources.tree import Folder, Tree

ARCHIVE = "px4_msgs_old/msg"
"""The folder of a tree's archived versions, below `msg/`."""

TRANSLATIONS = "translation_node/translations"
"""The folder of the headers that translate between versions, below `msg/`."""

LISTS = "msg/CMakeLists.txt"
"""The file in which a tree lists the messages that it builds."""

_PARTS = (("msg",), ("srv",), ("msg", "versioned"))
"""The folders that PX4 has definitions in."""

_FOLDERS = ("msg/versioned", "msg/px4_msgs_old", "msg/translation_node")
"""The folders that PX4 has in `msg/`."""

_OLD_SCRIPTS = ("msg/tools", "msg/templates/uorb")
"""The folders of the generators of a tree before v1.14, and before v1.8."""

_CLIENT = "src/modules/uxrce_dds_client"
_BRIDGE_PLACES = (f"{_CLIENT}/dds_topics.yaml", "dds_topics.yaml")
_ZENOH_PLACES = ("src/modules/zenoh/dds_topics.yaml", "zenoh_topics.yaml")
"""The places in a tree, and in an embedded release."""

CLIENT_SOURCES = (f"{_CLIENT}/dds_topics.h.em", f"{_CLIENT}/utilities.hpp")
"""The sources of the bridge's client that show its conventions."""


def find_definitions(tree: Tree, folder: str, suffix: str, package: str, *, is_flat: bool) -> list[File]:
    """Return the definitions of `package` in `tree`: those in `folder` (`msg` or `srv`), or else those in its root.

    The folder `versioned/` is included unless the tree `is_flat`, as a ROS package is. The archived versions in
    `px4_msgs_old/` are not included.
    """
    prefix = f"{folder}/" if tree.is_folder(folder) else ""
    folders = (prefix,) if is_flat else (prefix, f"{prefix}versioned/")
    return [file._replace(package=package) for each in folders for file in find_files(tree, each, suffix)]


def find_files(tree: Tree, folder: str, suffix: str) -> list[File]:
    """Return the files with this suffix in `folder`, "" or a name that ends in `/`. Hidden files are left out."""
    place = tree.place(folder)
    return [
        File(place + name, folder + name, tree)
        for name in tree.names(folder)
        if name.endswith(suffix) and not name.startswith(".")
    ]


def unread_folders(tree: Tree) -> Iterator[Diagnostic]:
    """Yield a warning for each folder below `msg/` that has definitions and that PX4 does not have."""
    if not tree.is_folder("msg"):
        return
    for folder in ("msg/", "msg/versioned/"):
        for name in tree.names(folder):
            if "." in name or folder + name in _FOLDERS:
                continue
            inside = [*tree.names(f"{folder}{name}/"), *tree.names(f"{folder}{name}/msg/")]
            found = [file for file in inside if file.endswith(".msg")]
            if found:
                text = f"{counted(len(found), 'definition')} not read, such as '{found[0]}'"
                text += ": PX4 has definitions in msg/ and msg/versioned/, name other folders with --msg-dir"
                yield Diagnostic(Location(tree.place(folder + name), 0), "S121", text)


def find_bridge(tree: Tree) -> File | None:
    """Return the dds_topics.yaml of a tree, None if it is missing."""
    return next(filter(None, (find_file(tree, place) for place in _BRIDGE_PLACES)), None)


def find_zenoh(tree: Tree) -> File | None:
    """Return PX4's list for Zenoh, of the form of dds_topics.yaml. None if it is missing, as before v1.17."""
    return next(filter(None, (find_file(tree, place) for place in _ZENOH_PLACES)), None)


def find_manifest(tree: Tree) -> File | None:
    """Return the package.xml of a ROS package, None if it is missing.

    That of a PX4-Autopilot tree is ignored, because the tree is not a ROS package.
    """
    return None if is_firmware(tree) else find_file(tree, "package.xml")


def find_file(tree: Tree, name: str) -> File | None:
    """Return the file of this name, None if it is missing."""
    return File(tree.place(name), name, tree) if tree.is_file(name) else None


def is_firmware(tree: Tree) -> bool:
    """Whether this is a PX4-Autopilot tree."""
    return tree.is_folder("src/modules")


def is_too_old(tree: Tree) -> bool:
    """Whether this is a PX4-Autopilot tree before v1.14, which has another bridge and other names of messages."""
    return is_firmware(tree) and not tree.is_folder(_CLIENT) and any(map(tree.is_folder, _OLD_SCRIPTS))


def tree_above(path: str) -> str | None:
    """Return the nearest folder above `path` that is a PX4-Autopilot tree, None if there is none."""
    folder = path
    for _ in os.path.abspath(path).split(os.sep)[1:]:
        folder = os.path.normpath(os.path.join(folder, os.pardir))
        if is_firmware(Folder(folder)):
            return folder
    return None


def whole_tree(path: str) -> str | None:
    """Return the PX4-Autopilot tree that `path` is only a part of: its definitions. None for any other folder."""
    parts = os.path.abspath(path).split(os.sep)
    for part in _PARTS:
        if parts[-len(part) :] == [*part]:
            tree = os.path.normpath(os.path.join(path, *[os.pardir] * len(part)))
            return tree if is_firmware(Folder(tree)) else None
    return None
