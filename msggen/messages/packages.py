"""Generated packages: which class a topic has, and which one decodes the samples of a vehicle.

A package is an argument, or follows from the class of a message. It is never imported here.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Protocol, TypeAlias, TypeVar

from msggen.link.link import FormatError, Route, TopicError
from msggen.messages.names import is_named_after, stem_of, version_of

if TYPE_CHECKING:
    from typing_extensions import Self


_HEADER = 4
"""The bytes of the encapsulation before a sample."""


class Message(Protocol):
    """What msggen needs of a message class of a generated package (docs/package.md)."""

    __msg__: ClassVar[Any]

    def encode(self) -> bytes:
        """Return the message as a CDR sample with its header."""

    @classmethod
    def decode(cls, data: bytes, allow_surplus: bool = False) -> Self:  # noqa: FBT001, FBT002 - as it is generated
        """Return the message in a CDR sample with its header. Raises a ValueError."""

    @classmethod
    def decode_batch(cls, payloads: Any) -> Any:
        """Return samples as a structured array of numpy. Raises a ValueError."""


MessageT = TypeVar("MessageT", bound=Message)
MessageT_co = TypeVar("MessageT_co", bound=Message, covariant=True)


class Endpoint(Protocol[MessageT_co]):
    """What msggen needs of an endpoint of a generated package, such as `topics.out.vehicle_status`."""

    @property
    def direction(self) -> Literal["in", "out"]:
        """`out` if PX4 publishes it, `in` if PX4 subscribes to it."""

    @property
    def ros_name(self) -> str:
        """The name in ROS 2, with the version suffix."""

    @property
    def uorb_topic(self) -> str:
        """The name of the uORB topic."""

    @property
    def object_id(self) -> int | None:
        """The number of the endpoint at the client, None if only PX4's list for Zenoh has it."""

    @property
    def on_zenoh(self) -> bool:
        """Whether PX4's list for Zenoh has it."""

    @property
    def message_name(self) -> str:
        """The name of the class of the message, which need not be imported for it."""

    @property
    def message(self) -> type[MessageT_co]:
        """The class of the message."""


Packages: TypeAlias = tuple[ModuleType, ...]
Target: TypeAlias = type[Message] | Endpoint[Any] | str
Way: TypeAlias = Literal["in", "out"]


class NamedTopic(NamedTuple):
    """A topic that the user has named."""

    stem: str
    """The name without namespace and version: `/fmu/out/vehicle_status`."""
    namespace: str | None
    """The namespace in the given name, or None if the name has none."""
    message: type[Message]
    """The class that the user expects."""
    package: ModuleType
    direction: Way
    is_typed: bool
    """Whether the user has named a class, an endpoint or a version, so that samples must become messages of it."""

    @property
    def name(self) -> str:
        """The name without the version."""
        return f"/{self.namespace}{self.stem}" if self.namespace else self.stem


class Decoding(NamedTuple):
    """The way from a payload to a message."""

    message: type[Message]
    """The class that has the vehicle's definition."""
    decode: Callable[[bytes], Any]


def packages_of(types: ModuleType | Sequence[ModuleType] | None) -> Packages:
    """Return the given packages. Raises TypeError if one of them is not a generated package."""
    is_several = isinstance(types, (list, tuple))
    packages = () if types is None else tuple(types) if is_several else (types,)
    for package in packages:
        if not (isinstance(package, ModuleType) and hasattr(package, "topics") and hasattr(package, "by_type")):
            shown = package.__name__ if isinstance(package, (type, ModuleType)) else repr(package)
            raise TypeError(f"expected a generated package such as px4_types, got {shown}")
    return packages


def check_message(value: object) -> None:
    """Raise TypeError if `value` is not a message."""
    if isinstance(value, type) and hasattr(value, "__msg__"):
        raise TypeError(f"expected a message, got the class {value.__name__}: call it to make one, {value.__name__}()")
    if not hasattr(value, "__msg__"):
        raise TypeError(f"expected a message, got an object of type {type(value).__name__}")


def package_of_class(cls: type) -> ModuleType:
    """Return the generated package of a message class. Raises TypeError if it is not one."""
    for base in cls.__mro__ if isinstance(cls, type) else ():
        if "__msg__" in vars(base):
            for folder in (".msg.", ".srv."):
                name, found, _ = base.__module__.rpartition(folder)
                if found:
                    return sys.modules[name]
    raise TypeError(f"expected the class of a message, got {getattr(cls, '__name__', repr(cls))}")


def heard_way(target: Target) -> Way:
    """Return the direction of a topic to subscribe to: `in` only if an endpoint or a whole name says so."""
    if isinstance(target, str):
        return "in" if "/fmu/in/" in target else "out"
    return "out" if isinstance(target, type) else getattr(target, "direction", "out")


def find_topic(target: Target, way: Way, packages: Packages) -> NamedTopic:
    """Return the topic that a class, an endpoint or a name stands for.

    Raises TopicError, and TypeError if `target` is none of them.
    """
    if isinstance(target, str):
        return _by_name(target, way, packages)
    if isinstance(target, type):
        return _by_class(target, way)
    if not hasattr(target, "ros_name"):
        raise TypeError(f"expected the class of a message, an endpoint or a name, got {target!r}")
    package = package_of_class(target.message)
    _check_way(target, way)
    stem = stem_of(target.ros_name)
    plain = _plain_stem(package, stem)
    namespace = stem[: len(stem) - len(plain)].strip("/") if plain != stem else None
    return NamedTopic(plain, namespace, target.message, package, way, is_typed=True)


def _by_class(cls: type[Message], way: Way) -> NamedTopic:
    package = package_of_class(cls)
    name = cls.__msg__.ros_type.rpartition("/")[2]
    every = [
        endpoint
        for current in package.topics.ENDPOINTS
        if current.message_name.rstrip("_") == name  # its class is imported only if it has this name
        for endpoint in package.topics.versions_of(current.ros_name)
        if issubclass(cls, endpoint.message)
    ]
    found = [endpoint for endpoint in every if endpoint.direction == way]
    named = [endpoint for endpoint in found if is_named_after(endpoint.ros_name, name)]
    if len(named) == 1:
        found = named
    if len(found) == 1:
        return NamedTopic(stem_of(found[0].ros_name), None, cls, package, way, is_typed=True)
    if found:
        names = ", ".join(f"'{endpoint.ros_name}'" for endpoint in found)
        how = "name one: subscribe(topics.out...)" if way == "out" else "name one with topic="
        raise TopicError(f"{cls.__name__} is the message of {names}: {how}")
    if every:
        _check_way(every[0], way)
    if not package.topics.ENDPOINTS:
        text = "has no endpoints, because it was built without a dds_topics.yaml: name one with --topics"
        raise TopicError(f"no endpoint for {cls.__name__}: {package.__name__} {text}")
    text = f"no endpoint for {cls.__name__}: its topic is not in the dds_topics.yaml of {package.__name__}"
    raise TopicError(f"{text}, which can be built with that of your firmware: --px4 or --topics")


def _by_name(name: str, way: Way, packages: Packages) -> NamedTopic:
    if not packages:
        raise TopicError(f"'{name}' is only a name: give the generated package, as in Vehicle(types=px4_types)")
    errors = []
    for package in packages:
        try:
            endpoint, namespace = endpoint_of(package, name, way)
        except KeyError as error:
            errors.append(str(error))
        else:
            _check_way(endpoint, way)
            stem, version = stem_of(endpoint.ros_name), version_of(name)
            if not version:
                return NamedTopic(stem, namespace, endpoint.message, package, way, is_typed=False)
            classes = [each.message for each in package.topics.versions_of(endpoint.ros_name)]
            for cls in classes:
                if cls.__msg__.message_version == version:
                    return NamedTopic(stem, namespace, cls, package, way, is_typed=True)
            have = ", ".join(str(cls.__msg__.message_version) for cls in classes)
            errors.append(
                f"{package.__name__} has no version {version} of '{stem}', but {have}: leave the version out of the "
                "name for that of the vehicle, or give types that have it"
            )
    raise TopicError(errors[0])


def endpoint_of(package: ModuleType, name: str, way: Way) -> tuple[Endpoint[Message], str | None]:
    """Return the endpoint that a name stands for, in its newest version, and the namespace in the name.

    Raises the KeyError of the package, which names the nearest endpoint.
    """
    plain = stem_of(name)
    for direction in (way, "out", "in"):
        for endpoint in package.topics.ENDPOINTS:
            if endpoint.direction == direction and stem_of(endpoint.ros_name).rpartition("/")[2] == plain:
                return endpoint, None
    ros_name = package.topics.versions_of(name)[-1].ros_name
    found = next(each for each in package.topics.ENDPOINTS if ros_name.endswith(each.ros_name))
    return found, ros_name[: -len(found.ros_name)].strip("/") or None


def zenoh_endpoints(package: ModuleType) -> tuple[Endpoint[Any], ...]:
    """Return the endpoints that PX4's list for Zenoh has, or all of a package that was built without one."""
    return tuple(each for each in package.topics.ENDPOINTS if each.on_zenoh) or tuple(package.topics.ENDPOINTS)


def _plain_stem(package: ModuleType, stem: str) -> str:
    """Return the stem without a namespace."""
    stems = {stem_of(endpoint.ros_name) for endpoint in package.topics.ENDPOINTS}
    return next((each for each in stems if stem.endswith(each)), stem)


def _check_way(endpoint: Endpoint[Message], way: Way) -> None:
    if endpoint.direction != way:
        name = endpoint.ros_name
        if way == "in":
            raise TopicError(f"'{name}' is published by PX4: use subscribe, or name a topic of '/fmu/in'")
        raise TopicError(f"'{name}' is read by PX4: use publish, or name a topic of '/fmu/out'")


def decoding_of(
    topic: NamedTopic, route: Route, packages: Packages, message_hash: int | None, *, is_converted: bool
) -> Decoding:
    """Return how to decode the samples of a route.

    `message_hash` is the vehicle's hash of the definition, or None if it is not known. Raises FormatError if the given
    packages have no class with the vehicle's definition, or only one that the user has not asked for.
    """
    for cls, package in _candidates(topic, packages):
        if has_definition(cls, route, message_hash):
            found = _accepted(topic, cls, package, route.name, is_converted=is_converted)
            return without_surplus(found) if route.has_surplus else found
    raise UnknownFormatError(_difference(topic, route, message_hash))


def has_definition(cls: type[Message], route: Route, message_hash: int | None) -> bool:
    """Whether a class has the vehicle's definition of a route, as far as that is known."""
    info = cls.__msg__
    if route.has_surplus and route.type_hash.startswith("RIHS01_"):
        return bool(info.type_hash == route.type_hash)
    return info.message_version == version_of(route.name) and message_hash in (None, info.message_hash)


def size_of(route: Route, packages: Packages) -> int | None:
    """Return the bytes of a sample of a route whose size its link does not know, None if no package has it."""
    for package in packages if route.has_surplus else ():
        for cls in classes_of(package, route.name, route.ros_type):
            if has_definition(cls, route, None):
                return _HEADER + (cls.__msg__.cdr_size or 0)
    return None


def without_surplus(decoding: Decoding) -> Decoding:
    """Return a decoding that leaves out what follows the message in a sample."""
    size = _HEADER + (decoding.message.__msg__.cdr_size or 0)
    decode = decoding.decode
    return decoding._replace(decode=lambda payload: decode(payload[:size]))


class UnknownFormatError(FormatError):
    """No given package has the vehicle's definition."""


def _candidates(topic: NamedTopic, packages: Packages) -> Iterator[tuple[type[Message], ModuleType]]:
    """Yield the classes that a topic may have: the expected one, archived ones, and those of the other packages."""
    yield topic.message, topic.package
    for package in dict.fromkeys((topic.package, *packages)):
        for endpoint in package.topics.ENDPOINTS:
            if stem_of(endpoint.ros_name) == topic.stem:
                for version in reversed(package.topics.versions_of(endpoint.ros_name)):
                    yield version.message, package


def _accepted(
    topic: NamedTopic, cls: type[Message], package: ModuleType, ros_name: str, *, is_converted: bool
) -> Decoding:
    if cls is topic.message or (not topic.is_typed and not is_converted):
        return Decoding(cls, cls.decode)
    if is_converted:
        convert = _converter(topic, package)
        return Decoding(cls, lambda payload: convert(cls.decode(payload), topic.message).message)
    if package is not topic.package:
        return Decoding(cls, cls.decode)
    expected = f"{topic.message.__name__} is version {topic.message.__msg__.message_version}"
    raise FormatError(
        f"the vehicle has '{ros_name}', and {expected}: subscribe to {cls.__name__}, or with convert=True"
    )


def _converter(topic: NamedTopic, package: ModuleType) -> Callable[[Any, Any], Any]:
    for each in (topic.package, package):
        try:
            found: Callable[[Any, Any], Any] = each.versions.convert
        except AttributeError:
            continue
        return found
    raise FormatError(f"convert=True needs archived versions: build {topic.package.__name__} with --archived")


def _difference(topic: NamedTopic, route: Route, message_hash: int | None) -> str:
    info, name = topic.message.__msg__, f"{topic.package.__name__}.{topic.message.__name__}"
    if route.has_surplus:
        return f"the vehicle's definition of '{route.name}' has the hash {route.type_hash}, and {name} {info.type_hash}"
    if version_of(route.name) != info.message_version:
        return f"the vehicle has '{route.name}', and {name} is version {info.message_version}"
    return difference(route.name, message_hash, name, info.message_hash)


def difference(ros_name: str, theirs: int | None, own_name: str, own: int) -> str:
    """Return the start of an error about two definitions of a message."""
    shown = "is not known" if theirs is None else f"has the hash {theirs:#010x}"
    return f"the vehicle's definition of '{ros_name}' {shown}, and {own_name} has {own:#010x}"


def check_sent(cls: type[Message], route: Route, known: int | None) -> None:
    """Raise FormatError if a message of `cls` is not what the vehicle reads from `route`."""
    info = cls.__msg__
    if has_definition(cls, route, known):
        return
    own = f"{package_of_class(cls).__name__}.{cls.__name__}"
    if route.has_surplus:
        text = f"the vehicle reads '{route.name}' with the hash {route.type_hash}, and {own} has {info.type_hash}"
        raise FormatError(f"{text}: publish a message of its firmware, msggen build --px4 PX4-Autopilot")
    if version_of(route.name) != info.message_version:
        text = f"the vehicle reads '{route.name}', and {cls.__name__} is version {info.message_version}"
        raise FormatError(f"{text}: publish another version, from versions.convert of a package with --archived")
    raise FormatError(f"{difference(route.name, known, own, info.message_hash)}: publish a message of its release")


def check_convertible(topic: NamedTopic, packages: Packages) -> None:
    """Raise TopicError if no package has what `convert=True` needs."""
    if not any(hasattr(package, "versions") for package in (topic.package, *packages)):
        raise TopicError(f"convert=True needs archived versions: build {topic.package.__name__} with --archived")


def response_of(request: Message) -> tuple[Any, str]:
    """Return the class of the reply to a request, and the name of the service. Raises TypeError if it is no request."""
    cls = type(request)
    info = getattr(cls, "__msg__", None)
    name, found, _ = (info.ros_type if info else "").rpartition("_Request")
    if info is None or not found:
        raise TypeError(f"expected a request such as srv.VehicleCommand.Request(...), got {cls.__name__}")
    package = package_of_class(cls)
    return getattr(package.srv, cls.__name__.removesuffix("_Request") + "_Response"), name.rpartition("/")[2]


def classes_of(package: Any, name: str, ros_type: str) -> list[Any]:
    """Return the classes of a topic in a package, the newest version first."""
    try:
        found = [endpoint.message for endpoint in reversed(package.topics.versions_of(name))]
    except KeyError:
        try:
            found = [package.by_type(ros_type)]
        except KeyError:
            return []
    return [cls for cls in found if cls.__msg__.ros_type == ros_type]
