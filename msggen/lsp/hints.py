"""The hints that an editor shows between the words: offsets of fields, and the values of enums."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from msggen.definitions.enumeration import enumerations
from msggen.lsp.project import State

_MOST = 4
"""The number of members of an enum in a hint."""


class Hint(NamedTuple):
    """A text to show behind the name at a line and a column, which count from 1. `tip` is shown on request."""

    line: int
    column: int
    text: str
    tip: str = ""


def hints(state: State, path: str) -> Iterator[Hint]:
    """Yield the hints in a definition."""
    for each in state.in_file(path):
        message = state.complete(each)
        layout = state.layout(message)
        extents = layout.extents() if layout else {}
        enums = {name: enum for enum in enumerations(message) for name in enum.fields}
        for field in message.fields:
            parts = [f"@{extents[field.name][0]}"] if field.name in extents else []
            tip = ""
            if enum := enums.get(field.name):
                members = [f"{member.value} {member.name}" for member in enum.members]
                parts.append(", ".join(members[:_MOST]) + ("…" if len(members) > _MOST else ""))
                tip = "\n".join(members)
            if parts:
                yield Hint(field.location.line, field.name_column + len(field.name), " ".join(parts), tip)
