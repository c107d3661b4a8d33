"""The inputs for a new version of a message: the old and the new definition, and the archive of the tree."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

from msggen.base.diagnostics import InputError
from msggen.definitions.model import VERSION, Catalog, Message, Value
from msggen.generate.bump.archived_version import Definition, read_definition, read_nested
from msggen.generate.bump.header import Side, header_name, topic_of
from msggen.sources.finding import find_sources
from msggen.sources.history import VERSIONED, read_history
from msggen.sources.inferred import Inference
from msggen.sources.tree import Folder, Tree

CURRENT_FILE = "the current file (no git repository)"
"""The label of the old definitions if there is no repository: the files in their current state."""

CONSTANT = re.compile(rf"^([ \t]*\w+[ \t]+{VERSION}[ \t]*=[ \t]*)([^\s#]+)", re.MULTILINE)
"""The line of MESSAGE_VERSION: in two groups, the text before its value, and the value."""


class Previous(NamedTuple):
    """The tree of the old definitions, its name for the user, and the option that selects it."""

    tree: Tree
    label: str
    option: str = ""


class VersionStep:
    """The step from the message `old`, of the tree `previous`, to the message `new`, of the tree `tree`.

    `nested` has the old definitions of all messages that `old` nests, by name. `options` are the options that a command
    on the same tree needs.
    """

    def __init__(self, tree: Folder, catalog: Catalog, previous: Previous, old: Definition, new: Message) -> None:
        self.tree = tree
        self.catalog = catalog
        self.previous = previous
        self.old = old
        self.new = new
        self.options = "" if tree.path == "." else f" --px4 {shlex.quote(tree.path)}"
        self.nested = read_nested(previous.tree, old.message)
        self.history = read_history(tree)
        self.version = old.message.message_version
        self.is_translated = self.history.translates(new.name, self.version)
        self.header = header_name(new.name, self.version + 1)
        self.topics = tuple(
            dict.fromkeys(topic_of(entry) for entry in catalog.bridge if entry.message_name == new.name)
        )

    @property
    def path(self) -> str:
        """The path of the message in the tree."""
        return f"{VERSIONED}/{self.new.name}.msg"

    @cached_property
    def is_unchanged(self) -> bool:
        """Whether the definition and all that it nests have the old texts."""
        return all(
            new is not None and new.text == old.text
            for name, old in {**self.nested, self.new.name: self.old}.items()
            for new in [read_definition(self.tree, name)]
        )

    @cached_property
    def sides(self) -> tuple[Side, Side]:
        """The old and the new message with the tags that can be inferred for them, and the messages that they nest."""
        before, after = _inferred(self.previous.tree), _inferred(self.tree)
        nested = {name: before(definition.message) for name, definition in self.nested.items()}
        inner = {message.name: after(message) for message in self.catalog.nested_all(self.new)}
        return Side("older", before(self.old.message), nested), Side("newer", after(self.new), inner)

    @cached_property
    def means_the_same(self) -> bool:
        """Whether the new definitions have all fields, tags and constants of the old ones; they may add constants."""
        older, newer = self.sides
        pairs = [(older.message, newer.message), *((old, newer.nested.get(name)) for name, old in older.nested.items())]
        return older.message.is_versioned and all(new is not None and _means_the_same(old, new) for old, new in pairs)

    @cached_property
    def added_constants(self) -> tuple[str, ...]:
        """The constants that only the new definitions have."""
        older, newer = self.sides
        olds = {**older.nested, older.message.name: older.message}
        news = {**newer.nested, newer.message.name: newer.message}
        return tuple(
            name
            for each, old in olds.items()
            if each in news
            for name in _constants(news[each])
            if name not in _constants(old)
        )

    def text(self, path: str) -> str:
        """Return the text of a file. Bytes that are not UTF-8 are kept when the text is written back."""
        return self.tree.read(path).decode("utf-8", "surrogateescape")


def fields_of(message: Message) -> list[tuple[str, str]]:
    """Return the type and the name of each field."""
    return [(str(field.type), field.name) for field in message.fields]


def _means_the_same(old: Message, new: Message) -> bool:
    return (
        fields_of(old) == fields_of(new)
        and not any(
            before.comment.changed_tags(after.comment) for before, after in zip(old.fields, new.fields, strict=True)
        )
        and _constants(old).items() <= _constants(new).items()
    )


def _constants(message: Message) -> dict[str, tuple[str, Value]]:
    """Return the type and the value of each constant except MESSAGE_VERSION."""
    return {each.name: (each.type.name, each.value) for each in message.constants if each.name != VERSION}


def _inferred(tree: Tree) -> Callable[[Message], Message]:
    """Return the function that adds the tags that can be inferred. It adds none if `tree` is only a few definitions."""
    try:
        return Inference(find_sources(tree)).message
    except InputError:
        return lambda message: message
