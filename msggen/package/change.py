"""In what two texts of a definition differ, said in a word or two."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from msggen.model import DEFAULT_PACKAGE, Message
from msggen.parse import decode_text, parse_message, parse_service


def describe_change(name: str, before: bytes | None, after: bytes) -> str:
    """Return what changed in the definition `name`: "fields", say, or "only comments"; "" where that cannot be told."""
    if before is None:
        return ""
    old, new = (_halves(name, data) for data in (before, after))
    if not old or not new:
        return ""
    aspects: dict[str, Callable[[Message], Any]] = {
        "fields": lambda half: [(str(field.type), field.name, field.default) for field in half.fields],
        "constants": lambda half: {each.name: (str(each.type), each.value) for each in half.constants},
        "topics": lambda half: half.topic_names,
    }
    found = [aspect for aspect, of in aspects.items() if [of(half) for half in old] != [of(half) for half in new]]
    return ", ".join(found) or "only comments"


def _halves(name: str, data: bytes) -> list[Message]:
    """Return the message, or request and response of a service; nothing where the text has faults."""
    text, unclean = decode_text(data, name)
    stem, suffix = os.path.splitext(os.path.basename(name))
    if suffix == ".msg":
        message, faults = parse_message(text, name, stem, DEFAULT_PACKAGE)
        return [] if faults or unclean else [message]
    service, faults = parse_service(text, name, stem, DEFAULT_PACKAGE)
    return [] if faults or unclean else [service.request, service.response]
