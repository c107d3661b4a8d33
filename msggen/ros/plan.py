"""Which topics and services of a vehicle ROS 2 gets, with which installed types, and why it does not get others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from types import ModuleType
from typing import Any, NamedTuple

from msggen.base.diagnostics import few, suggestion
from msggen.link.link import Route, Service
from msggen.messages.names import stem_of, version_of, without_namespace
from msggen.messages.packages import Message, Packages, has_definition
from msggen.ros.standard import SOURCES
from msggen.ros.types import Finder, differences, installed, nested_classes

_OLD = "px4_msgs_old"
"""The package with PX4's archived versions, whose types have the version in their names."""


class Row(NamedTuple):
    """A topic of ROS, and the topic of the vehicle that it stands for."""

    name: str
    """The name in ROS. A converted topic has the suffix of its own version."""
    route: Route
    ros: Any
    """The class of rclpy."""
    qos: Any
    """The QoS of the end in ROS, which is that of PX4 behind an agent."""
    theirs: type[Message]
    """The message of the vehicle."""
    own: type[Message]
    """The message in ROS: another version if it is converted."""
    convert: Callable[[Any, Any], Any] | None
    """`versions.convert` of a package with both versions, or None if they are the same."""

    def to_ros(self, payload: bytes) -> bytes:
        """Return a sample of the vehicle for ROS: unchanged, or converted. Raises ValueError if it is not a sample."""
        if self.convert is None:
            return payload
        converted: bytes = self.convert(self.theirs.decode(payload), self.own).message.encode()
        return converted

    def to_vehicle(self, payload: bytes) -> Message:
        """Return a sample of ROS as a message for the vehicle. Raises ValueError if it is not a sample."""
        message = self.own.decode(payload)
        if self.convert is None:
            return message
        converted: Message = self.convert(message, self.theirs).message
        return converted


class ServiceRow(NamedTuple):
    """A service of ROS, and the service of the vehicle that it stands for. Both have the same name."""

    service: Service
    ros: Any
    """The class of rclpy, with `Request` and `Response`."""
    request: type[Message]
    """The message of the vehicle."""
    response: type[Message]

    def failure(self, request: Message, result: str) -> Message | None:
        """Return an answer with a result of VehicleCommandAck, for a call that the vehicle has not answered.

        Its time is 0. Returns None if the response has no acknowledgement.
        """
        response: Any = self.response
        asked, unset = getattr(request, "request", None), getattr(response(), "reply", None)
        if asked is None or unset is None:
            return None
        reply = type(unset)(command=asked.command, result=unset.__msg__.enum("result")[result])
        failed: Message = response(reply=reply)
        return failed


class Source(NamedTuple):
    """A topic of PX4 that standard messages of ROS are made from."""

    name: str
    """One of SOURCES."""
    message: type[Message]


class Plan(NamedTuple):
    """What is relayed, and what is not."""

    rows: tuple[Row, ...]
    refused: tuple[tuple[str, str], ...]
    """Topics that differ, each with the reason."""
    missing: tuple[str, ...]
    """The types that are not installed."""
    sources: Mapping[str, Source]
    """The topics that standard messages are made from, by their names."""
    services: tuple[ServiceRow, ...] = ()


class Wish(NamedTuple):
    """What the user asks for."""

    topics: Sequence[str] = ()
    """Names or patterns of topics and services, all if there are none: `vehicle_status`, `/fmu/out/*`."""
    is_translated: bool = False
    """Whether to convert versions, so that ROS also gets the versions that are installed."""
    is_standard: bool = False
    """Whether to make standard messages."""
    is_beside_agent: bool = False
    """Whether an agent publishes the vehicle's own versions already."""


class Topics(NamedTuple):
    """The topics and services of a connected vehicle, and generated packages with their definitions."""

    routes: Sequence[Route]
    namespace: str
    hashes: Mapping[str, int]
    """The `message_hash` of each type as the vehicle has told. One that it has not told is not compared."""
    packages: Packages
    """The package of the vehicle, then others with versions to convert to."""
    services: Sequence[Service] = ()

    def chosen(self, patterns: Sequence[str]) -> list[Route]:
        """Return the routes that names or patterns select. Raises ValueError for one that selects nothing."""
        names = [*(route.name for route in self.routes), *(service.name for service in self.services)]
        for pattern in patterns:
            if not any(self._is_chosen(name, pattern) for name in names):
                stems = {stem_of(name).rpartition("/")[2] for name in names}
                raise ValueError(f"the vehicle has no topic '{pattern}'{suggestion(pattern, sorted(stems))}")
        return [route for route in sorted(self.routes) if self._is_one_of(route.name, patterns)]

    def chosen_services(self, patterns: Sequence[str]) -> list[Service]:
        """Return the services that names or patterns select."""
        return [service for service in sorted(self.services) if self._is_one_of(service.name, patterns)]

    def _is_one_of(self, name: str, patterns: Sequence[str]) -> bool:
        return not patterns or any(self._is_chosen(name, pattern) for pattern in patterns)

    def _is_chosen(self, name: str, pattern: str) -> bool:
        plain = self.plain(name)
        stem = stem_of(plain)
        return any(fnmatchcase(each, pattern) for each in (name, plain, stem, stem.rpartition("/")[2]))

    def plain(self, name: str) -> str:
        """Return a name without the namespace of the vehicle."""
        return without_namespace(name, self.namespace)

    def message_of(self, route: Route) -> type[Message]:
        """Return the message class with the vehicle's definition. Raises ValueError if no package has it."""
        known, version = self.hashes.get(route.ros_type), version_of(route.name)
        others = []
        for _, endpoint in self.versions_of(route):
            info = endpoint.message.__msg__
            if has_definition(endpoint.message, route, known):
                found: type[Message] = endpoint.message
                return found
            if info.message_version == version:
                others.append(f"{info.message_hash:#010x}")
        if others and known is not None:
            raise ValueError(f"the vehicle's definition has the hash {known:#010x}, and that of --types {others[0]}")
        raise ValueError("not in the definitions of --types")

    def service_of(self, service: Service) -> Any:
        """Return the class with the vehicle's definition of a service. Raises ValueError if no package has it."""
        name = service_type(service).rpartition("/")[2]
        problem = "not in the definitions of --types"
        for package in self.packages:
            found = getattr(getattr(package, "srv", None), name, None)
            if found is None:
                continue
            nested = [cls for part in (found.Request, found.Response) for cls in nested_classes(part)]
            wrong = [cls for cls in nested if not self._is_known(cls)]
            if not wrong:
                return found
            problem = f"the vehicle has another definition of {wrong[0].__name__} than --types"
        raise ValueError(problem)

    def _is_known(self, cls: type[Message]) -> bool:
        """Whether the vehicle has not told another definition of a message."""
        info = cls.__msg__
        return self.hashes.get(info.ros_type) in (None, info.message_hash)

    def versions_of(self, route: Route) -> Iterator[tuple[ModuleType, Any]]:
        """Yield the versions of a topic that the packages have: package and endpoint."""
        for package in self.packages:
            try:
                endpoints = package.topics.versions_of(self.plain(route.name))
            except KeyError:
                continue
            yield from ((package, endpoint) for endpoint in endpoints)

    def sources(self) -> tuple[Mapping[str, Source], list[tuple[str, str]]]:
        """Return the topics that standard messages are made from, by their names, and those that cannot be used."""
        found, refused = {}, []
        for route in self.routes:
            name = stem_of(route.name).rpartition("/")[2]
            if route.direction == "out" and name in SOURCES:
                try:
                    found[route.name] = Source(name, self.message_of(route))
                except ValueError as error:
                    refused.append((route.name, str(error)))
        return found, refused


def planned(topics: Topics, wish: Wish, find: Finder = installed) -> Plan:
    """Return the topics that ROS can have with its installed types. Raises ValueError for a name of no topic."""
    rows: list[Row] = []
    refused: list[tuple[str, str]] = []
    missing: dict[str, None] = {}
    routes = topics.chosen(wish.topics)
    for route in routes if wish.is_translated or not wish.is_beside_agent else ():
        try:
            theirs = topics.message_of(route)
        except ValueError as error:
            refused.append((route.name, str(error)))
            continue
        found = [*_rows(topics, route, theirs, find, is_translated=wish.is_translated)]
        rows += [row for row in found if row.convert is not None or not wish.is_beside_agent]
        if not found and find(theirs.__msg__.ros_type) is None:
            missing[theirs.__msg__.ros_type] = None
        elif not found:
            refused.append((route.name, _reason(topics, route, theirs, find)))
    services: list[ServiceRow] = []
    for service in () if wish.is_beside_agent else topics.chosen_services(wish.topics):
        try:
            services.append(_service(topics, service, find))
        except LookupError:
            missing[service_type(service)] = None
        except ValueError as error:
            refused.append((service.name, str(error)))
    made, more = topics.sources() if wish.is_standard else ({}, [])
    return Plan(tuple(rows), tuple(dict.fromkeys([*refused, *more])), tuple(missing), made, tuple(services))


def service_type(service: Service) -> str:
    """Return the type of a service in ROS 2: `px4_msgs/srv/VehicleCommand`."""
    return service.request_type.removesuffix("_Request")


def _service(topics: Topics, service: Service, find: Finder) -> ServiceRow:
    """Return a service with its installed type.

    A service has no version. Its messages may have one: their fields decide. Raises ValueError if they differ, and
    LookupError if the type is not installed.
    """
    theirs, ros_type = topics.service_of(service), service_type(service)
    ros = find(ros_type)
    if ros is None:
        raise LookupError(ros_type)
    pairs = ((theirs.Request, ros.Request), (theirs.Response, ros.Response))
    found = [text for own, other in pairs for text in differences(own, other, find)]
    if found:
        raise ValueError(f"the vehicle's definition differs, and {ros_type} has {few(found)}")
    return ServiceRow(service, ros, theirs.Request, theirs.Response)


def _rows(topics: Topics, route: Route, theirs: type[Message], find: Finder, *, is_translated: bool) -> Iterator[Row]:
    """Yield the topics of ROS that a route can be, each version once."""
    front = route.name.removesuffix(topics.plain(route.name))
    theirs_hash, names = theirs.__msg__.message_hash, set()
    holders = {
        package: endpoint.message
        for package, endpoint in topics.versions_of(route)
        if endpoint.message.__msg__.message_hash == theirs_hash
    }
    for package, endpoint in topics.versions_of(route):
        own, name = endpoint.message, front + endpoint.ros_name
        is_same = name == route.name and own.__msg__.message_hash == theirs_hash
        is_convertible = is_translated and package in holders and hasattr(package, "versions")
        ros = _equal(own, find, is_translated=is_translated) if is_same or is_convertible else None
        if ros is None or name in names:
            continue
        names.add(name)
        qos = endpoint.qos.writer if route.direction == "out" else endpoint.qos.reader
        convert = None if is_same else package.versions.convert
        yield Row(name, route, ros, qos, theirs if is_same else holders[package], theirs if is_same else own, convert)


def _equal(own: type[Message], find: Finder, *, is_translated: bool) -> Any:
    """Return the installed type with the fields of a message, or None."""
    name = own.__msg__.ros_type
    names = [name]
    if is_translated:
        names.append(f"{_OLD}/msg/{name.rpartition('/')[2]}V{own.__msg__.message_version}")
    every = map(find, names)
    return next((ros for ros in every if ros is not None and not differences(own, ros, find)), None)


def _reason(topics: Topics, route: Route, theirs: type[Message], find: Finder) -> str:
    """Return how the installed type differs from the definition of the vehicle."""
    info = theirs.__msg__
    ros = find(info.ros_type)
    vehicle = f"the vehicle has version {info.message_version} ({info.message_hash:#010x})"
    for _, endpoint in topics.versions_of(route):
        other = endpoint.message.__msg__
        if not differences(endpoint.message, ros, find):
            return f"{vehicle}, and {info.ros_type} is version {other.message_version} ({other.message_hash:#010x})"
    return f"{vehicle}, and {info.ros_type} has {few(differences(theirs, ros, find))}"
