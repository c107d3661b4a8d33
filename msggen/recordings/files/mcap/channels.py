"""The schemas and channels that an MCAP file describes, and its problems."""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

from msggen.base.diagnostics import few
from msggen.recordings.files.mcap.checksums import Checks
from msggen.recordings.files.mcap.layouts import ENTRY, FRONT
from msggen.recordings.files.mcap.metadata import IS_LENT, NAMES
from msggen.recordings.files.mcap.records import (
    CHANNEL,
    LAST_OPCODE,
    METADATA,
    SCHEMA,
    Chunk,
    bytes_at,
    entries_of,
    text_at,
)
from msggen.recordings.source.source import SEPARATOR, VERIFIED, Channel, Problem, RawSchema

if TYPE_CHECKING:
    from collections.abc import Mapping

    from msggen.recordings.source.memory import Octets


_LARGEST_METADATA = 1 << 24
_KNOWN = tuple(name.encode() for name in NAMES)
_LONGEST_NAME = max(map(len, _KNOWN))
_NO_HASH = f"RIHS01_{'0' * 64}"


class Described:
    """The schemas and channels that were read so far."""

    def __init__(self, problems: list[Problem], checks: Checks | None = None) -> None:
        self.checks = checks or Checks(VERIFIED)
        self.channels: dict[int, Channel] = {}
        self.lacks_schemas = False
        """Whether a channel came before its schema."""
        self.lacks_channels = False
        """Whether channels are still to be found, without which damaged chunks are not reported."""
        self.attached: list[tuple[int, int, int]] = []
        """The opcodes, the offsets and the lengths of attachments and metadata records."""
        self.metadata: dict[str, list[dict[str, str]]] = {}
        """The contents of the metadata records that are read, by name."""
        self._schemas: dict[int, RawSchema] = {}
        self._definitions: dict[int, str] = {}
        """The schemas in ros2msg as text, which all channels share."""
        self._problems = problems
        self._reported = set(problems)
        self._left_out: dict[int, Mapping[int, int]] = {}
        """The number of messages of each channel in chunks that are left out, by the offsets of the chunks."""

    def report(self, text: str, offset: int | None = None, size: int = 0, samples: int = 0, topic: str = "") -> None:
        """Add a problem of the file, once."""
        self._add(Problem(text, offset, size, samples, topic))

    def report_damaged(self, file: Octets, chunk: Chunk) -> None:
        """Report a chunk that does not match its CRC, once, with its topics and times."""
        if self.lacks_channels or chunk.start in self._left_out:
            return
        counts = {
            number: entries.size // ENTRY
            for number, offset in chunk.indexes.items()
            if (entries := entries_of(file, number, offset)) is not None and number in self.channels
        }
        names = sorted({self.channels[number].topic for number, count in counts.items() if count})
        topics = f", with samples of {few(names)}" if names else ""
        is_lost = self.checks.leaves_out
        self._left_out[chunk.start] = counts if is_lost else {}
        size, samples = (chunk.length, sum(counts.values())) if is_lost else (0, 0)
        effect = "left out" if is_lost else "read all the same"
        span = (chunk.first, chunk.last) if chunk.first <= chunk.last else None
        self._add(
            Problem(
                f"a chunk {self.checks.error_of(chunk)} and is {effect}{topics}", chunk.start, size, samples, span=span
            )
        )

    def count_left_out(self, number: int) -> int:
        """Return how many messages of a channel are in chunks that are left out, as far as they have an index."""
        return sum(counts.get(number, 0) for counts in self._left_out.values())

    def _add(self, problem: Problem) -> None:
        if problem not in self._reported:
            self._reported.add(problem)
            self._problems.append(problem)

    def compare_counts(self, stated: Mapping[int, int], found: Mapping[int, int]) -> None:
        """Report channels with another number of messages than the statistics of the file have."""
        for number in sorted(found.keys() & stated.keys() & self.channels.keys()):
            if stated[number] != found[number]:
                topic = self.channels[number].topic
                text = f"{topic} should have {stated[number]} samples, {found[number]} were found"
                self.report(text, samples=max(stated[number] - found[number], 0), topic=topic)

    def set_counts(self, counts: Mapping[int, int]) -> None:
        """Set how many samples each channel has."""
        for number, channel in self.channels.items():
            self.channels[number] = channel._replace(sample_count=counts.get(number, 0))

    def take_or_report(self, data: memoryview, opcode: int, start: int, length: int) -> None:
        """Take a schema or a channel, or report a record that cannot be read or has an unknown kind."""
        if opcode > LAST_OPCODE:
            self.report(f"a record of the unknown kind {opcode}", start - FRONT, length + FRONT)
        try:
            self.take(data, opcode, start, length)
        except (struct.error, ValueError):
            self.report("a schema or a channel cannot be read", start, length)

    def take(self, data: memoryview, opcode: int, start: int, length: int) -> None:
        """Take a schema or a channel. Raises ValueError, and struct.error."""
        if opcode == SCHEMA:
            self._take_schema(bytes(data[start : start + length]))
        elif opcode == CHANNEL:
            channel = self._channel_of(bytes(data[start : start + length]), length)
            known = self.channels.setdefault(channel.number, channel)
            if known._replace(sample_count=None) != channel:
                text = f"channel {channel.number} is defined twice with different contents; the first is used"
                self.report(text, start, length, topic=channel.topic)

    def take_attached(self, data: memoryview, opcode: int, start: int, length: int) -> None:
        """Take an attachment or a metadata record."""
        self.attached.append((opcode, start, length))
        if opcode == METADATA:
            self.take_metadata(data, start, length)

    def take_metadata(self, data: memoryview, start: int, length: int) -> None:
        """Take a metadata record if it has one of the names that are read."""
        front = bytes(data[start + 4 : start + 4 + _LONGEST_NAME])
        if not front.startswith(_KNOWN):
            return
        if length > _LARGEST_METADATA:
            text = f"a metadata record has more than {_LARGEST_METADATA} bytes, and is not read"
            self.report(text, start - FRONT, length + FRONT)
            return
        record = bytes(data[start : start + length])
        try:
            name, place = text_at(record, 0)
            (size,) = struct.unpack_from("<I", record, place)
            values = _mapping(record, place + 4, place + 4 + size)
        except (struct.error, ValueError):
            self.report("a metadata record cannot be read", start - FRONT, length + FRONT)
            return
        if name in NAMES:
            self.metadata.setdefault(name, []).append(values)

    def _take_schema(self, record: bytes) -> None:
        (number,) = struct.unpack_from("<H", record)
        name, place = text_at(record, 2)
        encoding, place = text_at(record, place)
        data, place = bytes_at(record, place)
        definition = definition_in(name, encoding, data.decode(errors="replace"))
        self._schemas[number] = RawSchema(name, "ros2msg", b"") if definition else RawSchema(name, encoding, data)
        self._definitions[number] = definition

    def _channel_of(self, record: bytes, length: int) -> Channel:
        number, schema = struct.unpack_from("<HH", record)
        topic, place = text_at(record, 4)
        encoding, place = text_at(record, place)
        (size,) = struct.unpack_from("<I", record, place)
        metadata = _mapping(record, place + 4, min(place + 4 + size, length))
        type_hash, qos = metadata.pop("topic_type_hash", ""), metadata.pop("offered_qos_profiles", "")
        is_lent = metadata.pop(IS_LENT, None) is not None
        if schema and schema not in self._schemas:
            self.lacks_schemas = True
        raw = self._schemas.get(schema, RawSchema("", "", b""))
        is_ros = raw.encoding == "ros2msg"
        return Channel(
            number=number,
            topic=topic,
            ros_type=ros_type_of(raw.name),
            definition=self._definitions.get(schema, ""),
            encoding=encoding,
            type_hash=type_hash_in(type_hash),
            qos=qos,
            schema=None if is_ros or not (raw.encoding or raw.data) else raw,
            metadata=tuple(metadata.items()),
            is_lent=is_lent,
        )


def ros_type_of(name: str) -> str:
    """Return `px4_msgs/msg/VehicleStatus` for the names that programs write: `px4_msgs/VehicleStatus`, DDS names."""
    parts = [part for part in name.replace("::", "/").split("/") if part != "dds_"]
    if name.endswith("_") and "dds_" in name:
        parts[-1] = parts[-1].removesuffix("_")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == len(("package", "message")) else "/".join(parts)


def type_hash_in(text: str) -> str:
    """Return a type hash of a recording, "" for zeros: rosbag2 and some middlewares write them for no hash."""
    return "" if text == _NO_HASH else text


def definition_in(ros_type: str, encoding: str, text: str) -> str:
    """Return a definition of a recording, "" if there is none in `ros2msg`.

    That of std_msgs/msg/Empty has no characters. Those of services have a definition in the encoding `unknown`, too.
    """
    if encoding != "ros2msg" and not is_service(text):
        return ""
    return event_definition(ros_type, text) or ("\n" if ros_type.endswith("/Empty") else "")


def _mapping(data: bytes, start: int, stop: int) -> dict[str, str]:
    found = {}
    while start < stop:
        key, start = text_at(data, start)
        found[key], start = text_at(data, start)
    return found


# service events, which `ros2 bag record --services` writes: `/set_mode/_service_event`
#
# Their type, such as `std_srvs/srv/SetBool_Event`, has no file of its own: rosidl derives it from the service. rosbag2
# stores the text of the `.srv` under a head `SRV:`, with the encoding `ros2msg`, or `unknown` if the service nests no
# messages (rosbag2_cpp/message_definitions/local_message_definition_source.cpp).

_HEAD = re.compile(r"=+[ \t\r]*\nSRV:[ \t]*(\S+)[ \t\r]*\n")
_NESTED = re.compile(r"^=+[ \t\r]*\n(?=MSG:)", re.MULTILINE)
_MARK = re.compile(r"^[ \t]*---[ \t\r]*$", re.MULTILINE)

_EVENT = """\
service_msgs/ServiceEventInfo info
{0}_Request[<=1] request
{0}_Response[<=1] response
"""
_INFO = {
    "service_msgs/ServiceEventInfo": """\
uint8 REQUEST_SENT=0
uint8 REQUEST_RECEIVED=1
uint8 RESPONSE_SENT=2
uint8 RESPONSE_RECEIVED=3
uint8 event_type
builtin_interfaces/Time stamp
char[16] client_gid
int64 sequence_number
""",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
}


def is_service(text: str) -> bool:
    """Whether a recorded definition is that of a service."""
    return _HEAD.match(text) is not None


def event_definition(ros_type: str, text: str) -> str:
    """Return the definition of an event in the format `ros2msg`, from that of its service; other texts unchanged."""
    head = _HEAD.match(text)
    name = ros_type.rpartition("/")[2].removesuffix("_Event")
    if head is None or ros_type != f"{head[1]}_Event":
        return text
    own, *others = _NESTED.split(text[head.end() :])
    halves = _MARK.split(own, maxsplit=1)
    package = ros_type.partition("/")[0]
    known = {f"MSG: {key}" for key in _INFO}
    nested = {f"{package}/srv/{name}_{half}": body for half, body in zip(("Request", "Response"), halves, strict=False)}
    nested |= _INFO
    texts = [f"MSG: {key}\n{body.strip()}\n" for key, body in nested.items()]
    texts += [each for each in others if each.partition("\n")[0].strip() not in known]
    return _EVENT.format(name) + "".join(f"{SEPARATOR}\n{each}" for each in texts)
