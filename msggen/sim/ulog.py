"""A ULog of a simulated vehicle, as PX4's logger writes it (https://docs.px4.io/main/en/dev_log/ulog_file_format.html).

A ULog is whole at any length: if the program ends early, what was written can be read.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.recording_formats import FORMATS
from msggen.definitions.model import snake_case
from msggen.definitions.primitives import PRIMITIVES, Primitive

if TYPE_CHECKING:
    from typing_extensions import Self

_FRONT = FORMATS["ulog"].front + b"\1"
"""The first bytes, with the version of the format."""
_HEAD = struct.Struct("<HB")
_INFO = 6
"""The level of texts."""
_CHARACTER = "char"
_RELEASED = 255
"""The last byte of the number of a release, as no alpha, beta or release candidate."""


class _Part(NamedTuple):
    """A field of a format, or the padding between two."""

    text: str
    code: str
    attribute: str = ""
    """Its name in messages, "" for padding."""
    spread: Callable[[Any], Iterable[Any]] | None = None
    """Returns the values for `struct` of the value in a message, None if they are the same."""


class _Format(NamedTuple):
    """The format of a message: its fields in the order of uORB's struct, the largest first, and the padding."""

    name: str
    parts: tuple[_Part, ...]
    size: int
    nested: tuple[_Format, ...]
    values: Callable[[Any], Sequence[Any]]
    """Returns the values of a message, without padding."""

    @property
    def text(self) -> str:
        """The format as a ULog has it."""
        return f"{self.name}:{''.join(f'{part.text};' for part in self.parts)}"

    @property
    def code(self) -> str:
        """The codes for `struct`."""
        return "".join(part.code for part in self.parts)

    def all(self) -> Iterator[_Format]:
        """Yield the format and those that it nests."""
        yield self
        for each in self.nested:
            yield from each.all()


class Vehicle(NamedTuple):
    """The vehicle that a ULog tells."""

    number: int = 1
    """That of its board."""
    release: str = ""
    """The release of its firmware, such as "v1.18"; "" leaves it out."""


class UlogError(Exception):
    """A file that cannot be written further, as on a full disk. The message is the reason."""


class UlogWriter:
    """A new file, closed by a `with` statement. Raises OSError, FileExistsError among them.

    `topics` are the classes of the messages by the names of their topics in uORB. Times are in us since boot.
    """

    def __init__(
        self, path: str, start: int, topics: Mapping[str, Any], parameters: Mapping[str, float], vehicle: Vehicle
    ) -> None:
        self.path = path
        self.samples = 0
        self.size = 0
        """The bytes of the file."""
        formats = {topic: _format_of(cls)._replace(name=topic) for topic, cls in topics.items()}
        self._formats = {topic: (each, struct.Struct(f"<H{_without_end(each)}")) for topic, each in formats.items()}
        self._numbers: dict[str, int] = {}
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        self._file = os.fdopen(descriptor, "wb")
        try:
            self._begin(start, formats.values(), parameters, vehicle)
        except BaseException:
            with suppress(OSError):  # what waits cannot be written either
                self._file.close()
            with suppress(OSError):
                os.unlink(path)
            raise

    def _begin(
        self, start: int, formats: Collection[_Format], parameters: Mapping[str, float], vehicle: Vehicle
    ) -> None:
        """Write what is before the samples."""
        self._put(_FRONT + struct.pack("<Q", start))
        self._write("B", bytes(40))
        for key, text in (("sys_name", "PX4"), ("ver_hw", "MSGGEN_SIM"), ("sys_uuid", f"{vehicle.number:036}")):
            self._information(f"char[{len(text)}] {key}", text.encode())
        number = _number_of(vehicle.release)
        if number is not None:
            self._information("uint32_t ver_sw_release", struct.pack("<I", number))
        for text in dict.fromkeys(inner.text for each in formats for inner in each.all()):
            self._write("F", text.encode())
        for name, value in sorted(parameters.items()):
            label = f"float {name}".encode()
            self._write("P", bytes([len(label)]) + label + struct.pack("<f", value))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(self, topic: str, message: Any) -> None:
        """Write a message of a topic, unless the file has no such topic. Raises UlogError."""
        found = self._formats.get(topic)
        if found is None:
            return
        number = self._numbers.get(topic)
        if number is None:
            number = self._numbers[topic] = len(self._numbers)
            self._write("A", struct.pack("<BH", 0, number) + topic.encode())
        layout, packer = found
        self._write("D", packer.pack(number, *layout.values(message)))
        self.samples += 1

    def text(self, time: int, text: str) -> None:
        """Write a line of the vehicle's log. Raises UlogError."""
        self._write("L", struct.pack("<BQ", ord("0") + _INFO, time) + text.encode())

    def close(self) -> None:
        """Write what waits, and close the file. Can be repeated. Raises UlogError."""
        try:
            self._file.close()
        except OSError as error:
            raise UlogError(error.strerror or str(error)) from None

    def _information(self, key: str, value: bytes) -> None:
        self._write("I", bytes([len(key)]) + key.encode() + value)

    def _write(self, kind: str, content: bytes) -> None:
        self._put(_HEAD.pack(len(content), ord(kind)) + content)

    def _put(self, data: bytes) -> None:
        try:
            self._file.write(data)
        except OSError as error:
            raise UlogError(error.strerror or str(error)) from None
        self.size += len(data)


def _format_of(cls: Any) -> _Format:
    """Return the format of a generated class (docs/wire.md, 9)."""
    nested_class = import_module(type(cls.__msg__).__module__).nested_class
    fields: list[tuple[int, int, _Part]] = []
    nested: list[_Format] = []
    for field in cls.__msg__.fields:
        count = field.length or 0
        if field.base in PRIMITIVES:
            type_ = PRIMITIVES[field.base]
            text = _spelled(type_.cpp_type.removeprefix("std::"), count, field.name)
            part = _Part(text, _code_of(type_, count), field.attribute, _spread_of(type_, count))
            fields.append((type_.size, type_.size * (count or 1), part))
        else:
            inner = _format_of(nested_class(cls, field.base))
            nested.append(inner)
            text = _spelled(inner.name, count, field.name)
            part = _Part(text, inner.code * (count or 1), field.attribute, _spread_messages(inner, count))
            fields.append((0, inner.size * (count or 1), part))
    parts, size = _in_struct(fields)
    return _Format(snake_case(cls.__name__), parts, size, tuple(nested), _values_of(parts))


def _in_struct(fields: list[tuple[int, int, _Part]]) -> tuple[tuple[_Part, ...], int]:
    """Return fields, each with its alignment and size, in the order of uORB's struct with its padding, and its size.

    Nested messages, whose alignment is given as 0, come last and are aligned to 8.
    """
    parts: list[_Part] = []
    offset = 0
    for alignment, size, part in [*sorted(fields, key=lambda each: -each[0]), (0, 0, None)]:
        padding = -offset % (alignment or 8)
        if padding:
            parts.append(_Part(f"uint8_t[{padding}] _padding{len(parts)}", f"{padding}x"))
        if part is not None:
            parts.append(part)
        offset += padding + size
    return tuple(parts), offset


def _without_end(layout: _Format) -> str:
    """Return the codes of a format without the padding at its end, which PX4 does not write."""
    parts = layout.parts
    return "".join(part.code for part in (parts[:-1] if parts and not parts[-1].attribute else parts))


def _spelled(type_: str, count: int, name: str) -> str:
    return f"{type_}[{count}] {name}" if count else f"{type_} {name}"


def _code_of(type_: Primitive, count: int) -> str:
    """Return the code of a field for `struct`. Characters are one value."""
    return f"{count or 1}s" if type_.name == _CHARACTER else type_.code * (count or 1)


def _values_of(parts: Iterable[_Part]) -> Callable[[Any], Sequence[Any]]:
    """Return what takes the values of all fields out of a message."""
    fields = [part for part in parts if part.attribute]
    if not fields:
        return lambda _: ()
    get = attrgetter(*[part.attribute for part in fields])
    is_many = len(fields) > 1
    spread = [(place, part.spread) for place, part in enumerate(fields) if part.spread is not None][::-1]

    def values(message: Any) -> Sequence[Any]:
        found = [*get(message)] if is_many else [get(message)]
        for place, each in spread:  # from the last one, so that places stay
            found[place : place + 1] = each(found[place])
        return found

    return values


def _spread_of(type_: Primitive, count: int) -> Callable[[Any], Iterable[Any]] | None:
    """Return `_Part.spread` of a field of a primitive type."""
    if type_.name == _CHARACTER:
        return lambda value: [bytes((value,)) if isinstance(value, int) else bytes(value)]  # one can be a number
    return list if count else None


def _spread_messages(inner: _Format, count: int) -> Callable[[Any], Iterable[Any]]:
    """Return `_Part.spread` of a nested message, or of an array of them."""
    if count:
        return lambda messages: [value for each in messages for value in inner.values(each)]
    return inner.values


def _number_of(release: str) -> int | None:
    """Return the number of a release as `ver_sw_release` has it, None if this is no release."""
    found = re.search(r"\bv(\d{1,3})\.(\d{1,3})(?:\.(\d{1,3}))?\b", release)
    if not found:
        return None
    major, minor, patch = (int(each or 0) for each in found.groups())
    return major << 24 | minor << 16 | patch << 8 | _RELEASED
