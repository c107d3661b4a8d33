"""Do definitions fit together? What no single file can tell: names, nesting, uORB's rules, the bridge."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from msggen.diagnostics import Diagnostic, suggestion
from msggen.location import Location
from msggen.model import PRIMITIVES, SIZES, BridgeEntry, Field, Message, Service, snake_case

MAX_SIZE = 2**16 - 1
"""uORB keeps the size of a message in 16 bits."""

MAX_DEPTH = 64
"""Deepest nesting; PX4's deepest is 2."""


def check_names(definitions: Iterable[Message | Service]) -> Iterator[Diagnostic]:
    """No name twice, nor twice but for case: that would be one file on many machines."""
    seen: dict[str, Message | Service] = {}
    for definition in definitions:
        other = seen.setdefault(definition.name.lower(), definition)
        if other is definition:
            continue
        what = "is" if other.name == definition.name else f"differs only in case from '{other.name}',"
        text = f"'{definition.name}' {what} already defined in {other.location.path}"
        yield Diagnostic(definition.location, "M204", text)


def check_nesting(messages: Iterable[Message], services: Iterable[Service]) -> Iterator[Diagnostic]:
    """Every nested type exists, nothing nests itself, and nothing outgrows uORB."""
    known = {message.key: message for message in messages}
    halves = [half for service in services for half in (service.request, service.response)]
    unknown = [fault for outer in [*known.values(), *halves] for fault in _unknown_types(outer, known)]
    yield from unknown
    cycles = list(_cycles(known))
    yield from cycles
    if not unknown and not cycles:
        sizes: dict[str, int] = {}
        for message in known.values():
            size = _data_size(message, known, sizes)
            if size > MAX_SIZE:
                largest = max(message.fields, key=lambda field: _field_size(message, field, known, sizes))
                text = (
                    f"'{message.name}' has {size} bytes, uORB carries up to {MAX_SIZE}: '{largest.type}' is too large"
                )
                yield Diagnostic(largest.location, "M304", text)


def check_topics(messages: Iterable[Message]) -> Iterator[Diagnostic]:
    """No topic belongs to two messages, or twice to one."""
    owners: dict[str, Message] = {}
    for message in messages:
        for name, location in _topics(message):
            other = owners.setdefault(name, message)
            if other is not message:
                text = f"topic '{name}' is already declared by {other.location.path}"
                yield Diagnostic(location, "M403", text)
        names: set[str] = set()
        for topic in message.topics:
            if topic.name in names:
                yield Diagnostic(topic.location, "M403", f"topic '{topic.name}' is already declared in this file")
            names.add(topic.name)


def check_timestamps(messages: Iterable[Message]) -> Iterator[Diagnostic]:
    """Every message has the field that uORB stamps."""
    for message in messages:
        stamps = [field for field in message.fields if field.name == "timestamp"]
        if not stamps:
            text = f"'{message.name}' has no timestamp: uORB expects a field 'uint64 timestamp'"
            yield Diagnostic(message.location, "M401", text)
        elif str(stamps[0].type) != "uint64":
            text = f"uORB expects 'uint64 timestamp', found '{stamps[0].type} timestamp'"
            yield Diagnostic(stamps[0].location, "M401", text)


def check_bridge(entries: Iterable[BridgeEntry], messages: Iterable[Message]) -> Iterator[Diagnostic]:
    """Every entry names a message that exists, and a topic that this message declares."""
    names = {message.name: message for message in messages}
    owners = {topic: message for message in names.values() for topic in message.topic_names}
    seen: dict[tuple[str, int | None], BridgeEntry] = {}
    for entry in entries:
        other = seen.setdefault((entry.topic, entry.instance), entry)
        if other is not entry:
            text = f"'{entry.topic}' is already bridged on line {other.location.line}"
            yield Diagnostic(entry.location, "Y204", text)
        name, topic = entry.message_name, entry.uorb_topic
        if name not in names or entry.package != names[name].package:
            types = [f"{message.package}::msg::{message.name}" for message in names.values()]
            text = f"no message defines the type '{entry.type_name}'{suggestion(entry.type_name, types)}"
            yield Diagnostic(entry.type_location, "Y201", text)
        elif topic not in owners:
            declared = names[name].topic_names
            hint = suggestion(topic, declared) or f": '{name}' declares {', '.join(declared)}"
            yield Diagnostic(entry.location, "Y202", f"no message declares the topic '{topic}'{hint}")
        elif owners[topic] is not names[name]:
            text = f"topic '{topic}' carries '{owners[topic].name}', found '{name}'"
            yield Diagnostic(entry.type_location, "Y203", text)


def _unknown_types(outer: Message, known: Mapping[str, Message]) -> Iterator[Diagnostic]:
    for field in outer.fields:
        type_ = field.type
        if type_.is_primitive or outer.key_of(type_) in known:
            continue
        if type_.package and not any(key.startswith(f"{type_.package}/") for key in known):
            text = f"unknown type '{type_.base}': the package '{type_.package}' is not among the sources"
        elif f"{outer.version_of.split('/')[0]}/{type_.name}" in known:
            text = f"unknown type '{type_.base}': archived messages nest archived ones, as '{type_.name}V0'"
        else:
            names = [key.split("/")[1] for key in known if key.startswith(f"{type_.package or outer.package}/")]
            text = f"unknown type '{type_.base}'{suggestion(type_.name, [*names, *PRIMITIVES])}"
        yield Diagnostic(field.location, "M301", text)


def _nested(outer: Message, known: Mapping[str, Message]) -> Iterator[tuple[Field, Message]]:
    for field in outer.fields:
        inner = None if field.type.is_primitive else known.get(outer.key_of(field.type))
        if inner is not None:
            yield field, inner


def _cycles(known: Mapping[str, Message]) -> Iterator[Diagnostic]:
    """Follow what each message nests, depth first, without recursion: input may nest as deep as it likes."""
    done: set[str] = set()
    for start in known.values():
        path = [start.key]
        stack = [_nested(start, known)]
        while stack and start.key not in done:
            step = next(stack[-1], None)
            if step is None:
                done.add(path.pop())
                stack.pop()
                continue
            field, inner = step
            if inner.key in path:
                names = [key.split("/")[1] for key in [*path[path.index(inner.key) :], inner.key]]
                yield Diagnostic(field.location, "M302", f"messages nest each other: {' > '.join(names)}")
            elif len(path) == MAX_DEPTH:
                yield Diagnostic(field.location, "M302", f"'{start.name}' nests more than {MAX_DEPTH} messages deep")
                done.update(path)
            elif inner.key not in done:
                path.append(inner.key)
                stack.append(_nested(inner, known))


def _data_size(message: Message, known: Mapping[str, Message], sizes: dict[str, int]) -> int:
    """Return the bytes of `message` without padding; what has no fixed size counts as nothing."""
    if message.key not in sizes:
        sizes[message.key] = sum(_field_size(message, field, known, sizes) for field in message.fields)
    return sizes[message.key]


def _field_size(outer: Message, field: Field, known: Mapping[str, Message], sizes: dict[str, int]) -> int:
    type_ = field.type
    if not type_.is_fixed_size:
        return 0
    if type_.is_primitive:
        return SIZES[type_.name] * type_.count
    return _data_size(known[outer.key_of(type_)], known, sizes) * type_.count


def _topics(message: Message) -> Iterator[tuple[str, Location]]:
    if not message.topics:
        yield snake_case(message.name), message.location
    for topic in message.topics:
        yield topic.name, topic.location
