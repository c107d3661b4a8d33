"""Identities of messages and topics in the firmware and in ROS 2: hashes, ids, names, and quality of service.

The rules and their sources are in docs/wire.md, 8 to 13.
"""

from collections.abc import Iterator
from hashlib import sha256
from typing import NamedTuple

from msggen.base.qos import DEPTH
from msggen.definitions.model import ArrayKind, BridgeEntry, Catalog, Conventions, Direction, FieldType, Message
from msggen.definitions.primitives import PRIMITIVES

_FNV_OFFSET, _FNV_PRIME = 0x811C9DC5, 0x01000193

_NESTED_TYPE_ID = 1
"""The type_id of a nested message (docs/wire.md, 10)."""

_ARRAY_OFFSETS = {ArrayKind.SCALAR: 0, ArrayKind.FIXED: 48, ArrayKind.BOUNDED: 96, ArrayKind.UNBOUNDED: 144}
_BOUNDED_STRING_OFFSET = 4
_PLACEHOLDER = ("structure_needs_at_least_one_member", FieldType("uint8"))
"""The field that ROS 2 adds to a message without fields."""


def message_hash(catalog: Catalog, message: Message) -> int:
    """Return the hash that the firmware's compatibility check compares: 32-bit FNV-1a of the list of fields."""
    value = _FNV_OFFSET
    for byte in "".join(_field_lines(catalog, message)).encode():
        value = (value ^ byte) * _FNV_PRIME & 0xFFFFFFFF
    return value


def _field_lines(catalog: Catalog, message: Message) -> Iterator[str]:
    for field in message.fields:
        if field.type.is_primitive:
            yield f"{field.type} {field.name}\n"
        else:
            inner = catalog.nested(message, field.type)
            yield f"{field.type._replace(package=None, name=inner.released_as[1])} {field.name}\n"
            yield from _field_lines(catalog, inner)


def type_hash(catalog: Catalog, message: Message) -> str:
    """Return ROS 2's type hash, RIHS01 (docs/wire.md, 10)."""
    nested = ", ".join(_description(catalog, inner) for inner in catalog.nested_all(message))
    # plain formatting is enough: no name in the JSON needs an escape
    text = f'{{"type_description": {_description(catalog, message)}, "referenced_type_descriptions": [{nested}]}}'
    return "RIHS01_" + sha256(text.encode()).hexdigest()


def _description(catalog: Catalog, message: Message) -> str:
    named = [(field.name, field.type) for field in message.fields] or [_PLACEHOLDER]
    fields = ", ".join(f'{{"name": "{name}", "type": {_type(catalog, message, type_)}}}' for name, type_ in named)
    return f'{{"type_name": "{message.ros_type}", "fields": [{fields}]}}'


def _type(catalog: Catalog, outer: Message, type_: FieldType) -> str:
    if type_.is_primitive:
        base, nested = PRIMITIVES[type_.name].type_id, ""
    else:
        base, nested = _NESTED_TYPE_ID, catalog.nested(outer, type_).ros_type
    bound = 0 if type_.string_bound is None else _BOUNDED_STRING_OFFSET
    return (
        f'{{"type_id": {base + bound + _ARRAY_OFFSETS[type_.array]}, "capacity": {type_.length}, '
        f'"string_capacity": {type_.string_bound or 0}, "nested_type_name": "{nested}"}}'
    )


class UorbTopic(NamedTuple):
    """A uORB topic: its name, its id in `ORB_ID`, and its message."""

    name: str
    orb_id: int
    message: Message

    @property
    def condition(self) -> str:
        """The condition under which the firmware's build includes the message, "" for none."""
        return self.message.condition


def uorb_topics(catalog: Catalog) -> tuple[UorbTopic, ...]:
    """Return all topics in the order of their ids, which is the order of their names."""
    owners = {topic: message for message in catalog.uorb_messages for topic in message.topic_names}
    return tuple(UorbTopic(name, index, owners[name]) for index, name in enumerate(sorted(owners)))


class Qos(NamedTuple):
    """The quality of service of a writer or a reader, in DDS's terms; a depth of 0 leaves it to the middleware."""

    reliability: str
    durability: str
    history: str
    depth: int


PX4_WRITER = Qos("BEST_EFFORT", "TRANSIENT_LOCAL", "KEEP_LAST", 0)
"""The QoS of all of PX4's writers (docs/wire.md, 13)."""

APPLICATION = Qos("BEST_EFFORT", "VOLATILE", "KEEP_LAST", DEPTH)
"""The QoS of an application that matches PX4's. A reader must not request RELIABLE; a writer may offer either."""


class Endpoint(NamedTuple):
    """A bridged topic, as DDS and ROS 2 see it. `object_id` is the id that the XRCE client gives it, None if only
    PX4's list for Zenoh has the topic. `zenoh` is the entry of that list, None if it does not have the topic.

    `publish_interval_ms` is the shortest time between two samples that PX4 sends: 0 if it sends all samples in its
    queue, None for topics into PX4.
    """

    entry: BridgeEntry
    message: Message
    ros_name: str
    object_id: int | None
    publish_interval_ms: int | None
    zenoh: BridgeEntry | None = None

    @property
    def options_text(self) -> str:
        """The options of Zenoh's client."""
        return (self.zenoh or self.entry).options_text

    def zenoh_key(self, catalog: Catalog) -> str:
        """Return the key of the samples on Zenoh in domain 0, "" for none (docs/wire.md, 17)."""
        if self.zenoh is None:
            return ""
        instance = "" if self.zenoh.instance is None else self.zenoh.instance
        return f"0{self.zenoh.topic}{instance}/{self.message.dds_type}/{type_hash(catalog, self.message)}"

    @property
    def dds_name(self) -> str:
        """The name of the DDS topic: the ROS 2 name with the prefix `rt`."""
        return f"rt{self.ros_name}"

    @property
    def writer_qos(self) -> Qos:
        """The QoS of the writer: PX4's for topics out of PX4, the application's for topics into PX4."""
        return PX4_WRITER if self.entry.direction is Direction.OUT else APPLICATION

    @property
    def reader_qos(self) -> Qos:
        """The QoS of the reader: the application's for topics out of PX4, PX4's for topics into PX4.

        PX4's reader keeps as many samples as uORB's queue holds, for each source.
        """
        if self.entry.direction is Direction.OUT:
            return APPLICATION
        sources = self.entry.max_instances or _SOURCES
        return Qos("BEST_EFFORT", "VOLATILE", "KEEP_LAST", sources * self.message.queue_length)


_SOURCES = 2
"""The number of sources that PX4's reader assumes without `max_instances` (docs/wire.md, 13)."""


def endpoints(catalog: Catalog) -> tuple[Endpoint, ...]:
    """Return the endpoints in the YAML's order: those of publications, subscriptions, then subscriptions_multi.

    In each direction, those that only PX4's list for Zenoh has come last.
    """
    by_name = {message.name: message for message in catalog.uorb_messages}
    topics = {topic.name: topic for topic in uorb_topics(catalog)}
    on_zenoh = {entry.crossing: entry for entry in catalog.zenoh}
    found = []
    subscriptions = 0
    for entry in catalog.bridge:
        message = by_name[entry.message_name]
        if entry.direction is Direction.OUT:
            object_id = topics[entry.uorb_topic].orb_id + (entry.instance or 0) * len(topics)
            interval = _interval(entry, catalog.conventions)
        else:
            object_id = catalog.conventions.first_subscription_id + subscriptions
            interval = None
            subscriptions += 1
        endpoint = Endpoint(
            entry=entry,
            message=message,
            ros_name=_ros_name(entry, message, catalog.conventions),
            object_id=object_id,
            publish_interval_ms=interval,
            zenoh=on_zenoh.pop(entry.crossing, None),
        )
        found.append(endpoint)
    for entry in on_zenoh.values():
        message = topics[entry.uorb_topic].message  # whatever the YAML says: the client takes the topic's
        name = _ros_name(entry, message, catalog.conventions)
        found.append(Endpoint(entry, message, name, None, 0 if entry.direction is Direction.OUT else None, entry))
    return tuple(sorted(found, key=lambda endpoint: endpoint.entry.direction is Direction.IN))


def _interval(entry: BridgeEntry, conventions: Conventions) -> int:
    """Return the interval in milliseconds that PX4 derives from a rate limit (docs/wire.md, 15)."""
    rate = entry.rate_limit_hz
    if rate is None or (rate == 0 and not conventions.exact_intervals):
        return conventions.default_interval_ms
    if not conventions.exact_intervals:
        return int(1000 / rate)
    return nearest_interval(rate)


def nearest_interval(rate: float) -> int:
    """Return the interval in whole milliseconds nearest to a rate limit in Hz, at least 1; 0 for no limit."""
    return max(1, round(1000 / rate)) if rate else 0


def endpoint_versions(catalog: Catalog, endpoint: Endpoint) -> tuple[tuple[str, Message], ...]:
    """Return the ROS name and the message of each version of an endpoint, the oldest first.

    In releases whose topic names have no version suffix, this is only the current version.
    """
    known = catalog.versions(endpoint.message) if catalog.conventions.version_suffix else (endpoint.message,)
    return tuple((_ros_name(endpoint.entry, version, catalog.conventions), version) for version in known)


def _ros_name(entry: BridgeEntry, message: Message, conventions: Conventions) -> str:
    name = entry.topic if conventions.full_topic_path else f"/fmu/{entry.direction.value}/{entry.uorb_topic}"
    instance = "" if entry.instance is None else str(entry.instance)
    version = f"_v{message.message_version}" if conventions.version_suffix and message.message_version else ""
    return f"{name}{instance}{version}"
