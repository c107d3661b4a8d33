"""The names in definitions and in lists of topics: where each is defined, and where it is used."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from msggen.definitions.model import BridgeEntry, Constant, Field, Message, snake_case
from msggen.lsp.project import State

_NESTED = re.compile(r"(?:(\w+)/)?(\w+)")
_TAG = re.compile(r"\[@(enum|invalid|uncontrolled|frame)\s+([^\]]*)\]")
_WORD = re.compile(r"\w+")
_ROUTE = re.compile(r"route_field:\s*[\"']?(\w+)")


class Kind(Enum):
    """What has a name."""

    MESSAGE = "message"
    FIELD = "field"
    CONSTANT = "constant"
    ENUM = "prefix of constants"
    TOPIC = "topic"


class Span(NamedTuple):
    """A part of a line. Lines and columns count from 1, in characters; `end` is the column behind it."""

    path: str
    line: int
    start: int
    end: int

    def covers(self, line: int, column: int) -> bool:
        """Whether a cursor at a column, or directly behind the last one, is in the part."""
        return self.line == line and self.start <= column <= self.end

    def in_last(self, word: str) -> Span:
        """Return the part at the end that has `word`."""
        return self._replace(start=self.end - len(word))


class Name(NamedTuple):
    """A name, and the key of the message that it belongs to; a message and a topic belong to none."""

    kind: Kind
    text: str
    owner: str = ""


class Use(NamedTuple):
    """A place where a name stands. A definition without a span of its own begins at its file."""

    name: Name
    span: Span
    is_definition: bool = False


def uses(state: State, paths: Iterable[str] | None = None) -> Iterator[Use]:
    """Yield all names in the files at `paths`, by default in all."""
    wanted = None if paths is None else {*paths}
    for message in state.messages:
        path = message.location.path
        if wanted is None or path in wanted:
            yield from _of_message(message, state.lines(path))
    for path, entries in state.lists:
        if state.catalog and (wanted is None or path in wanted):
            yield from _of_list(state.catalog.package, entries, state.lines(path))


def at(state: State, path: str, line: int, column: int) -> Use | None:
    """Return what stands at a place, None for nothing with a name."""
    found = (use for use in uses(state, [path]) if use.span.start < use.span.end and use.span.covers(line, column))
    return next(found, None)


def _of_message(message: Message, lines: Sequence[str]) -> Iterator[Use]:
    path = message.location.path
    if message.folder == "msg":
        yield Use(Name(Kind.MESSAGE, message.key), Span(path, 1, 1, 1), is_definition=True)
    for topic in message.topics:
        line, column = topic.location.line, topic.location.column
        word = _word(lines, line, column, r"\S+")
        yield Use(Name(Kind.TOPIC, topic.name), Span(path, line, column, column + len(word)), is_definition=True)
    if message.folder == "msg" and not message.topics:
        yield Use(Name(Kind.TOPIC, snake_case(message.name)), Span(path, 1, 1, 1), is_definition=True)
    for element in elements(message):
        line, column = element.location.line, element.location.column
        if not element.type.is_primitive:
            spelled = _word(lines, line, column, r"[\w/]+")
            span = Span(path, line, column, column + len(spelled)).in_last(element.type.name)
            yield Use(Name(Kind.MESSAGE, message.key_of(element.type)), span)
        end = element.name_column + len(element.name)
        span = Span(path, line, element.name_column, end)
        kind = Kind.FIELD if isinstance(element, Field) else Kind.CONSTANT
        yield Use(Name(kind, element.name, message.key), span, is_definition=True)
    yield from _in_tags(message, lines)


def elements(message: Message) -> list[Field | Constant]:
    """Return the fields and the constants of a message, in the order of its lines."""
    found: list[Field | Constant] = [*message.fields, *message.constants]
    return sorted(found, key=lambda each: each.location)


def _word(lines: Sequence[str], line: int, column: int, pattern: str) -> str:
    text = lines[line - 1][column - 1 :] if line <= len(lines) else ""
    found = re.match(pattern, text)
    return found[0] if found else ""


def _in_tags(message: Message, lines: Sequence[str]) -> Iterator[Use]:
    """Yield the constants, prefixes and fields that the tags of a message name."""
    path = message.location.path
    constants = {each.name for each in message.constants}
    fields = {each.name for each in message.fields}
    for number, line in enumerate(lines, 1):
        if "[@" not in line:
            continue
        for tag in _TAG.finditer(line):
            for word in _WORD.finditer(tag[2]):
                start = tag.start(2) + word.start() + 1
                span = Span(path, number, start, start + len(word[0]))
                if tag[1] == "enum":
                    yield Use(Name(Kind.ENUM, word[0], message.key), span)
                elif word[0] in constants:
                    yield Use(Name(Kind.CONSTANT, word[0], message.key), span)
                elif tag[1] == "frame" and word[0] in fields:
                    yield Use(Name(Kind.FIELD, word[0], message.key), span)


def _of_list(package: str, found: Iterable[BridgeEntry], lines: Sequence[str]) -> Iterator[Use]:
    entries = sorted(found, key=lambda entry: entry.location)
    for entry, after in zip(entries, [*entries[1:], None], strict=False):
        topic = _part(lines, entry.location.line, entry.location.column, entry.uorb_topic, entry.topic)
        if topic:
            yield Use(Name(Kind.TOPIC, entry.uorb_topic), topic._replace(path=entry.location.path))
        place = entry.type_location
        type_ = _part(lines, place.line, place.column, entry.message_name, entry.type_name)
        owner = f"{package}/{entry.message_name}"
        if type_:
            yield Use(Name(Kind.MESSAGE, owner), type_._replace(path=place.path))
        if entry.route_field:
            end = after.location.line if after else len(lines) + 1
            yield from _route(entry, owner, lines, end)


def _part(lines: Sequence[str], line: int, column: int, last: str, whole: str) -> Span | None:
    """Return the part of a YAML scalar that has its last component; None if the scalar is not written plainly."""
    text = lines[line - 1] if line <= len(lines) else ""
    start = text.find(whole, column - 1)
    return Span("", line, start + 1, start + len(whole) + 1).in_last(last) if start >= 0 else None


def _route(entry: BridgeEntry, owner: str, lines: Sequence[str], end: int) -> Iterator[Use]:
    for number in range(entry.location.line, end):
        found = _ROUTE.search(lines[number - 1]) if number <= len(lines) else None
        if found and found[1] == entry.route_field:
            span = Span(entry.location.path, number, found.start(1) + 1, found.end(1) + 1)
            yield Use(Name(Kind.FIELD, found[1], owner), span)
            return


def definitions(state: State, name: Name) -> list[Span]:
    """Return where a name is defined. That of a prefix is where its constants are."""
    owners = [each for each in state.messages if each.key == (name.owner or name.text)]
    if name.kind is Kind.ENUM:
        found = [each for owner in owners for each in owner.constants if each.name.startswith(f"{name.text}_")]
        return [
            Span(each.location.path, each.location.line, each.name_column, each.name_column + len(each.name))
            for each in found
        ]
    paths = None if name.kind is Kind.TOPIC else [each.location.path for each in owners]
    return [use.span for use in uses(state, paths) if use.is_definition and use.name == name]
