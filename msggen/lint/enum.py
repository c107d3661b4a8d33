"""Constants that are the values of no field."""

from __future__ import annotations

from collections.abc import Iterator

from msggen.diagnostics import counted
from msggen.enumeration import Prefixes, constant_prefixes, enumerations, integer_constants
from msggen.finding import Change
from msggen.lint.definition import Definition
from msggen.model import Constant, Message


def find_unused(definition: Definition) -> Iterator[Change]:
    """Yield each group of constants that no field has as its enum, by a tag or by its name.

    A group has the same first words. A constant alone is a limit or a size, not a value.
    """
    own = _own(definition)
    used = Prefixes(prefix for each in enumerations(own) for prefix in each.prefixes)
    left: dict[str, list[Constant]] = {}
    for constant in integer_constants(own):
        if not used.longest(constant.name):
            left.setdefault(constant.name.partition("_")[0], []).append(constant)
    for constants in left.values():
        if len(constants) > 1:
            prefix = _common([constant.name for constant in constants])
            title = f"'{prefix}_*' ({counted(len(constants), 'constant')})"
            yield definition.change(constants[0], f"no field has the enum of {title}{_hint(definition, prefix)}")


def _own(definition: Definition) -> Message:
    """Return the message with the enums of its definition, and those that fields have by their names."""
    fields = (
        known if known.comment.origin("enum") == "name" else field
        for field, known in zip(definition.message.fields, definition.inferred.fields, strict=True)
    )
    return definition.message._replace(fields=tuple(fields))


def _common(names: list[str]) -> str:
    """Return the words that all names start with."""
    words = [name.split("_")[:-1] for name in names]
    count = next((end for end in range(min(map(len, words)), 0, -1) if len({*map(tuple, _cut(words, end))}) == 1), 1)
    return "_".join(names[0].split("_")[:count])


def _cut(words: list[list[str]], end: int) -> list[list[str]]:
    return [each[:end] for each in words]


def _hint(definition: Definition, prefix: str) -> str:
    """Return the field that has the constants in an embedded release."""
    for field in definition.inferred.fields:
        tag = field.comment.tag("enum")
        origin = field.comment.origin("enum")
        if origin.startswith("embedded ") and prefix in constant_prefixes(definition.message, tag):
            return f": '{field.name}' has '[@enum {tag}]' in msggen's {origin.removeprefix('embedded ')}"
    return ""
