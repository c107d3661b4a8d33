"""Revisions in git: `folder@revision`, read without changing a work tree."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from typing import NoReturn

from msggen.base.diagnostics import input_error, suggestion
from msggen.base.disk.git import GitError, commit_of, git, is_revision, revisions
from msggen.definitions.model import DEFAULT_PACKAGE
from msggen.sources.embedded import EMBEDDED, PREFIX, names_release, near_release
from msggen.sources.installed import INSTALLED, names_installed
from msggen.sources.installed import PREFIX as OF_INSTALLED
from msggen.sources.tree import Amount, Snapshot, TooMuchError, Wanted, is_wanted

_RANGE = re.compile(r"(.*[^./])?\.{2,3}([^./].*)?")
"""A range of revisions: `main..HEAD`, `main...`. In a path, `..` is next to a slash."""


def split_revision(text: str) -> tuple[str, str]:
    """Return the folder and the revision of `folder@revision`, or `text` and "" if it does not name a revision.

    If several `@` follow an existing folder, the longest folder is used.
    """
    ends = [index for index, character in enumerate(text) if character == "@" and os.path.isdir(text[:index])]
    if os.path.exists(text) or not ends:
        return text, ""
    return text[: ends[-1]], text[ends[-1] + 1 :]


def revised(tree: str, against: str) -> str:
    """Return the source that `against` names: `tree` at a revision of its repository, or another source.

    Raises InputError if `against` could be both or is neither.
    """
    if against.startswith((PREFIX, OF_INSTALLED)):
        return against
    folder = split_revision(tree)[0]
    known = os.path.isdir(folder) and is_revision(folder, against)
    if known and names_installed(against):
        text = f"'{against}' is a revision, and the name of the installed {DEFAULT_PACKAGE}"
        ways = f"write '{OF_INSTALLED}{DEFAULT_PACKAGE}' for the package, or '{folder}@{against}' for the revision"
        _fail("--against", "S108", f"{text}: {ways}")
    if known and os.path.isdir(against):
        text = f"'{against}' is a revision and a folder: write '{os.path.join('.', against)}' for the folder"
        _fail("--against", "S108", f"{text}, or '{folder}@{against}' for the revision")
    if known:
        return f"{folder}@{against}"
    if not (against in (*EMBEDDED, INSTALLED) or os.path.exists(against) or split_revision(against)[1]):
        _fail_to_find(folder, against)
    return against


def _fail_to_find(folder: str, against: str) -> NoReturn:
    ends = _RANGE.fullmatch(against)
    if ends:
        older, newer = (end or "HEAD" for end in ends.groups())
        text = f"'{against}' is a range, expected one revision: use $(git merge-base {older} {newer})"
        _fail("--against", "S108", text)
    if names_release(against):
        near = suggestion(against, EMBEDDED)
        _fail(
            "--against",
            "S108",
            f"'{against}' is neither a folder, a revision of {folder} nor an embedded release{near}",
        )
    near = near_release(against)
    obstacle = _obstacle(folder) if os.path.isdir(folder) else ""
    reason = f"{obstacle}{near}" if obstacle or not os.path.isdir(folder) else _hint(folder, against, near)
    _fail("--against", "S108", f"'{against}' is neither a folder nor a revision of {folder}{reason}")


def kept_or_revised(path: str, repository: str, revision: str) -> str:
    """Return `folder@revision` for the folder of `path`, or `path` if `revision` of `repository` does not have it."""
    folder = split_revision(path)[0]
    try:
        tops = [git(each, "rev-parse", "--show-toplevel") for each in (folder, repository)]
        was_there = git(folder, "ls-tree", "--name-only", revision)
    except GitError:
        return path
    return f"{folder}@{revision}" if tops[0] == tops[1] and was_there else path


def read_revision(folder: str, revision: str) -> Snapshot:
    """Return the files of a commit without checking them out. Raises InputError."""
    label = f"{folder}@{revision}"
    try:
        commit = commit_of(folder, revision)
    except GitError as error:
        _fail(label, "S108", f"{error}{_hint(folder, revision)}")
    try:
        base = os.fsdecode(git(folder, "rev-parse", "--show-prefix").rstrip(b"\n"))
        rows = os.fsdecode(git(folder, "ls-tree", "--full-tree", "-r", "-z", commit)).split("\0")
        entries = {name: about.split(" ") for about, _, name in (row.partition("\t") for row in rows if row)}
        links = [name for name, about in entries.items() if about[0] == "120000"]
        blobs = {name: about[2] for name, about in entries.items() if about[1] == "blob"}
        known = set(links)
    except GitError as error:
        _fail(label, "S108", str(error))
    contents = _read_blobs(folder, label, blobs, lambda name: is_wanted(name) or name in known)
    files = {name: contents.get(name, b"") for name in entries if name not in links}
    targets = {name: os.fsdecode(contents[name]) for name in links}
    return Snapshot(
        label, files, links=targets, base=base, more=lambda wanted: _read_blobs(folder, label, blobs, wanted)
    )


def _obstacle(folder: str) -> str:
    """Return the reason why git cannot read any revision, "" if it can."""
    try:
        git(folder, "rev-parse", "--git-dir")
    except GitError as error:
        return f": {error}"
    return ""


def _hint(folder: str, revision: str, near: str = "") -> str:
    """Return a hint about a missing `revision`: a shallow repository, or else `near` or the nearest existing name."""
    with suppress(GitError):
        if git(folder, "rev-parse", "--is-shallow-repository").strip() == b"true":
            return f": the repository is shallow, fetch the rest with `git fetch --unshallow`{near}"
    names = revisions(folder)
    exact = {f"v{revision}"}.intersection(names)
    return suggestion(revision, exact) or near or suggestion(revision, names)


def _read_blobs(folder: str, label: str, blobs: Mapping[str, str], wanted: Wanted) -> dict[str, bytes]:
    """Return the contents of the blobs whose names are `wanted`, read by one git process. Raises InputError."""
    names = [name for name in blobs if wanted(name)]
    objects = "".join(f"{blobs[name]}\n" for name in names).encode()
    try:
        amount = Amount()
        for name, row in zip(names, git(folder, "cat-file", "--batch-check", stdin=objects).splitlines(), strict=True):
            amount.add(name, _size(row))
        answer = git(folder, "cat-file", "--batch", stdin=objects)
        return dict(zip(names, _split_batch(answer), strict=True))
    except (GitError, TooMuchError) as error:
        _fail(label, "S108", str(error))


def _split_batch(answer: bytes) -> list[bytes]:
    """Return the contents in the output of `git cat-file --batch`: lines that end in a size, each with the bytes."""
    contents = []
    position = 0
    while position < len(answer):
        start = answer.index(b"\n", position) + 1
        size = _size(answer[position:start])
        contents.append(answer[start : start + size])
        position = start + size + 1
    return contents


def _size(row: bytes) -> int:
    """Return the size of the object that a line of git is about. Raises GitError if the object is missing."""
    about = row.decode(errors="replace").split()
    if about[-1] == "missing":
        cause = "the repository is damaged, or a partial clone, which `git fetch --refetch --no-filter` completes"
        raise GitError(f"object {about[0]} is missing: {cause}")
    return int(about[-1])


def _fail(path: str, code: str, message: str) -> NoReturn:
    raise input_error(path, code, message, 0)
