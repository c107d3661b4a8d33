"""Fields of single definitions: descriptions, constants of enums, units, and padding."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from msggen.base.diagnostics import counted, few
from msggen.check.finding import Change
from msggen.check.lint.definition import Definition
from msggen.check.lint.frame import joined
from msggen.definitions.enumeration import Prefixes, constant_prefixes, enumerations, integer_constants
from msggen.definitions.layout import is_static, lay_out
from msggen.definitions.model import Catalog, Constant, Field, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.unit import normalized_unit


def find_undocumented(definition: Definition) -> Iterator[Change]:
    """Yield the message if it has no comment, and once the fields that have none."""
    if not definition.message.comment and definition.message.folder == "msg":
        yield definition.change_of_all(f"'{definition.message.name}' has no description")
    fields = [field for field in definition.message.fields if not field.comment.text]
    if fields:
        names = few([f"'{field.name}'" for field in fields])
        yield definition.change(fields[0], f"no description: {names}")


def find_unused_constants(definition: Definition) -> Iterator[Change]:
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


def find_avoidable_padding(definition: Definition) -> Iterator[Change]:
    """Yield the message if its samples are smaller with the fields sorted by alignment, the largest first.

    Sizes are compared after rounding up to a multiple of 4, because DDS rounds samples up.
    """
    catalog, message = definition.catalog, definition.message
    if not is_static(catalog, message):
        return
    ordered = sorted_by_alignment(catalog, message)
    size, least = (_size(catalog, each) for each in (message, message._replace(fields=ordered)))
    if least < size:
        first = next(field for field, best in zip(message.fields, ordered, strict=True) if field is not best)
        best = ordered[message.fields.index(first)]
        text = f"samples have {size} bytes, but {least} if the fields are sorted by alignment"
        yield definition.change(first, f"{text}: put '{best.name}' before '{first.name}'")


def sorted_by_alignment(catalog: Catalog, message: Message) -> tuple[Field, ...]:
    """Return the fields of a static message with the largest alignment first, which needs the least padding."""
    alignments = {field.name: _alignment(catalog, message, field) for field in message.fields}
    return tuple(sorted(message.fields, key=lambda field: -alignments[field.name]))


def _size(catalog: Catalog, message: Message) -> int:
    return -(-lay_out(catalog, message).size // 4) * 4


def _alignment(catalog: Catalog, message: Message, field: Field) -> int:
    if field.type.is_primitive:
        return PRIMITIVES[field.type.name].size
    nested = catalog.nested(message, field.type)
    return max(_alignment(catalog, nested, each) for each in nested.fields)


def find_inconsistent_units(definition: Definition) -> Iterator[Change]:
    """Yield the fields without the unit that most of the fields joined to them have, in a tag or in a sentence."""
    units = {
        field.name: field.comment.tag("unit")
        for field in definition.inferred.fields
        if field.comment.origin("unit") in ("tag", "prose")
    }
    for fields in joined(definition.message):
        counts = Counter(normalized_unit(units[field.name]) for field in fields if field.name in units)
        if not counts:
            continue
        usual = counts.most_common(1)[0][0]
        model = next(field for field in fields if normalized_unit(units.get(field.name, "")) == usual)
        for field in fields:
            own = units.get(field.name, "")
            if normalized_unit(own) != usual:
                has = f"is in [{own}]" if own else "has no unit"
                text = f"'{field.name}' {has}, but '{model.name}' is in [{units[model.name]}]"
                yield definition.change(field, text, f"[{field.comment.unit}" if field.comment.unit else "")
