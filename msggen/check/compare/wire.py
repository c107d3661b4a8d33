"""WIRE rules, changes of the bytes of a message, and HASH rules: the same bytes under other names.

The firmware's compatibility check rejects both.
"""

from __future__ import annotations

from collections.abc import Iterator

from msggen.base.location import Location
from msggen.check.compare.comparison import Comparison, FieldPair, MessagePair, has_same_length, meaning, spelled
from msggen.check.finding import Change, Excerpt
from msggen.definitions.layout import Layout
from msggen.definitions.model import Field, Message


def find_added(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields that the previous side does not have."""
    for pair in comparison.changed:
        for field in pair.added:
            where = _at(pair.current_layout, field)
            text = f"'{_line(pair.current, field)}'{where} is not in {comparison.previous.label}"
            twin = next((each.previous for each in pair.replaced if each.current == field), None)
            hint = f", which has '{twin.name}' there: was it renamed?" if twin else ""
            after = excerpt(pair.current, field)
            yield Change(pair.name, text + hint, field.location, after=after, names=(field.name,))


def find_removed(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields that the current side does not have."""
    for pair in comparison.changed:
        for field in pair.removed:
            where = _at(pair.previous_layout, field)
            text = f"'{_line(pair.previous, field)}'{where} of {comparison.previous.label} is missing"
            twin = next((each.current for each in pair.replaced if each.previous == field), None)
            hint = f", '{twin.name}' is there: was it renamed?" if twin else ""
            before = excerpt(pair.previous, field)
            yield Change(pair.name, text + hint, _neighbour(pair, field), before=before, names=(field.name,))


def find_moved(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields that are in another order."""
    for pair in comparison.changed:
        for moved in pair.moved:
            before = _after(pair.previous, moved.previous) + _at(pair.previous_layout, moved.previous)
            after = _after(pair.current, moved.current) + _at(pair.current_layout, moved.current)
            text = f"'{moved.current.name}' comes {after}, but {before} in {comparison.previous.label}"
            yield change(pair, moved, text)


def find_retyped(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields with another type, apart from the length of an array."""
    for pair in comparison.changed:
        for kept in pair.kept:
            if not is_same_type(pair, kept) and not is_type_renamed(pair, kept):
                yield change(pair, kept, _other_type(comparison, pair, kept))


def find_other_length(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields with another array length or bound, or that changed between a single value and an array."""
    for pair in comparison.changed:
        for kept in pair.kept:
            if not has_same_length(kept) and (is_same_type(pair, kept) or is_type_renamed(pair, kept)):
                yield change(pair, kept, _other_type(comparison, pair, kept))


def find_nested(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields of the same type that nest a message, at any depth, with another layout or other types."""
    for pair in comparison.changed:
        for nested in (*pair.kept, *pair.renamed):
            inner = pair.nested.get(nested.previous.name)
            if inner and is_same_type(pair, nested) and not inner.is_only_renamed:
                text = (
                    f"'{_line(pair.current, nested.current)}' nests another layout than in {comparison.previous.label}"
                )
                yield change(pair, nested, f"{text}: {' > '.join(_path(inner))}{_sizes(inner)}")


def find_renamed(comparison: Comparison) -> Iterator[Change]:
    """Yield the renamed fields."""
    for pair in comparison.changed:
        for renamed in pair.renamed:
            text = f"'{renamed.current.name}' is called '{renamed.previous.name}' in {comparison.previous.label}"
            yield change(pair, renamed, text)


def find_renamed_type(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields whose type has another name, but the same values in the same bytes."""
    for pair in comparison.changed:
        for kept in pair.kept:
            if is_type_renamed(pair, kept):
                text = f"'{kept.current.name}' is {kept.current.type}, but {kept.previous.type}"
                yield change(pair, kept, f"{text} in {comparison.previous.label}: the bytes are the same")


def find_nested_names(comparison: Comparison) -> Iterator[Change]:
    """Yield the fields of the same type that nest, at any depth, a field or type with another name."""
    for pair in comparison.changed:
        for kept in (*pair.kept, *pair.renamed):
            inner = pair.nested.get(kept.previous.name)
            if inner and is_same_type(pair, kept) and inner.differs and inner.is_only_renamed:
                names = " > ".join(_renamed_path(inner))
                text = (
                    f"'{kept.current.type} {kept.current.name}' nests other names than in {comparison.previous.label}"
                )
                yield change(pair, kept, f"{text}: {names}")


def change(pair: MessagePair, fields: FieldPair, text: str) -> Change:
    """Return a change of a field that both sides have."""
    before, after = excerpt(pair.previous, fields.previous), excerpt(pair.current, fields.current)
    names = (fields.previous.name, fields.current.name)
    return Change(pair.name, text, fields.current.location, before=before, after=after, names=names)


def excerpt(message: Message, field: Field) -> Excerpt:
    """Return the line that defines a field."""
    return Excerpt(field.location, _line(message, field))


def is_same_type(pair: MessagePair, fields: FieldPair) -> bool:
    """Whether both definitions spell the type of the field alike, apart from the length of an array."""
    before, after = spelled(pair.previous, fields.previous.type), spelled(pair.current, fields.current.type)
    return before.partition("[")[0] == after.partition("[")[0]


def is_type_renamed(pair: MessagePair, fields: FieldPair) -> bool:
    """Whether the types have different names, but the same values in the same bytes."""
    if is_same_type(pair, fields):
        return False
    inner = pair.nested.get(fields.previous.name)
    if inner:
        return inner.is_only_renamed
    before, after = fields.previous.type, fields.current.type
    return before.is_primitive and after.is_primitive and meaning(before) == meaning(after)


def _line(message: Message, field: Field) -> str:
    return f"{spelled(message, field.type)} {field.name}"


def _other_type(comparison: Comparison, pair: MessagePair, fields: FieldPair) -> str:
    before, after = spelled(pair.previous, fields.previous.type), spelled(pair.current, fields.current.type)
    return f"'{fields.current.name}' is {after}, but {before} in {comparison.previous.label}"


def _at(layout: Layout | None, field: Field) -> str:
    return f" at byte {layout.extents()[field.name][0]}" if layout else ""


def _after(message: Message, field: Field) -> str:
    index = message.fields.index(field)
    return f"after '{message.fields[index - 1].name}'" if index else "first"


def _sizes(pair: MessagePair) -> str:
    before, after = pair.previous_layout, pair.current_layout
    return f", {after.size} bytes instead of {before.size}" if before and after and before.size != after.size else ""


def _path(pair: MessagePair) -> list[str]:
    """Return the names of the messages from `pair` down to the first one whose own fields changed."""
    own = pair.added or pair.removed or pair.moved or not all(is_same_type(pair, kept) for kept in pair.kept)
    deeper = () if own else (inner for inner in pair.nested.values() if not inner.is_only_renamed)
    return [pair.name, *next((_path(inner) for inner in deeper), [])]


def _neighbour(pair: MessagePair, field: Field) -> Location:
    """Return the location on the current side of the nearest field before a removed one, or of the file."""
    before = pair.previous.fields[: pair.previous.fields.index(field)]
    current = {kept.previous: kept.current.location for kept in (*pair.kept, *pair.renamed)}
    return next((current[earlier] for earlier in reversed(before) if earlier in current), pair.current.location)


def _renamed_path(pair: MessagePair) -> list[str]:
    deeper = () if pair.renamed else (inner for inner in pair.nested.values() if inner.differs)
    return [pair.name, *next((_renamed_path(inner) for inner in deeper), [])]
