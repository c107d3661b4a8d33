"""The header that translates between an archived version of a message and the current one.

Classes, members and macros are the interface of PX4's translation node (`translation_util.h` of v1.16 and later).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from msggen.base.diagnostics import few
from msggen.definitions.enumeration import constant_prefixes
from msggen.definitions.model import SPECIAL, ArrayKind, BridgeEntry, Field, FieldType, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.sources.history import archived_name
from msggen.sources.translation_check import TODO

_TODO = f"// {TODO}:"
"""The start of a comment about a line that needs a decision."""

_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"(translation_[^"]+)".*\n?', re.MULTILINE)
_ANY_INCLUDE = re.compile(r"^[ \t]*#[ \t]*include\b.*\n?", re.MULTILINE)
_CLASS = re.compile(r"\b(?:class|struct)\s+(\w+)\s*\{|\bfromOlder\b")
"""The start of a class, or the name of its first function, before which it names its messages."""


class Translator(NamedTuple):
    """A class in an existing header that translates a nested message."""

    header: str
    class_name: str


class Side(NamedTuple):
    """One side of a translation: the message, and its nested messages by name. `age` is "older" or "newer"."""

    age: str
    message: Message
    nested: Mapping[str, Message]


class _OtherTopic(NamedTuple):
    class_name: str
    topic: str


def ros_file(name: str) -> str:
    """Return the name of the header that ROS 2 generates for a message.

    rosidl keeps consecutive capitals together, while uORB puts an underscore before each.
    """
    spaced = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", name)
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", spaced).lower()


def header_name(name: str, version: int) -> str:
    """Return the file name of the header that translates `name` to `version`."""
    return f"translation_{ros_file(name)}_v{version}.h"


def topic_of(entry: BridgeEntry) -> str:
    """Return the topic as a header names it: without the leading slash, so that a namespace can be prepended."""
    return entry.topic.lstrip("/") + ("" if entry.instance is None else str(entry.instance))


def find_translator(name: str, version: int, headers: Mapping[str, str]) -> Translator | None:
    """Return the class in `headers` that translates the message `name` from `version` to the current one."""
    older = re.compile(rf"\bMessageOlder\s*=\s*px4_msgs_old::msg::{name}V{version}\s*;")
    newer = re.compile(rf"\bMessageNewer\s*=\s*px4_msgs::msg::{name}\s*;")
    for header, text in headers.items():
        for class_name, body in _classes(text):
            if older.search(body) and newer.search(body):
                return Translator(header, class_name)
    return None


def _classes(text: str) -> Iterator[tuple[str, str]]:
    """Yield the name and the head of each class in a header: the text before `fromOlder`."""
    opened = None
    for found in _CLASS.finditer(text):
        if opened and not found[1]:
            yield opened[1], text[opened.end() : found.start()]
            opened = None
        opened = opened or (found if found[1] else None)


def find_callers(inner: str, archived: str, headers: Mapping[str, str]) -> list[str]:
    """Return the names of the `headers` that translate the message `archived` with the current version of `inner`.

    They no longer compile, because an archived version nests only archived versions.
    """
    newer = re.compile(rf"\bMessageNewer\s*=\s*px4_msgs::msg::{inner}\s*;")
    classes = [name for text in headers.values() for name, body in _classes(text) if newer.search(body)]
    called = re.compile(rf"\b(?:{'|'.join(classes)})::") if classes else None
    known = re.compile(rf"\bMessageNewer\s*=\s*px4_msgs_old::msg::{archived}\s*;")
    return [name for name, text in headers.items() if called and called.search(text) and known.search(text)]


def changed_constants(older: Message, newer: Message, prefixes: str | tuple[str, ...] = "") -> list[str]:
    """Return a description of each constant that has another value in `newer`, or is missing there.

    `prefixes` selects constants by the start of their names.
    """
    known = {constant.name: constant.value for constant in newer.constants}
    own = [each for each in older.constants if each.name not in SPECIAL and each.name.startswith(prefixes)]
    return [
        f"{each.name} is {known[each.name]}, was {each.value}" if each.name in known else f"{each.name} is gone"
        for each in own
        if each.name not in known or known[each.name] != each.value
    ]


def _constants_of_no_field(older: Message, newer: Message) -> list[str]:
    """Return a description of each constant that changed and that no field has as a value, as far as tags tell."""
    versions = (older, newer)
    tags = {field.comment.tag("enum") for message in versions for field in message.fields}
    used = changed_constants(*versions, _enum_prefixes(versions, tags))
    return [text for text in changed_constants(*versions) if text not in used]


def _enum_prefixes(versions: Iterable[Message], tags: Iterable[str]) -> tuple[str, ...]:
    """Return the starts of the names of the constants in the enums `tags`, in any of the versions of a message."""
    return tuple(f"{prefix}_" for message in versions for tag in tags for prefix in constant_prefixes(message, tag))


def render_header(older: Side, newer: Side, topics: tuple[str, ...], headers: Mapping[str, str]) -> str:
    """Return the text of the header. `headers` has existing headers by name, which may translate nested messages."""
    from msggen.generate.text.environment import make_environment

    name, version = newer.message.name, older.message.message_version + 1
    translators = {
        inner: found
        for inner, message in older.nested.items()
        if (found := find_translator(inner, message.message_version, headers))
    }
    class_name = f"{name}V{version}Translation"
    own, *others = topics or (f"fmu/out/{ros_file(name)}",)
    from_older, to_older = _Copy(older, newer, translators, "fromOlder"), _Copy(newer, older, translators, "toOlder")
    from_lines = list(from_older.lines(older.message, newer.message, older.age, newer.age))
    unused = _constants_of_no_field(older.message, newer.message)
    from_lines += [f"{_TODO} {text}: translate the fields that use it" for text in unused]
    to_lines = list(to_older.lines(newer.message, older.message, newer.age, older.age))
    return (
        make_environment()
        .get_template("bump/translation.h.j2")
        .render(
            name=name,
            older_version=version - 1,
            newer_version=version,
            older_type=archived_name(older.message),
            older_file=ros_file(archived_name(older.message)),
            newer_file=ros_file(name),
            has_loops=any("std::size_t" in line for line in from_lines),
            headers=sorted({translator.header for translator in from_older.used}),
            class_name=class_name,
            topic=own,
            topic_note="" if topics else f"  {_TODO} no topic of {name} crosses the bridge",
            from_older=from_lines,
            to_older=to_lines,
            other_topics=[_OtherTopic(class_name + _camel_case(topic), topic) for topic in others],
        )
    )


def render_all_translations(header: str) -> str:
    """Return the text of a new `all_translations.h` that includes one header."""
    from msggen.generate.text.environment import make_environment

    return make_environment().get_template("bump/all_translations.h.j2").render(header=header)


def includes(text: str, header: str) -> bool:
    """Whether `text` includes `header`."""
    return any(found[1] == header for found in _INCLUDE.finditer(text))


def with_include(text: str, header: str) -> str:
    """Return `text` with an include of `header`, sorted by name and version among the translation headers."""
    found = list(_INCLUDE.finditer(text))
    before = [include.end() for include in found if _by_version(include[1]) < _by_version(header)]
    others = [include.end() for include in _ANY_INCLUDE.finditer(text)]
    if before:
        position = before[-1]
    elif found:
        position = found[0].start()
    else:
        position = others[-1] if others else len(text)
    head = text[:position]
    return f'{head}{"" if head.endswith(chr(10)) or not head else chr(10)}#include "{header}"\n{text[position:]}'


def with_archived(text: str, message: Message) -> str:
    """Return the text of a header with the current version of `message` replaced by its archived version.

    A header that names the archived version already translates from it to the current one, and is returned unchanged.
    """
    old = archived_name(message)
    if re.search(rf"\bpx4_msgs_old::msg::{old}\b", text):
        return text
    text = re.sub(rf"\bpx4_msgs::msg::{message.name}\b", f"px4_msgs_old::msg::{old}", text)
    return re.sub(
        rf"(?<=[<\"])px4_msgs/msg/{ros_file(message.name)}\.hpp", f"px4_msgs_old/msg/{ros_file(old)}.hpp", text
    )


def _by_version(header: str) -> tuple[str, int]:
    """Return a sort key by which version 10 comes after version 9."""
    name, _, version = header.removesuffix(".h").rpartition("_v")
    return (name, int(version)) if version.isdecimal() else (header, 0)


def _camel_case(topic: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[/_]+", topic))


class _Copy:
    """A writer of the statements that set one message from another. `used` has the translators that they call."""

    def __init__(self, source: Side, target: Side, translators: Mapping[str, Translator], function: str) -> None:
        self.source, self.target = source, target
        self.translators = translators
        self.function = function
        self.used: set[Translator] = set()

    def lines(self, source: Message, target: Message, at: str, to: str, depth: int = 0) -> Iterator[str]:
        """Yield the statements that set every field of the message called `to` from the one called `at`."""
        known = {field.name: field for field in source.fields}
        renamed = _renamed(source.fields, target.fields)
        versions = (source, target) if self.source.age == "older" else (target, source)
        for field in target.fields:
            twin = known.pop(field.name, None)
            place = f"{to}.{field.name}"
            notes = [*self._notes(twin, field, versions)] if twin else []
            if twin and twin.type == field.type and field.type.is_primitive and notes:
                yield f"{place} = {at}.{field.name};  {_TODO} {'; '.join(notes)}"
            elif twin and twin.type == field.type:
                yield from self._set(field.type, f"{at}.{field.name}", place, depth)
            elif twin:
                note = f"{twin.type} in the {self.source.age} version, {field.type} in the {self.target.age}"
                yield f"{place} = {_default(field.type, place)};  {_TODO} {note}"
            else:
                hint = f"; is it {at}.{renamed[field.name]} by another name?" if field.name in renamed else ""
                note = f"not in the {self.source.age} version{hint}"
                yield f"{place} = {_default(field.type, place)};  {_TODO} {note}"
        for name in known:
            yield f"// {at}.{name} is dropped: not in the {self.target.age} version"

    def _notes(self, twin: Field, field: Field, versions: tuple[Message, Message]) -> Iterator[str]:
        """Yield the reasons why a copy of `twin` to `field` may have another meaning."""
        tag = field.comment.tag("enum") or twin.comment.tag("enum")
        constants = changed_constants(*versions, _enum_prefixes(versions, [tag]))
        if constants:
            yield f"other constants: {few(constants)}"
        for each in twin.comment.changed_tags(field.comment):
            yield f"{each.before} in the {self.source.age} version, {each.after} in the {self.target.age}"

    def _set(self, type_: FieldType, at: str, to: str, depth: int) -> Iterator[str]:
        if type_.is_primitive:
            yield f"{to} = {at};"
        elif type_.array is ArrayKind.SCALAR:
            yield from self._set_nested(type_.name, at, to, depth)
        else:
            index = f"i{depth or ''}"
            if type_.array is not ArrayKind.FIXED:
                yield f"{to}.resize({at}.size());"
            yield f"for (std::size_t {index} = 0; {index} < {to}.size(); ++{index}) {{"
            for line in self._set_nested(type_.name, f"{at}[{index}]", f"{to}[{index}]", depth + 1):
                yield f"\t{line}"
            yield "}"

    def _set_nested(self, name: str, at: str, to: str, depth: int) -> Iterator[str]:
        """Yield a call of the translator of the nested message if there is one, else set it field by field.

        An archived and a current version are different types in C++, even with the same fields. A message of another
        package has the same type on both sides.
        """
        if name in self.translators:
            self.used.add(self.translators[name])
            yield f"{self.translators[name].class_name}::{self.function}({at}, {to});"
        elif name in self.source.nested and name in self.target.nested:
            yield from self.lines(self.source.nested[name], self.target.nested[name], at, to, depth)
        else:
            yield f"{to} = {at};"


def _default(type_: FieldType, place: str) -> str:
    """Return the C++ expression for the zero value of a field.

    It names the type of a message, because ROS 2 makes the constructors of messages explicit.
    """
    zero = PRIMITIVES[type_.name].cpp_zero if type_.is_primitive else ""
    if not zero:
        return f"decltype({place})()"
    return zero if type_.array is ArrayKind.SCALAR else "{}"


def _renamed(source: tuple[Field, ...], target: tuple[Field, ...]) -> dict[str, str]:
    """Return the probable old name of new fields: a removed field of the same type after the same neighbour."""
    gone = _between(source, {field.name for field in target})
    found: dict[str, str] = {}
    for neighbour, fields in _between(target, {field.name for field in source}).items():
        for field in fields:
            same = [other.name for other in gone.get(neighbour, ()) if other.type == field.type]
            free = [name for name in same if name not in found.values()]
            if free:
                found[field.name] = free[0]
    return found


def _between(fields: Iterable[Field], carried: set[str]) -> dict[str, list[Field]]:
    """Return the fields that are not in `carried`, grouped by the nearest field before them that is in it."""
    found: dict[str, list[Field]] = {}
    neighbour = ""
    for field in fields:
        if field.name in carried:
            neighbour = field.name
        else:
            found.setdefault(neighbour, []).append(field)
    return found
