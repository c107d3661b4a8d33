"""What a message, a field, a constant, a topic, a service and a catalog are.

Plain frozen values: no text is read here and no byte is laid out. Every node carries the place it was
read from, so that whoever finds error with it later can say where.
"""

import re
from collections.abc import Mapping
from enum import Enum
from functools import cache
from types import MappingProxyType
from typing import NamedTuple, Union

from msggen.diagnostics import Diagnostic
from msggen.location import Location
from msggen.primitives import PRIMITIVES, STRINGS
from msggen.tags import ATTRIBUTES, COMPARED, UNIT, TagChange

TYPE_CHECKING = False
if TYPE_CHECKING:
    from msggen.translation import Translation

Value = Union[bool, int, float, str, tuple["Value", ...]]  # noqa: UP007 - evaluated, and it names itself
"""What a constant or a default may hold; tuples only as defaults of arrays."""

VERSION = "MESSAGE_VERSION"
"""The constant that says which version of a message a definition is."""

DEFAULT_PACKAGE = "px4_msgs"
"""The ROS 2 package that the firmware's definitions belong to."""

ARCHIVE_PACKAGE = "px4_msgs_old"
"""The ROS 2 package in which the firmware keeps earlier versions of messages, from v1.16 on."""

_LATER_CAPITAL = re.compile(r"(?<!^)(?=[A-Z])")


@cache
def snake_case(name: str) -> str:
    """Return `name` as uORB spells topics: an underscore before every later capital."""
    return _LATER_CAPITAL.sub("_", name).lower()


class ArrayKind(Enum):
    """How many values a field holds."""

    SCALAR = "one value"
    FIXED = "exactly `length` values"
    BOUNDED = "up to `length` values"
    UNBOUNDED = "any number of values"


class FieldType(NamedTuple):
    """The type of a field: `name` is a primitive, or a message of `package` (None: the field's own)."""

    name: str
    package: str | None = None
    array: ArrayKind = ArrayKind.SCALAR
    length: int = 0
    string_bound: int | None = None

    @property
    def is_primitive(self) -> bool:
        """Whether the grammar has the type built in; every other type is a message."""
        return self.package is None and self.name in PRIMITIVES

    @property
    def element_count(self) -> int:
        """The length of a fixed array; 1 for others."""
        return self.length if self.array is ArrayKind.FIXED else 1

    @property
    def is_fixed_size(self) -> bool:
        """Whether the field itself has a static size; a nested message may still have none."""
        return self.name not in STRINGS and self.array in (ArrayKind.SCALAR, ArrayKind.FIXED)

    @property
    def base(self) -> str:
        """The type of one value, as a definition spells it."""
        bound = "" if self.string_bound is None else f"<={self.string_bound}"
        return f"{self.package}/{self.name}" if self.package else f"{self.name}{bound}"

    def __str__(self) -> str:
        if self.array is ArrayKind.SCALAR:
            return self.base
        if self.array is ArrayKind.FIXED:
            return f"{self.base}[{self.length}]"
        return f"{self.base}[<={self.length}]" if self.array is ArrayKind.BOUNDED else f"{self.base}[]"


_ATTRIBUTES = frozenset(tag.name for tag in ATTRIBUTES)


class Comment(NamedTuple):
    """The comment of a field or constant, taken apart.

    `text` has the sentences without the tags. `tags` has name and content of every tag with an `@`, known or not, the
    known ones in the order of `TAGS`.
    """

    text: str = ""
    unit: str = ""
    tags: tuple[tuple[str, str], ...] = ()

    def tag(self, name: str) -> str:
        """Return the content of a tag, "" where the comment has none of that name."""
        if name == UNIT.name:
            return self.unit
        return next((content for known, content in self.tags if known == name), "")

    @property
    def attributes(self) -> list[tuple[str, str]]:
        """Name and content of the tags that are attributes, those without content left out."""
        unit = [(UNIT.name, self.unit)] if self.unit else []
        return unit + [(name, content) for name, content in self.tags if content and name in _ATTRIBUTES]

    def changed_tags(self, after: "Comment") -> list[TagChange]:
        """Return the tags that both comments have, and that do not mean the same."""
        if self == after:
            return []
        return [change for tag in COMPARED if (change := tag.change(self.tag(tag.name), after.tag(tag.name)))]

    def __str__(self) -> str:
        tags = [f"[{self.unit}]"] if self.unit else []
        tags += [f"[@{name} {value}]" if value else f"[@{name}]" for name, value in self.tags]
        return " ".join([*tags, self.text]).strip()


class Field(NamedTuple):
    """One field; `location` is where its type starts, `name_column` where its name does."""

    name: str
    type: FieldType
    location: Location
    name_column: int
    default: Value | None = None
    comment: Comment = Comment()


class Constant(NamedTuple):
    """One constant; `location` is where its type starts, `name_column` where its name does."""

    name: str
    type: FieldType
    value: Value
    location: Location
    name_column: int
    comment: Comment = Comment()


class Topic(NamedTuple):
    """A uORB topic that a message declares."""

    name: str
    location: Location


class Message(NamedTuple):
    """A `.msg` file, or one half of a `.srv` file (`folder` is then "srv")."""

    name: str
    package: str
    location: Location
    folder: str = "msg"
    fields: tuple[Field, ...] = ()
    constants: tuple[Constant, ...] = ()
    topics: tuple[Topic, ...] = ()
    comment: str = ""
    version_of: str = ""
    """Of an archived version: the key of the message that it is an earlier version of."""
    condition: str = ""
    """The condition under which the firmware's build lists the message, as CMake spells it; "" for none."""

    @property
    def key(self) -> str:
        """The name that other definitions nest it by, and catalogs find it by."""
        return f"{self.package}/{self.name}"

    def key_of(self, nested: FieldType) -> str:
        """The name that the message of a nested field is found by."""
        return f"{nested.package or self.package}/{nested.name}"

    @property
    def released_as(self) -> tuple[str, str]:
        """Package and name that the wire and all hashes know: an earlier version has those of its message."""
        package, _, name = (self.version_of or self.key).partition("/")
        return package, name

    @property
    def ros_type(self) -> str:
        """`px4_msgs/msg/VehicleStatus`."""
        package, name = self.released_as
        return f"{package}/{self.folder}/{name}"

    @property
    def dds_type(self) -> str:
        """`px4_msgs::msg::dds_::VehicleStatus_`."""
        package, name = self.released_as
        return f"{package}::{self.folder}::dds_::{name}_"

    @property
    def topic_names(self) -> tuple[str, ...]:
        """The uORB topics of this message: what it declares, or else its own name; none of a version."""
        if self.version_of:
            return ()
        return tuple(topic.name for topic in self.topics) or (snake_case(self.name),)

    @property
    def message_version(self) -> int:
        """MESSAGE_VERSION as the firmware reads it, or 0: what it assumes without."""
        return self._special(VERSION, 0) % 2**32

    @property
    def is_versioned(self) -> bool:
        """Whether the message says which version it is."""
        return any(constant.name == VERSION for constant in self.constants)

    @property
    def queue_length(self) -> int:
        """ORB_QUEUE_LENGTH, or 1: how many samples uORB keeps."""
        return self._special("ORB_QUEUE_LENGTH", 1)

    def _special(self, name: str, default: int) -> int:
        values = [constant.value for constant in self.constants if constant.name == name]
        try:
            return int(values[0]) if values else default  # type: ignore[arg-type]  # a tuple is a TypeError
        except (TypeError, ValueError, OverflowError):
            return default


class Service(NamedTuple):
    """A `.srv` file: two messages, `<Name>_Request` and `<Name>_Response`."""

    name: str
    package: str
    location: Location
    request: Message
    response: Message
    comment: str = ""


class Direction(Enum):
    """Seen from the vehicle, as the topic names are: `/fmu/out` is what PX4 publishes."""

    OUT = "out"
    IN = "in"


def options_text(options: Mapping[str, object]) -> str:
    """Return the options of an entry as PX4 hands them to Zenoh's client: `cc=block,express=true`."""
    return ",".join(
        f"{key}={str(value).lower() if isinstance(value, bool) else value}" for key, value in options.items()
    )


class BridgeEntry(NamedTuple):
    """One entry of `dds_topics.yaml`.

    `rate_limit_hz` is None where the entry has none (the firmware then has a default) and 0.0 for no limit.
    `instance` counts for publications only. `route_field` and `max_instances` come together, in
    `subscriptions_multi` (PX4 v1.18): each value of that field of a sample gets a uORB instance of its own, and what
    comes after `max_instances` values is dropped. `options` are for Zenoh's client. `extra` has the keys that msggen
    does not know, and the values that it cannot use.
    """

    direction: Direction
    topic: str
    type_name: str
    location: Location
    type_location: Location
    multi: bool = False
    rate_limit_hz: float | None = None
    instance: int | None = None
    route_field: str | None = None
    max_instances: int | None = None
    options: Mapping[str, object] = MappingProxyType({})
    extra: Mapping[str, object] = MappingProxyType({})

    def __hash__(self) -> int:
        """Two entries are never at one place; their data may hold lists, which have no hash."""
        return hash(self.location)

    @property
    def options_text(self) -> str:
        """The options as PX4 hands them to Zenoh's client."""
        return options_text(self.options)

    @property
    def uorb_topic(self) -> str:
        """The uORB topic behind it: the last component of the name."""
        return self.topic.rsplit("/", 1)[-1]

    @property
    def package(self) -> str:
        """The ROS 2 package that the YAML names."""
        return self.type_name.split("::")[0]

    @property
    def message_name(self) -> str:
        """The message that the YAML names."""
        return self.type_name.split("::")[-1]


class Conventions(NamedTuple):
    """How a firmware names, numbers and times what crosses the bridge.

    `release` is the release that it follows. `default_interval_ms` is the shortest time between two samples of a
    publication without a rate limit. With `exact_intervals` a rate limit becomes the nearest whole number of
    milliseconds, and 0 means no limit; before July 2026 the fraction was cut, and 0 meant the default.
    """

    release: str
    first_subscription_id: int
    full_topic_path: bool
    version_suffix: bool
    default_interval_ms: int
    exact_intervals: bool


class Catalog(NamedTuple):
    """A whole set of definitions that fit together: every nested type is found, every name unique in its package.

    The messages of `package` are uORB's, and have topics; those of other packages only ROS 2 knows. `archived` has
    earlier versions of messages by key, where they were asked for: they are no longer on uORB, and have no topics.
    `translations` say how the firmware makes one version from another.
    `bridge_extra` has what the bridge's YAML holds besides the lists of topics that msggen knows. `notices` are the
    warnings and notes about the sources.
    """

    messages: Mapping[str, Message]
    services: tuple[Service, ...]
    bridge: tuple[BridgeEntry, ...]
    conventions: Conventions
    package: str = DEFAULT_PACKAGE
    archived: Mapping[str, Message] = MappingProxyType({})
    translations: tuple["Translation", ...] = ()
    bridge_extra: Mapping[str, object] = MappingProxyType({})
    notices: tuple[Diagnostic, ...] = ()

    @property
    def uorb_messages(self) -> tuple[Message, ...]:
        """The messages that uORB carries, by name."""
        return tuple(message for message in self.messages.values() if message.package == self.package)

    @property
    def own_services(self) -> tuple[Service, ...]:
        """The services of `package`, by name."""
        return tuple(service for service in self.services if service.package == self.package)

    @property
    def other_packages(self) -> tuple[str, ...]:
        """The packages besides `package`, sorted."""
        found = {message.package for message in self.messages.values()}
        found |= {service.package for service in self.services}
        return tuple(sorted(found - {self.package}))

    def nested(self, outer: Message, type_: FieldType) -> Message:
        """Return the message that a nested field of `outer` holds."""
        key = outer.key_of(type_)
        return self.messages.get(key) or self.archived[key]

    def nested_all(self, outer: Message) -> tuple[Message, ...]:
        """Return every message nested in `outer`, at any depth, once each and sorted by ROS type."""
        found: dict[str, Message] = {}
        waiting = [outer]
        while waiting:
            message = waiting.pop()
            for field in message.fields:
                if not field.type.is_primitive:
                    inner = self.nested(message, field.type)
                    if inner.key not in found:
                        found[inner.key] = inner
                        waiting.append(inner)
        return tuple(sorted(found.values(), key=lambda message: message.ros_type))

    def versions(self, message: Message) -> tuple[Message, ...]:
        """Return all versions that there are of `message`, itself a version or not, the oldest first.

        An archived definition of the version that is current is none of them: the current one is.
        """
        key = message.version_of or message.key
        found = {old.message_version: old for old in self.archived.values() if old.version_of == key}
        if key in self.messages:
            found[self.messages[key].message_version] = self.messages[key]
        return tuple(found[version] for version in sorted(found))
