"""Definitions as the rules see them: fields and constants with their comments, and the lines of the file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from msggen.base.location import Location
from msggen.check.finding import Change, Excerpt
from msggen.definitions.model import Catalog, Comment, Constant, Field, Message
from msggen.definitions.parse.parameters import description, parameters
from msggen.definitions.parse.text import decode_text
from msggen.sources.finding import Sources
from msggen.sources.inferred import Inference

_FARTHEST = 50
"""The number of lines of a comment in which a tag is searched for its location."""


class Remark(NamedTuple):
    """A comment and the field or constant that it belongs to. `title` names them in messages.

    The comment of a command has the comments of its parameters, each after a `|`. They are remarks as well.
    """

    title: str
    element: Field | Constant
    comment: Comment


@dataclass(frozen=True, eq=False)
class Definition:
    """A message, or half of a service.

    `message` has the tags of the definition only, `inferred` also those that msggen knows from its sentences and from
    embedded releases. `lines` are those of the file.
    """

    catalog: Catalog
    message: Message
    inferred: Message
    lines: tuple[str, ...]

    @property
    def names(self) -> tuple[str, str]:
        """The file name, with and without its suffix: the name of the message or service."""
        name = os.path.basename(self.message.location.path)
        return name, os.path.splitext(name)[0]

    @cached_property
    def remarks(self) -> tuple[Remark, ...]:
        """All comments of fields, constants and parameters of commands."""
        return tuple(self._remarks())

    def _remarks(self) -> Iterator[Remark]:
        for field in self.message.fields:
            yield Remark(f"'{field.name}'", field, field.comment)
        for constant in self.message.constants:
            yield Remark(f"'{constant.name}'", constant, constant.comment._replace(text=description(constant)))
            for each in parameters(constant):
                yield Remark(f"parameter {each.number} of '{constant.name}'", constant, each.comment)

    def change(self, element: Field | Constant, message: str, text: str = "") -> Change:
        """Return what a rule found at `text` in the comment of `element`, or at `element` itself."""
        return self._change(self._place(element, text), message, element.name)

    def change_of_all(self, message: str) -> Change:
        """Return what a rule found about the whole message."""
        start = next((each.location.line for each in self.message.fields), 1)
        return self._change(Location(self.message.location.path, start if self.message.folder == "srv" else 1), message)

    def _change(self, location: Location, message: str, *names: str) -> Change:
        line = self.lines[location.line - 1] if location.line <= len(self.lines) else ""
        excerpt = Excerpt(location._replace(column=1), " ".join(line.split()))
        return Change(self.message.name, message, location, after=excerpt, names=names)

    def _place(self, element: Field | Constant, text: str) -> Location:
        """Return the location of `text` in the comment after, above or below an element, or that of the element."""
        line = element.location.line
        numbers = [line, *self._comments(line, -1), *self._comments(line, 1)] if text else []
        for wanted in (text, text.partition(" ")[2]):  # a range may have no tag: [0, 1]
            for number in numbers if wanted else ():
                whole = self.lines[number - 1]
                column = whole.find(wanted, whole.find("#"))
                if column >= 0:
                    return Location(element.location.path, number, column + 1)
        return element.location

    def _comments(self, line: int, step: int) -> Iterator[int]:
        """Yield the numbers of the nearest lines to `line` that have only a comment."""
        for number in range(line + step, line + (_FARTHEST + 1) * step, step):
            if not (1 <= number <= len(self.lines) and self.lines[number - 1].lstrip().startswith("#")):
                return
            yield number


def definitions_of(sources: Sources, catalog: Catalog, contents: Mapping[str, bytes]) -> Iterator[Definition]:
    """Yield the messages and the halves of services of the user, or else those of the embedded release.

    `catalog` and `contents` are what `sources` have. Definitions of other packages are left out.
    """
    files = [file for file in (*sources.messages, *sources.services) if not file.package]
    own = [file for file in files if not (sources.embedded and file.tree is sources.root)] or files
    lines = {file.path: tuple(decode_text(contents[file.path], file.path)[0].split("\n")) for file in own}
    inference = Inference(sources)
    halves = [half for service in catalog.own_services for half in (service.request, service.response)]
    for message in (*catalog.uorb_messages, *halves):
        if message.location.path in lines:
            yield Definition(catalog, message, inference.message(message), lines[message.location.path])
