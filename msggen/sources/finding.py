"""The files of a catalog, their contents and the packages that they belong to. They are not parsed here."""

import os
import re
from collections.abc import Iterator, Mapping
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.diagnostics import Diagnostic, input_error, suggestion
from msggen.base.location import Location
from msggen.base.recording_formats import format_named
from msggen.definitions.parse.package_xml import package_name, read_manifest
from msggen.sources.embedded import EMBEDDED, PREFIX, names_release, near_release, open_release
from msggen.sources.file import BoardOption, File, read_file
from msggen.sources.installed import find_installed, names_installed
from msggen.sources.refusals import fail_without_definitions, refuse_old_tree, refuse_part_of_tree
from msggen.sources.tree import Folder, Snapshot, Tree
from msggen.sources.tree_layout import (
    ARCHIVE,
    CLIENT_SOURCES,
    LISTS,
    TRANSLATIONS,
    find_bridge,
    find_definitions,
    find_file,
    find_files,
    find_manifest,
    find_zenoh,
    is_firmware,
    unread_folders,
)

if TYPE_CHECKING:
    from msggen.sources.board import Board
else:
    Board = object  # NamedTuple compiles an annotation in quotes, which takes longer than the rest of the class

RELEASES = (*reversed(EMBEDDED), "main")
"""The releases whose conventions are known (`conventions` has them)."""

_RELEASE_OPTION = Location("--release", 0)
_ARCHIVED_OPTION = Location("--archived", 0)
_FOLDER_OPTION = Location("--msg-dir", 0)
_PACKAGE_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")


class Sources(NamedTuple):
    """The files of one catalog.

    - `package` is the ROS package of uORB's messages if the package.xml of the first source names it, "" for px4_msgs.
      `manifests` are the package.xml files of all sources.
    - `own` is the number of messages of the first source, which come first in `messages`. The release is recognised by
      these messages and by `is_tree`: whether the first source is a PX4-Autopilot tree.
    - `label` is a short description of the sources. `root` is the tree of the first source.
    - `archived` and `translations` are the archived versions and their headers, if they were requested.
    - `embedded` is the name of the embedded release, if the first source is one. `is_installed` is set if it is an
      installed package.
    - `client` has the files of CLIENT_SOURCES that exist in the tree.
    - With `strict`, warnings are errors. `notices` are findings about the sources themselves.
    - `lists` is the file in which the tree lists the messages that it builds. `unbuilt` has the messages that the
      `board` does not build, with the condition under which each is listed, "" for those that are not listed. They are
      not in `messages`.
    - `zenoh` is PX4's list for Zenoh, if the `bridge` is the tree's own.
    - `is_partial` is set for the definitions of a recording, which are only some of its firmware's, and those of a
      generated package for a recording. Those that are missing are not compared, nor are comments.
    """

    messages: tuple[File, ...]
    services: tuple[File, ...]
    bridge: File | None = None
    manifests: tuple[File, ...] = ()
    package: str = ""
    release: str | None = None
    own: int = 0
    is_tree: bool = False
    label: str = ""
    root: Tree | None = None
    archived: tuple[File, ...] = ()
    translations: tuple[File, ...] = ()
    embedded: str = ""
    client: tuple[File, ...] = ()
    strict: bool = False
    notices: tuple[Diagnostic, ...] = ()
    lists: File | None = None
    board: Board | None = None
    unbuilt: Mapping[File, str] = MappingProxyType({})
    is_partial: bool = False
    is_installed: bool = False
    zenoh: File | None = None

    @property
    def has_own(self) -> bool:
        """Whether any of the definitions belongs to uORB's package."""
        return any(not file.package for file in (*self.messages, *self.services))

    def reasons(self) -> dict[str, str]:
        """Return the reasons why the board does not build messages of the tree, by the name of the message."""
        board = self.board.name if self.board else ""
        reasons = {condition: f"needs {condition}" for condition in self.unbuilt.values()} | {"": f"not in {LISTS}"}
        return {file.stem: f": not built for {board}, {reasons[needs]}" for file, needs in self.unbuilt.items()}

    def with_packages_of(self, other: "Sources") -> "Sources":
        """Return these sources with the further packages of `other`, so that both sides nest the same types."""
        messages, services = (
            tuple(file for file in files if not _is_own(file.package, self.package))
            for files in (other.messages, other.services)
        )
        return self._replace(messages=self.messages + messages, services=self.services + services)

    def dependencies(self) -> tuple[str, ...]:
        """Return the paths of the files and archives on disk. Revisions are left out, because they never change."""
        paths = (file.tree.path if isinstance(file.tree, Snapshot) else file.path for file in self.files())
        return tuple(path for path in dict.fromkeys(paths) if os.path.isfile(path))

    def files(self) -> tuple[File, ...]:
        """Return all files, in an order that does not depend on the machine."""
        single = [file for file in (self.bridge, self.zenoh, self.lists) if file]
        versions = (*self.archived, *self.translations)
        board = self.board.files if self.board else ()
        return (*self.messages, *self.services, *single, *self.manifests, *versions, *self.client, *board)


def open_tree(text: str) -> Tree:
    """Return what `text` names: a folder, `folder@revision`, an archive, an embedded release or an installed package.

    Raises InputError.
    """
    if "\0" in text:
        raise input_error(text, "S101", "no such folder", 0)
    if names_release(text):
        return open_release(text)[1]
    if names_installed(text):
        return _installed_root(text).tree
    if os.path.isdir(text):
        return Folder(text)
    if os.path.isfile(text):
        from msggen.sources.tarball import SUFFIXES, read_archive

        if not text.lower().endswith(SUFFIXES):
            raise input_error(text, "S101", f"neither a folder nor an archive ({', '.join(SUFFIXES)})", 0)
        return read_archive(text)
    from msggen.sources.revision import read_revision, split_revision

    folder, revision = split_revision(text)
    if folder == text:
        from msggen.base.disk.names import path_hint

        name = text.partition("@")[0] or text
        kind = "file" if format_named(text) else "folder"
        if names_installed(name):
            raise input_error(text, "S132", f"an installed package has no revisions: write '{name}'", 0)
        hint = near_release(text) or path_hint(name, is_meant=_is_source)
        raise input_error(name, "S101", f"no such {kind}{hint}", 0)
    return read_revision(folder, revision)


def find_sources(
    px4: str | Tree | None,
    folders: tuple[str, ...] = (),
    topics: str | File | None = None,
    release: str | None = None,
    release_place: Location = _RELEASE_OPTION,
) -> Sources:
    """Return the files of the tree or package `px4` and of the further `folders`.

    These folders contain further messages of uORB, or those of another ROS package, which `PKG=DIR` or a package.xml
    names. `topics` replaces the bridge's YAML file. `release` replaces the release that the tree shows. Without `px4`
    and `folders` the source is the newest embedded release.

    Raises InputError if a source cannot be read or has no definitions, and for an unknown release, with `release_place`
    as its location.
    """
    if release is not None and release not in RELEASES:
        hint = suggestion(release, RELEASES) or f": expected {', '.join(RELEASES)}"
        raise input_error(release_place.path, "S105", f"unknown release '{release}'{hint}", *release_place[1:])
    roots = []
    package = ""
    if px4 is not None:
        roots.append(_root(px4))
        if not roots[0].embedded:
            refuse_part_of_tree(roots[0].tree)
            refuse_old_tree(roots[0].tree)
        package = _name_in(roots[0].manifest)
    roots += [_further_root(text, package) for text in folders]
    is_named = bool(roots)
    roots = sorted(roots or [_root(PREFIX + EMBEDDED[0])], key=lambda root: bool(root.package))
    messages = [_definitions(root, "msg", ".msg") for root in roots]
    services = [_definitions(root, "srv", ".srv") for root in roots]
    for root, *found in zip(roots, messages, services, strict=True):
        if not any(found):
            fail_without_definitions(root.tree)
    first = roots[0]
    bridge = File(topics, os.path.basename(topics)) if isinstance(topics, str) else topics
    zenoh = None
    if bridge is None and (px4 is not None or not is_named):
        bridge, zenoh = find_bridge(first.tree), find_zenoh(first.tree)
    is_tree = not first.package and is_firmware(first.tree)
    client = [name for name in CLIENT_SOURCES if is_tree and first.tree.is_file(name)]
    return Sources(
        messages=tuple(chain(*messages)),
        services=tuple(chain(*services)),
        bridge=bridge,
        manifests=tuple(root.manifest for root in roots if root.manifest),
        package=package,
        release=release,
        own=0 if first.package else len(messages[0]),
        is_tree=is_tree,
        label=_label(roots),
        root=first.tree,
        embedded=first.embedded,
        client=tuple(File(first.tree.place(name), name, first.tree) for name in client),
        lists=None if first.package else find_file(first.tree, LISTS),
        notices=(*(_shadowed(px4) if isinstance(px4, str) else ()), *chain(*(_notices(root) for root in roots))),
        is_installed=first.is_installed,
        zenoh=zenoh,
    )


def with_board(sources: Sources, option: BoardOption | None) -> Sources:
    """Return `sources` without the messages that the board in `option` does not build, all of them if it is None.

    The name of a board has no effect on an embedded release, which gets a note. Raises InputError if the board does not
    exist or the tree has no lists. An optional board is ignored if the tree has no lists, or no conditions in them.
    """
    if option is None:
        return sources
    from msggen.definitions.parse.cmake import parse_lists
    from msggen.sources.board import find_board

    root = sources.root
    if sources.embedded and not option.is_path:
        text = f"{sources.label} has no boards: all of its messages are kept, whatever '{option.text}' builds"
        return sources._replace(notices=(*sources.notices, Diagnostic(option.place, "S122", text)))
    if root is None or sources.lists is None:
        if option.optional:
            return sources
        text = f"{sources.label} has no {LISTS}, which lists what a board builds: expected a PX4-Autopilot tree"
        raise input_error(option.place.path, "S118", text, *option.place[1:])
    lists = parse_lists(read_file(sources.lists).decode(errors="replace"), sources.lists.path)
    conditions = {f"msg/{name}": entry.condition for name, entry in lists.listed.items()}
    if option.optional and not any(conditions.values()):
        return sources
    board = find_board(root, option, conditions.values())
    unbuilt = {
        file: conditions.get(file.name, "")
        for file in sources.messages
        if file.tree is root
        and (board.builds(conditions[file.name]) is False if file.name in conditions else lists.complete)
    }
    return sources._replace(
        messages=tuple(file for file in sources.messages if file not in unbuilt),
        own=sources.own - len(unbuilt),
        board=board,
        unbuilt=MappingProxyType(unbuilt),
    )


def with_archived(sources: Sources, place: Location = _ARCHIVED_OPTION) -> Sources:
    """Return `sources` with the archived versions of the first source and the headers that translate them.

    Raises InputError if there are none, with `place` as its location.
    """
    root = sources.root
    folder = "msg/" if root and root.is_folder("msg") else ""
    found = find_files(root, f"{folder}{ARCHIVE}/", ".msg") if root else []
    if not root or not found:
        text = f"{sources.label} has no archived versions: PX4 v1.16 and later have them in msg/{ARCHIVE}"
        raise input_error(place.path, "S117", text, *place[1:])
    headers = find_files(root, f"{folder}{TRANSLATIONS}/", ".h")
    return sources._replace(archived=tuple(found), translations=tuple(headers))


def read_files(sources: Sources) -> dict[str, bytes]:
    """Return the contents of all files by path. Each file is read once. Raises InputError if one cannot be read."""
    return {file.path: read_file(file) for file in sources.files()}


def split_package(text: str, place: Location = _FOLDER_OPTION) -> tuple[str, str]:
    """Return the package and the folder of `PKG=DIR`.

    The package is "" if `text` has no `=`, or a `/` before it. Raises InputError for an invalid package name, with
    `place` as its location.
    """
    package, mark, folder = text.partition("=")
    if not mark or "/" in package or os.sep in package:
        return "", text
    if not _PACKAGE_NAME.fullmatch(package):
        hint = f"write a folder with '=' in its name as '{os.path.join(os.curdir, text)}'"
        raise input_error(place.path, "S103", f"{package!r} is not a ROS package name; {hint}", *place[1:])
    if not folder:
        raise input_error(place.path, "S101", f"'{text}' names no folder: expected {package}=DIR", *place[1:])
    return package, os.path.expanduser(folder)


def join_package(package: str, folder: str) -> str:
    """Return `PKG=DIR`, or the folder alone if the package is "": the inverse of `split_package`."""
    return f"{package}={folder}" if package else folder


class _Root(NamedTuple):
    """One source; `package` is "" if it contains messages of uORB."""

    tree: Tree
    label: str
    manifest: File | None
    package: str = ""
    embedded: str = ""
    is_installed: bool = False
    notices: tuple[Diagnostic, ...] = ()


def _root(named: str | Tree, label: str = "") -> _Root:
    if isinstance(named, str) and names_release(named):
        release, tree = open_release(named)
        return _Root(tree, f"the embedded PX4 {release}", None, embedded=release)
    if isinstance(named, str) and names_installed(named):
        return _installed_root(named)
    tree = open_tree(named) if isinstance(named, str) else named
    return _Root(tree, label or tree.path, find_manifest(tree))


def _installed_root(text: str) -> _Root:
    """Return an installed package. Raises InputError if there is none, or its folder has another package."""
    found = find_installed(text)
    tree = Folder(found.path)
    manifest = find_manifest(tree)
    if manifest is None:
        raise input_error(found.path, "S102", "no package.xml here: expected an installed ROS package", 0)
    name, version = read_manifest(read_file(manifest), manifest.path)
    if name != found.package:
        problem = f"the package is named '{name}', expected '{found.package}' as its folder"
        raise input_error(manifest.path, "S106", problem, 0)
    label = f"the installed {name} {version}".rstrip()
    return _Root(tree, label, manifest, is_installed=True, notices=(found.notice(text),))


def _shadowed(path: str) -> Iterator[Diagnostic]:
    """Yield a note if a path was read that has the name of an embedded release."""
    if path in EMBEDDED and not names_release(path):
        yield Diagnostic(Location(path, 0), "S120", f"this path is read, not the embedded release '{PREFIX}{path}'")


def _label(roots: list[_Root]) -> str:
    """Return the labels of uORB's sources. Those of further packages count only if there are no others."""
    own = [root.label for root in roots if not root.package]
    return ", ".join(own or [root.label for root in roots])


def _further_root(text: str, own: str) -> _Root:
    """Return a source that `--msg-dir` adds; `own` is the name of uORB's package."""
    given, folder = split_package(text)
    root = _root(folder, text)
    found = _name_in(root.manifest)
    if root.manifest and given not in ("", found):
        text = f"the package is named '{found}', found '{given}' in '{text}'"
        raise input_error(root.manifest.path, "S106", text, 0)
    package = given or found
    return root if _is_own(package, own) else root._replace(package=package)


def _is_own(package: str, own: str) -> bool:
    """Whether `package` is uORB's package, which is `own`, or px4_msgs if that is ""."""
    if not package or package == own:
        return True
    from msggen.definitions.model import DEFAULT_PACKAGE

    return not own and package == DEFAULT_PACKAGE


def _name_in(manifest: File | None) -> str:
    return package_name(read_file(manifest), manifest.path) if manifest else ""


def _definitions(root: _Root, folder: str, suffix: str) -> list[File]:
    return find_definitions(root.tree, folder, suffix, root.package, is_flat=root.manifest is not None)


def _notices(root: _Root) -> Iterator[Diagnostic]:
    yield from root.notices
    if not (root.manifest or root.package):
        yield from unread_folders(root.tree)


def _is_source(path: str) -> bool:
    """Whether a path can be meant: a folder or a recording."""
    return os.path.isdir(path) or format_named(path) is not None
