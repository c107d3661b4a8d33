"""What an editor proposes at a cursor."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lsprotocol.types import CompletionItemKind as Icon

from msggen.check.lint.frame import FRAMES
from msggen.definitions.enumeration import integer_constants
from msggen.definitions.model import ArrayKind, Direction, Message, snake_case
from msggen.definitions.parse.bridge import KEYS, LISTS
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.tags import TAGS, UNIT
from msggen.definitions.unit import SPELLINGS
from msggen.lsp.project import State


class Proposal(NamedTuple):
    """A text that replaces the word before the cursor, from column `start`, which counts from 1."""

    text: str
    icon: Icon
    start: int
    detail: str = ""


_TYPE = re.compile(r"\s*([\w/]*)")
_TOPICS = re.compile(r"# TOPICS (?:\S+ )*(\S*)")
_TAG_NAME = re.compile(r".*\[@(\w*)")
_UNIT = re.compile(r".*\[([^\]@\s]*)")
_CONTENT = re.compile(r".*\[@(\w+)\s+(?:[^\]]*\s)?([@\w]*)")
_NAME = re.compile(r"\s*[\w/]+(?:\[[^\]]*\])?\s+(\w*)")
_VALUE = re.compile(r"\s*(?:-\s+)?(topic|type|route_field):\s*[\"']?([\w/:]*)")
_KEY = re.compile(r"\s*(?:-\s+)?(\w*)")


def in_definition(state: State, message: Message | None, prefix: str) -> Iterator[Proposal]:
    """Yield the proposals in a definition; `prefix` is the line before the cursor."""
    code, mark, _ = prefix.partition("#")
    if found := _TOPICS.fullmatch(prefix):
        yield from _topics_of(state, message, found)
    elif not mark:
        if found := _TYPE.fullmatch(code):
            yield from _types(state, found)
        elif found := _NAME.fullmatch(code):
            yield from _names(message, found, code)
    elif found := _TAG_NAME.fullmatch(prefix):
        yield from (
            Proposal(tag.name, Icon.Property, found.start(1) + 1, tag.documentation) for tag in TAGS if tag is not UNIT
        )
    elif found := _CONTENT.fullmatch(prefix):
        yield from _contents(message, found)
    elif found := _UNIT.fullmatch(prefix):
        yield from (Proposal(unit, Icon.Unit, found.start(1) + 1) for unit in sorted(SPELLINGS))


def _types(state: State, found: re.Match[str]) -> Iterator[Proposal]:
    start = found.start(1) + 1
    for primitive in PRIMITIVES.values():
        yield Proposal(primitive.name, Icon.Keyword, start, f"{primitive.size} bytes" if primitive.size else "text")
    own = state.catalog.package if state.catalog else ""
    for each in state.messages:
        if each.folder == "msg":
            text = each.name if each.package == own else each.key
            yield Proposal(text, Icon.Struct, start, _first_sentence(each.comment))


def _first_sentence(comment: str) -> str:
    return comment.partition(". ")[0].partition("\n")[0][:100]


def _names(message: Message | None, found: re.Match[str], code: str) -> Iterator[Proposal]:
    """Yield the name that a field of a nested message usually has, and those that PX4 itself reads."""
    known = {each.name for each in message.fields} if message else set()
    type_ = code.split(maxsplit=1)[0]
    names = ["timestamp"] if type_ == "uint64" else []
    names += ["MESSAGE_VERSION = 0"] if type_ == "uint32" else []
    names += ["ORB_QUEUE_LENGTH = "] if type_ == "uint8" else []
    base = type_.partition("[")[0].rpartition("/")[2]
    names += [snake_case(base)] if base not in PRIMITIVES else []
    yield from (Proposal(name, Icon.Field, found.start(1) + 1) for name in names if name not in known)


def _topics_of(state: State, message: Message | None, found: re.Match[str]) -> Iterator[Proposal]:
    """Yield the topic of the message's own name, and bridged topics of its type that it does not declare."""
    if message is None or state.catalog is None:
        return
    declared = {each.name for each in message.topics}
    own = snake_case(message.name)
    bridged = {each.uorb_topic for each in state.catalog.bridge if each.message_name == message.name}
    for name in sorted({own, *bridged} - declared):
        yield Proposal(name, Icon.Event, found.start(1) + 1)


def _contents(message: Message | None, found: re.Match[str]) -> Iterator[Proposal]:
    start = found.start(2) + 1
    if message is None:
        return
    if found[1] == "enum":
        yield from (Proposal(prefix, Icon.Constant, start) for prefix in _prefixes(message))
    elif found[1] == "frame":
        yield from (Proposal(frame, Icon.Constant, start) for frame in FRAMES)
        yield from (Proposal(f"@{field.name}", Icon.Field, start) for field in message.fields)
    elif found[1] in ("invalid", "uncontrolled"):
        yield Proposal("NaN", Icon.Constant, start)
        yield from (Proposal(each.name, Icon.Constant, start, str(each.value)) for each in message.constants)


def _prefixes(message: Message) -> list[str]:
    """Return the words that at least two constants begin with."""
    counts: dict[str, int] = {}
    for constant in integer_constants(message):
        words = constant.name.split("_")
        for end in range(1, len(words)):
            prefix = "_".join(words[:end])
            counts[prefix] = counts.get(prefix, 0) + 1
    return sorted(prefix for prefix, count in counts.items() if count > 1)


def in_bridge(state: State, path: str, lines: Sequence[str], line: int, prefix: str) -> Iterator[Proposal]:
    """Yield the proposals in a list of topics, on a line that counts from 1."""
    if found := _VALUE.fullmatch(prefix):
        start = found.start(2) + 1
        if found[1] == "topic":
            yield from _topics(state, path, lines, line, start)
        elif found[1] == "type":
            yield from _message_types(state, lines, line, start)
        else:
            yield from _route_fields(state, lines, line, start)
    elif found := _KEY.fullmatch(prefix):
        is_list = not prefix[:1].isspace() and "-" not in prefix
        yield from (Proposal(f"{key}: ", Icon.Property, found.start(1) + 1) for key in (LISTS if is_list else KEYS))


def _topics(state: State, path: str, lines: Sequence[str], line: int, start: int) -> Iterator[Proposal]:
    """Yield the topics that the list above the line does not have yet."""
    direction = _direction(lines, line)
    entries = dict(state.lists).get(path, ())
    known = {entry.uorb_topic for entry in entries if entry.direction is direction}
    for message in _of_uorb(state):
        for topic in message.topic_names:
            if topic not in known:
                yield Proposal(f"/fmu/{direction.value}/{topic}", Icon.Event, start, message.name)


def _direction(lines: Sequence[str], line: int) -> Direction:
    above = (each.partition(":")[0].strip() for each in reversed(lines[:line]) if each[:1].strip())
    return LISTS.get(next(above, ""), (Direction.OUT, False))[0]


def _message_types(state: State, lines: Sequence[str], line: int, start: int) -> Iterator[Proposal]:
    """Yield the type of the topic on a line nearby first, then all types."""
    near = " ".join(lines[max(0, line - 2) : line + 1])
    topics = {name.rpartition("/")[2] for name in re.findall(r"topic:\s*[\"']?([\w/]+)", near)}
    found = sorted(_of_uorb(state), key=lambda each: not topics.intersection(each.topic_names))
    for message in found:
        yield Proposal(f"{message.package}::msg::{message.name}", Icon.Struct, start, ", ".join(message.topic_names))


def _route_fields(state: State, lines: Sequence[str], line: int, start: int) -> Iterator[Proposal]:
    near = " ".join(lines[max(0, line - 4) : line + 3])
    types = set(re.findall(r"type:\s*[\"']?\w+::msg::(\w+)", near))
    for message in _of_uorb(state):
        if message.name in types:
            for field in message.fields:
                if field.type.is_primitive and field.type.array is ArrayKind.SCALAR:
                    yield Proposal(field.name, Icon.Field, start, str(field.type))


def _of_uorb(state: State) -> tuple[Message, ...]:
    return state.catalog.uorb_messages if state.catalog else ()
