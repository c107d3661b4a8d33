"""Checks of a plan, before anything is written."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from shlex import quote

from msggen.base.diagnostics import Diagnostic, few, input_error
from msggen.base.disk.record import RECORD_NAME, digest
from msggen.base.disk.staging import is_writable
from msggen.base.location import Location
from msggen.generate.sync.change import read_halves
from msggen.generate.sync.plan import SyncPlan, entries, read_if_file
from msggen.generate.sync.target import Target
from msggen.sources.overlap import KINDS

_FEW = 3
_IGNORED = "!!"
"""The code of `git status` for a file that git ignores."""

_UNTRACKED = ("??", "A ", "AM")
"""The codes for a file that the last commit does not have."""


def find_errors(plan: SyncPlan, dependencies: Mapping[str, Location], *, write: bool) -> list[Diagnostic]:
    """Return the errors of `plan`. `dependencies` are the packages whose messages its definitions nest.

    Without `write`, changes that are not committed are no error, because nothing can be lost. Raises InputError if the
    git status cannot be read.
    """
    if plan.target.is_new:
        return [*_no_place(plan)]
    errors = [*_bad_links(plan), *_no_folders(plan), *_no_files(plan), *_other_cases(plan), *_other_source(plan)]
    if not plan.is_stale:
        return errors
    losses = [found for found in _losses(plan) if write or found.code != "S113"]
    return [*errors, *_read_only(plan), *losses, *_orphans(plan), *_missing_dependencies(plan, dependencies)]


def _no_place(plan: SyncPlan) -> Iterator[Diagnostic]:
    """Yield an error if the folder of a new package cannot be created or replaced."""
    target = plan.target
    parent = os.path.dirname(target.folder)
    while not os.path.lexists(parent):
        parent = os.path.dirname(parent)
    for name, path in ((".", target.folder), ("..", parent)):
        if os.path.exists(path) and not is_writable(path):
            yield _error(plan, name, "S114", "the folder is read-only: make it writable to create the package")


def _bad_links(plan: SyncPlan) -> Iterator[Diagnostic]:
    """Yield an error for each symbolic link out of the package, because sync changes nothing outside of it."""
    target = plan.target
    inside = os.path.join(target.folder, "")
    names = [kind for kind in KINDS if os.path.islink(os.path.join(target.folder, kind))]
    outside = [name for name in names if not os.path.realpath(os.path.join(target.folder, name)).startswith(inside)]
    for name in (*plan.changed, *plan.removed, *plan.unchanged):
        path = os.path.join(target.folder, name)
        is_reported = name.split("/")[0] in outside
        if os.path.islink(path) and not is_reported and not os.path.realpath(path).startswith(inside):
            outside.append(name)
    for name in outside:
        aim = os.readlink(os.path.join(target.folder, name))
        kind = "folder" if name in KINDS else "file"
        yield _error(plan, name, "S115", f"symbolic link out of the package, to {aim}: replace it with a {kind}")


def _no_folders(plan: SyncPlan) -> Iterator[Diagnostic]:
    for kind in KINDS:
        path = os.path.join(plan.target.folder, kind)
        if os.path.lexists(path) and not os.path.isdir(path):
            yield _error(plan, kind, "S104", "expected a folder for definitions, found something else: move it")


def _no_files(plan: SyncPlan) -> Iterator[Diagnostic]:
    for name in (*plan.changed, *plan.removed):
        if os.path.isdir(os.path.join(plan.target.folder, name)):
            yield _error(plan, name, "S104", "expected a definition, found a folder: move it")


def _other_cases(plan: SyncPlan) -> Iterator[Diagnostic]:
    """Yield an error for each name that differs from a new one only in case, because ROS cannot tell them apart."""
    wanted = {name.lower(): name for name in plan.files}
    for kind in KINDS:
        for base in entries(plan.target.folder, kind):
            name = f"{kind}/{base}"
            other = wanted.get(name.lower(), name)
            if other != name:
                yield _error(
                    plan, name, "S116", f"differs only in case from '{other}' of the firmware: rename or remove it"
                )


def _other_source(plan: SyncPlan) -> Iterator[Diagnostic]:
    """Yield an error if every definition that msggen wrote would be removed: the package is from another source."""
    own = [name for name in plan.before if name in plan.known.files]
    if own and set(own) <= set(plan.removed):
        text = f"not its source: the firmware has none of the definitions that msggen wrote here ({few(own)})"
        yield _error(plan, ".", "S128", f"{text}: name it with --px4 or --msg-dir, or remove them first")


def _read_only(plan: SyncPlan) -> list[Diagnostic]:
    """Return an error for each read-only file or folder to be changed, even for root; many are reported as one."""
    found = [*_each_read_only(plan)]
    if len(found) <= _FEW:
        return found
    text = (
        f"{len(found)} files and folders are read-only: make them writable with chmod -R u+w {quote(plan.target.path)}"
    )
    return [_error(plan, ".", "S114", text)]


def _each_read_only(plan: SyncPlan) -> Iterator[Diagnostic]:
    names = [".", *plan.folders, *plan.changed, *plan.removed, *plan.scaffold, RECORD_NAME]
    for name in names:
        path = os.path.join(plan.target.folder, name)
        if not os.path.exists(path) or (os.path.islink(path) and not os.path.isdir(path)):
            continue
        if not is_writable(path):
            kind = "folder" if os.path.isdir(path) else "file"
            yield _error(plan, name, "S114", f"the {kind} is read-only: make it writable")


def _losses(plan: SyncPlan) -> Iterator[Diagnostic]:
    """Yield an error for each file whose content would be lost: neither msggen wrote it, nor is it committed."""
    states = _uncommitted(plan.target)
    for name in (*plan.changed, *plan.removed):
        data = plan.before[name]
        if data is None or digest(data) in plan.known.files.get(name, "").split():
            continue
        real = os.path.relpath(os.path.realpath(os.path.join(plan.target.folder, name)), plan.target.folder)
        state = states.get(real) if states is not None else None
        if state == _IGNORED and plan.known.files:
            text = "git ignores this file, and msggen did not write its content, which would be lost: move or delete it"
            yield _error(plan, name, "S113", text)
        elif state not in (None, _IGNORED):
            yield _error(plan, name, "S113", _uncommitted_text(plan.target, name, state))
        elif states is None and plan.known.files and name not in plan.known.files:
            yield _error(
                plan, name, "S104", "the firmware has a definition of this name, msggen did not write this one: move it"
            )


def _uncommitted_text(target: Target, name: str, state: str) -> str:
    """Return the error about a file with the git status `state`, with the commands that resolve it."""
    if state in _UNTRACKED:
        return "is not committed and would be lost: commit or stash it (`git stash -u`), or delete it"
    staged = "" if state.startswith(" ") else " --staged --worktree"
    command = f"git -C {quote(target.path)} restore{staged} {quote(name)}"
    return f"has uncommitted changes: commit or stash them, or discard them with `{command}`"


def _orphans(plan: SyncPlan) -> Iterator[Diagnostic]:
    """Yield an error for each definition of the user that nests a message to be removed."""
    for name in plan.left_alone:
        path = os.path.normpath(plan.target.place(name))
        for half in read_halves(path, plan.before[name] or b"", plan.target.name):
            for field in half.fields:
                package = field.type.package or plan.target.name
                if package == plan.target.name and f"msg/{field.type.name}.msg" in plan.removed:
                    text = f"'{field.type.name}' would be removed, and this definition nests it"
                    yield Diagnostic(field.location, "M301", f"{text}: change or remove the definition first")


def _missing_dependencies(plan: SyncPlan, dependencies: Mapping[str, Location]) -> Iterator[Diagnostic]:
    """Yield an error for each package in `dependencies` that package.xml or CMakeLists.txt does not name."""
    remedies = {"package.xml": "<depend>{0}</depend>", "CMakeLists.txt": "find_package({0} REQUIRED), and DEPENDENCIES"}
    for name, remedy in remedies.items():
        data = plan.scaffold.get(name) or read_if_file(os.path.join(plan.target.folder, name)) or b""
        for package, place in dependencies.items():
            if not re.search(rb"\b%s\b" % package.encode(), data):
                path = os.path.normpath(plan.target.place(name))
                text = f"the package '{package}' is not in {path}: add {remedy.format(package)}"
                yield Diagnostic(place, "M301", text)


def _uncommitted(target: Target) -> dict[str, str] | None:
    """Return the git status, such as _IGNORED, of each file of the package that differs from the last commit.

    Return None if the package is not in a repository.
    """
    from msggen.base.disk.git import GitError, git, is_in_repository, status

    try:
        if not git(target.folder, "ls-files", "--", "."):
            return None
        prefix = git(target.folder, "rev-parse", "--show-prefix").rstrip(b"\n")
        rows = status(target.folder, "-z", "--no-renames", "--ignored", "--", ".")
    except GitError as error:
        if not is_in_repository(target.folder):
            return None
        raise input_error(target.path, "S113", f"cannot read the git status: {error}", 0) from None
    return {os.fsdecode(row[3:].removeprefix(prefix)): row[:2].decode() for row in rows.split(b"\0") if row}


def _error(plan: SyncPlan, name: str, code: str, message: str) -> Diagnostic:
    return Diagnostic(Location(os.path.normpath(plan.target.place(name)), 0), code, message)
