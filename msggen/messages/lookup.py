"""Topics by any spelling: the name in ROS 2, DDS or uORB, with or without version and namespace, or the message."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.link.link import Route, TopicError
from msggen.messages.names import is_named_after, is_topic, stem_of
from msggen.messages.packages import endpoint_of

if TYPE_CHECKING:
    from msggen.messages.packages import Endpoint, Message, Way

_TO_ADD = "; add it there, and build the firmware again (docs/doctor.md)"
_SUGGESTED = re.compile(r"(?<=did you mean ')/[^']*/([^/']+)(?='\?)")
"""The last part of a name that an error suggests: what is meant by a name without slashes."""


class Named(NamedTuple):
    """A topic that the user has named. At least one of `endpoint` and `route` is not None."""

    name: str
    """The name in ROS 2: that of the vehicle, or else that of the package."""
    direction: Way
    endpoint: Endpoint[Message] | None
    """What the package knows, in the version of the vehicle if the package has it."""
    route: Route | None
    """What the vehicle has."""

    @property
    def message(self) -> type[Message] | None:
        """The class of its messages, or None if the package does not know the topic."""
        return None if self.endpoint is None else self.endpoint.message


def named_topic(text: str, way: Way, package: ModuleType, routes: Sequence[Route]) -> Named:
    """Return the topic that a text names, one of the direction `way` if there are several.

    Raises TopicError, which names the nearest topic, or says that a topic is on uORB only.
    """
    route = _route(text, way, routes)
    if route is not None:
        return Named(route.name, route.direction, endpoint_at(package, route.name), route)
    endpoint, namespace = _endpoint(text, way, package)
    stem = stem_of(endpoint.ros_name)
    for found in routes:
        if found.direction == endpoint.direction and is_topic(found.name, stem, namespace):
            return Named(found.name, found.direction, endpoint_at(package, found.name), found)
    front = f"/{namespace}" if namespace else ""
    return Named(front + endpoint.ros_name, endpoint.direction, endpoint, None)


def all_topics(package: ModuleType, routes: Sequence[Route]) -> list[Named]:
    """Return the topics of a vehicle, and those of the package that it does not have, sorted by name."""
    own = [Named(route.name, route.direction, endpoint_at(package, route.name), route) for route in routes]
    missing = [
        Named(endpoint.ros_name, endpoint.direction, endpoint, None)
        for endpoint in package.topics.ENDPOINTS
        if not any(is_topic(route.name, stem_of(endpoint.ros_name)) for route in routes)
    ]
    return sorted([*own, *missing], key=lambda topic: topic.name)


def endpoint_at(package: ModuleType, ros_name: str) -> Endpoint[Message] | None:
    """Return the endpoint with this name, or another version of it, or None if the package has none."""
    try:
        versions = package.topics.versions_of(ros_name)
    except KeyError:
        return None
    found: Endpoint[Message] = next((each for each in versions if each.ros_name == ros_name), versions[-1])
    return found


def _route(text: str, way: Way, routes: Sequence[Route]) -> Route | None:
    plain = stem_of(text[2:] if text.startswith("rt/") else text)
    for route in sorted(routes, key=lambda route: route.direction != way):
        stem = stem_of(route.name)
        if plain in (stem, stem[1:], stem.rpartition("/")[2]):
            return route
    return None


def _endpoint(text: str, way: Way, package: ModuleType) -> tuple[Endpoint[Message], str | None]:
    """Return the endpoint of a package that a text names, and the namespace in it."""
    name = text if text.startswith(("/", "rt/")) or "/" not in text else f"/{text}"
    try:
        return endpoint_of(package, name, way)
    except KeyError as error:
        missing = str(error) if "/" in text else _SUGGESTED.sub(lambda found: stem_of(found[1]), str(error))
    try:
        message = message_named(text, package)
    except KeyError as error:
        is_message = text[:1].isupper() or "/msg/" in text or "::" in text
        raise TopicError(str(error) if is_message else _with_cure(missing)) from None
    return _of_message(message, way, package), None


def _of_message(message: type[Message], way: Way, package: ModuleType) -> Endpoint[Message]:
    """Return the endpoint with messages of a class."""
    name = message.__msg__.name
    every = topics_of_message(package, message)
    found = [endpoint for endpoint in every if endpoint.direction == way] or every
    found = [endpoint for endpoint in found if is_named_after(endpoint.ros_name, name)] or found
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(f"'{endpoint.ros_name}'" for endpoint in found)
        raise TopicError(f"{name} is the message of several topics: name one of {names}")
    on_uorb = ", ".join(f"'{topic}'" for topic in message.__msg__.topics)
    text = f"{on_uorb} is on uORB only" if on_uorb else "no topic has it"
    raise TopicError(_with_cure(f"no topic of the bridge has the message {name}: {text}, it is not in dds_topics.yaml"))


def message_named(text: str, package: ModuleType) -> type[Message]:
    """Return the class of a message by its name, or that of its type: `VehicleStatus`, `px4_msgs/msg/VehicleStatus`.

    Raises the KeyError of the package, which names the nearest one.
    """
    is_plain = "/" not in text and ":" not in text
    front = package.topics.ENDPOINTS[0].message.__msg__.ros_type.rpartition("/")[0] if is_plain else ""
    found: type[Message] = package.by_type(f"{front}/{text}" if front else text)
    return found


def topics_of_message(package: ModuleType, message: type[Message]) -> list[Endpoint[Any]]:
    """Return the endpoints with messages of a class."""
    endpoints: Iterable[Endpoint[Any]] = package.topics.ENDPOINTS
    return [endpoint for endpoint in endpoints if endpoint.message_name == message.__name__]


def _with_cure(text: str) -> str:
    """Return an error of the package about an endpoint, in the words of users, with what to do about it."""
    end = _TO_ADD if text.endswith("not in dds_topics.yaml") else ""
    return text.replace("no endpoint", "no topic", 1) + end
