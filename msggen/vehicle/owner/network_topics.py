"""A vehicle on a network, and its topics in the form of rmw_zenoh: their keys, their QoS, and what decodes them."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from msggen.link.link import LinkError, Route
from msggen.link.rmw_zenoh.names import Attachment, Key, Kind, Qos, Token, carrier_of
from msggen.messages.names import without_namespace
from msggen.messages.packages import Message, Packages, has_definition
from msggen.vehicle.entry import Entry

if TYPE_CHECKING:
    from msggen.link.rmw_zenoh.session import Declared, Publisher

_DOMAIN: Final = "ROS_DOMAIN_ID"
_DOMAINS: Final = 233


class Flow:
    """A topic of a vehicle on the network."""

    __slots__ = ("_lock", "gid", "newest", "publisher", "sequence")

    def __init__(self, publisher: Publisher, gid: bytes) -> None:
        self.publisher, self.gid = publisher, gid
        self.sequence = self.newest = 0
        self._lock = threading.Lock()
        """Two threads publish: numbers that went back would tell of two vehicles."""

    def put(self, payload: bytes, arrived: int, after: int = -1) -> None:
        """Publish a sample that has arrived at a time in ns. What cannot be published is missing in the sequence.

        With `after`, it is left out if it has not arrived after that time and the newest sample.
        """
        with self._lock:
            if after >= 0 and arrived <= max(after, self.newest):
                return
            self.sequence += 1
            self.newest = arrived
            with suppress(LinkError):
                self.publisher.put(payload, Attachment(self.sequence, arrived, self.gid).pack())


class Topic(NamedTuple):
    """A topic of a vehicle in the form of rmw_zenoh."""

    route: Route
    key: Key
    qos: Qos
    message: type[Message]


class OnNetwork:
    """A vehicle that is carried."""

    def __init__(self, entry: Entry) -> None:
        self.entry = entry
        self.topics: Mapping[str, Topic] = {}
        """By the names of their routes."""
        self.known: set[str] = set()
        """The names of all its routes whose types are found or looked for, also of those without a definition."""
        self.looked_at = 0.0
        """When its types were looked for, of the monotonic clock."""
        self.declared: list[Declared] = []
        self.beat: Flow | None = None

    def node(self, domain: int, zid: str) -> Token:
        """Return the token of its node in a session."""
        remote = self.entry.remote
        number = remote.number % 100_000 * 10_000  # of nine digits, which readers of tokens accept
        node = Token(domain, zid, "NN", carrier_of(remote.key), ids=(number, number))
        return node._replace(namespace=remote.namespace)

    def tokens(self, node: Token) -> Iterator[tuple[Topic, str]]:
        """Yield its topics, first those that it reads, and the token of each."""
        first, _ = node.ids or (0, 0)
        topics = sorted(self.topics.values(), key=lambda each: each.route.direction)
        for number, topic in enumerate(topics, first + 1):
            kind: Kind = "MS" if topic.route.direction == "in" else "MP"
            yield topic, str(node._replace(kind=kind, key=topic.key, qos=topic.qos, ids=(first, number)))


def topics_of(route: Route, entry: Entry, packages: Packages, domain: int) -> Iterator[Topic]:
    """Yield the topic that a route is, as packages with its definition have it."""
    known = entry.hash_of(route.ros_type)
    for package in packages:
        for endpoint in _versions(package, without_namespace(route.name, entry.remote.namespace)):
            info = endpoint.message.__msg__
            if info.ros_type == route.ros_type and has_definition(endpoint.message, route, known):
                side = endpoint.qos.writer if route.direction == "out" else endpoint.qos.reader
                qos = Qos(is_reliable=side.reliability == "RELIABLE", depth=side.depth or Qos().depth)
                key = Key(domain, route.name, route.ros_type, info.type_hash)
                yield Topic(route, key, qos, endpoint.message)


def _versions(package: Any, name: str) -> Sequence[Any]:
    try:
        return [*reversed(package.topics.versions_of(name))]
    except KeyError:
        return ()


def domain_of_ros() -> int:
    """Return the domain of ROS. Raises LinkError."""
    text = os.environ.get(_DOMAIN) or "0"
    if not text.isdecimal() or int(text) >= _DOMAINS:
        raise LinkError(f"{_DOMAIN} is '{text}': expected a number from 0 to {_DOMAINS - 1}")
    return int(text)
