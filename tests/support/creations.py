"""The CREATE and READ_DATA of routes that are known without them, as PX4's client sends them. docs/xrce.md, 4."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msggen.link.link import Route, Service
from msggen.link.xrce import entities, wire
from msggen.link.xrce.inventory import PARTICIPANT


def creations(namespace: str, routes: Iterable[Route | Service]) -> Iterator[bytes]:
    """Yield the submessages with which a client creates its routes and services, and reads them."""
    yield _create(PARTICIPANT, entities.Participant(f"{namespace}/px4_micro_xrce_dds"))
    for route in routes:
        if isinstance(route, Service):
            yield from _service(route)
        else:
            yield from _endpoint(route)


def _endpoint(route: Route) -> Iterator[bytes]:
    is_out = route.direction == "out"
    kinds = (entities.PUBLISHER, entities.WRITER) if is_out else (entities.SUBSCRIBER, entities.READER)
    topic, group, endpoint = (entities.object_id(route.object_id, kind) for kind in (entities.TOPIC, *kinds))
    yield _create(topic, entities.TopicEntity(route.name, route.ros_type, PARTICIPANT))
    yield _create(group, entities.Group(kinds[0], PARTICIPANT))
    yield _create(endpoint, entities.Endpoint(kinds[1], topic, group))
    if not is_out:
        yield wire.ReadData(wire.NO_REQUEST, endpoint).pack()


def _service(service: Service) -> Iterator[bytes]:
    replier = entities.object_id(service.object_id, entities.REPLIER)
    names = service.name, service.request_type, service.reply_type
    topics = f"{service.name}Request", f"{service.name}Reply"
    yield _create(replier, entities.Replier(*names, *topics, PARTICIPANT))
    yield wire.ReadData(wire.NO_REQUEST, replier, wire.RELIABLE).pack()


def _create(object_id: bytes, entity: entities.Entity) -> bytes:
    return wire.Create(wire.NO_REQUEST, object_id, entity.pack()).pack()
