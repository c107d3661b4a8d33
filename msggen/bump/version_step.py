"""What is known before a message gets a new version: both definitions, and what the tree has of earlier ones."""

from __future__ import annotations

import re
import shlex
from typing import NamedTuple

from msggen.bump.archived_version import Definition, read_nested
from msggen.bump.header import header_name, topic_of
from msggen.firmware.history import VERSIONED, read_history
from msggen.firmware.tree import Folder, Tree
from msggen.model import VERSION, Catalog, Message

AS_IT_STANDS = "the file as it stands, for there is no git repository"
"""Where the old definition is read without a repository."""

CONSTANT = re.compile(rf"^([ \t]*\w+[ \t]+{VERSION}[ \t]*=[ \t]*)([^\s#]+)", re.MULTILINE)
"""The line of MESSAGE_VERSION, up to its value."""


class Previous(NamedTuple):
    """Where the old definitions are, what to call it, and the option that names it."""

    tree: Tree
    label: str
    option: str = ""


class VersionStep:
    """The step from the message `old`, as it was in the tree `previous`, to `new`, and what there is to know for it."""

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
        """The file of the message."""
        return f"{VERSIONED}/{self.new.name}.msg"

    def text(self, path: str) -> str:
        """Return a text as it stands, whatever its encoding: it is written back so."""
        return self.tree.read(path).decode("utf-8", "surrogateescape")


def fields_of(message: Message) -> list[tuple[str, str]]:
    """Return type and name of each field."""
    return [(str(field.type), field.name) for field in message.fields]
