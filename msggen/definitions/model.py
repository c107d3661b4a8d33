"""The model: messages, fields, constants, topics, services, and the catalog that holds them.

All values are immutable. Every node has the location that it was read from, so that later checks can report it.
"""

import re
from collections.abc import Mapping
from enum import Enum
from functools import cache
from types import MappingProxyType
from typing import NamedTuple, Union

from msggen.base.diagnostics import Diagnostic
from msggen.base.location import Location
from msggen.definitions.primitives import PRIMITIVES, STRINGS
from msggen.definitions.tags import ATTRIBUTES, COMPARED, UNIT, TagChange

TYPE_CHECKING = False
if TYPE_CHECKING:
    from msggen.definitions.translation import Translation

Value = Union[bool, int, float, str, tuple["Value", ...]]  # noqa: UP007 - `|` fails at run time with the forward reference
"""The value of a constant or a default. Only defaults of arrays are tuples."""

VERSION = "MESSAGE_VERSION"
"""The name of the constant that holds the version of a message."""

QUEUE_LENGTH = "ORB_QUEUE_LENGTH"
"""The name of the constant that holds the number of samples in a message's uORB queue."""

SPECIAL = (VERSION, QUEUE_LENGTH)
"""The constants that the firmware itself reads. They are not values of a field."""

DEFAULT_PACKAGE = "px4_msgs"
"""The ROS 2 package of the firmware's definitions."""

ARCHIVE_PACKAGE = "px4_msgs_old"
"""The ROS 2 package of the firmware's archived versions, from v1.16 on."""

_LATER_CAPITAL = re.compile(r"(?<!^)(?=[A-Z])")


@cache
def snake_case(name: str) -> str:
    """Return `name` as uORB spells topics: lower case, with an underscore before each capital except a leading one."""
    return _LATER_CAPITAL.sub("_", name).lower()


class ArrayKind(Enum):
    """The kind of an array, or SCALAR for a single value. `length` in the values is the length in FieldType."""

    SCALAR = "one value"
    FIXED = "exactly `length` values"
    BOUNDED = "up to `length` values"
    UNBOUNDED = "any number of values"

    __hash__ = object.__hash__  # members are singletons, and the hash of Enum is Python code


class FieldType(NamedTuple):
    """The type of a field.

    `name` is a primitive, or a message in `package`; None stands for the package of the definition.
    """

    name: str
    package: str | None = None
    array: ArrayKind = ArrayKind.SCALAR
    length: int = 0
    string_bound: int | None = None

    @property
    def is_primitive(self) -> bool:
        """Whether the type is built into the grammar; every other type is a message."""
        return self.package is None and self.name in PRIMITIVES

    @property
    def element_count(self) -> int:
        """The length of a fixed array; 1 for other types."""
        return self.length if self.array is ArrayKind.FIXED else 1

    @property
    def is_fixed_size(self) -> bool:
        """Whether the type is neither a string nor a sequence; a nested message may still contain them."""
        return self.name not in STRINGS and self.array in (ArrayKind.SCALAR, ArrayKind.FIXED)

    @property
    def base(self) -> str:
        """The type of one element, as a definition spells it."""
        bound = "" if self.string_bound is None else f"<={self.string_bound}"
        return f"{self.package}/{self.name}" if self.package else f"{self.name}{bound}"

    def __str__(self) -> str:
        if self.array is ArrayKind.SCALAR:
            return self.base
        if self.array is ArrayKind.FIXED:
            return f"{self.base}[{self.length}]"
        return f"{self.base}[<={self.length}]" if self.array is ArrayKind.BOUNDED else f"{self.base}[]"


_ATTRIBUTES = frozenset(tag.name for tag in ATTRIBUTES)


class InferredTag(NamedTuple):
    """A tag that the brackets of a definition do not have. `origin` is `prose`, or a release: `embedded v1.17`."""

    name: str
    content: str
    origin: str


class Comment(NamedTuple):
    """The comment of a field or constant, split into its parts.

    `text` has the sentences without the tags. `tags` has the name and the content of every tag with an `@`, including
    unknown tags; known tags are in the order of `TAGS`. `inferred` has the tags that the definition does not have, but
    msggen knows.
    """

    text: str = ""
    unit: str = ""
    tags: tuple[tuple[str, str], ...] = ()
    inferred: tuple[InferredTag, ...] = ()

    def tag(self, name: str) -> str:
        """Return the content of the tag `name`, of the definition or inferred; "" if there is none."""
        if name == UNIT.name and self.unit:
            return self.unit
        for known, content in self.tags:
            if known == name and content:
                return content
        for tag in self.inferred:
            if tag.name == name:
                return tag.content
        return ""

    def origin(self, name: str) -> str:
        """Return the origin of the tag `name`: `tag` for one in brackets, `prose`, `embedded v1.17`; "" for no tag."""
        inferred = (tag.origin for tag in self.inferred if tag.name == name)
        return next(inferred, "") or ("tag" if self.tag(name) else "")

    @property
    def attributes(self) -> list[tuple[str, str]]:
        """The name and the content of each tag that is an attribute and has content."""
        found = [(UNIT.name, self.unit), *self.tags, *((tag.name, tag.content) for tag in self.inferred)]
        return [(name, content) for name, content in found if content and name in _ATTRIBUTES]

    @property
    def complete(self) -> "Comment":
        """The comment as if the definition had the inferred tags in brackets."""
        if not self.inferred:
            return self
        tags = [(tag.name, tag.content) for tag in self.inferred if tag.name != UNIT.name]
        return Comment(self.text, self.tag(UNIT.name), (*self.tags, *tags))

    def changed_tags(self, after: "Comment") -> list[TagChange]:
        """Return a change for each tag that both comments have with different meanings."""
        if self == after:
            return []
        return [change for tag in COMPARED if (change := tag.change(self.tag(tag.name), after.tag(tag.name)))]

    def __str__(self) -> str:
        tags = [f"[{self.unit}]"] if self.unit else []
        tags += [f"[@{name} {value}]" if value else f"[@{name}]" for name, value in self.tags]
        return " ".join([*tags, self.text]).strip()


class Field(NamedTuple):
    """A field. `location` is the start of its type, `name_column` the start of its name."""

    name: str
    type: FieldType
    location: Location
    name_column: int
    default: Value | None = None
    comment: Comment = Comment()


class Constant(NamedTuple):
    """A constant. `location` is the start of its type, `name_column` the start of its name."""

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
    """The definition in a `.msg` file, or one half of a `.srv` file; `folder` is then "srv"."""

    name: str
    package: str
    location: Location
    folder: str = "msg"
    fields: tuple[Field, ...] = ()
    constants: tuple[Constant, ...] = ()
    topics: tuple[Topic, ...] = ()
    comment: str = ""
    version_of: str = ""
    """For an archived version, the key of its current message; "" for other messages."""
    condition: str = ""
    """The condition under which the firmware's build includes the message, as CMake spells it; "" for none."""

    @property
    def key(self) -> str:
        """The full name, `px4_msgs/VehicleStatus`, by which definitions nest the message and catalogs index it."""
        return f"{self.package}/{self.name}"

    def key_of(self, nested: FieldType) -> str:
        """Return the key of the message that a field of type `nested` holds."""
        return f"{nested.package or self.package}/{nested.name}"

    @property
    def released_as(self) -> tuple[str, str]:
        """The package and the name on the wire and in hashes; an archived version has those of its current message."""
        package, _, name = (self.version_of or self.key).partition("/")
        return package, name

    @property
    def ros_type(self) -> str:
        """The ROS 2 type: `px4_msgs/msg/VehicleStatus`."""
        package, name = self.released_as
        return f"{package}/{self.folder}/{name}"

    @property
    def dds_type(self) -> str:
        """The DDS type: `px4_msgs::msg::dds_::VehicleStatus_`."""
        package, name = self.released_as
        return f"{package}::{self.folder}::dds_::{name}_"

    @property
    def topic_names(self) -> tuple[str, ...]:
        """The uORB topics of the message: declared ones, or else its own name. An archived version has none."""
        if self.version_of:
            return ()
        return tuple(topic.name for topic in self.topics) or (snake_case(self.name),)

    @property
    def message_version(self) -> int:
        """MESSAGE_VERSION as the firmware reads it, an unsigned 32-bit integer; 0 if the constant is missing."""
        return self._special(VERSION, 0) % 2**32

    @property
    def is_versioned(self) -> bool:
        """Whether the message has the constant MESSAGE_VERSION."""
        return any(constant.name == VERSION for constant in self.constants)

    @property
    def queue_length(self) -> int:
        """The number of samples that uORB keeps: ORB_QUEUE_LENGTH, or 1 if the constant is missing."""
        return self._special(QUEUE_LENGTH, 1)

    def _special(self, name: str, default: int) -> int:
        values = [constant.value for constant in self.constants if constant.name == name]
        try:
            return int(values[0]) if values else default  # type: ignore[arg-type]  # int() raises TypeError for a tuple
        except (TypeError, ValueError, OverflowError):
            return default


class Service(NamedTuple):
    """The definition in a `.srv` file: two messages, `<Name>_Request` and `<Name>_Response`."""

    name: str
    package: str
    location: Location
    request: Message
    response: Message
    comment: str = ""


class Direction(Enum):
    """The direction of a topic, seen from the vehicle: PX4 publishes `/fmu/out` and reads `/fmu/in`."""

    OUT = "out"
    IN = "in"


def options_text(options: Mapping[str, object]) -> str:
    """Return the options of an entry as PX4 passes them to Zenoh's client: `cc=block,express=true`."""
    return ",".join(
        f"{key}={str(value).lower() if isinstance(value, bool) else value}" for key, value in options.items()
    )


class BridgeEntry(NamedTuple):
    """An entry of `dds_topics.yaml`.

    `rate_limit_hz` is 0.0 for no limit. It is None if the entry does not set it; the firmware then uses its default.
    `instance` applies to publications only. `route_field` and `max_instances` occur together, in
    `subscriptions_multi` (PX4 v1.18): each value of the route field gets its own uORB instance, and after
    `max_instances` different values, samples with further values are dropped. `options` are for Zenoh's client.
    `extra` has the unknown keys, and values of known keys that msggen cannot use.
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
        """Return the hash of the location, which is unique; the options may contain lists, which have no hash."""
        return hash(self.location)

    @property
    def options_text(self) -> str:
        """The options as PX4 passes them to Zenoh's client."""
        return options_text(self.options)

    @property
    def uorb_topic(self) -> str:
        """The uORB topic: the last component of the name."""
        return self.topic.rsplit("/", 1)[-1]

    @property
    def crossing(self) -> tuple[Direction, str, int | None]:
        """What the entry of the other list has that carries the same samples: direction, name and instance."""
        return self.direction, self.topic, self.instance

    @property
    def package(self) -> str:
        """The ROS 2 package that the YAML names."""
        return self.type_name.split("::")[0]

    @property
    def message_name(self) -> str:
        """The message that the YAML names."""
        return self.type_name.split("::")[-1]


class Conventions(NamedTuple):
    """The rules by which a firmware names, numbers and times bridged topics.

    `release` is the release that has these rules. `default_interval_ms` is the shortest time between two samples of a
    publication that sets no rate limit. With `exact_intervals`, the interval of a rate limit is rounded to the nearest
    millisecond, and a limit of 0 means no limit. Before July 2026, it was rounded down, and 0 meant the default.
    """

    release: str
    first_subscription_id: int
    full_topic_path: bool
    version_suffix: bool
    default_interval_ms: int
    exact_intervals: bool


class Catalog(NamedTuple):
    """A consistent set of definitions: every nested type is defined, every name is unique in its package.

    The messages of `package` are on uORB and have topics; messages of other packages exist only in ROS 2. `archived`
    has the archived versions by key, if they were requested; they are not on uORB and have no topics. `zenoh` has the
    entries of PX4's list for Zenoh, which carries topics beside the bridge or instead of it. `translations` are the
    firmware's conversions between versions. `bridge_extra` has the unknown top-level keys of `dds_topics.yaml`.
    `notices` are the warnings and notes about the sources.
    """

    messages: Mapping[str, Message]
    services: tuple[Service, ...]
    bridge: tuple[BridgeEntry, ...]
    conventions: Conventions
    package: str = DEFAULT_PACKAGE
    archived: Mapping[str, Message] = MappingProxyType({})
    zenoh: tuple[BridgeEntry, ...] = ()
    translations: tuple["Translation", ...] = ()
    bridge_extra: Mapping[str, object] = MappingProxyType({})
    notices: tuple[Diagnostic, ...] = ()

    @property
    def uorb_messages(self) -> tuple[Message, ...]:
        """The messages on uORB, sorted by name."""
        return tuple(message for message in self.messages.values() if message.package == self.package)

    @property
    def own_services(self) -> tuple[Service, ...]:
        """The services of `package`, sorted by name."""
        return tuple(service for service in self.services if service.package == self.package)

    @property
    def other_packages(self) -> tuple[str, ...]:
        """The packages other than `package`, sorted."""
        found = {message.package for message in self.messages.values()}
        found |= {service.package for service in self.services}
        return tuple(sorted(found - {self.package}))

    def nested(self, outer: Message, type_: FieldType) -> Message:
        """Return the message that a field of `outer` with the type `type_` holds."""
        key = outer.key_of(type_)
        return self.messages.get(key) or self.archived[key]

    def nested_all(self, outer: Message) -> tuple[Message, ...]:
        """Return every message nested in `outer`, at any depth, without duplicates, sorted by ROS type."""
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
        """Return all versions of `message`, the oldest first; `message` may be current or archived.

        If the current version is also archived, only the current definition is returned.
        """
        key = message.version_of or message.key
        found = {old.message_version: old for old in self.archived.values() if old.version_of == key}
        if key in self.messages:
            found[self.messages[key].message_version] = self.messages[key]
        return tuple(found[version] for version in sorted(found))
