"""The inputs for a new version of a message: the old and the new definition, and the archive of the tree.

An archived version is a definition in `px4_msgs_old` such as `VehicleStatusV1.msg`. That package has only archived
versions. The messages that a definition nests are therefore archived with it, and it refers to them by their archived
names: ArmingCheckReplyV0 nests EventV0.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

from msggen.base.diagnostics import InputError
from msggen.definitions.model import DEFAULT_PACKAGE, VERSION, Catalog, Message, Value
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.parse.text import decode_text
from msggen.generate.bump.header import Side, header_name, topic_of
from msggen.sources.finding import find_sources
from msggen.sources.history import VERSIONED, archived_name, read_history
from msggen.sources.inferred import Inference
from msggen.sources.tree import Folder, Tree

_FOLDERS = ("msg/versioned/", "msg/", "versioned/", "")
"""The folders of definitions in a tree, a package or a bare folder."""


class Definition(NamedTuple):
    """A message and the text that it was read from, with its original line ends."""

    message: Message
    text: str


def read_definition(tree: Tree, name: str) -> Definition | None:
    """Return the definition of the message `name` in `tree`, or None if it is missing.

    Raises InputError if it has errors.
    """
    path = next((folder + f"{name}.msg" for folder in _FOLDERS if tree.is_file(f"{folder}{name}.msg")), None)
    if path is None:
        return None
    return parse_definition(tree.read(path), tree.place(path), name, DEFAULT_PACKAGE)


def parse_definition(data: bytes, place: str, name: str, package: str) -> Definition:
    """Return the definition in `data`. Raises InputError if it has errors; CR LF line ends are accepted."""
    text, unclean = decode_text(data, place)
    message, wrong = parse_message(text, place, name, package)
    errors = [*(found for found in unclean if found.code != "M106"), *wrong]
    if errors:
        raise InputError(errors)
    return Definition(message, data.decode())


def read_nested(tree: Tree, outer: Message) -> dict[str, Definition]:
    """Return the definitions in `tree` of all messages that `outer` nests, at any depth, by name."""
    found: dict[str, Definition] = {}
    waiting = [outer]
    while waiting:
        for field in waiting.pop().fields:
            inner = None if field.type.is_primitive or field.type.name in found else field.type.name
            definition = read_definition(tree, inner) if inner else None
            if inner and definition:
                found[inner] = definition
                waiting.append(definition.message)
    return found


def archive(outer: Definition, nested: dict[str, Definition]) -> dict[str, str]:
    """Return the archived texts of `outer` and of all messages that it nests, by archived name.

    Only the names of nested types differ from the old text. A message without a version gets version 0, because the
    translation header reads the constant.
    """
    renamed = {name: archived_name(definition.message) for name, definition in nested.items()}
    texts = {archived_name(definition.message): _renamed(definition, renamed) for definition in nested.values()}
    text = _renamed(outer, renamed)
    if not outer.message.is_versioned:
        text = f"uint32 {VERSION} = 0\n{text}"
    return {**texts, archived_name(outer.message): text}


def _renamed(definition: Definition, names: dict[str, str]) -> str:
    lines = definition.text.split("\n")
    for field in definition.message.fields:
        if not field.type.is_primitive and field.type.name in names:
            index = field.location.line - 1
            lines[index] = re.sub(rf"^(\s*){field.type.base}\b", rf"\g<1>{names[field.type.name]}", lines[index])
    return "\n".join(lines)


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
