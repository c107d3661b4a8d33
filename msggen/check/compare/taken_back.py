"""Remains of a version that was taken back: archived versions and headers that are not older than their message.

`msggen bump` archives the old definition, writes a header and includes it. If only MESSAGE_VERSION is restored later,
the translation node no longer compiles.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from msggen.base.location import Location
from msggen.check.compare.comparison import Comparison, Side
from msggen.check.finding import Change, Excerpt
from msggen.definitions.model import ARCHIVE_PACKAGE, DEFAULT_PACKAGE
from msggen.definitions.parse.translation import FIRST, read_translations
from msggen.definitions.translation import Translation
from msggen.sources.catalog import ARCHIVED_NAME
from msggen.sources.history import History


def find_remains(comparison: Comparison) -> Iterator[Change]:
    """Yield the archived versions, translations and includes that belong to no older version of a message.

    Those that the previous side has too are left out.
    """
    known = {change.message for change in _remains(comparison.previous)}
    yield from (change for change in _remains(comparison.current) if change.message not in known)


def _remains(side: Side) -> Iterator[Change]:
    history = side.history
    if not history or not history.is_kept:
        return
    classes = [(header, each) for header, text in history.translations.items() for each in read_translations(text)]
    versions = _not_older(side, history, [each for _, each in classes])
    for name in sorted(history.archived.keys() & versions):
        location = history.archived[name].location
        text = f"'{name}' is archived, but '{_message_of(name)}' is version {versions[name]}: delete the file"
        yield Change(_message_of(name), text, location, after=Excerpt(location, f"{name}.msg"))
    for header, each in classes:
        for name in sorted(_archived_in(each) & versions.keys()):
            hint = "delete the header"
            if name == _name(each.newer):
                hint = f"expected {DEFAULT_PACKAGE}::msg::{_message_of(name)}"
            text = f"'{header}' translates '{name}', but '{_message_of(name)}' is version {versions[name]}: {hint}"
            line = _line_with(history, header, f"{ARCHIVE_PACKAGE}::msg::{name};")
            yield in_header(history, header, line, _message_of(name), text)
    names = {message.name.lower(): message.name for message in side.catalog.uorb_messages}
    for header in history.missing:
        snake_case = re.sub(r"^translation_|_v\d+\.h$", "", header)
        subject = names.get(snake_case.replace("_", ""), header)
        text = f"'{FIRST}' includes '{header}', which does not exist: remove the line"
        yield in_header(history, FIRST, _line_with(history, FIRST, f'"{header}"'), subject, text)


def _not_older(side: Side, history: History, classes: Sequence[Translation]) -> Mapping[str, int]:
    """Return the version of the message for each name such as `HomePositionV1` that is not an older version of it.

    The current version may be archived too, if an archived message nests it or another message is translated from it.
    """
    used = {field.type.name for message in history.archived.values() for field in message.fields}
    names = set(history.archived)
    for each in classes:
        names |= _archived_in(each)
        if _message_of(_name(each.older)) != _message_of(_name(each.newer)):
            used |= _archived_in(each)
    found: dict[str, int] = {}
    for name in names:
        parts = ARCHIVED_NAME.fullmatch(name)
        message = side.catalog.messages.get(f"{side.catalog.package}/{_message_of(name)}")
        if parts and message and message.is_versioned:
            ahead = int(parts["version"]) - message.message_version
            if ahead > 0 or (ahead == 0 and name not in used):
                found[name] = message.message_version
    return found


def _archived_in(each: Translation) -> set[str]:
    """Return the archived versions that a class translates, such as `HomePositionV1`."""
    return {_name(key) for key in (each.older, each.newer) if key.startswith(f"{ARCHIVE_PACKAGE}/")}


def _name(key: str) -> str:
    return key.rpartition("/")[2]


def _message_of(name: str) -> str:
    """Return `HomePosition` for `HomePositionV1`, other names as they are."""
    parts = ARCHIVED_NAME.fullmatch(name)
    return parts["message"] if parts else name


def _line_with(history: History, header: str, code: str) -> int:
    """Return the number of the first line of a header that has `code`, or 1."""
    return next((number for number, line in enumerate(history.lines(header), 1) if code in line), 1)


def in_header(history: History, header: str, line: int, subject: str, text: str) -> Change:
    """Return the change `text` of `subject`, in a line of a header."""
    location = Location(f"{history.folder}/{header}", line)
    return Change(subject, text, location, after=Excerpt(location, history.lines(header)[line - 1].strip()))
