"""The definitions in a recording, in the format `ros2msg`: a definition, and after each separator one that it nests."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain
from typing import TYPE_CHECKING

from msggen.base.diagnostics import Level
from msggen.definitions.identity import message_hash, type_hash
from msggen.definitions.layout import is_static
from msggen.definitions.model import Catalog, Conventions, Message
from msggen.definitions.nesting import Extent, cycles, too_large
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.primitives import OCTETS
from msggen.recordings.source.source import SEPARATOR, SchemaError

if TYPE_CHECKING:
    from collections.abc import Mapping

_HEAD = re.compile(r"^=+[ \t\r]*\nMSG:[ \t]*(\S+)[ \t\r]*$", re.MULTILINE)
"""The head of the definition of a nested message."""
_NO_CONVENTIONS = Conventions(
    "", 0, full_topic_path=True, version_suffix=True, default_interval_ms=0, exact_intervals=True
)


@dataclass(frozen=True, eq=False)
class Schema:
    """A definition that was read, with those that it nests."""

    catalog: Catalog
    message: Message
    value_count: int
    """How many values a sample has at least, those of each element of an array of messages among them."""

    @cached_property
    def is_static(self) -> bool:
        """Whether all samples have the same size: no strings, sequences, or messages without fields."""
        return is_static(self.catalog, self.message)


def read_schema(ros_type: str, definition: str) -> Schema:
    """Return the definition of `ros_type`, such as `px4_msgs/msg/VehicleStatus`. Raises SchemaError."""
    found = _read(ros_type, definition)
    if isinstance(found, str):
        raise SchemaError(found)
    return found


@lru_cache(1024)
def _read(ros_type: str, definition: str) -> Schema | str:
    """Return a definition, or why it cannot be read: many channels can have the same one."""
    try:
        return _parsed(ros_type, definition)
    except SchemaError as error:
        return str(error)


def _parsed(ros_type: str, definition: str) -> Schema:
    messages: dict[str, Message] = {}
    folders = {
        key_of(name): name.split("/")[1] for name in (ros_type, *_HEAD.findall(definition)) if name.count("/") > 1
    }
    for key, text in definitions_in(ros_type, definition).items():
        package, _, name = key.partition("/")
        message, errors = parse_message(text, key, name, package, of_uorb=False)
        error = next((each for each in errors if each.level is Level.ERROR), None)
        if error is not None:
            raise SchemaError(f"definition of {key}, line {error.location.line}: {error.message}")
        messages[key] = message._replace(folder=folders.get(key, message.folder))
    catalog = Catalog(messages, (), (), _NO_CONVENTIONS)
    message = messages[key_of(ros_type)]
    return Schema(catalog, message, _extent(messages, message).values)


def nested_values(ros_type: str, definition: str) -> int:
    """Return how many values a definition has that can have more than its text shows, otherwise 0."""
    if "MSG:" not in definition and "bool[" not in definition:
        return 0
    try:
        return read_schema(ros_type, definition).value_count
    except SchemaError:
        return 0


def definitions_in(ros_type: str, definition: str) -> dict[str, str]:
    """Return the texts of a definition and of those that it nests by names such as `px4_msgs/EscStatus`."""
    own, *others = _HEAD.split(definition)
    nested = {key_of(name): text for name, text in zip(others[::2], others[1::2], strict=True)}
    return {key_of(ros_type): own, **nested}


def hash_of(ros_type: str, definition: str) -> int | None:
    """Return the `message_hash` of PX4 (docs/wire.md, section 8), or None if the definition cannot be read."""
    if not definition:
        return None
    try:
        schema = read_schema(ros_type, definition)
    except SchemaError:
        return None
    return message_hash(schema.catalog, schema.message)


def content_of(catalog: Catalog, message: Message) -> frozenset[object]:
    """Return the fields of a message in no order, because a ULog has them in the order of uORB's struct."""
    return frozenset(
        (
            field.name,
            field.type.array,
            field.type.length,
            ("uint8" if field.type.name in OCTETS else field.type.name)
            if field.type.is_primitive
            else content_of(catalog, catalog.nested(message, field.type)),
        )
        for field in message.fields
    )


def type_hash_of(ros_type: str, definition: str) -> str:
    """Return ROS 2's type hash (docs/wire.md, section 10). Raises SchemaError."""
    schema = read_schema(ros_type, definition)
    return type_hash(schema.catalog, schema.message)


def definition_of(catalog: Catalog, message: Message) -> str:
    """Return a definition with those that it nests, in the format `ros2msg`, without comments and defaults."""
    package = message.released_as[0]
    nested = [
        f"{SEPARATOR}\nMSG: {'/'.join(inner.released_as)}\n{_lines(catalog, inner, package)}"
        for inner in catalog.nested_all(message)
    ]
    return "".join([_lines(catalog, message, package), *nested])


def _lines(catalog: Catalog, message: Message, package: str) -> str:
    constants = [f"{each.type} {each.name}={_spelled(each.value)}\n" for each in message.constants]
    fields = []
    for field in message.fields:
        type_ = field.type
        if not type_.is_primitive:
            of, name = catalog.nested(message, type_).released_as
            type_ = type_._replace(name=name, package=None if of == package else of)
        fields.append(f"{type_} {field.name}\n")
    return "".join(constants + fields)


def _spelled(value: object) -> str:
    return value if isinstance(value, str) else repr(value).lower()


def key_of(name: str) -> str:
    """Return `px4_msgs/EscStatus` for `px4_msgs/msg/EscStatus`."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}"


def _extent(messages: Mapping[str, Message], message: Message) -> Extent:
    """Return the extent of a definition. Raises SchemaError beyond the limits that definitions of a firmware have."""
    reached = {message.key: message}
    waiting = [message]
    while waiting:
        outer = waiting.pop()
        for field in outer.fields:
            if not field.type.is_primitive and (key := outer.key_of(field.type)) not in reached:
                if key not in messages:
                    raise SchemaError(f"{outer.name}.{field.name}: there is no definition of {field.type.base}")
                reached[key] = messages[key]
                waiting.append(messages[key])
    extents: dict[str, Extent] = {}
    for error in chain(cycles(reached), too_large(message, reached, extents)):
        raise SchemaError(error.message)
    return extents[message.key]
