"""A second codec, slow and simple: CDR written and read one value at a time, directly from the definitions.

It shares nothing with msggen except the parsed model. The rules are those of docs/wire.md, 2 to 6:

- a number of n bytes starts at a multiple of n (at most 8 in XCDR1, at most 4 in XCDR2), counted from the
  first byte after the encapsulation header
- a string is the number of its bytes in UTF-8 plus one for the NUL, as uint32; then the bytes; then the NUL
- a wstring is the number of its UTF-16 code units, as uint32, then each code unit as a uint32; no standard
  defines this, but rclpy does it
- an array is its values in order; a sequence is their number, as uint32, then its values in order
- a message is its fields in order; a message without fields is a single byte
- XCDR2 puts a delimiter header, the number of bytes that follow, before an array or a sequence of strings or
  messages
"""

from __future__ import annotations

import struct
from array import array
from typing import Any

from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message

HEADERS = {("big", 1): b"\0\0\0\0", ("little", 1): b"\0\1\0\0", ("big", 2): b"\0\6\0\0", ("little", 2): b"\0\7\0\0"}

SIZES = {"bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2}
SIZES |= {"int32": 4, "uint32": 4, "int64": 8, "uint64": 8, "float32": 4, "float64": 8}

SURPLUS = 3
"""The length of a sample is rounded up to a multiple of 4 (docs/wire.md, 7)."""

OVERESTIMATE = 8
"""The most bytes by which rclpy's serialize_message overestimates a sample for each wstring and each empty sequence.

It counts an end for each wstring, and alignment for each empty sequence of 8-byte numbers, but writes neither.
"""

Values = dict[str, Any]
"""The values of a message as a dictionary; arrays and sequences are lists, nested messages dictionaries."""


class MalformedError(Exception):
    """Raised for bytes that are no valid sample of the message."""


def serialize(catalog: Catalog, message: Message, values: Values, order: str, version: int) -> bytes:
    """Return `values` as a sample with its header."""
    writer = Writer(catalog, order, version)
    writer.message(message, values)
    return HEADERS[order, version] + bytes(writer.buffer)


def padding(catalog: Catalog, message: Message, values: Values, order: str, version: int) -> list[int]:
    """Return the positions of padding in the sample of `values`."""
    writer = Writer(catalog, order, version)
    writer.message(message, values)
    return [4 + position for position in writer.padding]


def deserialize(catalog: Catalog, message: Message, sample: bytes) -> Values:
    """Return the values in a sample with its header. Raise MalformedError if it is invalid."""
    if len(sample) < 4:
        raise MalformedError("no header")
    for (order, version), header in HEADERS.items():
        if header[:2] == sample[:2]:
            reader = Reader(catalog, sample[4:], order, version)
            values = reader.message(message)
            if len(reader.buffer) > reader.position + SURPLUS + OVERESTIMATE * reader.overestimated:
                raise MalformedError("too long")
            return values
    raise MalformedError("unknown header")


class Writer:
    """Appends values to a buffer."""

    def __init__(self, catalog: Catalog, order: str, version: int) -> None:
        self.catalog, self.order, self.version = catalog, order, version
        self.buffer = bytearray()
        self.padding: list[int] = []

    def message(self, message: Message, values: Values) -> None:
        for field in message.fields:
            self.field(message, field.type, values[field.name])
        if not message.fields:
            self.number("uint8", 0)

    def field(self, outer: Message, type_: FieldType, value: Any) -> None:
        if type_.array is ArrayKind.SCALAR:
            self.one(outer, type_, value)
            return
        start = 0
        if self.version == 2 and type_.name not in SIZES:
            self.number("uint32", 0)  # replaced when the size is known
            start = len(self.buffer)
        if type_.array is not ArrayKind.FIXED:
            self.number("uint32", len(value))
        for item in value:
            self.one(outer, type_, item)
        if start:
            self.buffer[start - 4 : start] = (len(self.buffer) - start).to_bytes(4, self.byte_order)

    def one(self, outer: Message, type_: FieldType, value: Any) -> None:
        if type_.name == "string":
            self.string(value)
        elif type_.name == "wstring":
            self.wstring(value)
        elif type_.is_primitive:
            self.number(type_.name, value)
        else:
            self.message(self.catalog.nested(outer, type_), value)

    def string(self, text: str) -> None:
        raw = text.encode("utf-8") + b"\0"
        self.number("uint32", len(raw))
        self.buffer += raw

    def wstring(self, text: str) -> None:
        raw = text.encode("utf-16-le")
        self.number("uint32", len(raw) // 2)
        for index in range(0, len(raw), 2):
            self.number("uint32", int.from_bytes(raw[index : index + 2], "little"))

    def number(self, name: str, value: Any) -> None:
        size = SIZES[name]
        while len(self.buffer) % min(size, 8 if self.version == 1 else 4) != 0:
            self.padding.append(len(self.buffer))
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
    """Takes values from a buffer. Raises MalformedError if the buffer holds no such value."""

    def __init__(self, catalog: Catalog, buffer: bytes, order: str, version: int) -> None:
        self.catalog, self.buffer, self.order, self.version = catalog, buffer, order, version
        self.position = 0
        self.overestimated = 0

    def message(self, message: Message) -> Values:
        values = {field.name: self.field(message, field.type) for field in message.fields}
        if not message.fields:
            self.number("uint8")
        return values

    def field(self, outer: Message, type_: FieldType) -> Any:
        if type_.array is ArrayKind.SCALAR:
            return self.one(outer, type_)
        is_delimited = self.version == 2 and type_.name not in SIZES
        expected = self.number("uint32") if is_delimited else 0
        start = self.position
        count = type_.length if type_.array is ArrayKind.FIXED else self.number("uint32")
        if type_.array is ArrayKind.BOUNDED and count > type_.length:
            raise MalformedError("more elements than the bound")
        self.overestimated += count == 0 and SIZES.get(type_.name) == 8
        items = [self.one(outer, type_) for _ in range(count)]
        if is_delimited and expected != self.position - start:
            raise MalformedError("wrong delimiter header")
        return items

    def one(self, outer: Message, type_: FieldType) -> Any:
        if type_.name == "string":
            return self.string(type_.string_bound)
        if type_.name == "wstring":
            return self.wstring(type_.string_bound)
        if type_.is_primitive:
            return self.number(type_.name)
        return self.message(self.catalog.nested(outer, type_))

    def string(self, bound: int | None) -> str:
        """A string of no bytes, not even a NUL, is empty, as in rclpy."""
        raw = self.take(self.number("uint32"))
        if raw and raw[-1] != 0:
            raise MalformedError("no NUL at the end of a string")
        return self.text(raw[:-1], "utf-8", bound)

    def wstring(self, bound: int | None) -> str:
        self.overestimated += 1
        units = [self.number("uint32") for _ in range(self.number("uint32"))]
        if any(unit > 0xFFFF for unit in units):
            raise MalformedError("no UTF-16 code unit")
        return self.text(b"".join(unit.to_bytes(2, "little") for unit in units), "utf-16-le", bound)

    def text(self, raw: bytes, encoding: str, bound: int | None) -> str:
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            raise MalformedError(f"not {encoding}") from None
        if bound is not None and len(text) > bound:
            raise MalformedError("more characters than the bound")
        return text

    def number(self, name: str) -> Any:
        size = SIZES[name]
        while self.position % min(size, 8 if self.version == 1 else 4) != 0:
            self.position += 1
        raw = self.take(size)
        if name in ("float32", "float64"):
            code = {"float32": "f", "float64": "d"}[name]
            return struct.unpack((">" if self.order == "big" else "<") + code, raw)[0]
        order: Any = self.order
        value = int.from_bytes(raw, order, signed=name.startswith("int"))
        return bool(value) if name == "bool" else value

    def take(self, size: int) -> bytes:
        raw = self.buffer[self.position : self.position + size]
        if len(raw) != size:
            raise MalformedError("too short")
        self.position += size
        return raw


CODES = {"int8": "b", "int16": "h", "int32": "i", "int64": "q", "uint16": "H", "uint32": "I", "uint64": "Q"}
CODES |= {"float32": "f", "float64": "d"}


def to_object(package: Any, catalog: Catalog, message: Message, values: Values) -> Any:
    """Return `values` as an object of the generated class, an attribute of `package` or of a module inside it."""

    def one(type_: FieldType, value: Any) -> Any:
        is_message = not type_.is_primitive
        return to_object(package, catalog, catalog.nested(message, type_), value) if is_message else value

    def held(type_: FieldType, value: Any) -> Any:
        if type_.array is ArrayKind.SCALAR:
            return one(type_, value)
        if type_.name in ("uint8", "char", "byte"):
            return bytes(value)
        if type_.name in CODES and type_.array is not ArrayKind.FIXED:
            return array(CODES[type_.name], value)
        return tuple(one(type_, item) for item in value)

    is_own = message.released_as[0] == catalog.package
    home = package if is_own else getattr(getattr(package, message.package), message.folder)
    cls = class_of(home, message)
    attributes = {field.name: field.attribute for field in cls.__msg__.fields}
    return cls(**{attributes[field.name]: held(field.type, values[field.name]) for field in message.fields})


def class_of(home: Any, message: Message) -> Any:
    """Return the class of `message` in `home`, where its name may differ from the name in the definition."""
    found = getattr(home, message.name, None)
    return (
        found
        if is_class_of(found, message)
        else next(filter(lambda cls: is_class_of(cls, message), (getattr(home, name) for name in home.__all__)))
    )


def is_class_of(value: Any, message: Message) -> bool:
    """Whether `value` is the class of `message`."""
    return bool(getattr(value, "__msg__", None) and value.__msg__.name == message.name)


def to_values(catalog: Catalog, message: Message, sample: Any) -> Values:
    """Return the values of an object of the generated class."""

    def one(type_: FieldType, value: Any) -> Any:
        return value if type_.is_primitive else to_values(catalog, catalog.nested(message, type_), value)

    def held(type_: FieldType, value: Any) -> Any:
        is_scalar = type_.array is ArrayKind.SCALAR
        return one(type_, value) if is_scalar else [one(type_, item) for item in value]

    attributes = {field.name: field.attribute for field in sample.__msg__.fields}
    return {field.name: held(field.type, getattr(sample, attributes[field.name])) for field in message.fields}
