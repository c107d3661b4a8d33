"""The embedded releases of PX4: the newest as files, each earlier one as its differences from the next.

`releases/v1.16.msgs` has the files of v1.16 that differ from those of v1.17, each below a line `=== PATH`. A path
without lines below it is a file that v1.16 does not have. To write each comment only once, a field or constant without
a comment takes the comment from the next newer release that has it. `tests/support/embed.py` writes these files.
"""

import os
import re
from collections.abc import Collection
from functools import cache, cached_property

from msggen.base.diagnostics import input_error, suggestion
from msggen.base.disk.resources import embedded_root
from msggen.sources.tree import Folder, Snapshot, Tree

EMBEDDED = ("v1.18", "v1.17", "v1.16", "v1.15", "v1.14")
"""The releases of PX4 whose definitions are embedded, the newest first."""

PREFIX = "embedded:"
"""The prefix of the name of an embedded release: `embedded:v1.16`. It is needed if `v1.16` is also a path."""

ARCHIVED = "msg/px4_msgs_old/msg/"
"""The folder of the archived versions."""

FOLDERS = ("", "msg/", "msg/versioned/", ARCHIVED, "srv/")
"""The folders that contain the files of a release."""

LISTS = ("dds_topics.yaml", "zenoh_topics.yaml")
"""The lists of topics of a release: those that cross the bridge, and those on Zenoh."""

_NAME = re.compile(r"v\d+\.\d+")
_HEAD = re.compile(r"(?:#.*\n)*")


def names_release(text: str) -> bool:
    """Whether `text` looks like the name of an embedded release, existing or not. An existing path has priority."""
    is_name = _NAME.fullmatch(text) is not None and not os.path.exists(text)
    return is_name or text.startswith(PREFIX)


def unknown_release(text: str) -> str:
    """Return an error message for the name of an embedded release that does not exist, "" if it exists."""
    name = text.removeprefix(PREFIX)
    if name in EMBEDDED:
        return ""
    problem = "neither a folder nor an embedded release" if name == text else "no such embedded release"
    if _NAME.fullmatch(name) and _number(name) < _number(EMBEDDED[-1]):
        return f"{problem}: there are {EMBEDDED[-1]} to {EMBEDDED[0]}"
    return problem + (suggestion(name, EMBEDDED) or f": expected {', '.join(EMBEDDED)}")


def _number(release: str) -> tuple[int, ...]:
    return tuple(map(int, release[1:].split(".")))


def nearest_first(version: str) -> tuple[str, ...]:
    """Return the embedded releases, the nearest to a version such as `v1.16.2` first. Without one, the newest first."""
    told = _NAME.match(version)
    if told is None:
        return EMBEDDED
    place = _place(told[0])
    return tuple(sorted(EMBEDDED, key=lambda release: abs(_place(release) - place)))


def _place(release: str) -> int:
    major, minor = _number(release)
    return 1000 * major + minor


def near_release(text: str) -> str:
    """Return ", did you mean 'v1.16'?" for `1.16` and `v1.16.0`, "" if no embedded release is similar."""
    found = re.fullmatch(r"[vV]?(\d+\.\d+)(?:\.\d+)?", text)
    name = f"v{found[1]}" if found else ""
    return f", did you mean '{name}'?" if name in EMBEDDED else ""


def open_release(text: str) -> tuple[str, Tree]:
    """Return the name and the files of the embedded release that `text` names. Raises InputError."""
    problem = unknown_release(text)
    if problem:
        raise input_error(text, "S105", problem, 0)
    release = text.removeprefix(PREFIX)
    return release, embedded_tree(release)


def embedded_tree(release: str) -> Tree:
    """Return the files of an embedded release."""
    if release == EMBEDDED[0]:
        return Folder(embedded_root())
    releases = Releases()
    found = (releases.file(release, name) for name in releases.names(release))
    return Snapshot(PREFIX + release, {path: text.encode() for path, text in found if path}, {})


def release_path(path: str) -> str:
    """Return how people read the path of a file of an embedded release: `v1.18:msg/Rpm.msg`. Others stay as they are.

    It is the same wherever msggen is installed.
    """
    if path.startswith(PREFIX):
        return path.removeprefix(PREFIX).replace("/", ":", 1)
    root = os.path.join(embedded_root(), "")
    return f"{EMBEDDED[0]}:{path[len(root) :].replace(os.sep, '/')}" if path.startswith(root) else path


class Releases:
    """The files of all embedded releases. Each is read when it is needed."""

    def __init__(self) -> None:
        self._newest = Folder(embedded_root())
        self._changes: dict[str, dict[str, tuple[str, str]]] = {}
        self._texts: dict[str, str] = {}

    def names(self, oldest: str) -> frozenset[str]:
        """Return the names of the files of the releases from `oldest` on, without their folders."""
        return frozenset(self._paths).union(*map(self._changes_of, EMBEDDED[: EMBEDDED.index(oldest) + 1]))

    def file(self, release: str, name: str) -> tuple[str, str]:
        """Return the path and the text of the file `name`, such as `Rpm.msg`; both "" if the release lacks it."""
        path, text = self.stored(release, name)
        if not text:
            return "", ""
        *newer, _ = [self._newest_text(name), *(text for _, text in self._versions(release, name))]
        return path, with_comments(text, newer) if newer else text

    def stored(self, release: str, name: str) -> tuple[str, str]:
        """Return the same as `file`, without the comments that the text takes from newer releases."""
        versions = self._versions(release, name)
        return versions[-1] if versions else (self._paths.get(name, ""), self._newest_text(name))

    def nearest(self, names: Collection[str]) -> str:
        """Return the release whose messages differ least from those in files with these names."""
        paths = dict(self._paths)
        different = {}
        for release in EMBEDDED:
            for name, (path, text) in self._changes_of(release).items():
                paths[name] = path if text else ""
            known = {name for name, path in paths.items() if path.endswith(".msg") and not path.startswith(ARCHIVED)}
            different[release] = len(known.symmetric_difference(names))
        return min(different, key=different.__getitem__)

    @property
    def definitions(self) -> frozenset[str]:
        """The definitions of all releases by kind, such as `msg/Rpm.msg`, without the archived versions."""
        changed = (path for release in EMBEDDED for path, _ in self._changes_of(release).values())
        folders = [os.path.split(path) for path in (*self._paths.values(), *changed) if not path.startswith(ARCHIVED)]
        return frozenset(f"{folder.partition('/')[0]}/{name}" for folder, name in folders if folder)

    def _newest_text(self, name: str) -> str:
        """Return the text of a file of the newest release, "" if that lacks it."""
        if name not in self._texts:
            self._texts[name] = self._newest.read(self._paths[name]).decode() if name in self._paths else ""
        return self._texts[name]

    def _versions(self, release: str, name: str) -> list[tuple[str, str]]:
        """Return the paths and texts of a file in the releases before the newest that change it, down to `release`."""
        earlier = EMBEDDED[: EMBEDDED.index(release) + 1]
        return [found for each in earlier if (found := self._changes_of(each).get(name))]

    def _changes_of(self, release: str) -> dict[str, tuple[str, str]]:
        """Return path and text of the files of a release that are not as in the next newer one, by name."""
        if release not in self._changes:
            is_newest = release == EMBEDDED[0]
            text = "" if is_newest else self._newest.read(f"releases/{release}.msgs").decode()
            self._changes[release] = {os.path.basename(path): (path, lines) for path, lines in sections(text)}
        return self._changes[release]

    @cached_property
    def _paths(self) -> dict[str, str]:
        """The paths of the files of the newest release, by name."""
        newest = self._newest
        return {name: folder + name for folder in FOLDERS for name in newest.names(folder) if is_of_release(name)}


def newest_version(name: str) -> int | None:
    """Return the version of the message `name` in the newest release, None if it is not a versioned message there."""
    newest, path = Folder(embedded_root()), f"msg/versioned/{name}.msg"
    text = newest.read(path).decode() if newest.is_file(path) else ""
    found = re.search(r"^uint32 MESSAGE_VERSION = (\d+)", text, re.MULTILINE)
    return int(found[1]) if found else None


def is_of_release(name: str) -> bool:
    """Whether a file of this name belongs to a release."""
    return name.endswith((".msg", ".srv")) or name in LISTS


def sections(text: str) -> list[tuple[str, str]]:
    """Return the paths and texts in a file of `releases/`. The lines before the first path are a comment."""
    parts = (part.partition("\n") for part in f"\n{text}".split("\n=== ")[1:])
    return [(path, lines.strip("\n")) for path, _, lines in parts]


def comments_in(text: str) -> dict[str, str]:
    """Return the comments in a definition, by the name of the field or constant."""
    found = {}
    for line in text.split("\n"):
        code, mark, comment = line.partition("  # ")
        if mark:
            found[code.split(" ", 2)[1]] = comment
    return found


def head_of(text: str) -> str:
    """Return the comment at the top of a definition, line ends included."""
    head = _HEAD.match(text)
    return head[0] if head else ""


def with_comments(text: str, newer: list[str]) -> str:
    """Return a definition with its missing comments added from the `newer` texts. The last of these has priority."""
    known: dict[str, str] = {}
    for version in newer:
        if "  # " in version:
            known.update(comments_in(version))
    head = head_of(text) or next(filter(None, map(head_of, reversed(newer))), "")
    lines = text.removeprefix(head).split("\n")
    for index, line in enumerate(lines):
        if "#" not in line:
            comment = known.get(line.partition(" = ")[0].partition(" ")[2])
            if comment:
                lines[index] = f"{line}  # {comment}"
    body = "\n".join(lines)
    return f"{head}\n{body}\n" if head else f"{body}\n"


@cache
def all_releases() -> Releases:
    """Return the files of all embedded releases, so that each is read once for all that ask for it."""
    return Releases()
