"""The offsets of values in CDR samples (docs/wire.md, 3 and 5).

Only messages whose samples all have the same layout have such offsets. Offsets and alignment count from the first byte
after the encapsulation header, which has four bytes.
"""

from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message
from msggen.definitions.primitives import PRIMITIVES

Path = tuple[tuple[str, int | None], ...]
"""The path to a value: (field name, index in an array of messages or None) for each level, the outermost first."""


class Encoding(Enum):
    """The two plain encodings. They differ in the largest alignment and in the header of arrays of messages."""

    XCDR1 = 8
    XCDR2 = 4

    @property
    def largest_alignment(self) -> int:
        """The largest alignment in bytes."""
        return self.value


class Leaf(NamedTuple):
    """A primitive or an array of primitives: values of `size` bytes each, from `offset`, after `padding` bytes."""

    path: Path
    type: FieldType
    element_count: int
    size: int
    offset: int
    padding: int


class DelimiterHeader(NamedTuple):
    """XCDR2's four bytes before an array of messages: the `size` of the array in bytes (docs/wire.md, 5)."""

    offset: int
    size: int
    padding: int


class Layout(NamedTuple):
    """The layout of a message, including all nested messages."""

    size: int
    items: tuple[Leaf | DelimiterHeader, ...]

    @property
    def leaves(self) -> tuple[Leaf, ...]:
        """The values, without delimiter headers."""
        return tuple(item for item in self.items if isinstance(item, Leaf))

    @property
    def delimiter_headers(self) -> tuple[DelimiterHeader, ...]:
        """The delimiter headers; XCDR1 has none."""
        return tuple(item for item in self.items if isinstance(item, DelimiterHeader))

    def extents(self) -> dict[str, tuple[int, int]]:
        """Return the offset and the size in bytes of each field, including padding inside the field."""
        extents: dict[str, tuple[int, int]] = {}
        for leaf in self.leaves:
            name = leaf.path[0][0]
            offset = extents.get(name, (leaf.offset, 0))[0]
            extents[name] = offset, leaf.offset + leaf.size * leaf.element_count - offset
        return extents


def is_static(catalog: Catalog, message: Message) -> bool:
    """Whether every sample of `message` has the same layout: no strings, sequences, or messages without fields.

    ROS 2 gives a message without fields one byte that holds no value, which a Layout cannot describe.
    """
    return bool(message.fields) and all(
        field.type.is_fixed_size
        and (field.type.is_primitive or is_static(catalog, catalog.nested(message, field.type)))
        for field in message.fields
    )


def lay_out(catalog: Catalog, message: Message, encoding: Encoding = Encoding.XCDR1) -> Layout:
    """Return the layout of `message`, which must be static."""
    writer = _Writer(catalog, encoding)
    writer.message(message, ())
    return Layout(writer.offset, tuple(writer.items))


def struct_size(catalog: Catalog, message: Message) -> int:
    """Return the size in bytes of the firmware's C++ struct, without the padding at its end (docs/wire.md, 9).

    The fields are sorted by size, so only nested messages have padding before them: they come last and are aligned to 8
    bytes.
    """
    primitives = [field.type for field in message.fields if field.type.is_primitive]
    offset = sum(PRIMITIVES[type_.name].size * type_.element_count for type_ in primitives)
    for field in message.fields:
        if not field.type.is_primitive:
            inner = -(-struct_size(catalog, catalog.nested(message, field.type)) // 8) * 8
            offset = -(-offset // 8) * 8 + inner * field.type.element_count
    return offset


def padding_before(offset: int, alignment: int) -> int:
    """Return the number of bytes from `offset` to the next multiple of `alignment`."""
    return -offset % alignment


class _Writer:
    """A walk through a message, field by field, as a serializer does it."""

    def __init__(self, catalog: Catalog, encoding: Encoding) -> None:
        self.catalog = catalog
        self.encoding = encoding
        self.largest_alignment = encoding.largest_alignment
        self.offset = 0
        self.items: list[Leaf | DelimiterHeader] = []

    def message(self, message: Message, path: Path) -> None:
        for field in message.fields:
            if field.type.is_primitive:
                self._leaf(field.type, (*path, (field.name, None)))
            elif field.type.array is ArrayKind.SCALAR:
                self.message(self.catalog.nested(message, field.type), (*path, (field.name, None)))
            else:
                self._array(message, field.type, field.name, path)

    def _leaf(self, type_: FieldType, path: Path) -> None:
        size = PRIMITIVES[type_.name].size
        count = type_.element_count
        padding = self._pad(size)
        leaf = Leaf(path=path, type=type_, element_count=count, size=size, offset=self.offset, padding=padding)
        self.items.append(leaf)
        self.offset += size * count

    def _array(self, outer: Message, type_: FieldType, name: str, path: Path) -> None:
        inner = self.catalog.nested(outer, type_)
        header = len(self.items)
        if self.encoding is Encoding.XCDR2:
            padding = self._pad(4)
            self.items.append(DelimiterHeader(self.offset, 0, padding))
            self.offset += 4
        start = self.offset
        for index in range(type_.length):
            self.message(inner, (*path, (name, index)))
        if self.encoding is Encoding.XCDR2:
            self.items[header] = DelimiterHeader(start - 4, self.offset - start, self.items[header].padding)

    def _pad(self, alignment: int) -> int:
        padding = padding_before(self.offset, min(alignment, self.largest_alignment))
        self.offset += padding
        return padding


def struct_format(items: Iterable[tuple[int, int, str]]) -> str:
    """Return the `struct` format, without byte order, of items (padding before, count, code).

    Neighbours with the same code are joined: `3f` and `f` become `4f`.
    """
    runs: list[tuple[int, str]] = []
    for padding, count, code in items:
        for number, kind in ((padding, "x"), (count, code)):
            if runs and kind == runs[-1][1] != "s":
                runs[-1] = runs[-1][0] + number, kind
            elif number:
                runs.append((number, kind))
    return "".join(f"{number}{kind}" if number > 1 or kind == "s" else kind for number, kind in runs)
