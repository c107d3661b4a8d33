"""Refusals of trees that are no sources of definitions, each with the folder that may be meant."""

import os
from typing import NoReturn

from msggen.base.diagnostics import input_error
from msggen.sources.embedded import EMBEDDED, PREFIX
from msggen.sources.tree import Folder, Snapshot, Tree
from msggen.sources.tree_layout import is_too_old, whole_tree


def refuse_part_of_tree(root: Tree) -> None:
    """Raise InputError for a folder of definitions in a firmware tree, which lacks the bridge and other inputs."""
    folder, revision = root.path, ""
    if isinstance(root, Snapshot):
        from msggen.sources.revision import split_revision

        folder, revision = split_revision(root.path)
    whole = whole_tree(folder)
    if whole:
        hint = f"{whole}@{revision}" if revision else whole
        raise input_error(root.path, "S102", f"only a part of a firmware tree, did you mean '{hint}'?", 0)


def refuse_old_tree(root: Tree) -> None:
    """Raise InputError for a firmware tree that is older than the first release that msggen reads."""
    if is_too_old(root):
        text = f"a PX4-Autopilot tree before {EMBEDDED[-1]}, the first release that msggen reads"
        raise input_error(root.path, "S105", text, 0)


def fail_without_definitions(root: Tree) -> NoReturn:
    """Raise InputError for a source without definitions, with what it may be instead."""
    parent = os.path.dirname(os.path.abspath(root.path))
    near = isinstance(root, Folder) and os.path.isdir(os.path.join(parent, "msg"))
    hint = f", did you mean '{parent}'?" if near else ""
    hint = f"; the embedded release is '{PREFIX}{root.path}'" if root.path in EMBEDDED else hint
    if isinstance(root, Folder) and not root.names(""):
        raise input_error(root.path, "S102", f"empty folder: a submodule that is not checked out?{hint}", 0)
    if isinstance(root, Folder) and root.is_file("topics.py"):
        text = "a package that msggen has generated, not definitions: `msggen build --check` tells if it is up to date"
        raise input_error(root.path, "S102", text, 0)
    if any(name.endswith(".idl") for name in (*root.names(""), *root.names("msg/"))):
        text = "only .idl files, which msggen does not read: name the folder of the .msg files that they are made from"
        raise input_error(root.path, "S102", text, 0)
    text = f"no .msg file here or in msg/: expected a PX4-Autopilot tree, px4_msgs or a folder{hint}"
    raise input_error(root.path, "S102", text, 0)
