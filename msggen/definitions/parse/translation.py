"""The parser of translation headers: their classes, the messages that these translate, and their functions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

from msggen.definitions.parse.cpp import TooLargeError, closings, included, line_of, numbered_tokens, tokens
from msggen.definitions.parse.statements import Body, OpaqueError
from msggen.definitions.translation import Statement, Translation

FIRST = "all_translations.h"
"""The header that the firmware's translation node includes. It includes the others."""

_MAX_HEAD = 50
"""Maximum number of tokens between `class` and the body, including base classes."""


def read_headers(headers: Mapping[str, str]) -> tuple[Translation, ...]:
    """Return the translations in FIRST and in the headers that it includes, directly or indirectly.

    `headers` has the texts by file name.
    """
    found: dict[str, None] = {}
    waiting = [FIRST]
    while waiting:
        name = waiting.pop()
        if name in headers and name not in found:
            found[name] = None
            waiting += included(headers[name])
    return tuple(chain.from_iterable(read_translations(headers[name]) for name in sorted(found)))


def read_translations(text: str) -> tuple[Translation, ...]:
    """Return the translations of the classes in a header, none if it is not a translation header."""
    try:
        return tuple(each.translation for each in _Header(tokens(text)).classes())
    except TooLargeError:
        return ()


class Reference(NamedTuple):
    """A field or a constant that a header names, such as `older.events[i].id`; `path` has the names without indices."""

    is_older: bool
    text: str
    path: tuple[str, ...]
    line: int


class TranslationClass(NamedTuple):
    """A class in a header, and the fields and constants of both messages that its functions name."""

    translation: Translation
    references: tuple[Reference, ...]


def read_classes(text: str) -> tuple[TranslationClass, ...]:
    """Return the translation classes of a header, none if it is not a translation header."""
    try:
        return tuple(
            TranslationClass(each.translation, tuple(each.references()))
            for each in _Header(numbered_tokens(text)).classes()
        )
    except TooLargeError:
        return ()


class _Function(NamedTuple):
    """A function: the types and names of its two parameters, and its body."""

    source_type: str
    source: str
    target_type: str
    target: str
    body: Sequence[str]


class _Class(NamedTuple):
    """A class: its translation, its functions, and the messages by the names that these use for their types."""

    translation: Translation
    functions: tuple[_Function, ...]
    aliases: Mapping[str, str]

    def references(self) -> Iterator[Reference]:
        """Yield the fields and constants of both messages that the functions name."""
        ages = {self.translation.older: True, self.translation.newer: False}
        types = {name: ages[message] for name, message in self.aliases.items() if message in ages}
        spelled = {**ages, **types}
        for function in self.functions:
            parameters = (function.source, function.source_type), (function.target, function.target_type)
            known = {name: spelled[type_] for name, type_ in parameters if type_ in spelled}
            if len(known) == len(parameters):
                yield from _references(function.body, known, types)


def _references(code: Sequence[str], parameters: Mapping[str, bool], types: Mapping[str, bool]) -> Iterator[Reference]:
    """Yield the fields that `code` names in `parameters`, and the constants in `types`; True stands for the older."""
    end_of = closings(code)
    for position, word in enumerate(code):
        if position and code[position - 1] in (".", "->", "::"):
            continue
        if word in parameters:
            path = tuple(_path(code, position + 1, end_of))
            if path:
                yield Reference(parameters[word], ".".join((word, *path)), path, line_of(word))
        elif word in types and code[position + 1 : position + 2] == ["::"]:
            name = "".join(code[position + 2 : position + 3])
            if name.isupper():  # ROS 2 adds types such as SharedPtr
                yield Reference(types[word], f"{word}::{name}", (name,), line_of(word))


def _path(code: Sequence[str], position: int, end_of: Mapping[int, int]) -> Iterator[str]:
    """Yield the names after a variable, up to the call of a method other than `at`."""
    while position + 1 < len(code) and code[position] in (".", "->") and code[position + 1].isidentifier():
        name = code[position + 1]
        position += 2
        is_call = code[position : position + 1] == ["("]
        if is_call and name != "at":
            return
        if not is_call:
            yield name
        while position < len(code) and code[position] in ("[", "(") and position in end_of:
            position = end_of[position] + 1


class _Header:
    """A reader of the classes in a header and their functions."""

    def __init__(self, code: Sequence[str]) -> None:
        self.code = code
        self.end_of = closings(code)

    def classes(self) -> list[_Class]:
        found: list[_Class] = []
        for position, word in enumerate(self.code):
            if word in ("class", "struct"):
                start = self._body_of_class(position + 1)
                if start is not None:
                    found += self._class(start + 1, self.end_of.get(start, len(self.code)))
        return found

    def _body_of_class(self, position: int) -> int | None:
        """Return the position of the body of the class whose name is at `position`, None if it has no body."""
        for further, word in enumerate(self.code[position : position + _MAX_HEAD]):
            if word == "{":
                return position + further
            if not word.isidentifier() and word not in ("::", ":", ","):
                break
        return None

    def _class(self, position: int, end: int) -> list[_Class]:
        aliases: dict[str, str] = {}
        functions: dict[str, list[_Function]] = {"fromOlder": [], "toOlder": []}
        while position < end:
            word = self.code[position]
            if word == "using" and self.code[position + 2 : position + 3] == ["="]:
                stop = self._next(";", position, end)
                aliases[self.code[position + 1]] = _type_name(self.code[position + 3 : stop])
                position = stop
            elif word in functions and self.code[position + 1 : position + 2] == ["("]:
                function, position = self._function(position + 1, end)
                functions[word] += function
            elif word == "{":
                position = self.end_of.get(position, end)
            position += 1
        older, newer = aliases.get("MessageOlder", ""), aliases.get("MessageNewer", "")
        if not older or not newer:
            return []
        forth = _statements_of(functions["fromOlder"], older, newer, aliases)
        back = _statements_of(functions["toOlder"], newer, older, aliases)
        return [_Class(Translation(older, newer, forth, back), tuple(chain(*functions.values())), aliases)]

    def _function(self, start: int, end: int) -> tuple[list[_Function], int]:
        """Return the function whose parameters begin at `start`, and its end.

        The list is empty unless the function has two parameters and a body.
        """
        stop = self.end_of.get(start, end)
        parameters = _split(self.code[start + 1 : stop], ",")
        if self.code[stop + 1 : stop + 2] != ["{"] or len(parameters) != 2 or not all(parameters):  # noqa: PLR2004
            return [], stop
        last = self.end_of.get(stop + 1)
        if last is None:
            return [], end
        (source, source_type), (target, target_type) = [(part[-1], _type_name(part[:-1])) for part in parameters]
        function = _Function(
            source_type=source_type,
            source=source,
            target_type=target_type,
            target=target,
            body=self.code[stop + 2 : last],
        )
        return [function], last

    def _next(self, word: str, position: int, end: int) -> int:
        while position < end and self.code[position] != word:
            position += 1
        return position


def _statements_of(
    functions: list[_Function], source: str, target: str, aliases: dict[str, str]
) -> tuple[Statement, ...] | None:
    """Return the statements of the function from `source` to `target`, None unless exactly one can be read."""
    fitting = [
        function
        for function in functions
        if aliases.get(function.source_type, function.source_type) == source
        and aliases.get(function.target_type, function.target_type) == target
    ]
    if len(fitting) != 1:
        return None
    types = {name: message == target for name, message in aliases.items() if message in (source, target)}
    function = fitting[0]
    try:
        return Body(function.body, function.source, function.target, types).statements()
    except OpaqueError:
        return None


def _type_name(code: Sequence[str]) -> str:
    """Return `px4_msgs_old/EventV0` for `const px4_msgs_old::msg::EventV0 &`. Other names are not changed."""
    names = [word for word in code if word not in ("const", "&", "::")]
    if len(names) == 3 and names[1] == "msg":  # noqa: PLR2004 - package, folder, name
        return f"{names[0]}/{names[2]}"
    return "::".join(names)


def _split(code: Sequence[str], separator: str) -> list[Sequence[str]]:
    parts: list[list[str]] = [[]]
    for word in code:
        if word == separator:
            parts.append([])
        else:
            parts[-1].append(word)
    return list(parts)
