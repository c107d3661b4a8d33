"""Entities that a client creates: object ids and representations. docs/xrce.md, 4.

A representation is binary, XML, or the name of a profile that the agent would have. `parse` reads all three, as far as
they are clear; `pack` of each class writes the one that PX4's client sends.
"""

from __future__ import annotations

import struct
from typing import Final, NamedTuple, TypeAlias

from msggen.link.xrce.wire import ERR_DDS_ERROR, Create, WireError, pack_string, read_string, read_u32

# Kinds of entities: the lower 4 bits of an object id
PARTICIPANT: Final = 1
TOPIC: Final = 2
PUBLISHER: Final = 3
SUBSCRIBER: Final = 4
WRITER: Final = 5
READER: Final = 6
REPLIER: Final = 8

LARGEST_NUMBER: Final = 0xFFF
"""The largest number of an entity: 12 bits."""

# Formats of representations
BY_REFERENCE: Final = 1
BY_XML: Final = 2
BY_BINARY: Final = 3

# Flags of the QoS of writers and readers
QOS_RELIABLE: Final = 0x01
QOS_KEEP_LAST: Final = 0x02
QOS_TRANSIENT_LOCAL: Final = 0x08

_HEAD = struct.Struct("<BBxxI")
_U16 = struct.Struct("<H")


class RefusedError(ValueError):
    """A request about an entity that the agent refuses. The text is one of a fixed set."""

    def __init__(self, reason: str, status: int) -> None:
        super().__init__(reason)
        self.status = status
        """What STATUS tells the client."""


def object_id(number: int, kind: int) -> bytes:
    """Return the object id of an entity: 12 bits of number, 4 bits of kind."""
    return (number << 4 | kind).to_bytes(2, "big")


def object_number(object_id: bytes) -> int:
    """Return the number in an object id."""
    return int.from_bytes(object_id, "big") >> 4


def object_kind(object_id: bytes) -> int:
    """Return the kind in an object id."""
    return object_id[1] & 15


class Participant(NamedTuple):
    """The participant of a client."""

    name: str
    """PX4 names it `NAMESPACE/px4_micro_xrce_dds`. Empty if it is not known."""
    domain: int = 0

    def pack(self) -> bytes:
        """Return the representation in XML."""
        xml = f"<dds><participant><rtps><name>{_escape(self.name)}</name></rtps></participant></dds>".encode()
        text = _HEAD.pack(PARTICIPANT, BY_XML, len(xml) + 1) + xml + b"\0"
        return text + bytes(len(text) & 1) + self.domain.to_bytes(2, "little", signed=True)


class TopicEntity(NamedTuple):
    """A topic, with its names in DDS."""

    name: str
    type: str
    parent: bytes

    def pack(self) -> bytes:
        """Return the representation in binary."""
        text = pack_string(self.name) + b"\0\1"
        return _pack_binary(TOPIC, text + bytes(-len(text) & 3) + pack_string(self.type), self.parent)


class Group(NamedTuple):
    """A publisher or subscriber, without properties."""

    kind: int
    parent: bytes

    def pack(self) -> bytes:
        """Return the representation in binary."""
        return _pack_binary(self.kind, b"\0\0", self.parent)


class Endpoint(NamedTuple):
    """A datawriter or datareader."""

    kind: int
    topic: bytes | tuple[str, str]
    """The object id of its topic, or name and type if the representation has them (XML)."""
    parent: bytes
    flags: int = QOS_KEEP_LAST | QOS_TRANSIENT_LOCAL
    depth: int | None = None

    def pack(self) -> bytes:
        """Return the representation in binary. `topic` must be an object id."""
        if isinstance(self.topic, tuple):
            raise TypeError("an endpoint in binary has the object id of its topic")
        depth = b"\0" if self.depth is None else b"\1\0" + _U16.pack(self.depth)
        # no deadline, life span and user data; then no ownership strength of a writer, or no filters of a reader
        absent = bytes(4 if self.kind == WRITER else 5)
        return _pack_binary(self.kind, self.topic + b"\1\0" + _U16.pack(self.flags) + depth + absent, self.parent)


class Replier(NamedTuple):
    """A service that the client has. Names as in DDS."""

    service: str
    request_type: str
    reply_type: str
    request_topic: str
    reply_topic: str
    parent: bytes

    def pack(self) -> bytes:
        """Return the representation in binary."""
        data = b""
        for text in (self.service, self.request_type, self.reply_type):
            data += bytes(-len(data) & 3) + pack_string(text)
        for text in (self.request_topic, self.reply_topic):
            data += b"\1"
            data += bytes(-len(data) & 3) + pack_string(text)
        return _pack_binary(REPLIER, data, self.parent)


Entity: TypeAlias = Participant | TopicEntity | Group | Endpoint | Replier


def parse(create: Create) -> Entity:
    """Return the entity of a CREATE. Raises WireError if it is malformed, RefusedError if its kind is unknown."""
    kind, data = object_kind(create.object_id), create.representation
    if len(data) < 8:
        raise WireError("payload too short")
    if data[0] != kind:
        raise WireError("kind of an entity differs from its object id")
    read = {BY_REFERENCE: _by_reference, BY_XML: _by_xml, BY_BINARY: _by_binary}.get(data[1])
    if read is None:
        raise WireError("unknown format of a representation")
    return read(kind, data)


def _by_reference(kind: int, data: bytes) -> Entity:
    """Return a participant without a name. The profiles that other entities refer to are not known here."""
    if kind != PARTICIPANT:
        raise RefusedError("entity by reference", ERR_DDS_ERROR)
    _, end = _read_text(data)
    return Participant("", _domain(data, end))


def _by_xml(kind: int, data: bytes) -> Entity:
    text, end = _read_text(data)
    if kind == PARTICIPANT:
        return Participant(_element(text, "rtps", "name"), _domain(data, end))
    parent = _parent(data, end)
    if kind in (PUBLISHER, SUBSCRIBER):
        return Group(kind, parent)
    if kind == TOPIC:
        return TopicEntity(_element(text, "topic", "name"), _element(text, "topic", "dataType"), parent)
    if kind in (WRITER, READER):
        flags = QOS_RELIABLE if "<kind>RELIABLE</kind>" in text else 0
        return Endpoint(kind, (_element(text, "topic", "name"), _element(text, "topic", "dataType")), parent, flags)
    if kind == REPLIER:
        return Replier(
            _attribute(text, "replier", "service_name"),
            _attribute(text, "replier", "request_type"),
            _attribute(text, "replier", "reply_type"),
            _element(text, "replier", "request_topic_name"),
            _element(text, "replier", "reply_topic_name"),
            parent,
        )
    raise RefusedError("unknown kind of entity", ERR_DDS_ERROR)


def _by_binary(kind: int, data: bytes) -> Entity:
    size, at = read_u32(data, 4)
    if kind == PARTICIPANT:
        return Participant(_participant_name(data[at : at + size]), _domain(data, at + size))
    content, parent = data[at : at + size], _parent(data, at + size)
    if kind == TOPIC:
        return _topic(content, parent)
    if kind in (PUBLISHER, SUBSCRIBER):
        return Group(kind, parent)
    if kind in (WRITER, READER):
        return _endpoint(kind, content, parent)
    if kind == REPLIER:
        return _replier(content, parent)
    raise RefusedError("unknown kind of entity", ERR_DDS_ERROR)


def _participant_name(data: bytes) -> str:
    """Return the name of a participant in binary, which is where XRCE has a reference to QoS, or "" without one."""
    at = 1
    if _flag(data, 0):
        _, at = read_string(data, 1)  # reference to a domain
    return read_string(data, at + 1)[0] if _flag(data, at) else ""


def _topic(data: bytes, parent: bytes) -> TopicEntity:
    name, at = read_string(data, 0)
    if _flag(data, at):
        _, at = read_string(data, at + 1)
    else:
        at += 1
    if not _flag(data, at):
        raise WireError("topic without a type")
    return TopicEntity(name, read_string(data, at + 1)[0], parent)


def _endpoint(kind: int, data: bytes, parent: bytes) -> Endpoint:
    topic = data[:2]
    if not _flag(data, 2):
        return Endpoint(kind, topic, parent, 0)
    if len(data) < 7:
        raise WireError("payload too short")
    depth = None
    if _flag(data, 6):
        if len(data) < 10:
            raise WireError("payload too short")
        depth = int.from_bytes(data[8:10], "little")
    return Endpoint(kind, topic, parent, int.from_bytes(data[4:6], "little"), depth)


def _replier(data: bytes, parent: bytes) -> Replier:
    service, at = read_string(data, 0)
    request_type, at = read_string(data, at)
    reply_type, at = read_string(data, at)
    request_topic, at = _topic_name(data, at)
    reply_topic, at = _topic_name(data, at)
    return Replier(service, request_type, reply_type, request_topic, reply_topic, parent)


def _topic_name(data: bytes, at: int) -> tuple[str, int]:
    """Return the name of a replier's topic, which XRCE allows to be absent, and the offset of its end."""
    if not _flag(data, at):
        raise WireError("replier without topics")
    return read_string(data, at + 1)


def _read_text(data: bytes) -> tuple[str, int]:
    text, end = read_string(data, 4)
    return text.rstrip("\0"), end


def _flag(data: bytes, at: int) -> bool:
    """Whether an optional member follows."""
    if at >= len(data):
        raise WireError("payload too short")
    return data[at] != 0


def _parent(data: bytes, at: int) -> bytes:
    """Return the object id behind a representation, which is not aligned."""
    if len(data) < at + 2:
        raise WireError("payload too short")
    return data[at : at + 2]


def _domain(data: bytes, at: int) -> int:
    """Return the number behind a participant's representation, which is aligned."""
    return int.from_bytes(_parent(data, at + (at & 1)), "little", signed=True)


def _element(text: str, outer: str, inner: str) -> str:
    """Return the text of an XML element, without an XML parser: clients on a network write this text."""
    start = text.find(f"<{inner}>", text.find(f"<{outer}") + 1) + len(inner) + 2
    end = text.find("<", start)
    if f"<{outer}" not in text or start < len(inner) + 2 or not text.startswith(f"</{inner}>", end):
        raise WireError("XML without a name or a type")
    return _unescape(text[start:end])


def _attribute(text: str, tag: str, name: str) -> str:
    """Return the text of an attribute of the first XML element with a tag."""
    _, begun, rest = text.partition(f"<{tag} ")
    _, found, rest = rest.partition(">")[0].partition(f'{name}="')
    value, ended, _ = rest.partition('"')
    if not (begun and found and ended):
        raise WireError("XML without a name or a type")
    return _unescape(value)


def _escape(text: str) -> str:
    """Return text for XML. The standard library's function costs 20 ms of imports."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _unescape(text: str) -> str:
    for name, character in (("lt", "<"), ("gt", ">"), ("quot", '"'), ("apos", "'"), ("amp", "&")):
        text = text.replace(f"&{name};", character)
    return text


def _pack_binary(kind: int, content: bytes, parent: bytes) -> bytes:
    return _HEAD.pack(kind, BY_BINARY, len(content)) + content + parent
