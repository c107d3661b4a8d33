"""Edits that an editor offers at a problem or at a topic, and renaming.

Each edit gives whole new texts of files. The server turns them into the lines that differ.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from msggen.base.diagnostics import input_error
from msggen.check.lint.fields import sorted_by_alignment
from msggen.definitions.model import Direction, Message, snake_case
from msggen.definitions.parse.definition import CONSTANT_NAME, FIELD_NAME, TOPIC_NAME
from msggen.definitions.parse.field_type import MESSAGE_NAME
from msggen.generate.bump.edits import plan_bump, target_of
from msggen.lsp.buffers import BufferedFolder
from msggen.lsp.names import Kind, Name, Use, elements, uses
from msggen.lsp.project import Problem, Project, State

_HINT = re.compile(r"did you mean '([^']+)'")
_QUOTED = re.compile(r"'([^']+)'")
_UNDECLARED = re.compile(r"no message declares the topic '(\w+)', .* in (\w+)\.msg")
_BUMP = "msggen bump "
_PADDING = "PADDING_AVOIDABLE"

_RENAMED: Mapping[Kind, re.Pattern[str]] = MappingProxyType(
    {
        Kind.MESSAGE: MESSAGE_NAME,
        Kind.FIELD: FIELD_NAME,
        Kind.CONSTANT: CONSTANT_NAME,
        Kind.TOPIC: TOPIC_NAME,
    }
)
"""What a new name of each kind must be."""


@dataclass(frozen=True)
class Edit:
    """New texts of files by path, and the files that get another name before. A new file has no old text."""

    title: str
    texts: Mapping[str, str]
    moved: Mapping[str, str] = field(default_factory=dict)
    problem: Problem | None = None


def nearest_name(state: State, problem: Problem) -> Edit | None:
    """Return the edit that writes the name that a problem suggests."""
    hint = _HINT.search(problem.message)
    place = problem.location
    lines = state.source(place.path)
    if not hint or not 0 < place.line <= len(lines):
        return None
    line = lines[place.line - 1]
    for quoted in _QUOTED.findall(problem.message[: hint.start()]):
        word = quoted if quoted in line else quoted.rpartition("::")[2]
        start = line.find(word, place.column - 1)
        right = hint[1].rpartition("::")[2] if word != quoted else hint[1]
        if start >= 0 and right != word:
            new = line[:start] + right + line[start + len(word) :]
            text = "\n".join([*lines[: place.line - 1], new, *lines[place.line :]])
            return Edit(f"write '{hint[1]}'", {place.path: text}, problem=problem)
    return None


def bumped(problem: Problem) -> str:
    """Return the message whose next version is the remedy of a problem, "" for another remedy or none."""
    remedy = problem.finding.remedy if problem.finding else ""
    return remedy.removeprefix(_BUMP) if remedy.startswith(_BUMP) else ""


def bump(project: Project, message: str) -> Edit:
    """Return the edit that `msggen bump` makes for a message, with the texts of open files. Raises InputError."""
    root = project.root
    folder = root.settings.px4 or root.folder
    plan = plan_bump(BufferedFolder(folder, project.buffers), message, None)
    texts = {}
    for change in plan.changes:
        target_of(folder, change)  # a link must not lead out of the firmware
        texts[os.path.join(folder, *change.name.split("/"))] = change.after.decode("utf-8", "surrogateescape")
    return Edit(f"{_BUMP}{message}", texts)


def reorder(state: State, problem: Problem) -> Edit | None:
    """Return the edit that sorts the fields of a message by alignment, with their comments."""
    path = problem.location.path
    if problem.code != _PADDING or state.catalog is None:
        return None
    message = state.in_file(path)[0]
    if message.folder != "msg":
        return None
    lines = state.source(path)
    blocks = _blocks(lines, message)
    new: list[str] = []
    done = 0
    for (start, end), wanted in zip(blocks.values(), sorted_by_alignment(state.catalog, message), strict=True):
        first, last = blocks[wanted.name]
        new += [*lines[done:start], *lines[first:last]]
        done = end
    return Edit("sort the fields by alignment", {path: "\n".join([*new, *lines[done:]])}, problem=problem)


def _blocks(lines: Sequence[str], message: Message) -> dict[str, tuple[int, int]]:
    """Return the lines of each field with its comments: the first and the one behind the last, from 0.

    The comments of a field are the lines directly above it and the indented ones below it.
    """
    found = {}
    done = 0
    for element in elements(message):
        line = element.location.line - 1
        end = line + 1
        while end < len(lines) and lines[end][:1].isspace() and lines[end].strip().startswith("#"):
            end += 1
        start = line
        while start > done and lines[start - 1].startswith("#") and not lines[start - 1].startswith("# TOPICS"):
            start -= 1
        if start == 0:
            start = line  # the comment of the message
        found[element.name] = (start, end)
        done = end
    return {field.name: found[field.name] for field in message.fields}


def at_topic(state: State, use: Use) -> Iterator[Edit]:
    """Yield the edits that bridge a topic, and the one that declares it in the definition of its message."""
    name = use.name.text
    owner = next((each for each in state.messages if each.folder == "msg" and name in each.topic_names), None)
    bridge = state.sources.bridge if state.sources else None
    if owner is None or state.catalog is None:
        return
    if bridge and not any(entry.uorb_topic == name for entry in state.catalog.bridge):
        lines = state.source(bridge.path)
        for list_, direction in (("publications", Direction.OUT), ("subscriptions", Direction.IN)):
            text = _with_entry(lines, list_, f"/fmu/{direction.value}/{name}", f"{owner.package}::msg::{owner.name}")
            if text is not None:
                yield Edit(f"add {name} to the {list_} of dds_topics.yaml", {bridge.path: text})


def _with_entry(lines: Sequence[str], list_: str, topic: str, type_: str) -> str | None:
    """Return the text with an entry at the end of a list, None if the list is not written plainly."""
    start = next((number for number, line in enumerate(lines) if re.fullmatch(rf"{list_}:\s*(#.*)?", line)), None)
    if start is None:
        return None
    end = start + 1
    for number in range(start + 1, len(lines)):
        if lines[number].strip() and not lines[number][0].isspace() and not lines[number].startswith(("-", "#")):
            break
        if lines[number].strip() and not lines[number].lstrip().startswith("#"):
            end = number + 1
    items = [line for line in lines[start + 1 : end] if line.lstrip().startswith("- ")]
    indent = items[-1][: len(items[-1]) - len(items[-1].lstrip())] if items else "  "
    gap = [""] if items and "" in [line.strip() for line in lines[start + 1 : end]] else []
    entry = [*gap, f"{indent}- topic: {topic}", f"{indent}  type: {type_}"]
    return "\n".join([*lines[:end], *entry, *lines[end:]])


def declare(state: State, problem: Problem) -> Edit | None:
    """Return the edit that declares a topic of dds_topics.yaml which no message has."""
    found = _UNDECLARED.search(problem.message) if problem.code == "Y202" else None
    messages = state.catalog.uorb_messages if state.catalog else ()
    message = next((each for each in messages if found and each.name == found[2]), None)
    if not found or message is None:
        return None
    text = _with_topics(state.source(message.location.path), message, (*message.topic_names, found[1]))
    return Edit(f"declare {found[1]} in {message.name}.msg", {message.location.path: text}, problem=problem)


def _with_topics(lines: Sequence[str], message: Message, topics: Sequence[str]) -> str:
    """Return the text of a definition that declares `topics`, on its last line with topics or at its end."""
    if message.topics:
        line = message.topics[-1].location.line
        more = [topic for topic in topics if topic not in message.topic_names]
        return "\n".join([*lines[: line - 1], " ".join([lines[line - 1].rstrip(), *more]), *lines[line:]])
    whole = "\n".join(lines).rstrip("\r\n")
    return f"{whole}\n\n# TOPICS {' '.join(topics)}\n"


def rename(state: State, name: Name, new: str) -> Edit:
    """Return the edit that renames a message, a field, a constant or a topic wherever it stands. Raises InputError."""
    if name.kind is Kind.ENUM:
        raise input_error("rename", "M201", "a prefix has the name of its constants: rename these", 0)
    if not _RENAMED[name.kind].fullmatch(new):
        wanted = {Kind.MESSAGE: "CamelCase", Kind.CONSTANT: "UPPER_CASE"}.get(name.kind, "lower_case")
        raise input_error("rename", "M201", f"'{new}': expected a name in {wanted}", 0)
    text = f"{name.text.rpartition('/')[0]}/{new}" if name.kind is Kind.MESSAGE else new
    if any(use.name == name._replace(text=text) for use in uses(state)):
        raise input_error("rename", "M202", f"there is a {name.kind.value} '{new}' already", 0)
    spans: dict[str, list[Use]] = {}
    for use in uses(state):
        if use.name == name and use.span.start < use.span.end:
            spans.setdefault(use.span.path, []).append(use)
    renamed = (each.location.path for each in state.messages if Name(Kind.MESSAGE, each.key) == name)
    moved = {path: os.path.join(os.path.dirname(path), f"{new}.msg") for path in renamed}
    texts = {path: _replaced(state.source(path), found, new) for path, found in spans.items()}
    for message in state.messages:
        implied = (Name(Kind.MESSAGE, message.key), Name(Kind.TOPIC, snake_case(message.name)))
        if name in implied and message.folder == "msg" and not message.topics:
            path = message.location.path  # the name of the message is no longer that of the topic
            lines = texts.get(path, "\n".join(state.source(path))).split("\n")
            texts[path] = _with_topics(lines, message, [new] if name.kind is Kind.TOPIC else message.topic_names)
    return Edit(f"rename to {new}", texts, moved)


def _replaced(old: Sequence[str], found: list[Use], new: str) -> str:
    lines = [*old]
    for use in sorted(found, key=lambda each: each.span, reverse=True):
        line = lines[use.span.line - 1]
        lines[use.span.line - 1] = line[: use.span.start - 1] + new + line[use.span.end - 1 :]
    return "\n".join(lines)


def all_at(state: State, problem: Problem) -> Iterator[Edit]:
    """Yield the edits for a problem, without the next version of a message, which takes longer."""
    for make in (nearest_name, reorder, declare):
        if edit := make(state, problem):
            yield edit
