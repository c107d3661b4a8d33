"""The metadata of PX4's events, as a ULog has it (`metadata_events`, JSON in xz): what each event says.

The number of an event is that of its component in the highest byte, and its own in the others. It can come from a
damaged file, or from an attacker: sizes are limited, and events whose metadata is not as expected are left out.

What an event says is a template: text with arguments, tags and escapes. `{2:.1m}` is the second argument with one digit
and a unit. `<param>` and `<a>` have their content, `<profile>` has it for readers of one kind, and any other tag is
left out (https://docs.px4.io/main/en/concept/events_interface.html).
"""

from __future__ import annotations

import json
import re
import struct
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.messages.events import CODES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

LONGEST = 2000
"""The length of a template, and of a text that is made of one, in characters: PX4's have up to 600."""
_PROFILE = "dev"
"""The readers for whom texts are: `dev` or `normal`. Those of logs are developers."""
_SPECIAL = re.compile(
    r"\\(?P<escaped>.?)"
    r'|<(?P<tag>[a-z]+)(?: [a-z]+="(?P<attribute>[^"]*)")?>'
    r"|\{(?P<number>[0-9]{1,4})(?::(?:\.(?P<digits>[0-9]{1,2}))?)?(?P<unit>m_v|m/s|m\^2|m|C)?\}",
    re.DOTALL,
)
_UNITS = {"m_v": "m"}
"""What is shown for units that are not shown as they are: a vertical distance is in m, too."""


class Placeholder(NamedTuple):
    """The place of an argument in a template."""

    position: int
    digits: int | None
    """The digits behind the point, None for as many as the value has."""
    unit: str
    source: str
    """The placeholder as it is in the template: shown for an argument that the event does not have."""


def parse_template(template: str) -> tuple[str | Placeholder, ...]:
    """Return the pieces of a template, which is cut at LONGEST."""
    return tuple(_pieces(template[:LONGEST]))


def fill(pieces: Sequence[str | Placeholder], values: Sequence[str | float]) -> str:
    """Return the text of a template with arguments, up to LONGEST."""
    made: list[str] = []
    length = 0
    for piece in pieces:
        text = piece if isinstance(piece, str) else _argument(piece, values)
        made.append(text)
        length += len(text)
        if length > LONGEST:
            break
    return "".join(made)[:LONGEST].strip()


def _pieces(template: str) -> Iterator[str | Placeholder]:
    place = 0
    while found := _SPECIAL.search(template, place):
        yield template[place : found.start()]
        place = found.end()
        if found["tag"]:
            end = template.find(f"</{found['tag']}>", place)
            if end < 0:
                yield "<"
                place = found.start() + 1
                continue
            yield from _content(found["tag"], found["attribute"] or "", template[place:end])
            place = end + len(found["tag"]) + 3
        elif found["number"]:
            digits = None if found["digits"] is None else int(found["digits"])
            unit = found["unit"] or ""
            yield Placeholder(int(found["number"]) - 1, digits, _UNITS.get(unit, unit), found[0])
        else:
            yield found["escaped"]
    yield template[place:]


def _content(tag: str, attribute: str, content: str) -> Iterator[str | Placeholder]:
    """Yield what is shown of the content of a tag."""
    if tag in ("a", "param"):
        yield content
    elif tag == "profile":
        is_shown = attribute[1:] != _PROFILE if attribute.startswith("!") else attribute == _PROFILE
        if is_shown:
            yield from _pieces(content)


def _argument(place: Placeholder, values: Sequence[str | float]) -> str:
    if not 0 <= place.position < len(values):
        return place.source
    value = values[place.position]
    is_rounded = place.digits is not None and not isinstance(value, str)
    text = f"{value:.{place.digits}f}" if is_rounded else str(value)
    return f"{text} {place.unit}" if place.unit else text


_LARGEST = 4 << 20
"""The size of the JSON in bytes: that of PX4 v1.17 has 161 kB."""
_MEMORY = 128 << 20
"""The memory in bytes that decompressing takes: `xz -9` needs 65 MiB."""


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
    if type_ not in CODES or type_ == "float":
        return None
    names: dict[int, str] = {}
    for key, entry in _object(content.get("entries")).items():
        value, own = _number(key), _object(entry)
        if value is not None:
            names[value] = _text(own.get("description", own.get("name")))
    bits = struct.calcsize(CODES[type_]) * 8 if content.get("is_bitfield") is True else 0
    return Enum(CODES[type_], MappingProxyType(names), bits, _text(content.get("separator", "|")))


def _definition(event: object, group: str, namespace: str, enums: Mapping[str, Enum]) -> Definition | None:
    """Return an event, None if it is not as expected."""
    own = _object(event)
    arguments = own.get("arguments", [])
    if not isinstance(own.get("message"), str) or not isinstance(arguments, list):
        return None
    names, codes, found = [], "", []
    for argument in map(_object, arguments):
        type_ = _text(argument.get("type"))
        enum = None if type_ in CODES else enums.get(type_ if "::" in type_ else f"{namespace}::{type_}")
        code = CODES.get(type_) if enum is None else enum.code
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
