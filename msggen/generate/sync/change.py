"""Short descriptions of the difference between two texts of a definition."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

from msggen.base.diagnostics import few
from msggen.definitions.model import DEFAULT_PACKAGE, Message
from msggen.definitions.parse.definition import parse_message, parse_service
from msggen.definitions.parse.text import decode_text
from msggen.sources.catalog import is_comparable

COMMENTS, WHITE_SPACE = "only comments", "only white space"
"""Descriptions of a change that affects no field, constant, topic or tag."""


def describe_change(name: str, before: bytes | None, after: bytes) -> str:
    """Return a description of the change in the definition `name`, such as "fields, topics" or COMMENTS.

    A tag whose meaning changed, such as a unit, is named with its old and its new text. Return "" if there is no old
    text, or if one of the texts has errors.
    """
    if before is None:
        return ""
    old, new = (read_halves(name, data, DEFAULT_PACKAGE) for data in (before, after))
    if not old or not new:
        return ""
    aspects: dict[str, Callable[[Message], Any]] = {
        "fields": lambda half: [(str(field.type), field.name, field.default) for field in half.fields],
        "constants": lambda half: {each.name: (str(each.type), each.value) for each in half.constants},
        "topics": lambda half: half.topic_names,
    }
    found = [aspect for aspect, of in aspects.items() if [of(half) for half in old] != [of(half) for half in new]]
    tags = [text for halves in zip(old, new, strict=True) for text in _tag_changes(*halves)]
    found += [few(tags)] if tags else []
    is_same_text = b"".join(before.split()) == b"".join(after.split())
    return ", ".join(found) or (WHITE_SPACE if is_same_text else COMMENTS)


def _tag_changes(old: Message, new: Message) -> Iterator[str]:
    fields = {field.name: field for field in old.fields}
    for field in new.fields:
        if field.name in fields:
            for change in fields[field.name].comment.changed_tags(field.comment):
                yield f"{change.title} of '{field.name}' from '{change.before}' to '{change.after}'"


def read_halves(path: str, data: bytes, package: str) -> list[Message]:
    """Return the message in a file, or the request and response of a service. Return [] if the text has errors."""
    text, unclean = decode_text(data, path)
    stem, suffix = os.path.splitext(os.path.basename(path))
    if suffix == ".msg":
        message, errors = parse_message(text, path, stem, package)
        halves = [message]
    else:
        service, errors = parse_service(text, path, stem, package)
        halves = [service.request, service.response]
    return halves if all(map(is_comparable, (*unclean, *errors))) else []
