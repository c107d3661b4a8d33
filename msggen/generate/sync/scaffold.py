"""The files of a package besides definitions: package.xml, CMakeLists.txt, and a README that names the firmware.

msggen updates each of them until the user edits it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from shlex import quote
from typing import NamedTuple

from msggen.base.disk.record import Record, digest, digest_of
from msggen.base.disk.resources import template_text
from msggen.base.version import __version__
from msggen.generate.sync.contents import PackageContents
from msggen.generate.sync.target import Target
from msggen.sources.finding import Sources
from msggen.sources.overlap import KINDS
from msggen.sources.revision import split_revision
from msggen.sources.tree import Folder

NAMES = ("CMakeLists.txt", "README.md", "package.xml")


class Scaffold(NamedTuple):
    """The files to write, the digests to record, and one digest of all inputs."""

    inputs: str
    digests: Mapping[str, str]
    changes: Mapping[str, bytes]


class Origin(NamedTuple):
    """The origin of the definitions, without a path of this machine.

    `commit` is empty if the definitions are not in a repository. `described` is the output of `git describe`, or empty
    if there is no tag. `further` are the names of the other sources.
    """

    name: str
    commit: str = ""
    described: str = ""
    is_modified: bool = False
    further: tuple[str, ...] = ()


def plan_scaffold(target: Target, sources: Sources, known: Record, definitions: PackageContents) -> Scaffold:
    """Return the files to write: all in a new package, else those that msggen wrote and the user did not edit."""
    recorded = {name: value for name, value in known.files.items() if name in NAMES}
    found = {name: digest_of(target.folder, name) or "" for name in recorded}
    own = {name: value for name, value in found.items() if value in recorded[name].split()}
    if not own and not target.is_new:
        return Scaffold(known.scaffold, recorded, {})
    origin = origin_of(sources)
    dependencies = tuple(definitions.dependencies)
    options = _options(origin, sources.embedded, dependencies)
    state = (target.name, origin, options)
    if known.scaffold == _digest_inputs(state, recorded):
        return Scaffold(known.scaffold, recorded, {})
    names = NAMES if target.is_new else tuple(own)
    rendered = _render(names, package=target.name, origin=origin, options=options, dependencies=dependencies)
    digests = {name: digest(data) for name, data in rendered.items()}
    changes = {name: data for name, data in rendered.items() if digests[name] != own.get(name)}
    after = {**recorded, **digests}
    return Scaffold(_digest_inputs(state, after), after, changes)


def origin_of(sources: Sources) -> Origin:
    """Return the origin of the first source, with the names of the others that have uORB messages or services."""
    root = sources.root
    trees = dict.fromkeys(file.tree for file in (*sources.messages, *sources.services) if not file.package)
    further = tuple(_base(tree.path) for tree in trees if tree is not None and tree is not root)
    if root is None or sources.embedded:
        return Origin(f"PX4 {sources.embedded}, embedded in msggen", further=further)
    if isinstance(root, Folder):
        return _origin_in_git(root.path, None)._replace(name=_base(root.path), further=further)
    folder, revision = split_revision(root.path)
    return _origin_in_git(folder, revision)._replace(name=_base(root.path), further=further)


def _origin_in_git(folder: str, revision: str | None) -> Origin:
    """Return the commit that `revision` names, by default the last one; an empty origin if git has no such files."""
    from msggen.base.disk.git import GitError, commit_of, git, status

    paths = [kind for kind in KINDS if os.path.isdir(os.path.join(folder, kind))] or ["."]
    try:
        if not os.path.isdir(folder) or not (revision or git(folder, "ls-files", "--", *paths)):
            return Origin("")
        commit = commit_of(folder, revision or "HEAD")
        is_modified = not revision and status(folder, "--", *paths)
    except GitError:
        return Origin("")
    try:
        described = git(folder, "describe", "--tags", commit).decode().strip()
    except GitError:
        described = ""
    return Origin("", commit, described, bool(is_modified))


def _base(path: str) -> str:
    """Return the last part of a path, with characters that Markdown would interpret replaced."""
    folder, revision = split_revision(path)
    name = os.path.basename(os.path.abspath(folder or path)) + (f"@{revision}" if revision else "")
    return "".join(character if character.isprintable() and character not in "`|" else "_" for character in name)


def _options(origin: Origin, embedded: str, dependencies: tuple[str, ...]) -> str:
    """Return the options that name the sources of the next sync. The folders of paths are those of the reader.

    The record of the package has its name and the option --topics-only.
    """
    further = [*(f"path/to/{name}" for name in origin.further), *(f"{name}=path/to/{name}" for name in dependencies)]
    first = embedded or f"path/to/{origin.name}"
    return " ".join([f"--px4 {quote(first)}", *(f"--msg-dir {quote(each)}" for each in further)])


def _digest_inputs(state: tuple[object, ...], digests: Mapping[str, str]) -> str:
    """Return one digest of the inputs and of the rendered files, so that a merge that mixes two sides is noticed."""
    templates = (template_text(_template(name)) for name in NAMES)
    parts = [__version__, repr(state), repr(sorted(digests.items())), *templates]
    return digest("\0".join(parts).encode())


def _render(names: tuple[str, ...], **values: object) -> dict[str, bytes]:
    from msggen.generate.text.environment import make_environment

    environment = make_environment()
    templates = {name: environment.get_template(_template(name)) for name in names}
    return {name: template.render(values).encode() for name, template in templates.items()}


def _template(name: str) -> str:
    return f"ros2/{name}.j2"
