"""A second codec, slow and obvious: CDR written and read one value at a time, straight from the definitions.

It shares nothing with msggen but the parsed model. Read it beside DDS-XTypes 1.3, section 7.4:

- a value of n bytes starts at a multiple of n (at most 8 in XCDR1, at most 4 in XCDR2), counted from the
  first byte after the encapsulation header
- an array is its values one after the other; a nested message is its fields one after the other
- XCDR2 puts a delimiter header, the number of bytes that follow, before an array of nested messages
"""

from __future__ import annotations

import struct
from typing import Any

from msggen.model import ArrayKind, Catalog, FieldType, Message

HEADERS = {("big", 1): b"\0\0\0\0", ("little", 1): b"\0\1\0\0", ("big", 2): b"\0\6\0\0", ("little", 2): b"\0\7\0\0"}

SIZES = {"bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2}
SIZES |= {"int32": 4, "uint32": 4, "int64": 8, "uint64": 8, "float32": 4, "float64": 8}

Values = dict[str, Any]
"""A message as a dictionary; arrays are lists, nested messages dictionaries."""


def serialize(catalog: Catalog, message: Message, values: Values, order: str, version: int) -> bytes:
    """Return `values` as a sample, with header."""
    writer = Writer(catalog, order, version)
    writer.message(message, values)
    return HEADERS[order, version] + bytes(writer.buffer)


def deserialize(catalog: Catalog, message: Message, sample: bytes) -> Values:
    """Return the values in a sample with header."""
    order, version = next(key for key, header in HEADERS.items() if header[:2] == sample[:2])
    reader = Reader(catalog, sample[4:], order, version)
    return reader.message(message)


class Writer:
    """Appends to a buffer."""

    def __init__(self, catalog: Catalog, order: str, version: int) -> None:
        self.catalog, self.order, self.version = catalog, order, version
        self.buffer = bytearray()

    def message(self, message: Message, values: Values) -> None:
        for field in message.fields:
            self.field(message, field.type, values[field.name])

    def field(self, outer: Message, type_: FieldType, value: Any) -> None:
        if type_.is_primitive:
            for item in value if type_.array is ArrayKind.FIXED else [value]:
                self.value(type_.name, item)
            return
        inner = self.catalog.nested(outer, type_)
        if type_.array is ArrayKind.SCALAR:
            self.message(inner, value)
            return
        if self.version == 1:
            for item in value:
                self.message(inner, item)
            return
        self.value("uint32", 0)
        start = len(self.buffer)
        for item in value:
            self.message(inner, item)
        self.buffer[start - 4 : start] = (len(self.buffer) - start).to_bytes(4, self.byte_order)

    def value(self, name: str, value: Any) -> None:
        size = SIZES[name]
        while len(self.buffer) % min(size, 8 if self.version == 1 else 4) != 0:
            self.buffer.append(0)
        if name in ("float32", "float64"):
            code = {"float32": "f", "float64": "d"}[name]
            self.buffer += struct.pack((">" if self.order == "big" else "<") + code, value)
        else:
            self.buffer += int(value).to_bytes(size, self.byte_order, signed=name.startswith("int"))

    @property
    def byte_order(self) -> Any:
        return self.order


class Reader:
    """Takes from a buffer."""

    def __init__(self, catalog: Catalog, buffer: bytes, order: str, version: int) -> None:
        self.catalog, self.buffer, self.order, self.version = catalog, buffer, order, version
        self.position = 0

    def message(self, message: Message) -> Values:
        return {field.name: self.field(message, field.type) for field in message.fields}

    def field(self, outer: Message, type_: FieldType) -> Any:
        if type_.is_primitive:
            if type_.array is ArrayKind.SCALAR:
                return self.value(type_.name)
            return [self.value(type_.name) for _ in range(type_.length)]
        inner = self.catalog.nested(outer, type_)
        if type_.array is ArrayKind.SCALAR:
            return self.message(inner)
        expected = self.value("uint32") if self.version == 2 else None
        start = self.position
        items = [self.message(inner) for _ in range(type_.length)]
        assert expected in (None, self.position - start)
        return items

    def value(self, name: str) -> Any:
        size = SIZES[name]
        while self.position % min(size, 8 if self.version == 1 else 4) != 0:
            self.position += 1
        raw = self.buffer[self.position : self.position + size]
        assert len(raw) == size
        self.position += size
        if name in ("float32", "float64"):
            code = {"float32": "f", "float64": "d"}[name]
            return struct.unpack((">" if self.order == "big" else "<") + code, raw)[0]
        order: Any = self.order
        value = int.from_bytes(raw, order, signed=name.startswith("int"))
        return bool(value) if name == "bool" else value


def to_object(package: Any, catalog: Catalog, message: Message, values: Values) -> Any:
    """Return `values` as an object of the generated class."""
    arguments = {}
    for field in message.fields:
        value = values[field.name]
        if not field.type.is_primitive:
            inner = catalog.nested(message, field.type)
            if field.type.array is ArrayKind.SCALAR:
                value = to_object(package, catalog, inner, value)
            else:
                value = tuple(to_object(package, catalog, inner, item) for item in value)
        elif field.type.array is ArrayKind.FIXED:
            value = bytes(value) if field.type.name in ("uint8", "char", "byte") else tuple(value)
        arguments[field.name] = value
    return getattr(package, message.name)(**arguments)


def to_values(catalog: Catalog, message: Message, sample: Any) -> Values:
    """Return an object of the generated class as values."""
    values: Values = {}
    for field in message.fields:
        value = getattr(sample, field.name)
        if not field.type.is_primitive:
            inner = catalog.nested(message, field.type)
            if field.type.array is ArrayKind.SCALAR:
                value = to_values(catalog, inner, value)
            else:
                value = [to_values(catalog, inner, item) for item in value]
        elif field.type.array is ArrayKind.FIXED:
            value = list(value)
        values[field.name] = value
    return values
