"""The metadata of PX4's events, as a ULog has it (`metadata_events`, JSON in xz): what each event says.

The number of an event is that of its component in the highest byte, and its own in the others. It can come from a
damaged file, or from an attacker: sizes are limited, and events whose metadata is not as expected are left out.
"""

from __future__ import annotations

import json
import struct
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.recordings.decode.event_text import LONGEST, Placeholder, fill, parse_template

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

_LARGEST = 4 << 20
"""The size of the JSON in bytes: that of PX4 v1.17 has 161 kB."""
_MEMORY = 128 << 20
"""The memory in bytes that decompressing takes: `xz -9` needs 65 MiB."""
_CODES: Mapping[str, str] = MappingProxyType(
    {
        "uint8_t": "B",
        "int8_t": "b",
        "uint16_t": "H",
        "int16_t": "h",
        "uint32_t": "I",
        "int32_t": "i",
        "uint64_t": "Q",
        "int64_t": "q",
        "float": "f",
    }
)
"""The types of arguments, as `struct` names them."""


class EventMetadataError(ValueError):
    """Metadata that cannot be read. The message is the end of a sentence that begins with its name."""


class Enum(NamedTuple):
    """The names of the values of an argument."""

    code: str
    """Its type, as `struct` names it."""
    names: Mapping[int, str]
    bits: int
    """The bits of its type if it is a set of flags, otherwise 0."""
    separator: str

    def text(self, value: int) -> str:
        """Return the name of a value, or the names of its flags."""
        if not self.bits:
            return self.names.get(value, f"(unknown: {value})")
        flags = (1 << bit for bit in range(self.bits) if value >> bit & 1)
        return self.separator.join(self.names.get(flag, f"(unknown: {value})") for flag in flags)


class Definition(NamedTuple):
    """An event in the metadata."""

    name: str
    group: str
    """`default` for what a user reads, `arming_check`, `health`, `calibration`."""
    message: Sequence[str | Placeholder]
    description: Sequence[str | Placeholder]
    names: Sequence[str]
    """The names of the arguments."""
    packed: struct.Struct
    enums: Sequence[Enum | None]

    def values(self, data: bytes) -> tuple[int | float, ...] | None:
        """Return the arguments in the bytes of an event, None if there are not enough bytes."""
        return self.packed.unpack_from(data) if len(data) >= self.packed.size else None

    def texts(self, values: Sequence[int | float]) -> tuple[str, str]:
        """Return the message and the description with arguments."""
        shown = [
            value if enum is None else enum.text(int(value)) for value, enum in zip(values, self.enums, strict=True)
        ]
        return fill(self.message, shown), fill(self.description, shown)


def read_definitions(compressed: bytes, numbers: Collection[int]) -> Mapping[int, Definition]:
    """Return the definitions of the events with some numbers, as far as the metadata has them.

    Raises EventMetadataError.
    """
    components = _object(_object(_parsed(_decompressed(compressed))).get("components"))
    if not components:
        raise EventMetadataError("has no components")
    enums = _enums(components)
    found: dict[int, Definition] = {}
    for key, namespace, group, events in _groups(components):
        for own, event in events.items():
            number = _number(own)
            if number is None or not 0 <= number < 1 << 24 or key << 24 | number not in numbers:
                continue
            definition = _definition(event, group, namespace, enums)
            if definition is not None:
                found.setdefault(key << 24 | number, definition)
    return MappingProxyType(found)


def _decompressed(compressed: bytes) -> bytes:
    """Return the content of a file of xz. Raises EventMetadataError."""
    try:
        import lzma
    except ImportError:
        raise EventMetadataError("cannot be decompressed: this Python was built without lzma") from None
    try:
        decompressor = lzma.LZMADecompressor(lzma.FORMAT_XZ, _MEMORY)
        content = decompressor.decompress(compressed, _LARGEST + 1)
    except (lzma.LZMAError, EOFError) as error:
        raise EventMetadataError(f"cannot be decompressed: {error}") from None
    if len(content) > _LARGEST:
        raise EventMetadataError(f"has more than {_LARGEST >> 20} MiB without its compression")
    if not decompressor.eof:
        raise EventMetadataError("cannot be decompressed: it is cut off")
    return content


def _parsed(content: bytes) -> object:
    try:
        return json.loads(content)
    except (ValueError, RecursionError):
        raise EventMetadataError("is not JSON") from None


def _groups(components: Mapping[str, Any]) -> Iterator[tuple[int, str, str, Mapping[str, Any]]]:
    """Yield the number and the namespace of a component, the name of a group, and its events, group by group."""
    for key, component in components.items():
        number, own = _number(key), _object(component)
        if number is None or not 0 <= number < 1 << 8:
            continue
        for group, content in _object(own.get("event_groups")).items():
            yield number, _text(own.get("namespace")), _text(group), _object(_object(content).get("events"))


def _enums(components: Mapping[str, Any]) -> Mapping[str, Enum]:
    """Return the enums of all components by their whole names, such as `px4::arming_state_t`."""
    found = {}
    for component in map(_object, components.values()):
        namespace = _text(component.get("namespace"))
        for name, content in _object(component.get("enums")).items():
            enum = _enum(_object(content))
            if enum is not None:
                found[f"{namespace}::{name}"] = enum
    return found


def _enum(content: Mapping[str, Any]) -> Enum | None:
    """Return an enum, None for one without a type of integers."""
    type_ = _text(content.get("type"))
    if type_ not in _CODES or type_ == "float":
        return None
    names: dict[int, str] = {}
    for key, entry in _object(content.get("entries")).items():
        value, own = _number(key), _object(entry)
        if value is not None:
            names[value] = _text(own.get("description", own.get("name")))
    bits = struct.calcsize(_CODES[type_]) * 8 if content.get("is_bitfield") is True else 0
    return Enum(_CODES[type_], MappingProxyType(names), bits, _text(content.get("separator", "|")))


def _definition(event: object, group: str, namespace: str, enums: Mapping[str, Enum]) -> Definition | None:
    """Return an event, None if it is not as expected."""
    own = _object(event)
    arguments = own.get("arguments", [])
    if not isinstance(own.get("message"), str) or not isinstance(arguments, list):
        return None
    names, codes, found = [], "", []
    for argument in map(_object, arguments):
        type_ = _text(argument.get("type"))
        enum = None if type_ in _CODES else enums.get(type_ if "::" in type_ else f"{namespace}::{type_}")
        code = _CODES.get(type_) if enum is None else enum.code
        if code is None:
            return None
        names.append(_text(argument.get("name")))
        codes += code
        found.append(enum)
    return Definition(
        name=_text(own.get("name")),
        group=group,
        message=parse_template(_text(own["message"])),
        description=parse_template(_text(own.get("description"))),
        names=tuple(names),
        packed=struct.Struct(f"<{codes}"),
        enums=tuple(found),
    )


def _object(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _text(value: object) -> str:
    """Return a text that can be encoded, not longer than a template."""
    return value[:LONGEST].encode(errors="replace").decode() if isinstance(value, str) else ""


def _number(key: str) -> int | None:
    """Return a number that is a key, None for other keys."""
    try:
        return int(key)
    except ValueError:
        return None
