"""Embeds a new release of PX4: `python tests/support/embed.py PX4-Autopilot v1.19`.

`msg/`, `srv/` and the lists of topics become those of the firmware, without its comments. Our comments stay with each
field or constant that stays. The previously newest release becomes a file in `releases/` with its differences; the
other files there do not change. All else that follows from the definitions is written too, and what does not follow is
listed: `releases/README.md` has both.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from difflib import SequenceMatcher
from pathlib import Path
from textwrap import wrap
from typing import Any, TypeAlias

import yaml

ROOT = Path(__file__).resolve().parents[2]
sys.path[0:0] = [str(ROOT / folder) for folder in ("tests", "")]  # this file is a program too

from msggen.definitions.parse.cmake import parse_lists  # noqa: E402
from msggen.sources.conventions import CONVENTIONS, as_shown  # noqa: E402
from msggen.sources.embedded import (  # noqa: E402
    ARCHIVED,
    EMBEDDED,
    FOLDERS,
    comments_in,
    head_of,
    is_of_release,
)
from msggen.sources.embedded import LISTS as LISTS_OF_TOPICS  # noqa: E402
from msggen.sources.finding import find_sources, with_archived  # noqa: E402
from msggen.sources.tree import Folder, Tree  # noqa: E402
from msggen.sources.tree_layout import CLIENT_SOURCES, LISTS  # noqa: E402
from support import facts  # noqa: E402

BRIDGE, ZENOH = LISTS_OF_TOPICS
_OTHER_SIDE = {BRIDGE: "DDS", ZENOH: "Zenoh"}

Files: TypeAlias = dict[str, tuple[str, str]]
"""Paths and texts by file name, which is unique in the firmware."""


def files_of(tree: Tree) -> Files:
    """Return the files of an embedded release."""
    return {
        name: (folder + name, tree.read(folder + name).decode())
        for folder in FOLDERS
        for name in tree.names(folder)
        if is_of_release(name)
    }


def files_of_firmware(path: str, release: str) -> Files:
    """Return the files of a firmware tree, without its comments."""
    sources = find_sources(path)
    root = sources.root
    if root and root.is_folder(ARCHIVED):
        sources = with_archived(sources)
    found = {
        Path(file.path).name: (file.name, "\n".join(lines_of(file.tree.read(file.name).decode())))
        for file in (*sources.messages, *sources.services, *sources.archived)
        if file.tree
    }
    for name, file in ((BRIDGE, sources.bridge), (ZENOH, sources.zenoh)):
        if file and file.tree:
            found[name] = (name, list_text(name, file.tree.read(file.name).decode(), release))
    return found


def lines_of(text: str) -> list[str]:
    """Return the lines of a definition in a normalised spelling, without comments and with topics last."""
    topics = [" ".join(line.split()) for line in text.split("\n") if line.startswith("# TOPICS")]
    codes = [" ".join(line.partition("#")[0].replace("=", " = ").split()) for line in text.split("\n")]
    return [code for code in codes if code] + topics


def list_text(name: str, text: str, release: str, *, is_newest: bool = False) -> str:
    """Return a list of topics without its comments; in the newest release, each key has its own line."""
    head = f"# What crosses the bridge between uORB and {_OTHER_SIDE[name]}: the topics of PX4 {release}."
    lists = [[*_list(key, entries, is_newest=is_newest)] for key, entries in yaml.safe_load(text).items()]
    return ("\n\n" if is_newest else "\n").join(["\n".join(lines) for lines in ([head], *lists)])


def _list(key: str, entries: list[dict[str, Any]] | None, *, is_newest: bool) -> Iterator[str]:
    yield f"{key}:" if entries else f"{key}: []"
    for entry in entries or ():
        pairs = [f"{name}: {_plain(value)}" for name, value in entry.items()]
        yield "  - " + ("\n    ".join(pairs) if is_newest else f"{{{', '.join(pairs)}}}")


def _plain(value: Any) -> str:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=1000).removesuffix("...\n").strip()


def earlier_release(release: str, older: Files, newer: Files, known: dict[str, list[str]]) -> str:
    """Return the text in `releases/` for `older`, which `newer` follows.

    `known` has, by file name, the texts of all newer releases whose comments `older` can share. The text of `newer` is
    added to it.
    """
    sections = []
    for name in sorted({*older, *newer}, key=lambda name: (older.get(name) or newer[name])[0]):
        path, text = older.get(name, ("", ""))
        if name in newer:
            known.setdefault(name, []).append(newer[name][1])
            if path == newer[name][0] and _meaning(name, text) == _meaning(name, newer[name][1]):
                continue
        if not path:
            sections.append(f"=== {newer[name][0]}\n")
            continue
        body = list_text(name, text, release) if name in _OTHER_SIDE else _without(text, known.get(name, []))
        sections.append(f"=== {path}\n{body}\n")
    about = f"# The files of PX4 {release} that are not as in the next newer release: README.md has the format.\n"
    return "\n".join([about, *sections])


def _meaning(name: str, text: str) -> object:
    return yaml.safe_load(text) if name in _OTHER_SIDE else (lines_of(text), comments_in(text), head_of(text))


def _without(text: str, newer: list[str]) -> str:
    """Return a definition without the comments that it shares with its newer versions."""
    known = {name: comment for version in newer for name, comment in comments_in(version).items()}
    own = {name: comment for name, comment in comments_in(text).items() if known.get(name) != comment}
    heads = [head for head in map(head_of, newer) if head]
    head = "" if heads[-1:] == [head_of(text)] else head_of(text)
    return head + "\n".join(commented(lines_of(text), own))


def commented(lines: list[str], comments: Mapping[str, str]) -> list[str]:
    """Return the lines of a definition with the comments of its fields and constants added."""
    names = [_name(line) for line in lines]
    return [
        f"{line}  # {comments[name]}" if name in comments else line for line, name in zip(lines, names, strict=True)
    ]


def _name(line: str) -> str:
    return "" if line.startswith("#") or " " not in line else line.split(" ")[1]


def merged(old: str, new: str) -> str:
    """Return the definition `new` in the layout and with the comments of `old`."""
    head, comments = head_of(old), comments_in(old)
    rows = old.removeprefix(head).strip("\n").split("\n")
    ours, theirs = [lines_of(row)[:1] or [row] for row in rows], [[line] for line in lines_of(new)]
    result: list[str] = []
    matcher = SequenceMatcher(None, [str(row) for row in ours], [str(row) for row in theirs], autojunk=False)
    for kind, start, end, first, last in matcher.get_opcodes():
        if kind == "equal":
            result += rows[start:end]
            continue
        result += commented([line for (line,) in theirs[first:last]], comments)
        result += [row for row in rows[start:end] if not lines_of(row)]
    body = re.sub(r"\n{3,}", "\n\n", "\n".join(result)).strip("\n")
    return f"{head}\n{body}\n" if head else f"{body}\n"


def embed(firmware: str, release: str) -> list[str]:
    """Make `firmware` the newest embedded release, and write all that follows from it; return what is missing."""
    if release in EMBEDDED:
        raise SystemExit(f"{release} is embedded already")
    older, found = files_of(Folder(str(ROOT))), files_of_firmware(firmware, release)
    root = find_sources(firmware).root
    newer = store(older, found, release)
    (ROOT / LISTS).write_text(lists_text(root.read(LISTS).decode() if root and root.is_file(LISTS) else "", release))
    (ROOT / "tests" / "vectors" / f"{release}.json").write_text(vectors(newer, release))
    module = ROOT / "msggen" / "sources" / "embedded.py"
    module.write_text(module.read_text().replace("\nEMBEDDED = (", f'\nEMBEDDED = ("{release}", '))
    table = ROOT / "tests" / "support" / "live_releases.py"
    subprocess.run([sys.executable, str(table)], check=True)  # which imports the new EMBEDDED
    return [*uncommented(newer), *_other_conventions(root, release), *_other_samples(older, newer)]


def store(older: Files, found: Files, release: str) -> Files:
    """Replace the files of the newest release, `older`, with those in `found`, and return them with our comments."""
    newer = {name: (path, _newest(name, text, release, older)) for name, (path, text) in found.items()}
    last = EMBEDDED[0]
    (ROOT / "releases" / f"{last}.msgs").write_text(earlier_release(last, older, newer, {}))
    for path, _ in older.values():
        (ROOT / path).unlink()
    for path, text in newer.values():
        (ROOT / path).parent.mkdir(parents=True, exist_ok=True)
        (ROOT / path).write_text(text)
    return newer


def _newest(name: str, text: str, release: str, older: Files) -> str:
    if name in _OTHER_SIDE:
        return list_text(name, text, release, is_newest=True) + "\n"
    return merged(older[name][1], text) if name in older else text + "\n"


def uncommented(files: Files) -> list[str]:
    """Return the messages, fields and constants without a comment."""
    return [missing for name, (path, text) in sorted(files.items()) for missing in _missing(path, name, text)]


def _missing(path: str, name: str, text: str) -> Iterator[str]:
    if name not in _OTHER_SIDE and not path.startswith(ARCHIVED):
        if not head_of(text):
            yield f"{path}: what the message is for"
        known = comments_in(text)
        yield from (f"{path}: {line}" for line in lines_of(text) if _name(line) and _name(line) not in known)


def lists_text(text: str, release: str) -> str:
    """Return `msg/CMakeLists.txt` of a release: the messages that the firmware's lists have under a condition."""
    listed: dict[str, list[str]] = {}
    for name, entry in sorted(parse_lists(text, LISTS).listed.items()):
        if entry.condition:
            listed.setdefault(entry.condition, []).append(name)
    others = "All others are built for every board, and are not listed here."
    lines = [f"# The messages of PX4 {release} that only some boards build. {others}"]
    for condition, names in listed.items():
        appended = [f"    list(APPEND msg_files {names})" for names in wrap(" ".join(names), 90)]
        lines += [f"if({condition})", *appended, "endif()"]
    return "\n".join(lines) + "\n"


def vectors(files: Files, release: str) -> str:
    """Return the identities of messages and endpoints, computed by a reader that shares no code with msggen."""
    texts = {Path(name).stem: text for name, (path, text) in sorted(files.items()) if _is_message(path)}
    known = {name: facts.facts_in(text, name) for name, text in texts.items()}
    messages = facts.messages(known)
    endpoints = facts.endpoints(known, files[BRIDGE][1], release)
    rows = ",\n  ".join(f"{json.dumps(name)}: {json.dumps([*row.values()])}" for name, row in messages.items())
    entries = ",\n  ".join(json.dumps([*row.values()]) for row in endpoints)
    parts = {
        "message_columns": json.dumps([*next(iter(messages.values()))]),
        "messages": f"{{\n  {rows}\n }}",
        "endpoint_columns": json.dumps([*endpoints[0]]),
        "endpoints": f"[\n  {entries}\n ]",
    }
    return "{\n" + ",\n".join(f' "{name}": {text}' for name, text in parts.items()) + "\n}\n"


def _is_message(path: str) -> bool:
    return path.endswith(".msg") and not path.startswith(ARCHIVED)


def _other_samples(older: Files, newer: Files) -> Iterator[str]:
    """Yield the messages whose samples in `tests/vectors` are those of an older definition, or missing."""
    before, after = (
        {name: lines_of(text) for name, (path, text) in files.items() if _is_message(path)} for files in (older, newer)
    )
    changed = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
    if changed:
        yield f"tests/vectors/cdr.json: the firmware's samples of {', '.join(changed)}"


def _other_conventions(root: Tree | None, release: str) -> Iterator[str]:
    """Yield the conventions that the sources of the firmware's client show, if they are not those of main."""
    texts = [root.read(name).decode() if root and root.is_file(name) else "" for name in CLIENT_SOURCES]
    known = CONVENTIONS["main"]
    if not all(texts):
        yield f"msggen/sources/conventions.py: a row, if {release} changed {', '.join(known._fields[1:])}"
    shown = as_shown(known, *texts)
    changes = {name: value for name, value in shown._asdict().items() if value != getattr(known, name)}
    if changes:
        yield f"msggen/sources/conventions.py: a row for {release} with {changes}"


if __name__ == "__main__":
    print("\n".join(embed(*sys.argv[1:])))
