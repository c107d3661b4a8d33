"""Samples with strings and sequences, which have no fixed layout: decoded value by value."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.definitions.layout import Encoding, is_static, padding_before
from msggen.definitions.model import ArrayKind, Field, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.recordings.decode.encapsulation import HEADER, SURPLUS
from msggen.recordings.decode.layouts import ENCODINGS

if TYPE_CHECKING:
    from collections.abc import Callable

    from msggen.recordings.decode.schemas import Schema

_LARGEST_UNIT = 0xFFFF
_OVERESTIMATE = 8
"""The bytes that rclpy can add for each wstring and each empty sequence of 8-byte numbers (docs/wire.md, section 6)."""
_LENGTH = 4
"""The size of the length before a sequence or a string."""


class ValueDecodeError(ValueError):
    """A sample that is shorter or longer than its definition."""


@lru_cache(1024)
def dtype_of(schema: Schema) -> np.dtype[Any]:
    """Return the dtype of rows of values: fields of variable size are objects.

    Text is `str`, a sequence of numbers an array, one of text or of messages a list, and a message in it a dict.
    """
    catalog, message = schema.catalog, schema.message

    def kind(field: Field, outer: Message) -> Any:
        type_ = field.type
        if not type_.is_fixed_size:
            return object
        if type_.is_primitive:
            base: Any = np.dtype(PRIMITIVES[type_.name].code)
        else:
            inner = catalog.nested(outer, type_)
            if type_.array is not ArrayKind.SCALAR and not is_static(catalog, inner):
                return object
            base = fields(inner)
        return base if type_.array is ArrayKind.SCALAR else (base, (type_.length,))

    def fields(message: Message) -> np.dtype[Any]:
        return np.dtype([(field.name, kind(field, message)) for field in message.fields])

    return fields(message)


def decode(schema: Schema, sample: bytes) -> tuple[Any, ...]:
    """Return a row of `dtype_of(schema)`. `sample` begins with its header. Raises ValueDecodeError."""
    order, encoding = ENCODINGS[sample[:2]]
    reader = _Reader(sample, order, encoding)
    try:
        row = reader.row(schema, schema.message)
    except (struct.error, IndexError) as error:
        raise ValueDecodeError(str(error)) from None
    if not 0 <= len(sample) - HEADER - reader.offset <= SURPLUS + reader.overestimated:
        raise ValueDecodeError(f"{len(sample) - HEADER - reader.offset} bytes too many")
    return row


class _Reader:
    """A walk through a sample, as a deserializer does it. Offsets count from the end of the header."""

    def __init__(self, sample: bytes, order: str, encoding: Encoding) -> None:
        self.data = memoryview(sample)[HEADER:]
        self.order = order
        self.encoding = encoding
        self.offset = 0
        self.overestimated = 0
        """How many bytes more than the sample rclpy may have written."""

    def row(self, schema: Schema, message: Message) -> tuple[Any, ...]:
        """Return the values of a message as a tuple, for a row."""
        if not message.fields:
            self.take(1)  # ROS 2 gives a message without fields one byte
        return tuple(self.field(schema, message, field, self.row) for field in message.fields)

    def mapping(self, schema: Schema, message: Message) -> dict[str, Any]:
        """Return the values of a message by the names of its fields, for an object."""
        if not message.fields:
            self.take(1)
        return {field.name: self.field(schema, message, field, self.mapping) for field in message.fields}

    def field(self, schema: Schema, outer: Message, field: Field, nested: Callable[[Schema, Message], Any]) -> Any:
        """Return the value of a field; `nested` reads a message."""
        type_ = field.type
        is_scalar = type_.array is ArrayKind.SCALAR
        is_sequence = type_.array in (ArrayKind.BOUNDED, ArrayKind.UNBOUNDED)
        if type_.is_primitive and not PRIMITIVES[type_.name].is_string:
            count = self.length() if is_sequence else type_.element_count
            self.check_bound(field, count)
            values = self.numbers(type_.name, count)
            return values[0] if is_scalar else values
        has_delimiter = self.encoding is Encoding.XCDR2 and not is_scalar  # elements are strings or messages
        end = self.length() + self.offset if has_delimiter else None
        count = self.length() if is_sequence else type_.element_count
        if type_.is_primitive:
            read: Callable[[], Any] = self.wide_text if type_.name == "wstring" else self.text
        else:
            inner = schema.catalog.nested(outer, type_)
            of_object = is_sequence or not (is_scalar or is_static(schema.catalog, inner))
            reader = self.mapping if of_object else nested
            read = lambda: reader(schema, inner)  # noqa: E731 - named functions of one call would not say more
        self.check_bound(field, count)
        self.check_count(count)
        elements = [read() for _ in range(count)]
        if end is not None and self.offset != end:
            raise ValueDecodeError(f"{outer.name}.{field.name}: its delimiter header has another size")
        return elements[0] if is_scalar else elements

    def numbers(self, name: str, count: int) -> Any:
        """Return `count` values of a primitive, as an array of numpy in the order of the machine."""
        primitive = PRIMITIVES[name]
        if count:
            self.align(primitive.size)
        elif primitive.size == _OVERESTIMATE:
            self.overestimated += _OVERESTIMATE
        octets = self.take(primitive.size * count)
        if name == "bool":
            return np.frombuffer(octets, np.uint8) != 0
        dtype = np.dtype(self.order + primitive.code)
        return np.frombuffer(octets, dtype).astype(dtype.newbyteorder("="))

    def text(self) -> str:
        """Return a string, which ends with a zero byte. Bytes that are not UTF-8 become surrogates."""
        size = self.length()
        return str(self.take(size), "utf-8", "surrogateescape").removesuffix("\0")

    def wide_text(self) -> str:
        """Return a string of UTF-16 units in four bytes each (docs/wire.md, section 6)."""
        units = np.frombuffer(self.take(4 * self.length()), f"{self.order}u4")
        if units.size and int(units.max()) > _LARGEST_UNIT:
            raise ValueDecodeError("a wstring has a unit of more than 16 bits")
        self.overestimated += _OVERESTIMATE
        return str(units.astype("<u2").tobytes(), "utf-16-le", "surrogatepass")

    def length(self) -> int:
        """Return a length."""
        self.align(_LENGTH)
        (found,) = struct.unpack(f"{self.order}I", self.take(_LENGTH))
        return int(found)

    def align(self, size: int) -> None:
        """Skip padding."""
        self.offset += padding_before(self.offset, min(size, self.encoding.largest_alignment))

    def check_bound(self, field: Field, count: int) -> None:
        """Refuse more elements than a bounded sequence can have."""
        if field.type.array is ArrayKind.BOUNDED and count > field.type.length:
            raise ValueDecodeError(f"{field.name} has {count} elements, at most {field.type.length} fit")

    def check_count(self, count: int) -> None:
        """Refuse more elements than the sample has bytes: each has at least one."""
        if count > len(self.data) - self.offset:
            raise ValueDecodeError(f"expected {count} elements, the sample has {len(self.data) - self.offset} bytes")

    def take(self, size: int) -> memoryview:
        """Return the next bytes."""
        end = self.offset + size
        if end > len(self.data):
            raise ValueDecodeError(f"expected {end + HEADER} bytes, got {len(self.data) + HEADER}")
        found = self.data[self.offset : end]
        self.offset = end
        return found
