"""The archived version of a message, a definition in `px4_msgs_old` such as `VehicleStatusV1.msg`.

That package has only archived versions. The messages that a definition nests are therefore archived with it, and it
refers to them by their archived names: ArmingCheckReplyV0 nests EventV0.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from msggen.base.diagnostics import InputError
from msggen.definitions.model import DEFAULT_PACKAGE, VERSION, Message
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.parse.text import decode_text
from msggen.sources.history import archived_name
from msggen.sources.tree import Tree

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
