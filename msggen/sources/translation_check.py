"""Comparison of a translation header with the definitions of the two versions that it translates."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from typing import NamedTuple

from msggen.base.diagnostics import suggestion
from msggen.definitions.model import ARCHIVE_PACKAGE, DEFAULT_PACKAGE, VERSION, Field, Message
from msggen.definitions.parse.translation import Reference, TranslationClass, read_classes
from msggen.definitions.translation import Assignment, Branch, Expression, Loop, Number, Operation, Place, Statement
from msggen.sources.history import archived_name, without_comments

TODO = "TODO"
"""The mark of a line that needs a decision."""

_WORD = re.compile(r"\w+")


class Version(NamedTuple):
    """A version of a message, and the function that returns the message that one of its fields nests."""

    message: Message
    nested: Callable[[Message, Field], Message | None]
    is_current: bool = False

    @property
    def key(self) -> str:
        """The message as translations name it, such as `px4_msgs_old/EventV0`."""
        if self.is_current:
            return f"{DEFAULT_PACKAGE}/{self.message.name}"
        known = self.message.package == ARCHIVE_PACKAGE
        return f"{ARCHIVE_PACKAGE}/{self.message.name if known else archived_name(self.message)}"


class Problem(NamedTuple):
    """A problem in a line of a header."""

    line: int
    text: str
    names: tuple[str, ...] = ()
    """The fields that it is about, of both versions."""


class Assigned(NamedTuple):
    """The names of the fields that a header sets: those that it only copies, and those that it computes."""

    copied: frozenset[str]
    computed: frozenset[str]


def unknown_names(text: str, older: Version, newer: Version) -> Iterator[Problem]:
    """Yield the fields and constants that a header names but the version does not have, each once."""
    found: dict[str, Problem] = {}
    for each in _classes(text, older, newer):
        for reference in each.references:
            problem = _problem(reference, older if reference.is_older else newer)
            if problem:
                found.setdefault(reference.text, Problem(reference.line, problem))
    yield from found.values()


def unfinished_lines(text: str) -> list[int]:
    """Return the numbers of the lines marked TODO."""
    return [number for number, line in enumerate(text.split("\n"), 1) if TODO in line]


def unfinished_names(text: str) -> frozenset[str]:
    """Return the words in the lines marked TODO. If such a line is only a comment, the words of the next line too."""
    lines = text.split("\n")
    found: set[str] = set()
    for number in unfinished_lines(text):
        line = lines[number - 1]
        is_comment = not without_comments(line).strip()
        found.update(_WORD.findall(" ".join(lines[number - 1 : number + 1]) if is_comment else line))
    return frozenset(found)


def missing_fields(text: str, older: Message, newer: Message) -> list[str]:
    """Return the names of the fields of both messages that a header does not mention."""
    known = set(_WORD.findall(without_comments(text)))
    names = dict.fromkeys(field.name for message in (newer, older) for field in message.fields)
    return [name for name in names if name not in known]


def assigned(text: str, older: Version, newer: Version) -> Assigned:
    """Return the fields that a header sets in both directions together.

    A field that one direction only copies is copied. The fields of a function that cannot be read are not known.
    """
    copied: set[str] = set()
    computed: set[str] = set()
    for each in _classes(text, older, newer):
        for statements in (each.translation.from_older, each.translation.to_older):
            for assignment in _assignments(statements or ()):
                is_copy = isinstance(assignment.value, Place) and not assignment.value.is_target
                (copied if is_copy else computed).add(assignment.target.field)
    return Assigned(frozenset(copied), frozenset(computed - copied))


def lost_values(text: str, older: Version, newer: Version, renamed: Mapping[str, str]) -> Iterator[Problem]:
    """Yield the fields that a direction only sets to a constant, although the other version has their value.

    It has a field of the same name, or the same field by another name: `renamed` has the newer names by the older ones.
    """
    before, after = ({field.name for field in version.message.fields} for version in (older, newer))
    pairs = {name: name for name in before & after}
    pairs |= {old: new for old, new in renamed.items() if old in before - after and new in after - before}
    for each in _classes(text, older, newer):
        from_older = _constant_fields(each.translation.from_older)
        to_older = _constant_fields(each.translation.to_older)
        for old, new in pairs.items():
            found = [("newer", new, "older", old)] if new in from_older else []
            found += [("older", old, "newer", new)] if old in to_older else []
            for age, name, other_age, other in found:
                named = (at.line for at in each.references if at.is_older == (age == "older") and at.path[0] == name)
                problem = f"sets {age}.{name} to a constant, not from {other_age}.{other}"
                yield Problem(next(named, 1), problem, (old, new))


def _constant_fields(statements: Iterable[Statement] | None) -> set[str]:
    """Return the fields that statements set to constants only. What a condition chooses is no constant."""
    plain = [*_assignments(statements or (), of_branches=False)]
    constant = {each.target.field for each in plain if _is_constant(each.value)}
    others = {each.target.field for each in _assignments(statements or ()) if each not in plain}
    return constant - others - {each.target.field for each in plain if not _is_constant(each.value)}


def _is_constant(value: Expression | None) -> bool:
    if isinstance(value, Operation):
        return all(map(_is_constant, value.operands))
    return isinstance(value, Number)


def _classes(text: str, older: Version, newer: Version) -> Iterator[TranslationClass]:
    for each in _read(text):
        if (each.translation.older, each.translation.newer) == (older.key, newer.key):
            yield each


@lru_cache(maxsize=100)
def _read(text: str) -> tuple[TranslationClass, ...]:
    return read_classes(text)


def _problem(reference: Reference, version: Version) -> str:
    """Return the reason why `version` does not have what a header names, "" if it has it."""
    message: Message | None = version.message
    for name in reference.path:
        if message is None:
            break
        fields = {field.name: field for field in message.fields}
        if name not in fields:
            if name == VERSION or any(constant.name == name for constant in message.constants):
                break
            owner = f"version {version.message.message_version} of '{version.message.name}'"
            if message is not version.message:
                owner = f"'{message.name}' in {owner}"
            return f"'{reference.text}' does not exist: {owner} has no '{name}'{suggestion(name, fields)}"
        field = fields[name]
        message = None if field.type.is_primitive else version.nested(message, field)
    return ""


def _assignments(statements: Iterable[Statement], *, of_branches: bool = True) -> Iterator[Assignment]:
    for each in statements:
        if isinstance(each, Assignment):
            yield each
        elif isinstance(each, Loop):
            yield from _assignments(each.body, of_branches=of_branches)
        elif isinstance(each, Branch) and of_branches:
            yield from _assignments((*each.then, *each.otherwise))
