"""Checks across definitions: names, nesting, the rules of uORB, the bridge, and the lists of the build."""

from __future__ import annotations

import posixpath
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from msggen.base.diagnostics import Diagnostic, counted, few, suggestion
from msggen.base.location import Location
from msggen.definitions.model import (
    DEFAULT_PACKAGE,
    ArrayKind,
    BridgeEntry,
    Field,
    FieldType,
    Message,
    Service,
    snake_case,
)
from msggen.definitions.nesting import Extent, cycles, too_large
from msggen.definitions.parse.field_type import type_hint
from msggen.definitions.primitives import INTEGERS, STRINGS
from msggen.sources.finding import Sources
from msggen.sources.tree_layout import LISTS

if TYPE_CHECKING:
    from msggen.definitions.parse.cmake import MessageLists

_OF_GENMSG = "px4"
"""The package of PX4's messages in genmsg, which some definitions before v1.14 spell."""


def check_names(definitions: Iterable[Message | Service], uorb: str) -> Iterator[Diagnostic]:
    """Check that names are unique in a package, and that no two definitions generate files with the same name.

    Names that differ only in case are the same for ROS 2 and for many file systems, but not for the firmware: its
    header for `FOO` is `f_o_o.h`. `uorb` is the package of uORB's messages, from which the firmware is built.
    """
    files: dict[tuple[str, str], Message | Service] = {}
    cases: dict[tuple[str, str], Message | Service] = {}
    for definition in definitions:
        package, name = definition.package, definition.name
        other = files.get((package, snake_case(name)))
        if other is not None:
            where = f"already defined in {other.location.path}"
            text = f"'{name}' is {where}"
            if other.name != name:
                text = f"'{name}' generates the same files as '{other.name}' in the firmware, {where}"
            yield Diagnostic(definition.location, "M204", text)
            continue
        files[package, snake_case(name)] = definition
        other = cases.setdefault((package, name.lower()), definition)
        if other is not definition:
            code = "M205" if package == uorb and isinstance(definition, Message) else "M204"
            text = f"'{name}' differs only in case from '{other.name}', already defined in {other.location.path}"
            yield Diagnostic(definition.location, code, f"{text}: ROS 2 generates the same files for both")


def check_nesting(
    messages: Iterable[Message],
    services: Iterable[Service],
    uorb: str,
    unbuilt: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[Diagnostic]:
    """Check that every nested type exists, that no message nests itself, and that none is too large.

    `uorb` is the package of uORB's messages. `unbuilt` has, by name, the reasons why messages are not built.
    """
    known = {message.key: message for message in messages}
    halves = [half for service in services for half in (service.request, service.response)]
    unknown = [error for outer in [*known.values(), *halves] for error in _unknown_types(outer, known, unbuilt)]
    yield from unknown
    nesting = list(cycles(known))
    yield from nesting
    if not unknown and not nesting:
        extents: dict[str, Extent] = {}
        for message in (*known.values(), *halves):
            yield from too_large(message, known, extents, uorb)


def check_topics(messages: Iterable[Message]) -> Iterator[Diagnostic]:
    """Check that each topic is declared once."""
    places: dict[str, Location] = {}
    for message in messages:
        for name, location in _topics(message):
            other = places.get(name)
            places.setdefault(name, location)
            if other is not None:
                where = f"on line {other.line}" if other.path == location.path else f"in {other}"
                yield Diagnostic(location, "M403", f"topic '{name}' is already declared {where}")


def check_timestamps(messages: Iterable[Message], sources: Sources | None = None) -> Iterator[Diagnostic]:
    """Check that every message has the field `uint64 timestamp`, which uORB requires."""
    hint = ""
    if sources and sources.root and sources.package not in ("", DEFAULT_PACKAGE):
        hint = f"; for the messages of another ROS package, use --msg-dir {sources.root.path}"
    for message in messages:
        stamps = [field for field in message.fields if field.name == "timestamp"]
        if not stamps:
            text = f"'{message.name}' has no timestamp: uORB expects a field 'uint64 timestamp'"
            yield Diagnostic(message.location, "M401", text + hint)
        elif str(stamps[0].type) != "uint64":
            text = f"uORB expects 'uint64 timestamp', found '{stamps[0].type} timestamp'"
            yield Diagnostic(stamps[0].location, "M401", text)


def check_fixed_sizes(messages: Iterable[Message], everything: Iterable[Message]) -> Iterator[Diagnostic]:
    """Check that messages have no strings and no sequences.

    uORB copies messages of a fixed size, and the firmware's build fails for others. `everything` includes the messages
    of other packages, which uORB's `messages` may nest.
    """
    known = {message.key: message for message in everything}
    for message in messages:
        for field in message.fields:
            if not field.type.is_fixed_size:
                example = f"{'char' if field.type.name in STRINGS else field.type.base}[32]"
                text = f"expected an array such as '{example}', found '{field.type} {field.name}'"
                yield Diagnostic(field.location, "M306", f"uORB messages have a fixed size: {text}")
            elif field.type.package not in (None, message.package) and _differs_in_size(message, field, known):
                text = f"uORB messages have a fixed size: '{field.type}' has strings or sequences"
                yield Diagnostic(field.location, "M306", text)


def check_no_defaults(messages: Iterable[Message]) -> Iterator[Diagnostic]:
    """Check that no field has a default value, which the firmware's generator does not read."""
    for message in messages:
        for field in message.fields:
            if field.default is not None:
                text = f"the firmware cannot be built with a default value: expected '{field.type} {field.name}'"
                yield Diagnostic(field.location, "M307", text)


def _differs_in_size(outer: Message, field: Field, known: Mapping[str, Message]) -> bool:
    inner = None if field.type.is_primitive else known.get(outer.key_of(field.type))
    return not field.type.is_fixed_size or (
        inner is not None and any(_differs_in_size(inner, nested, known) for nested in inner.fields)
    )


def check_bridge(
    entries: Sequence[BridgeEntry],
    messages: Iterable[Message],
    uorb: str,
    unbuilt: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[Diagnostic]:
    """Check that every entry names an existing message of the package `uorb` and a topic that this message declares.

    The firmware's script reads only the name of the message, so another package is a warning. `unbuilt` has, by name,
    the reasons why messages are not built.
    """
    messages = list(messages)
    names = {message.name: message for message in messages if message.package == uorb}
    packages = {entry.package for entry in entries}
    is_known = any(entry.message_name in names for entry in entries)
    if len(entries) > 1 and len(packages) == 1 and uorb not in packages and not is_known:
        first = entries[0]
        text = f"the file names types of '{first.package}', but the package of the firmware's messages is '{uorb}'"
        yield Diagnostic(first.type_location, "Y201", text)
        return
    others = {f"{message.package}::msg::{message.name}" for message in messages if message.package != uorb}
    owners = {topic: message for message in names.values() for topic in message.topic_names}
    yield from _foreign_types(entries, names, uorb)
    seen: dict[tuple[str, int | None], BridgeEntry] = {}
    for entry in entries:
        other = seen.setdefault((entry.topic, entry.instance), entry)
        if other is not entry:
            text = f"'{entry.topic}' is already bridged on line {other.location.line}"
            yield Diagnostic(entry.location, "Y204", text)
        name, topic = entry.message_name, entry.uorb_topic
        if name not in names:
            types = [f"{uorb}::msg::{known}" for known in names]
            hint = unbuilt.get(name) or suggestion(entry.type_name, types)
            text = f"no message defines the type '{entry.type_name}'{hint}"
            if entry.type_name in others:
                text = f"'{entry.type_name}' is not a uORB message: expected a type of the package '{uorb}'"
            yield Diagnostic(entry.type_location, "Y201", text)
        elif topic not in owners:
            declared = names[name].topic_names
            hint = suggestion(topic, declared) or f": '{name}' declares {few(declared)}"
            cure = f"which takes '# TOPICS {' '.join((*declared, topic))}' in {name}.msg"
            yield Diagnostic(entry.location, "Y202", f"no message declares the topic '{topic}', {cure}{hint}")
        elif owners[topic] is not names[name]:
            text = f"topic '{topic}' carries '{owners[topic].name}', found '{name}'"
            yield Diagnostic(entry.type_location, "Y203", text)
        elif entry.route_field:
            yield from _check_route(entry, names[name])


def _foreign_types(entries: Sequence[BridgeEntry], names: Collection[str], uorb: str) -> Iterator[Diagnostic]:
    """Yield a warning for each other package under which entries bridge messages of the firmware."""
    foreign: dict[str, list[BridgeEntry]] = {}
    for entry in entries:
        if entry.package != uorb and entry.message_name in names:
            foreign.setdefault(entry.package, []).append(entry)
    for package, found in foreign.items():
        named = few([*dict.fromkeys(entry.message_name for entry in found)])
        text = f"messages of the firmware cross the bridge as types of '{package}' ({named})"
        text += f": ROS nodes need that package; write '{uorb}::msg::{found[0].message_name}' for '{uorb}'"
        yield Diagnostic(found[0].type_location, "Y110", text)


def _check_route(entry: BridgeEntry, message: Message) -> Iterator[Diagnostic]:
    """Check that the route field exists and is a single integer, because PX4 stores its values as uint32."""
    fields = {field.name: field.type for field in message.fields}
    found = fields.get(entry.route_field or "")
    if found is None:
        text = f"'{message.name}' has no field '{entry.route_field}' to route by"
        yield Diagnostic(entry.location, "Y205", f"{text}{suggestion(entry.route_field or '', fields)}")
    elif found.name not in INTEGERS or found.array is not ArrayKind.SCALAR:
        text = f"'{message.name}' is routed by '{entry.route_field}': expected an integer, found {found}"
        yield Diagnostic(entry.location, "Y205", text)


def check_lists(sources: Sources, lists: MessageLists) -> Iterator[Diagnostic]:
    """Check that a tree lists every message and no others, and report conditions in its lists that no board decides.

    The lists of the embedded releases have only the messages with a condition, because these releases have no boards.
    """
    conditional: dict[str, list[str]] = {}
    for file in (*sources.messages, *sources.unbuilt):
        entry = lists.listed.get(file.name.removeprefix("msg/")) if file.tree is sources.root else None
        if entry and entry.condition:
            conditional.setdefault(entry.condition, []).append(file.stem)
        elif sources.is_tree and lists.complete and not entry and file.tree is sources.root:
            text = f"{LISTS} does not list '{file.stem}': the firmware does not build it"
            yield Diagnostic(Location(file.path), "M408", text)
    if sources.is_tree and lists.complete:
        yield from _check_listed(sources, lists)
    places = {entry.condition: entry.location for entry in reversed([*lists.listed.values()])}
    if lists.complete and sources.board is None and conditional:
        number = counted(sum(map(len, conditional.values())), "message")
        text = f"ids depend on the board, name it with --board: only some boards build {number} of this tree"
        yield Diagnostic(places[next(iter(conditional))], "M407", text)
    for condition, names in conditional.items():
        if sources.board and sources.board.builds(condition) is None:
            text = f"cannot tell whether '{condition}' holds for {sources.board.name}"
            why = f"its messages are kept: {few(names)}; neither the board nor a Kconfig file decides it"
            yield Diagnostic(places[condition], "M409", f"{text}, {why}")


def _check_listed(sources: Sources, lists: MessageLists) -> Iterator[Diagnostic]:
    """Check that every listed file exists. A list may use commands that msggen does not know, so this is a warning."""
    files = (*sources.messages, *sources.unbuilt)
    names = [file.name.removeprefix("msg/").removesuffix(".msg") for file in files if file.tree is sources.root]
    unlisted = [name for name in names if f"{name}.msg" not in lists.listed]
    for file, entry in lists.listed.items():
        if sources.root and not file.startswith("/") and not sources.root.is_file(posixpath.normpath(f"msg/{file}")):
            name = file.removesuffix(".msg")
            elsewhere = [each for each in names if posixpath.basename(each) == posixpath.basename(name)]
            hint = suggestion(name, elsewhere or unlisted) or suggestion(name, names)
            yield Diagnostic(entry.location, "M411", f"'{file}' does not exist, so the firmware's build stops{hint}")


def _unknown_types(outer: Message, known: Mapping[str, Message], unbuilt: Mapping[str, str]) -> Iterator[Diagnostic]:
    for field in outer.fields:
        type_ = field.type
        if not type_.is_primitive and outer.key_of(type_) not in known:
            reason = unbuilt.get(type_.name) if type_.package in (None, outer.package) else None
            yield Diagnostic(
                field.location, "M301", f"unknown type '{type_.base}'{reason or _hint(outer, type_, known)}"
            )


def _hint(outer: Message, type_: FieldType, known: Mapping[str, Message]) -> str:
    """Return a hint for an unknown type: the type that was probably meant, or how to add its package."""
    names: dict[str, list[str]] = {outer.package: []}
    for message in known.values():
        if message is not outer:
            names.setdefault(message.package, []).append(message.name)
    if type_.package is None:
        if outer.version_of and type_.name in names.get(outer.released_as[0], ()):
            return f": archived messages nest archived ones, such as '{type_.name}V0'"
        elsewhere = sorted(package for package in names if type_.name in names[package])
        if elsewhere:
            return f", did you mean '{elsewhere[0]}/{type_.name}'?"
        return type_hint(type_.name, names[outer.package])
    if type_.package in names:
        return suggestion(type_.base, [f"{type_.package}/{name}" for name in names[type_.package]])
    if type_.package == _OF_GENMSG:
        own = names[outer.package]
        text = ": PX4's messages are nested without a package"
        return f"{text}, write '{type_.name}'" if type_.name in own else f"{text}{suggestion(type_.name, own)}"
    text = f": the package '{type_.package}' is not among the sources"
    return f"{text}, name it with --msg-dir {type_.package}=DIR"


def _topics(message: Message) -> Iterator[tuple[str, Location]]:
    if not message.topics:
        yield snake_case(message.name), message.location
    for topic in message.topics:
        yield topic.name, topic.location
