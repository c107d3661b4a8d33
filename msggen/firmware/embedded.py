"""The releases of PX4 that msggen brings along: the newest as files, each earlier one as what differs from the next.

`releases/v1.16.msgs` has the files of v1.16 that are not as in v1.17, each below a line `=== PATH`; a path without
lines is a file that v1.16 does not have. A field or constant without a comment has the one that it has in the next
newer release that knows it, so each comment is written once. `tests/support/embed.py` writes these files.
"""

import os
import re

from msggen.diagnostics import input_error, suggestion
from msggen.disk.resources import embedded_root
from msggen.firmware.tree import Folder, Snapshot, Tree

EMBEDDED = ("v1.18", "v1.17", "v1.16", "v1.15", "v1.14")
"""The releases of PX4 whose definitions are embedded, the newest first."""

PREFIX = "embedded:"
"""What names an embedded release for certain, as in `embedded:v1.16`; `v1.16` may also be a path."""

FOLDERS = ("", "msg/", "msg/versioned/", "msg/px4_msgs_old/msg/", "srv/")
"""Where the files of a release lie."""

_NAME = re.compile(r"v\d+\.\d+")
_HEAD = re.compile(r"(?:#.*\n)*")


def names_release(text: str) -> bool:
    """Whether `text` names an embedded release, be there one of that name or not; a path of the same name wins."""
    is_name = _NAME.fullmatch(text) is not None and not os.path.exists(text)
    return is_name or text.startswith(PREFIX)


def unknown_release(text: str) -> str:
    """Return what is wrong with the name of an embedded release, "" for nothing."""
    name = text.removeprefix(PREFIX)
    if name in EMBEDDED:
        return ""
    what = "neither a folder nor an embedded release" if name == text else "no such embedded release"
    return what + (suggestion(name, EMBEDDED) or f": expected {', '.join(EMBEDDED)}")


def near_release(text: str) -> str:
    """Return ", did you mean 'v1.16'?" for `1.16` and `v1.16.0`, "" where no embedded release is meant."""
    found = re.fullmatch(r"[vV]?(\d+\.\d+)(?:\.\d+)?", text)
    name = f"v{found[1]}" if found else ""
    return f", did you mean '{name}'?" if name in EMBEDDED else ""


def open_release(text: str) -> tuple[str, Tree]:
    """Return name and files of the embedded release that `text` names. Raises InputError."""
    wrong = unknown_release(text)
    if wrong:
        raise input_error(text, "S105", wrong, 0)
    release = text.removeprefix(PREFIX)
    return release, embedded_tree(release)


def embedded_tree(release: str) -> Tree:
    """Return the files of an embedded release."""
    newest = Folder(embedded_root())
    if release == EMBEDDED[0]:
        return newest
    paths = {name: folder + name for folder in FOLDERS for name in newest.names(folder) if is_of_release(name)}
    changes: dict[str, list[tuple[str, str]]] = {}
    for earlier in EMBEDDED[1 : EMBEDDED.index(release) + 1]:
        for path, text in sections(newest.read(f"releases/{earlier}.msgs").decode()):
            changes.setdefault(os.path.basename(path), []).append((path, text))
    files = {path: newest.read(path) for name, path in paths.items() if name not in changes}
    for name, versions in changes.items():
        path, text = versions.pop()
        if text:
            newer = [newest.read(paths[name]).decode()] if name in paths else []
            files[path] = with_comments(text, [*newer, *(each for _, each in versions)]).encode()
    return Snapshot(PREFIX + release, files, {})


def newest_version(name: str) -> int | None:
    """Return the version of the message `name` in the newest release, None where that has no such versioned message."""
    newest, path = Folder(embedded_root()), f"msg/versioned/{name}.msg"
    text = newest.read(path).decode() if newest.is_file(path) else ""
    found = re.search(r"^uint32 MESSAGE_VERSION = (\d+)", text, re.MULTILINE)
    return int(found[1]) if found else None


def is_of_release(name: str) -> bool:
    """Whether a file of this name belongs to a release."""
    return name.endswith((".msg", ".srv")) or name == "dds_topics.yaml"


def sections(text: str) -> list[tuple[str, str]]:
    """Return the paths and texts in a file of `releases/`; what precedes the first of them is a comment."""
    parts = (part.partition("\n") for part in f"\n{text}".split("\n=== ")[1:])
    return [(path, lines.strip("\n")) for path, _, lines in parts]


def comments_in(text: str) -> dict[str, str]:
    """Return the comments of a definition by field or constant."""
    found = {}
    for line in text.split("\n"):
        code, mark, comment = line.partition("  # ")
        if mark:
            found[code.split(" ", 2)[1]] = comment
    return found


def head_of(text: str) -> str:
    """Return the comment that a definition begins with, line ends included."""
    head = _HEAD.match(text)
    return head[0] if head else ""


def with_comments(text: str, newer: list[str]) -> str:
    """Return a definition with the comments that it lacks, from its newer versions; the last of these counts most."""
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
