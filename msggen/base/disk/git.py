"""Calls of the program git, which knows every format of a repository.

The configuration of a repository can name programs for git to run. None of them runs here, because a tree of PX4 may
come from anywhere: git gets no network, no hook, no monitor of files and no filter of the repository.
"""

from __future__ import annotations

import os
import subprocess
from tempfile import TemporaryFile
from threading import Timer
from typing import IO

from msggen.base.interpreter import program_at

_OWN_REPOSITORY = (
    "GIT_ALTERNATE_OBJECT_DIRECTORIES GIT_COMMON_DIR GIT_DIR GIT_GRAFT_FILE GIT_IMPLICIT_WORK_TREE GIT_INDEX_FILE "
    "GIT_NAMESPACE GIT_OBJECT_DIRECTORY GIT_PREFIX GIT_SHALLOW_FILE GIT_WORK_TREE"
)
"""Variables that git sets for a hook (`git rev-parse --local-env-vars`). With them, git would use that repository."""

_WITHOUT_PROGRAMS = {
    "GIT_ALLOW_PROTOCOL": "",  # before 2.45, git would otherwise fetch the missing objects of a partial clone
    "GIT_ASKPASS": "",
    "GIT_EXTERNAL_DIFF": "",
    "GIT_NO_LAZY_FETCH": "1",
    "GIT_PROTOCOL_FROM_USER": "0",
    "GIT_SSH_COMMAND": "false",
    "GIT_TERMINAL_PROMPT": "0",
}
_OPTIONS = ("--no-pager", "-c", "core.fsmonitor=false", "-c", f"core.hooksPath={os.devnull}", "-c", "gc.auto=0")
_NO_FILTER = ("clean=", "smudge=", "process=", "required=false")
"""Settings that turn off a filter. A repository's `.gitattributes` names the files that each filter is applied to."""

SECONDS = 60
"""The time after which git is stopped. It waits for ever for a pipe in place of a file of the repository."""

_LARGEST_OUTPUT = 2**29
_CHUNK = 2**16


class GitError(Exception):
    """An error that git reported, as the first line of its output."""


def git(folder: str, *arguments: str, stdin: bytes = b"") -> bytes:
    """Run git in `folder` and return what it prints. No program of the repository runs. Raises GitError."""
    environment = {name: value for name, value in os.environ.items() if name not in _OWN_REPOSITORY.split()}
    environment |= {"LC_ALL": "C", "GIT_OPTIONAL_LOCKS": "0", **_WITHOUT_PROGRAMS}
    options = ("-C", folder or ".", *_OPTIONS, *arguments)
    with TemporaryFile() as given, TemporaryFile() as errors:
        given.write(stdin)
        given.seek(0)
        try:
            command = [program_at("git"), *options]
            process = subprocess.Popen(command, stdin=given, stdout=subprocess.PIPE, stderr=errors, env=environment)  # noqa: S603
        except FileNotFoundError:
            raise GitError("the program 'git' is not installed") from None
        code, answer = _finish(process)
        if code:
            errors.seek(0)
            lines = errors.read(_CHUNK).decode(errors="replace").strip().splitlines() or [f"git {arguments[0]} failed"]
            raise GitError(lines[0].removeprefix("fatal: "))
    return answer


def status(folder: str, *arguments: str) -> bytes:
    """Return what `git status --porcelain` prints, with all untracked files. Raises GitError.

    Files are compared without filters. Submodules are ignored.
    """
    how = ("--porcelain", "--untracked-files=all", "--ignore-submodules=all")
    return git(folder, *_without_filters(folder), "status", *how, *arguments)


def _without_filters(folder: str) -> list[str]:
    """Return options that turn off all filters that are configured."""
    keys = os.fsdecode(git(folder, "config", "--list", "--name-only", "-z")).split("\0")
    names = dict.fromkeys(key.rpartition(".")[0] for key in keys if key.startswith("filter."))
    if any("=" in name for name in names):
        raise GitError("the repository has a filter with '=' in its name, which cannot be turned off")
    return [part for name in names for setting in _NO_FILTER for part in ("-c", f"{name}.{setting}")]


def _finish(process: subprocess.Popen[bytes]) -> tuple[int, bytes]:
    """Return the exit code of git and all that it prints. Raises GitError if it prints too much, or takes too long."""
    clock = Timer(SECONDS, process.kill)
    clock.daemon = True  # at Ctrl-C before `cancel`, Python would wait for its end
    try:
        clock.start()
        with process.stdout or TemporaryFile() as stream:
            answer = _read(stream)
        code = process.wait()
        if not clock.is_alive():
            raise GitError(f"git does not finish within {SECONDS} s: a file in .git may be a pipe")
        return code, answer
    finally:
        clock.cancel()
        process.kill()  # after an interruption
        process.wait()


def _read(stream: IO[bytes]) -> bytes:
    parts: list[bytes] = []
    size = 0
    while part := stream.read(_CHUNK):
        parts.append(part)
        size += len(part)
        if size > _LARGEST_OUTPUT:
            raise GitError(f"git prints more than {_LARGEST_OUTPUT // 2**20} MiB")
    return b"".join(parts)


def is_in_repository(folder: str) -> bool:
    """Whether the folder is in a repository. This does not call git, which may fail for other reasons."""
    here = os.path.realpath(folder)
    while not os.path.lexists(os.path.join(here, ".git")):
        here, below = os.path.dirname(here), here
        if here == below:
            return False
    return True


def is_revision(folder: str, revision: str) -> bool:
    """Whether the repository of `folder` has a commit of that name."""
    try:
        commit_of(folder, revision)
    except GitError:
        return False
    return True


def commit_of(folder: str, revision: str) -> str:
    """Return the full hash of the commit that `revision` names. Raises GitError."""
    if not revision or revision.startswith("-") or "\0" in revision:
        raise GitError(f"{revision!r} is not a valid name of a revision")
    try:
        named = revision if ":" not in revision else _parsed(folder, revision)  # a path or a text may end in anything
        return _parsed(folder, f"{named}^{{commit}}")
    except GitError:
        git(folder, "rev-parse", "--git-dir")
        raise GitError(f"the repository has no revision '{revision}'") from None


def _parsed(folder: str, revision: str) -> str:
    return git(folder, "rev-parse", "--verify", "--quiet", revision).decode().strip()


def revisions(folder: str) -> list[str]:
    """Return the names of branches and tags, or [] if there is no repository."""
    try:
        return git(folder, "for-each-ref", "--format=%(refname:short)").decode(errors="replace").split()
    except GitError:
        return []


def is_safe(folder: str) -> bool:
    """Whether the user has told git to trust a folder of another user, or one above it: its `safe.directory`."""
    try:
        found = git(os.sep, "config", "--null", "--type=path", "--get-all", "safe.directory")
    except GitError:
        return False
    trusts = False
    for each in os.fsdecode(found).split("\0")[:-1]:
        if not each:  # forgets all before it
            trusts = False
        elif each == "*" or _is_below(folder, each.removesuffix("/*")):
            trusts = True
    return trusts


def _is_below(folder: str, above: str) -> bool:
    return os.path.isabs(above) and os.path.commonpath([os.path.realpath(folder), os.path.realpath(above)]) == (
        os.path.realpath(above)
    )
