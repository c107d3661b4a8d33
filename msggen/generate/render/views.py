"""The documented model for templates. The site makes the tables of all names in docs/render.md of its docstrings.

A view combines the facts from model, layout and identity about one thing. Each fact is computed on first access.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import ClassVar, TypeVar

from msggen.definitions.enumeration import Enumeration, enumerations
from msggen.definitions.identity import Endpoint, Qos, UorbTopic, endpoints, message_hash, type_hash, uorb_topics
from msggen.definitions.layout import Encoding, Layout, Path, is_static, lay_out, struct_size
from msggen.definitions.model import ArrayKind, Catalog, Comment, Constant, Field, Message, Service, Value
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.tags import ATTRIBUTES, Tag
from msggen.generate.text.words import NotTextError, kind_of, with_article

_T = TypeVar("_T")


class Views:
    """The views of one catalog. Each message has one view, so that views can be compared by identity."""

    def __init__(self, catalog: Catalog) -> None:
        self.model = catalog
        self.catalog = CatalogView(catalog, self)
        self._messages: dict[str, MessageView] = {}

    @cached_property
    def topics(self) -> dict[str, TopicView]:
        """The uORB topics by name."""
        return {topic.name: topic for topic in self.catalog.topics}

    def message(self, message: Message) -> MessageView:
        """Return the view of `message`."""
        return self._messages.setdefault(message.ros_type, MessageView(message, self))


class _View:
    """The base class of the views. A view is not text: a template writes one of its attributes."""

    _label: ClassVar[str] = "name"
    """The attribute that an error suggests for a template that writes the view itself."""

    def __str__(self) -> str:
        """Raise NotTextError. Templates of both languages call this, also to join and to format views."""
        kind = kind_of(self)
        raise NotTextError(f"{with_article(kind)} is not text, did you mean {kind}.{self._label}?")

    def __repr__(self) -> str:
        """Return a short text for exceptions and debuggers."""
        return f"<{kind_of(self)} {getattr(self, self._label)}>"


class ViewList(tuple[_T, ...]):
    """A list of views. It is not text: a template loops over it."""

    __slots__ = ()

    def __str__(self) -> str:
        """Raise NotTextError."""
        raise NotTextError("a list is not text: loop over it")


def _fact(_: type[_T], path: str, doc: str) -> _T:
    """Return a property with what the model of a view has at a path, such as `entry.direction`."""
    found: _T = property(attrgetter(f"_model.{path}"), doc=doc)  # type: ignore[assignment]
    return found


@dataclass(frozen=True, eq=False, repr=False)
class CatalogView(_View):
    """All definitions of a firmware and of further packages."""

    _label = "package"
    _model: Catalog
    _views: Views

    package = _fact(str, "package", "The ROS 2 package of the firmware's messages.")
    release = _fact(str, "conventions.release", "The release whose conventions determine names and ids.")

    @cached_property
    def messages(self) -> ViewList[MessageView]:
        """The messages of all packages, sorted by package and name."""
        return ViewList(map(self._views.message, self._model.messages.values()))

    @cached_property
    def services(self) -> ViewList[ServiceView]:
        """The services, sorted by name."""
        return ViewList(ServiceView(service, self._views) for service in self._model.services)

    @cached_property
    def topics(self) -> ViewList[TopicView]:
        """The uORB topics, in the order of their ids."""
        return ViewList(TopicView(topic, self._views) for topic in uorb_topics(self._model))

    @cached_property
    def endpoints(self) -> ViewList[EndpointView]:
        """The endpoints of the bridge, in the order of dds_topics.yaml."""
        return ViewList(EndpointView(endpoint, self._views) for endpoint in endpoints(self._model))

    @property
    def bridge_extra(self) -> Mapping[str, object]:
        """The parts of dds_topics.yaml that msggen does not interpret, by key."""
        return dict(self._model.bridge_extra)


class _Definition(_View):
    """The base class of the views of messages and services."""

    _model: Message | Service

    name = _fact(str, "name", "The name: `VehicleStatus`, `VehicleCommand`.")
    package = _fact(str, "package", "The ROS package: `px4_msgs`.")
    comment = _fact(str, "comment", "The comment about the definition as a whole.")


@dataclass(frozen=True, eq=False, repr=False)
class MessageView(_Definition):
    """A message, or one half of a service."""

    _model: Message
    _views: Views

    ros_type = _fact(str, "ros_type", "The ROS 2 type: `px4_msgs/msg/VehicleStatus`.")
    dds_type = _fact(str, "dds_type", "The DDS type: `px4_msgs::msg::dds_::VehicleStatus_`.")

    @cached_property
    def fields(self) -> ViewList[FieldView]:
        """The fields, in the order of the definition and of the wire."""
        return ViewList(map(self._field, self._model.fields))

    @cached_property
    def constants(self) -> ViewList[ConstantView]:
        """The constants, in the order of the definition."""
        return ViewList(map(ConstantView, self._model.constants))

    @cached_property
    def nested(self) -> ViewList[MessageView]:
        """The nested messages at any depth, each once, sorted by ROS type."""
        return ViewList(map(self._views.message, self._views.model.nested_all(self._model)))

    @cached_property
    def is_static(self) -> bool:
        """Whether every sample has the same layout: no strings, no sequences, at least one field."""
        return is_static(self._views.model, self._model)

    @property
    def cdr_size(self) -> int | None:
        """The number of bytes of a sample in XCDR1, without its header; None if not static."""
        return self._layouts[0].size if self._layouts else None

    @property
    def cdr_size_xcdr2(self) -> int | None:
        """The number of bytes of a sample in XCDR2, without its header; None if not static."""
        return self._layouts[1].size if self._layouts else None

    @cached_property
    def struct_size(self) -> int | None:
        """The size of the firmware's C++ struct without trailing padding; None if not static."""
        return struct_size(self._views.model, self._model) if self.is_static else None

    @cached_property
    def leaves(self) -> ViewList[LeafView]:
        """The primitives and arrays of primitives, with all nested messages flattened; empty if not static."""
        if not self._layouts:
            return ViewList()
        pairs = zip(*(layout.leaves for layout in self._layouts), strict=True)
        return ViewList(
            LeafView(
                path=_path_text(leaf.path),
                field=_field_at(self, leaf.path),
                count=leaf.element_count,
                item_size=leaf.size,
                offset=leaf.offset,
                padding=leaf.padding,
                offset_xcdr2=other.offset,
            )
            for leaf, other in pairs
        )

    message_version = _fact(int, "message_version", "The value of MESSAGE_VERSION, or 0.")
    condition = _fact(
        str, "condition", 'The condition under which `msg/CMakeLists.txt` lists the message, in CMake\'s syntax, or "".'
    )
    is_versioned = _fact(bool, "is_versioned", "Whether the definition has MESSAGE_VERSION.")

    @cached_property
    def message_hash(self) -> int:
        """The hash that the compatibility check of the firmware compares."""
        return message_hash(self._views.model, self._model)

    @cached_property
    def type_hash(self) -> str:
        """The ROS 2 type hash: `RIHS01_...`."""
        return type_hash(self._views.model, self._model)

    @cached_property
    def topics(self) -> ViewList[TopicView]:
        """The uORB topics of the message, in the order of the definition; empty if uORB does not carry it."""
        found = (self._views.topics.get(name) for name in self._model.topic_names)
        return ViewList(topic for topic in found if topic and topic.message is self)

    queue_length = _fact(int, "queue_length", "The length of the uORB queue: ORB_QUEUE_LENGTH, or 1.")

    @cached_property
    def endpoints(self) -> ViewList[EndpointView]:
        """The endpoints with this type."""
        return ViewList(endpoint for endpoint in self._views.catalog.endpoints if endpoint.message is self)

    @cached_property
    def _layouts(self) -> tuple[Layout, Layout] | None:
        """The layouts in XCDR1 and XCDR2."""
        if not self.is_static:
            return None
        catalog = self._views.model
        return lay_out(catalog, self._model), lay_out(catalog, self._model, Encoding.XCDR2)

    @cached_property
    def _places(self) -> dict[str, dict[str, int]]:
        """The offsets, sizes and paddings of FieldView, by field; empty if not static."""
        if not self._layouts:
            return {}
        first, second = (layout.extents() for layout in self._layouts)
        padding = {leaf.offset: leaf.padding for leaf in self._layouts[0].leaves}
        return {
            name: {
                "offset": offset,
                "size": size,
                "padding": padding[offset],
                "offset_xcdr2": second[name][0],
                "size_xcdr2": second[name][1],
            }
            for name, (offset, size) in first.items()
        }

    @cached_property
    def _enumerations(self) -> tuple[Enumeration, ...]:
        return enumerations(self._model)

    def _field(self, field: Field) -> FieldView:
        is_nested = not field.type.is_primitive
        enum = next((each for each in self._enumerations if field.name in each.fields), None)
        values = {member.constant.name for member in enum.members} if enum else set()
        return FieldView(
            _model=field,
            message=self._views.message(self._views.model.nested(self._model, field.type)) if is_nested else None,
            enum_constants=ViewList(found for found in self.constants if found.name in values),
            **self._places.get(field.name, {}),
        )


class _Described(_View):
    """The base class of the views of fields and constants."""

    _model: Field | Constant

    name = _fact(str, "name", "The name: `gyro_rad`, `CLIPPING_X`.")

    @property
    def type(self) -> str:
        """The type, spelled as in the definition: `float32[3]`."""
        return str(self._model.type)

    base = _fact(
        str, "type.name", "The type of one value, without package and bound: `float32`, `string`, `EscReport`."
    )

    @property
    def cpp_base(self) -> str:
        """The type of one value in C++, such as `std::uint8_t`, or "" for a message."""
        return PRIMITIVES[self.base].cpp_type if self._model.type.is_primitive else ""

    @property
    def comment(self) -> str:
        """The comment, without the tags."""
        return self._comment.text

    @property
    def tags(self) -> dict[str, str]:
        """The content of every tag `[@name ...]` by name, including tags that PX4 does not use."""
        return dict(self._comment.tags)

    @property
    def origins(self) -> dict[str, str]:
        """The origin of each tag that is an attribute: `tag`, `prose` or `embedded v1.17`."""
        return {name: self._comment.origin(name) for name, _ in self._comment.attributes}

    @property
    def documentation(self) -> str:
        """Tags and comment, as in the definition."""
        return str(self._comment)

    @property
    def _comment(self) -> Comment:
        return self._model.comment


def _content(tag: Tag) -> property:
    """Return a property with the content of a tag, "" if the tag is missing."""

    def content(self: _Described) -> str:
        return self._comment.tag(tag.name)

    return property(content, doc=tag.documentation)


for _tag in ATTRIBUTES:
    setattr(_Described, _tag.name, _content(_tag))


@dataclass(frozen=True, eq=False, repr=False)
class FieldView(_Described):
    """A field of a message. Its offsets, sizes and padding are None if the message is not static."""

    _model: Field
    message: MessageView | None
    """The nested message; None for primitives."""
    enum_constants: ViewList[ConstantView]
    """The constants that are values of the field, or numbers or masks of its bits."""
    offset: int | None = None
    """The offset of its first value in XCDR1, from the end of the header."""
    size: int | None = None
    """The number of bytes from its first to its last value in XCDR1."""
    padding: int | None = None
    """The number of padding bytes before it in XCDR1."""
    offset_xcdr2: int | None = None
    """The offset in XCDR2; the delimiter header of an array of messages is before it."""
    size_xcdr2: int | None = None
    """The size in XCDR2."""

    @property
    def array(self) -> str:
        """The kind of array: `scalar`, `fixed` (`T[N]`), `bounded` (`T[<=N]`) or `unbounded` (`T[]`)."""
        return self._model.type.array.name.lower()

    @property
    def is_array(self) -> bool:
        """Whether `array` is not `scalar`."""
        return self._model.type.array is not ArrayKind.SCALAR

    length = _fact(int, "type.length", "The N of a fixed or bounded array, else 0.")

    @property
    def string_bound(self) -> int | None:
        """The N of `string<=N`, else None."""
        return self._model.type.string_bound

    @property
    def default(self) -> Value | None:
        """The default value, or None."""
        return self._model.default


@dataclass(frozen=True, eq=False, repr=False)
class ConstantView(_Described):
    """A constant of a message."""

    _model: Constant

    @property
    def value(self) -> Value:
        """The value: a number, a bool or a string."""
        return self._model.value


@dataclass(frozen=True, repr=False)
class LeafView(_View):
    """A primitive or an array of primitives, at any depth of a message."""

    _label = "path"
    path: str
    """The path from the message: `esc[0].esc_rpm`."""
    field: FieldView
    """The field of the innermost message."""
    count: int
    """The number of values: 1, or the length of the array."""
    item_size: int
    """The number of bytes of one value."""
    offset: int
    """The offset in XCDR1, from the end of the header."""
    padding: int
    """The number of padding bytes before it in XCDR1."""
    offset_xcdr2: int
    """The offset in XCDR2."""


@dataclass(frozen=True, eq=False, repr=False)
class TopicView(_View):
    """A uORB topic."""

    _model: UorbTopic
    _views: Views

    name = _fact(str, "name", "The name: `vehicle_odometry`.")
    orb_id = _fact(int, "orb_id", "The position in the list of all topics, sorted by name.")
    condition = _fact(str, "condition", 'The condition under which `msg/CMakeLists.txt` lists its message, or "".')

    @property
    def message(self) -> MessageView:
        """The message that it carries."""
        return self._views.message(self._model.message)

    @cached_property
    def endpoints(self) -> ViewList[EndpointView]:
        """The endpoints of the bridge that carry this topic. Those of its message may carry other topics."""
        return ViewList(endpoint for endpoint in self._views.catalog.endpoints if endpoint.topic is self)


@dataclass(frozen=True, eq=False, repr=False)
class EndpointView(_View):
    """A topic that the bridge carries to or from DDS and ROS 2."""

    _label = "ros_name"
    _model: Endpoint
    _views: Views

    ros_name = _fact(str, "ros_name", "The ROS 2 name: `/fmu/out/vehicle_status_v1`.")
    dds_name = _fact(str, "dds_name", "The DDS name: `rt/fmu/out/vehicle_status_v1`.")
    direction = _fact(str, "entry.direction.value", "The direction, seen from the vehicle: `out` or `in`.")

    @property
    def message(self) -> MessageView:
        """The message that it carries."""
        return self._views.message(self._model.message)

    @cached_property
    def topic(self) -> TopicView:
        """The uORB topic of the endpoint."""
        return self._views.topics[self._model.entry.uorb_topic]

    @property
    def object_id(self) -> int | None:
        """The id in the XRCE client of the firmware, None if only PX4's list for Zenoh has the topic."""
        return self._model.object_id

    @property
    def zenoh_key(self) -> str:
        """The key on Zenoh, with ROS_DOMAIN_ID 0, "" if PX4's list for Zenoh does not have the topic."""
        return self._model.zenoh_key(self._views.model)

    @property
    def rate_limit_hz(self) -> float | None:
        """The rate limit in the YAML: 0.0 for no limit, None if the YAML has no entry."""
        return self._model.entry.rate_limit_hz

    @property
    def rate_limit(self) -> str:
        """The rate limit that applies, also the client's default, as text: `5 Hz`, `no limit`, or "" for `in`."""
        interval = self.publish_interval_ms
        if interval is None:
            return ""
        return f"{self.rate_limit_hz or 1000 / interval:g} Hz" if interval else "no limit"

    @property
    def publish_interval_ms(self) -> int | None:
        """The shortest time between two samples that PX4 sends; 0 for all samples in uORB's queue. None for `in`."""
        return self._model.publish_interval_ms

    @property
    def instance(self) -> int | None:
        """The uORB instance that the YAML names, or None."""
        return self._model.entry.instance

    @property
    def is_multi(self) -> bool:
        """Whether PX4 publishes the samples on a uORB instance of their own: an entry of `subscriptions_multi`."""
        return self._model.entry.multi

    @property
    def route_field(self) -> str | None:
        """The field that selects the uORB instance, or None. Each of its values gets an instance of its own."""
        return self._model.entry.route_field

    @property
    def max_instances(self) -> int | None:
        """The number of values of `route_field` that get an instance, or None."""
        return self._model.entry.max_instances

    @property
    def options(self) -> Mapping[str, object]:
        """The options for the Zenoh client, in the order of the YAML."""
        return dict((self._model.zenoh or self._model.entry).options)

    @property
    def extra(self) -> Mapping[str, object]:
        """The values in the entry that msggen does not interpret, by key."""
        return dict(self._model.entry.extra)

    @property
    def writer_qos(self) -> QosView:
        """The QoS of the writer, PX4 for `out`: `reliability`, `durability`, `history` and `depth`."""
        return QosView(*self._model.writer_qos)

    @property
    def reader_qos(self) -> QosView:
        """The QoS of the reader."""
        return QosView(*self._model.reader_qos)


class QosView(_View, Qos):  # the view first, so that it is not text
    """The quality of service of a writer or a reader."""

    _label = "reliability"


@dataclass(frozen=True, eq=False, repr=False)
class ServiceView(_Definition):
    """A service."""

    _model: Service
    _views: Views

    @property
    def ros_type(self) -> str:
        """The ROS 2 type: `px4_msgs/srv/VehicleCommand`."""
        return f"{self._model.package}/srv/{self._model.name}"

    @property
    def request(self) -> MessageView:
        """The message that the client sends."""
        return self._views.message(self._model.request)

    @property
    def response(self) -> MessageView:
        """The message that the server returns."""
        return self._views.message(self._model.response)


def _field_at(message: MessageView, path: Path) -> FieldView:
    """Return the field at the end of `path`."""
    (name, _), *rest = path
    field = next(field for field in message.fields if field.name == name)
    return _field_at(field.message, tuple(rest)) if field.message else field


def _path_text(path: Path) -> str:
    return ".".join(name if index is None else f"{name}[{index}]" for name, index in path)
