"""The entities of one client, and the routes and services that they make. docs/xrce.md, 4."""

from __future__ import annotations

import re
from typing import NamedTuple

from msggen.link.link import Route, Service
from msggen.link.xrce import entities, wire
from msggen.link.xrce.entities import Endpoint, Entity, Participant, RefusedError, Replier, TopicEntity
from msggen.link.xrce.wire import WireError

_NAME = re.compile(r"[A-Za-z0-9_/:~]+")
_NAMESPACE = re.compile(r"[A-Za-z0-9_/]*")
_PARENTS = {
    entities.TOPIC: entities.PARTICIPANT,
    entities.PUBLISHER: entities.PARTICIPANT,
    entities.SUBSCRIBER: entities.PARTICIPANT,
    entities.REPLIER: entities.PARTICIPANT,
    entities.WRITER: entities.PUBLISHER,
    entities.READER: entities.SUBSCRIBER,
}

PARTICIPANT = entities.object_id(1, entities.PARTICIPANT)
"""The participant of PX4's client."""

ROUNDS = 4
"""How often a client may create all its entities in one session. PX4's client creates each once. The routes of deleted
entities stay with the listener until the session ends, so their number needs a bound too."""


class Reading(NamedTuple):
    """A READ_DATA: where samples or requests go."""

    route: Route | Service
    request_id: bytes
    stream: int


class Inventory:
    """The entities of one client."""

    def __init__(self, most: int, longest: int) -> None:
        """Make an empty inventory for up to `most` entities with names of up to `longest` characters.

        Entities that replace others, or deleted ones, count too, up to ROUNDS times `most`.
        """
        self.namespace: str | None = None
        """The namespace of the first participant: empty if it tells none, None before there is one."""
        self.writers: dict[bytes, Route] = {}
        self.services: dict[bytes, Service] = {}
        self.readings: dict[bytes, Reading] = {}
        """What the client has asked for, by the object ids of readers and repliers."""
        self._readers: dict[bytes, Route] = {}
        self._entities: dict[bytes, Entity] = {}
        self._parts: dict[bytes, set[bytes]] = {}  # of an entity, those whose parent it is
        self._most = most
        self._left = ROUNDS * most
        self._longest = longest

    def __len__(self) -> int:
        return len(self._entities)

    def routes(self) -> list[Route | Service]:
        """Return what the client publishes, and what it has asked for."""
        return [*self.writers.values(), *(reading.route for reading in self.readings.values())]

    def create(self, create: wire.Create) -> Route | None:
        """Make an entity; return the route that it opens. Raises RefusedError and WireError."""
        entity = entities.parse(create)
        object_id = create.object_id
        old = self._entities.get(object_id)
        if (old is None and len(self._entities) >= self._most) or not self._left:
            raise RefusedError("too many entities", wire.ERR_RESOURCES)
        if old is not None and not create.flags & wire.REPLACE:
            if create.flags & wire.REUSE and entity == old:
                return None
            raise RefusedError("entity that exists", wire.ERR_ALREADY_EXISTS)
        parent = _parent(entity)
        if parent is not None:
            kind = _PARENTS[entities.object_kind(object_id)]
            if parent not in self._entities or entities.object_kind(parent) != kind:
                raise RefusedError("entity of an unknown parent", wire.ERR_UNKNOWN_REFERENCE)
        route = self._make(object_id, entity)
        if old is not None:
            self._leave_parent(object_id, old)
        if parent is not None:
            self._parts.setdefault(parent, set()).add(object_id)
        self._entities[object_id] = entity
        self._left -= 1
        return route

    def read(self, read: wire.ReadData) -> Route | Service | None:
        """Take a READ_DATA; return the route or service that it opens. Raises RefusedError."""
        route = self._readers.get(read.object_id) or self.services.get(read.object_id)
        if route is None:
            raise RefusedError("READ_DATA of an unknown entity", wire.ERR_UNKNOWN_REFERENCE)
        if read.stream not in (wire.BEST_EFFORT, wire.RELIABLE):
            raise RefusedError("unknown stream", wire.ERR_INVALID_DATA)
        is_new = read.object_id not in self.readings
        self.readings[read.object_id] = Reading(route, read.request_id, read.stream)
        return route if is_new else None

    def delete(self, object_id: bytes) -> None:
        """Remove an entity and those that are part of it. Raises RefusedError."""
        if object_id not in self._entities:
            raise RefusedError("DELETE of an unknown entity", wire.ERR_UNKNOWN_REFERENCE)
        self._leave_parent(object_id, self._entities[object_id])
        gone = [object_id]
        for each in gone:  # which grows meanwhile
            gone += self._parts.pop(each, ())
            del self._entities[each]
            for table in (self.writers, self.services, self.readings, self._readers):
                table.pop(each, None)

    def _leave_parent(self, object_id: bytes, entity: Entity) -> None:
        parent = _parent(entity)
        if parent is not None:
            self._parts[parent].remove(object_id)

    def _make(self, object_id: bytes, entity: Entity) -> Route | None:
        if isinstance(entity, Participant):
            if self.namespace is None:
                self.namespace = _namespace(entity.name[: self._longest])
        elif isinstance(entity, TopicEntity):
            self._check(entity.name, entity.type)
        elif isinstance(entity, Replier):
            self._check(*entity[:5])
            self.services[object_id] = _service(object_id, entity)
        elif isinstance(entity, Endpoint):
            return self._endpoint(object_id, entity)
        return None

    def _endpoint(self, object_id: bytes, endpoint: Endpoint) -> Route | None:
        names = endpoint.topic
        if isinstance(names, bytes):
            topic = self._entities.get(names)
            if not isinstance(topic, TopicEntity):
                raise RefusedError("endpoint of an unknown topic", wire.ERR_UNKNOWN_REFERENCE)
            names = topic.name, topic.type
        self._check(*names)
        name, ros_type, number = _ros_name(names[0]), _ros_type(names[1]), entities.object_number(object_id)
        if endpoint.kind == entities.READER:
            self._readers[object_id] = Route(name, ros_type, "in", number)
            self.readings.pop(object_id, None)  # until the client asks for its samples
            return None
        route = Route(name, ros_type, "out", number)
        is_new = self.writers.get(object_id) != route
        self.writers[object_id] = route
        return route if is_new else None

    def _check(self, *names: str) -> None:
        for name in names:
            if len(name) > self._longest or not _NAME.fullmatch(name):
                raise WireError("name with unexpected characters, or too long")


def _parent(entity: Entity) -> bytes | None:
    return None if isinstance(entity, Participant) else entity.parent


def _namespace(name: str) -> str:
    """Return the namespace in the name of a participant, `uav_1/px4_micro_xrce_dds`, or "" if it has none."""
    namespace, _, rest = name.rpartition("px4_micro_xrce_dds")
    return namespace.strip("/") if not rest and _NAMESPACE.fullmatch(namespace) else ""


def _service(object_id: bytes, replier: Replier) -> Service:
    """Return a service with its names in ROS 2: `rq/fmu/vehicle_commandRequest` is `/fmu/vehicle_command`."""
    name = _ros_name(replier.request_topic).removesuffix("Request")
    types = _ros_type(replier.request_type), _ros_type(replier.reply_type)
    return Service(name, *types, entities.object_number(object_id))


def _ros_name(topic: str) -> str:
    """Return a topic's name in ROS 2: `rt/fmu/out/vehicle_status` is `/fmu/out/vehicle_status`."""
    return topic[2:] if topic.startswith(("rt/", "rq/")) else topic


def _ros_type(dds_type: str) -> str:
    """Return a type's name in ROS 2: `px4_msgs::msg::dds_::VehicleStatus_` is `px4_msgs/msg/VehicleStatus`."""
    if "::dds_::" in dds_type:
        dds_type = dds_type.replace("::dds_::", "::").removesuffix("_")
    return dds_type.replace("::", "/")
