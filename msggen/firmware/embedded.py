"""The embedded releases of PX4: the newest as files, each earlier one as its differences from the next.

`releases/v1.16.msgs` has the files of v1.16 that differ from those of v1.17, each below a line `=== PATH`. A path
without lines below it is a file that v1.16 does not have. To write each comment only once, a field or constant without
a comment takes the comment from the next newer release that has it. `tests/support/embed.py` writes these files.
"""

import os
import re

from msggen.diagnostics import input_error, suggestion
from msggen.disk.resources import embedded_root
from msggen.firmware.tree import Folder, Snapshot, Tree

EMBEDDED = ("v1.18", "v1.17", "v1.16", "v1.15", "v1.14")
"""The releases of PX4 whose definitions are embedded, the newest first."""

PREFIX = "embedded:"
"""The prefix of the name of an embedded release: `embedded:v1.16`. It is needed if `v1.16` is also a path."""

FOLDERS = ("", "msg/", "msg/versioned/", "msg/px4_msgs_old/msg/", "srv/")
"""The folders that contain the files of a release."""

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
    return problem + (suggestion(name, EMBEDDED) or f": expected {', '.join(EMBEDDED)}")


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
    """Return the version of the message `name` in the newest release, None if it is not a versioned message there."""
    newest, path = Folder(embedded_root()), f"msg/versioned/{name}.msg"
    text = newest.read(path).decode() if newest.is_file(path) else ""
    found = re.search(r"^uint32 MESSAGE_VERSION = (\d+)", text, re.MULTILINE)
    return int(found[1]) if found else None


def is_of_release(name: str) -> bool:
    """Whether a file of this name belongs to a release."""
    return name.endswith((".msg", ".srv")) or name == "dds_topics.yaml"


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
