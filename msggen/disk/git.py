"""Calls of the program git, which knows every format of a repository."""

from __future__ import annotations

import os
import subprocess

_OWN_REPOSITORY = {
    "GIT_ALTERNATE_OBJECT_DIRECTORIES",
    "GIT_COMMON_DIR",
    "GIT_DIR",
    "GIT_GRAFT_FILE",
    "GIT_IMPLICIT_WORK_TREE",
    "GIT_INDEX_FILE",
    "GIT_NAMESPACE",
    "GIT_OBJECT_DIRECTORY",
    "GIT_PREFIX",
    "GIT_SHALLOW_FILE",
    "GIT_WORK_TREE",
}
"""Variables that git sets for a hook (`git rev-parse --local-env-vars`). With them, git would use that repository."""


class GitError(Exception):
    """An error that git reported, as the first line of its output."""


def git(folder: str, *arguments: str, stdin: bytes = b"") -> bytes:
    """Run git in `folder` and return what it prints. Raises GitError."""
    environment = {name: value for name, value in os.environ.items() if name not in _OWN_REPOSITORY}
    environment |= {"LC_ALL": "C", "GIT_OPTIONAL_LOCKS": "0"}
    command = ["git", "-C", folder or ".", *arguments]
    try:
        done = subprocess.run(command, input=stdin, capture_output=True, check=False, env=environment)  # noqa: S603
    except FileNotFoundError:
        raise GitError("the program 'git' is not installed") from None
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines() or [f"git {arguments[0]} failed"]
        raise GitError(lines[0].removeprefix("fatal: "))
    return done.stdout


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
        found = git(folder, "rev-parse", "--verify", "--quiet", revision).decode().strip()
        return git(folder, "rev-parse", "--verify", "--quiet", f"{found}^{{commit}}").decode().strip()
    except GitError:
        git(folder, "rev-parse", "--git-dir")
        raise GitError(f"the repository has no revision '{revision}'") from None


def revisions(folder: str) -> list[str]:
    """Return the names of branches and tags, or [] if there is no repository."""
    try:
        return git(folder, "for-each-ref", "--format=%(refname:short)").decode(errors="replace").split()
    except GitError:
        return []
