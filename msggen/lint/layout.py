"""Padding bytes that another order of the fields saves.

The layout is that of samples in DDS, XCDR1 (docs/wire.md, 3). The firmware's C++ struct has no such padding, because
its generator sorts the fields by size (docs/wire.md, 9).
"""

from __future__ import annotations

from collections.abc import Iterator

from msggen.finding import Change
from msggen.layout import is_static, lay_out
from msggen.lint.definition import Definition
from msggen.model import Catalog, Field, Message
from msggen.primitives import PRIMITIVES


def find_avoidable(definition: Definition) -> Iterator[Change]:
    """Yield the message if its samples are smaller with the fields sorted by alignment, the largest first.

    Sizes are compared after rounding up to a multiple of 4, because DDS rounds samples up.
    """
    catalog, message = definition.catalog, definition.message
    if not is_static(catalog, message):
        return
    alignments = {field.name: _alignment(catalog, message, field) for field in message.fields}
    ordered = sorted(message.fields, key=lambda field: -alignments[field.name])
    size, least = (_size(catalog, each) for each in (message, message._replace(fields=tuple(ordered))))
    if least < size:
        first = next(field for field, best in zip(message.fields, ordered, strict=True) if field is not best)
        best = ordered[message.fields.index(first)]
        text = f"samples have {size} bytes, but {least} if the fields are sorted by alignment"
        yield definition.change(first, f"{text}: put '{best.name}' before '{first.name}'")


def _size(catalog: Catalog, message: Message) -> int:
    return -(-lay_out(catalog, message).size // 4) * 4


def _alignment(catalog: Catalog, message: Message, field: Field) -> int:
    if field.type.is_primitive:
        return PRIMITIVES[field.type.name].size
    nested = catalog.nested(message, field.type)
    return max(_alignment(catalog, nested, each) for each in nested.fields)
