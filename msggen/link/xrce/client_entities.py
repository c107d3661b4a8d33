"""The entities that PX4's client creates, and their representations: docs/xrce.md, "Entities"."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple, TypeAlias
from xml.sax.saxutils import escape

from msggen.link.xrce import wire
from msggen.link.xrce.entities import (
    BY_XML,
    PARTICIPANT,
    PUBLISHER,
    QOS_KEEP_LAST,
    QOS_TRANSIENT_LOCAL,
    READER,
    REPLIER,
    SUBSCRIBER,
    TOPIC,
    WRITER,
    Endpoint,
    Group,
    Participant,
    Replier,
    TopicEntity,
    object_id,
)

Sync: TypeAlias = Literal["px4", "short", "off"]
"""The time synchronisation: as PX4's, which takes 5 s at the start; with 20 exchanges; or none."""

Creation: TypeAlias = tuple[bytes, bytes]
"""An object id and a representation."""

_PARTICIPANT_ID: Final = object_id(1, PARTICIPANT)


class Reader(NamedTuple):
    """A topic that the client reads."""

    number: int
    """The number of the entity: 12 bits."""
    name: str
    """The name in DDS: `rt/fmu/in/vehicle_command`."""
    type: str
    depth: int


class Writer(NamedTuple):
    """A topic that the client writes."""

    number: int
    name: str
    type: str


class Server(NamedTuple):
    """A service of the client."""

    number: int
    name: str
    request_type: str
    reply_type: str
    request_topic: str
    reply_topic: str


class Settings(NamedTuple):
    """The settings of a client. Namespaces are part of the names of topics already."""

    readers: Sequence[Reader]
    writers: Sequence[Writer]
    servers: Sequence[Server] = ()
    key: int = 1
    """The parameter UXRCE_DDS_KEY."""
    namespace: str = ""
    """Becomes part of the name of the participant."""
    sync: Sync = "px4"
    silence: int = 3_000_000
    """The time in us without a sample from the vehicle after which it ends the session: UXRCE_DDS_TX_TO."""
    localhost: bool = False
    """The parameter UXRCE_DDS_PTCFG: ask the agent to use the loopback interface only."""


def create_participant(settings: Settings) -> Creation:
    """Return the participant."""
    name = f"{settings.namespace}/px4_micro_xrce_dds"
    return _PARTICIPANT_ID, _localhost_participant(name) if settings.localhost else Participant(name).pack()


def create_reader(reader: Reader) -> list[Creation]:
    """Return topic, subscriber and reader."""
    topic, subscriber, identity = (object_id(reader.number, kind) for kind in (TOPIC, SUBSCRIBER, READER))
    return [
        (topic, TopicEntity(reader.name, reader.type, _PARTICIPANT_ID).pack()),
        (subscriber, Group(SUBSCRIBER, _PARTICIPANT_ID).pack()),
        (identity, Endpoint(READER, topic, subscriber, QOS_KEEP_LAST, reader.depth).pack()),
    ]


def create_writer(writer: Writer) -> list[Creation]:
    """Return topic, publisher and writer."""
    topic, publisher, identity = (object_id(writer.number, kind) for kind in (TOPIC, PUBLISHER, WRITER))
    return [
        (topic, TopicEntity(writer.name, writer.type, _PARTICIPANT_ID).pack()),
        (publisher, Group(PUBLISHER, _PARTICIPANT_ID).pack()),
        (identity, Endpoint(WRITER, topic, publisher, QOS_KEEP_LAST | QOS_TRANSIENT_LOCAL).pack()),
    ]


def create_server(server: Server) -> Creation:
    """Return the replier."""
    return object_id(server.number, REPLIER), Replier(*server[1:], parent=_PARTICIPANT_ID).pack()


def _localhost_participant(name: str) -> bytes:
    """Return the representation of a participant that is restricted to the loopback interface."""
    transport = "<transport_id>udp_localhost</transport_id>"
    only = "<interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>"
    xml = (
        f"<dds><profiles><transport_descriptors><transport_descriptor>{transport}<type>UDPv4</type>{only}"
        "</transport_descriptor></transport_descriptors></profiles>"
        f"<participant><rtps><name>{escape(name)}</name><useBuiltinTransports>false</useBuiltinTransports>"
        f"<userTransports>{transport}</userTransports></rtps></participant></dds>"
    )
    text = bytes((PARTICIPANT, BY_XML, 0, 0)) + wire.pack_string(xml)
    return text + bytes(len(text) & 1) + bytes(2)
