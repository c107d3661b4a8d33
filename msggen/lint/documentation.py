"""Messages and fields without a description."""

from __future__ import annotations

from collections.abc import Iterator

from msggen.diagnostics import few
from msggen.finding import Change
from msggen.lint.definition import Definition


def find_missing(definition: Definition) -> Iterator[Change]:
    """Yield the message if it has no comment, and once the fields that have none."""
    if not definition.message.comment and definition.message.folder == "msg":
        yield definition.change_of_all(f"'{definition.message.name}' has no description")
    fields = [field for field in definition.message.fields if not field.comment.text]
    if fields:
        names = few([f"'{field.name}'" for field in fields])
        yield definition.change(fields[0], f"no description: {names}")
