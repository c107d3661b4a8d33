"""What the client of a simulated vehicle creates: the topics that it publishes and reads, and its service."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

from msggen.link.xrce.client import Client
from msggen.link.xrce.client_entities import Reader, Server, Settings, Writer
from msggen.sim.options import Options
from msggen.sim.publishing import Publication, publication_of

_SERVICE_NUMBER = 2048


class Input(NamedTuple):
    """A topic that the vehicle reads."""

    topic: str
    """Its name in uORB."""
    name: str
    """Its name in ROS 2."""
    message: Any


class Endpoints(NamedTuple):
    """The endpoints of a vehicle."""

    publications: Sequence[Publication]
    inputs: Mapping[int, Input]
    """By the numbers of their objects in the session."""
    new_client: Callable[[], Client]
    """Makes the client of a session."""


def endpoints_of(package: ModuleType, options: Options) -> Endpoints:
    """Return the endpoints of a generated package, with the namespace and the misbehaviour of options."""
    namespace = f"/{options.namespace}" if options.namespace else ""
    versions = options.misbehaviour.versions or {}
    publications, inputs, readers, writers = [], {}, [], []
    topics = import_module(f"{package.__name__}.topics")
    numbers = object_ids_of(topics, has_all=options.board != "most")
    bridged = [endpoint for endpoint in topics.ENDPOINTS if endpoint.object_id is not None]
    for endpoint, number in zip(bridged, numbers, strict=True):
        name = namespace + _versioned(endpoint.ros_name, versions.get(endpoint.message_name))
        if endpoint.direction == "in":
            readers.append(Reader(number, f"rt{name}", endpoint.dds_type, endpoint.qos.reader.depth))
            inputs[number] = Input(endpoint.uorb_topic, name, endpoint.message)
        else:
            writers.append(Writer(number, f"rt{name}", endpoint.dds_type))
            publications.append(
                publication_of(endpoint, name=name, number=number, rate=options.rate, parts=options.equipment)
            )
    servers = _servers(getattr(package, "srv", None), namespace)
    settings = Settings(readers, writers, servers, key=options.key, namespace=options.namespace, sync=options.sync)
    return Endpoints(publications, inputs, lambda: Client(settings))


def object_ids_of(topics: Any, *, has_all: bool = False) -> tuple[int, ...]:
    """Return the object id of each endpoint of a package's module `topics` that crosses the bridge, in their order.

    They depend on the board: most have no messages with a condition (docs/wire.md, section 12), but for those whose
    topics cross the bridge. With `has_all`, the board has all of them.
    """
    bridged = [endpoint for endpoint in topics.ENDPOINTS if endpoint.object_id is not None]
    met = {topics.UORB[endpoint.uorb_topic].condition for endpoint in bridged} | {""}
    built = [topic for topic in topics.UORB.values() if has_all or topic.condition in met]
    orb_ids = {topic.name: place for place, topic in enumerate(sorted(built, key=lambda each: each.orb_id))}
    return tuple(
        endpoint.object_id
        if endpoint.direction == "in"
        else orb_ids[endpoint.uorb_topic] + (endpoint.instance or 0) * len(orb_ids)
        for endpoint in bridged
    )


def _servers(services: Any, namespace: str) -> list[Server]:
    if services is None:
        return []
    service = services.VehicleCommand
    topics = f"rq{namespace}/fmu/vehicle_commandRequest", f"rr{namespace}/fmu/vehicle_commandReply"
    types = service.Request.__msg__.dds_type, service.Response.__msg__.dds_type
    return [Server(_SERVICE_NUMBER, "vehicle_command", *types, *topics)]


def _versioned(name: str, version: int | None) -> str:
    """Return the name of a topic with another version suffix. Version 0 has none."""
    if version is None:
        return name
    return re.sub(r"_v\d+$", "", name) + (f"_v{version}" if version else "")
