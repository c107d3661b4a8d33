"""The archived versions of messages in a PX4-Autopilot tree, and the headers that translate between versions.

Both exist since v1.16: `msg/px4_msgs_old/msg/<Name>V<n>.msg` and `msg/translation_node/translations/*.h`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from msggen.base.diagnostics import Diagnostic, InputError, suggestion
from msggen.definitions.model import ARCHIVE_PACKAGE, Message
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.parse.text import decode_text
from msggen.definitions.primitives import PRIMITIVES
from msggen.sources import tree_layout
from msggen.sources.catalog import ARCHIVED_NAME, is_comparable
from msggen.sources.tree import Tree

VERSIONED = "msg/versioned"
ARCHIVE = f"msg/{tree_layout.ARCHIVE}"
TRANSLATIONS = f"msg/{tree_layout.TRANSLATIONS}"
ALL_TRANSLATIONS = f"{TRANSLATIONS}/all_translations.h"

_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"\n]+)"', re.MULTILINE)
_HEADER = re.compile(r"translation_\w+_v\d+\.h")
_COMMENT = re.compile(r"//[^\n]*|/\*.*?(?:\*/|\Z)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class History:
    """The archived versions of a tree and their translations.

    `archived` has messages such as `VehicleStatusV0` by name. `translations` has the texts of the headers that
    `all_translations.h` includes, by file name, and `folder` is the path of their folder. `includes` is the text of
    `all_translations.h`, and `missing` has the names of translation headers that it includes but that do not exist.
    `is_kept` is True if the tree has versioned messages. `is_translated` is True if every archived version is assumed
    to be translated, by a header that is not in `translations`.
    """

    is_kept: bool
    archived: Mapping[str, Message]
    translations: Mapping[str, str]
    is_translated: bool = False
    folder: str = TRANSLATIONS
    includes: str = ""
    missing: tuple[str, ...] = ()

    def lines(self, header: str) -> list[str]:
        """Return the lines of a header in `translations`, or of `all_translations.h`."""
        return self.translations.get(header, self.includes).split("\n")

    def translates(self, name: str, version: int) -> bool:
        """Return whether a header translates the message `name` between `version` and the current version."""
        return bool(self.translating(name, version))

    def translating(self, name: str, version: int, newer: int | None = None) -> dict[str, str]:
        """Return the headers that translate the message `name` between `version` and `newer`, by file name.

        Without `newer` it is the current version. A header may translate several messages, so headers are found by the
        types that they use, not by their names.
        """
        target = rf"px4_msgs::msg::{name}\b" if newer is None else rf"px4_msgs_old::msg::{name}V{newer}\b"
        types = [re.compile(rf"px4_msgs_old::msg::{name}V{version}\b"), re.compile(target)]
        code = {header: without_comments(text) for header, text in self.translations.items()}
        return {
            header: self.translations[header]
            for header, text in code.items()
            if all(type_.search(text) for type_ in types)
        }


def archived_name(message: Message) -> str:
    """Return the name of this version of a message in the archive, such as `VehicleStatusV0`."""
    return f"{message.name}V{message.message_version}"


def without_comments(text: str) -> str:
    """Return C++ without its comments."""
    return _COMMENT.sub(" ", text)


def read_history(tree: Tree) -> History:
    """Return the archived versions of `tree`. Raises InputError for archived definitions that cannot be read."""
    archived: dict[str, Message] = {}
    errors: list[Diagnostic] = []
    for file in tree.names(ARCHIVE):
        name, dot, suffix = file.partition(".")
        if suffix != "msg" or not dot or not ARCHIVED_NAME.fullmatch(name):
            continue
        path = f"{ARCHIVE}/{file}"
        text, found_in_bytes = decode_text(tree.read(path), tree.place(path))
        archived[name], found_in_text = parse_message(text, tree.place(path), name, ARCHIVE_PACKAGE)
        errors += [found for found in (*found_in_bytes, *found_in_text) if not is_comparable(found)]
    errors += _unknown_types(archived)
    if errors:
        raise InputError(errors)
    includes = tree.read(ALL_TRANSLATIONS).decode(errors="replace") if tree.is_file(ALL_TRANSLATIONS) else ""
    paths = {name: f"{TRANSLATIONS}/{name}" for name in _INCLUDE.findall(without_comments(includes))}
    found = {name: path for name, path in paths.items() if tree.is_file(path)}
    return History(
        is_kept=tree.is_folder(VERSIONED),
        archived=archived,
        translations={name: tree.read(path).decode(errors="replace") for name, path in found.items()},
        folder=tree.place(TRANSLATIONS),
        includes=includes,
        missing=tuple(name for name in paths if name not in found and _HEADER.fullmatch(name)),
    )


def _unknown_types(archived: Mapping[str, Message]) -> Iterator[Diagnostic]:
    """Yield an error for each type that is neither a primitive nor a message name.

    Whether a nested message exists is checked by the rules, not here.
    """
    for message in archived.values():
        for field in message.fields:
            name = field.type.name
            if not field.type.is_primitive and name[:1].islower() and name not in archived:
                text = f"unknown type '{name}'{suggestion(name, [*PRIMITIVES, *archived])}"
                yield Diagnostic(field.location, "M301", text)
