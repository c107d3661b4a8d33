"""Messages and submessages of DDS-XRCE: layouts, packing and parsing, for both directions.

docs/xrce.md has the tables, with the source of each field. Parsing raises WireError and nothing else.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Final, NamedTuple

# Kinds of submessages
CREATE_CLIENT: Final = 0
CREATE: Final = 1
GET_INFO: Final = 2
DELETE: Final = 3
STATUS_AGENT: Final = 4
STATUS: Final = 5
INFO: Final = 6
WRITE_DATA: Final = 7
READ_DATA: Final = 8
DATA: Final = 9
ACKNACK: Final = 10
HEARTBEAT: Final = 11
RESET: Final = 12
FRAGMENT: Final = 13
TIMESTAMP: Final = 14
TIMESTAMP_REPLY: Final = 15

# Flags of a submessage
LITTLE_ENDIAN: Final = 0x01
REUSE: Final = 0x02
REPLACE: Final = 0x04
LAST_FRAGMENT: Final = 0x02
FORMAT: Final = 0x0E
"""The bits of WRITE_DATA and DATA that tell the format. 0 is plain data, the only one that PX4 and this module use."""

# Streams
NO_STREAM: Final = 0x00
BEST_EFFORT: Final = 0x01
RELIABLE: Final = 0x80

# Status values
OK: Final = 0x00
ERR_DDS_ERROR: Final = 0x80
ERR_ALREADY_EXISTS: Final = 0x82
ERR_UNKNOWN_REFERENCE: Final = 0x84
ERR_INVALID_DATA: Final = 0x85
ERR_RESOURCES: Final = 0x87

NO_SESSION: Final = 0x80
"""The session id of a message outside of a session: ping and CREATE_CLIENT."""
NO_SESSION_WITH_KEY: Final = 0x00
"""The same, with the client's key in the header."""
PX4_SESSION: Final = 0x81
"""The session id of every PX4 client."""
MTU: Final = 508
"""The length of the longest message of PX4's client, with its header."""

AGENT_ID: Final = b"\xff\xfd"
CLIENT_ID: Final = b"\xff\xfe"
NO_REQUEST: Final = b"\x00\x00"

ENCAPSULATION: Final = b"\x00\x01\x00\x00"
"""The header of a little-endian CDR payload, which samples lack on the wire."""

_PROTOCOL = b"XRCE\x01\x00\x01\x0f"  # cookie, version 1.0, vendor eProsima
_COOKIE = _PROTOCOL[:4]

HEADER = struct.Struct("<BBH")
SUBMESSAGE = struct.Struct("<BBH")
_CREATE_CLIENT = struct.Struct(">8sIBB")
_ACKNACK = struct.Struct("<HBBB")
_HEARTBEAT = struct.Struct("<HHB")
_TIME = struct.Struct("<iI")
_READ_CONTROL = struct.Struct("<HHHH")
_SEQUENCE = struct.Struct("<iI")
_U16 = struct.Struct("<H")
_U32 = struct.Struct("<I")


class WireError(ValueError):
    """Malformed bytes. The text is one of a fixed set, so that errors can be counted by text."""


class Header(NamedTuple):
    """The header of a message."""

    session_id: int
    stream: int
    sequence: int
    key: bytes
    """Four bytes if `session_id` is below 0x80, otherwise none."""


class Submessage(NamedTuple):
    """A submessage; `payload` without padding."""

    id: int
    flags: int
    payload: bytes


def parse_header(data: bytes) -> Header:
    """Return the header of a message, which takes 4 bytes, and its key, if it has one, 4 more."""
    if len(data) < 4:
        raise WireError("message shorter than its header")
    session_id, stream, sequence = HEADER.unpack_from(data)
    if session_id >= 0x80:
        return Header(session_id, stream, sequence, b"")
    if len(data) < 8:
        raise WireError("message shorter than its header")
    return Header(session_id, stream, sequence, data[4:8])


def has_data(message: bytes) -> bool:
    """Whether a message of an agent has samples or requests, and not only what keeps the session."""
    try:
        return any(each.id == DATA for each in submessages(message[HEADER.size + len(parse_header(message).key) :]))
    except WireError:
        return False


def submessages(body: bytes) -> Iterator[Submessage]:
    """Yield the submessages of a message without its header.

    Up to 3 bytes at the end are padding. Raises WireError for a big-endian submessage: PX4 sends none.
    """
    at, end = 0, len(body)
    while end - at >= 4:
        kind, flags, length = SUBMESSAGE.unpack_from(body, at)
        at += 4
        if at + length > end:
            raise WireError("submessage longer than its message")
        if not flags & LITTLE_ENDIAN:
            raise WireError("big-endian submessage")
        yield Submessage(kind, flags, body[at : at + length])
        at += length + (-length & 3)


def pack_message(session_id: int, stream: int, sequence: int, *parts: bytes, key: bytes = b"") -> bytes:
    """Return a message of packed submessages, padded between them and not after the last one.

    `key` is given if `session_id` is below 0x80.
    """
    head = HEADER.pack(session_id, stream, sequence) + key
    if len(parts) == 1:
        return head + parts[0]
    return head + b"".join(part + bytes(-len(part) & 3) for part in parts[:-1]) + b"".join(parts[-1:])


def pack_submessage(kind: int, payload: bytes, flags: int = LITTLE_ENDIAN) -> bytes:
    """Return a submessage without padding."""
    return SUBMESSAGE.pack(kind, flags, len(payload)) + payload


def key_bytes(key: int) -> bytes:
    """Return a client's key as it is on the wire: 4 bytes, big-endian."""
    return key.to_bytes(4, "big")


class CreateClient(NamedTuple):
    """CREATE_CLIENT: a client asks for a session."""

    key: int
    session_id: int = PX4_SESSION
    mtu: int = MTU

    def pack(self) -> bytes:
        """Return the submessage."""
        payload = _CREATE_CLIENT.pack(_PROTOCOL, self.key, self.session_id, 0) + _U16.pack(self.mtu)
        return pack_submessage(CREATE_CLIENT, payload)

    @classmethod
    def unpack(cls, payload: bytes) -> CreateClient:
        """Return the fields of a payload. Properties are skipped."""
        _need(payload, 16)
        if payload[:4] != _COOKIE:
            raise WireError("wrong cookie")
        if payload[4] != _PROTOCOL[4]:
            raise WireError("unknown version of the protocol")
        _, key, session_id, properties = _CREATE_CLIENT.unpack_from(payload)
        at = 14
        if properties:
            count, at = read_u32(payload, at)
            most = min(count, len(payload))  # a string takes 5 bytes or more, so a false count ends in an error
            for _ in range(2 * most):  # a name and a value for each
                _, at = read_string(payload, at)
            at += at & 1
        _need(payload, at + 2)
        return cls(key, session_id, _U16.unpack_from(payload, at)[0])


class StatusAgent(NamedTuple):
    """STATUS_AGENT: the answer to CREATE_CLIENT."""

    status: int = OK

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(STATUS_AGENT, bytes((self.status, 0)) + _PROTOCOL + b"\0")

    @classmethod
    def unpack(cls, payload: bytes) -> StatusAgent:
        """Return the fields of a payload."""
        _need(payload, 6)
        if payload[2:6] != _COOKIE:
            raise WireError("wrong cookie")
        return cls(payload[0])


class Create(NamedTuple):
    """CREATE: a client asks for an entity. `entities` reads and writes its representation."""

    request_id: bytes
    object_id: bytes
    representation: bytes
    """From the kind of the entity to the end of the payload."""
    flags: int = LITTLE_ENDIAN | REPLACE

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(CREATE, self.request_id + self.object_id + self.representation, self.flags)

    @classmethod
    def unpack(cls, payload: bytes, flags: int) -> Create:
        """Return the fields of a payload."""
        _need(payload, 6)
        return cls(payload[:2], payload[2:4], payload[4:], flags)


class GetInfo(NamedTuple):
    """GET_INFO: a ping."""

    request_id: bytes
    object_id: bytes = AGENT_ID
    mask: int = 2
    """1 asks for the configuration, 2 for the activity."""

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(GET_INFO, self.request_id + self.object_id + _U32.pack(self.mask))

    @classmethod
    def unpack(cls, payload: bytes) -> GetInfo:
        """Return the fields of a payload."""
        _need(payload, 8)
        return cls(payload[:2], payload[2:4], _U32.unpack_from(payload, 4)[0])


class Info(NamedTuple):
    """INFO: the answer to GET_INFO."""

    request_id: bytes
    known: bool
    """Whether the agent has a session for the address of the sender. PX4 ends a session after four answers without."""
    object_id: bytes = AGENT_ID
    available: bool = True

    def pack(self) -> bytes:
        """Return the submessage."""
        head = self.request_id + self.object_id + bytes((OK, self.known))
        config = b"\x01\x0d" + _PROTOCOL + b"\x00"
        activity = b"\x01\x0d\x00" + bytes((self.available, 0)) + bytes(6)
        return pack_submessage(INFO, head + config + activity)

    @classmethod
    def unpack(cls, payload: bytes) -> Info:
        """Return the fields of a payload. Raises WireError if it lacks the configuration or the activity."""
        _need(payload, 22)
        if payload[6] != 1 or payload[17] != 1:
            raise WireError("INFO without configuration or activity")
        return cls(payload[:2], payload[5] == 1, payload[2:4], payload[20] > 0)


def answer_info(payload: bytes, *, known: bool) -> bytes:
    """Return the INFO submessage for the payload of a GET_INFO."""
    asked = GetInfo.unpack(payload)
    if asked.object_id != AGENT_ID:
        raise WireError("GET_INFO of something else than the agent")
    return Info(asked.request_id, known).pack()


class Delete(NamedTuple):
    """DELETE: a client removes an entity, or with CLIENT_ID itself."""

    request_id: bytes
    object_id: bytes = CLIENT_ID

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(DELETE, self.request_id + self.object_id)

    @classmethod
    def unpack(cls, payload: bytes) -> Delete:
        """Return the fields of a payload."""
        _need(payload, 4)
        return cls(payload[:2], payload[2:4])


class Status(NamedTuple):
    """STATUS: the answer to CREATE, to DELETE and to a READ_DATA that fails."""

    request_id: bytes
    object_id: bytes
    status: int = OK

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(STATUS, self.request_id + self.object_id + bytes((self.status, 0)))

    @classmethod
    def unpack(cls, payload: bytes) -> Status:
        """Return the fields of a payload."""
        _need(payload, 6)
        return cls(payload[:2], payload[2:4], payload[4])


class ReadData(NamedTuple):
    """READ_DATA: a client asks for the samples of a reader, without an end."""

    request_id: bytes
    object_id: bytes
    stream: int = BEST_EFFORT

    def pack(self) -> bytes:
        """Return the submessage, with the delivery control that PX4 sends: no limits."""
        control = bytes((self.stream, 0, 0, 1)) + _READ_CONTROL.pack(0xFFFF, 0, 0, 0)
        return pack_submessage(READ_DATA, self.request_id + self.object_id + control)

    @classmethod
    def unpack(cls, payload: bytes) -> ReadData:
        """Return the fields of a payload. The delivery control is not applied."""
        _need(payload, 6)
        if payload[5]:
            raise WireError("READ_DATA of another format than plain data")
        return cls(payload[:2], payload[2:4], payload[4])


class Sample(NamedTuple):
    """WRITE_DATA and DATA: a sample, to the agent and to the client. `data` is CDR without encapsulation."""

    request_id: bytes
    object_id: bytes
    data: bytes

    def pack(self, kind: int) -> bytes:
        """Return the submessage. `kind` is WRITE_DATA or DATA."""
        return pack_submessage(kind, self.request_id + self.object_id + self.data)

    @classmethod
    def unpack(cls, payload: bytes, flags: int) -> Sample:
        """Return the fields of a payload."""
        _need(payload, 4)
        if flags & FORMAT:
            raise WireError("data of another format than plain data")
        return cls(payload[:2], payload[2:4], payload[4:])


class AckNack(NamedTuple):
    """ACKNACK: the state of the receiver of a reliable stream."""

    first: int
    """The sequence number of the first message that was not received."""
    missing: int
    """16 bits: bit i is set if message `first` + i is known to be missing."""
    stream: int = RELIABLE

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(ACKNACK, _ACKNACK.pack(self.first, self.missing >> 8, self.missing & 0xFF, self.stream))

    @classmethod
    def unpack(cls, payload: bytes) -> AckNack:
        """Return the fields of a payload."""
        _need(payload, 5)
        first, high, low, stream = _ACKNACK.unpack_from(payload)
        return cls(first, high << 8 | low, stream)


class Heartbeat(NamedTuple):
    """HEARTBEAT: the messages that the sender of a reliable stream still keeps."""

    first: int
    last: int
    stream: int = RELIABLE

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(HEARTBEAT, _HEARTBEAT.pack(*self))

    @classmethod
    def unpack(cls, payload: bytes) -> Heartbeat:
        """Return the fields of a payload."""
        _need(payload, 5)
        return cls(*_HEARTBEAT.unpack_from(payload))


class Timestamp(NamedTuple):
    """TIMESTAMP: a client asks for the time. In ns, of the client's clock."""

    time: int

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(TIMESTAMP, _pack_time(self.time))

    @classmethod
    def unpack(cls, payload: bytes) -> Timestamp:
        """Return the fields of a payload."""
        _need(payload, 8)
        return cls(_unpack_time(payload, 0))


class TimestampReply(NamedTuple):
    """TIMESTAMP_REPLY: the answer to TIMESTAMP. In ns."""

    transmitted: int
    """The agent's time of sending. PX4 uses it as the time of receiving, too."""
    received: int
    originated: int
    """The client's time, as it sent it."""

    def pack(self) -> bytes:
        """Return the submessage."""
        return pack_submessage(TIMESTAMP_REPLY, b"".join(map(_pack_time, self)))

    @classmethod
    def unpack(cls, payload: bytes) -> TimestampReply:
        """Return the fields of a payload."""
        _need(payload, 24)
        return cls(_unpack_time(payload, 0), _unpack_time(payload, 8), _unpack_time(payload, 16))


def answer_timestamp(payload: bytes, time: int) -> bytes:
    """Return the TIMESTAMP_REPLY submessage for the payload of a TIMESTAMP, which is echoed as it is. `time` in ns."""
    _need(payload, 8)
    stamp = _pack_time(time)
    return pack_submessage(TIMESTAMP_REPLY, stamp + stamp + payload[:8])


class Identity(NamedTuple):
    """The 24 bytes in front of a request or a reply, which tell the caller and its request."""

    writer: bytes
    """GUID prefix and entity id: 16 bytes."""
    number: int
    """The number of the request, 64 bits."""

    def pack(self) -> bytes:
        """Return the 24 bytes."""
        high, low = divmod(self.number, 1 << 32)
        return self.writer + _SEQUENCE.pack(high, low)

    @classmethod
    def unpack(cls, data: bytes) -> Identity:
        """Return the fields of the first 24 bytes."""
        _need(data, 24)
        high, low = _SEQUENCE.unpack_from(data, 16)
        return cls(data[:16], high << 32 | low)


def read_u32(data: bytes, at: int) -> tuple[int, int]:
    """Return the number at an offset, after alignment, and the offset of its end."""
    at += -at & 3
    if at + 4 > len(data):
        raise WireError("payload too short")
    return _U32.unpack_from(data, at)[0], at + 4


def read_string(data: bytes, at: int) -> tuple[str, int]:
    """Return the CDR string at an offset, after alignment, and the offset of its end."""
    size, at = read_u32(data, at)
    end = at + size
    if not size or end > len(data):
        raise WireError("string longer than its payload")
    try:
        return data[at : end - 1].decode(), end
    except UnicodeDecodeError:
        raise WireError("string that is not UTF-8") from None


def pack_string(text: str) -> bytes:
    """Return a CDR string, which starts at a multiple of 4."""
    data = text.encode() + b"\0"
    return _U32.pack(len(data)) + data


def _need(payload: bytes, size: int) -> None:
    if len(payload) < size:
        raise WireError("payload too short")


def _pack_time(time: int) -> bytes:
    """Return seconds and nanoseconds. The seconds wrap in 2038."""
    seconds, nanoseconds = divmod(time, 1_000_000_000)
    return _TIME.pack(((seconds + 0x80000000) & 0xFFFFFFFF) - 0x80000000, nanoseconds)


def _unpack_time(payload: bytes, at: int) -> int:
    seconds, nanoseconds = _TIME.unpack_from(payload, at)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)
