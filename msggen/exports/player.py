"""A recording that is played by a client of DDS-XRCE, as if the vehicle published it again.

It has no input or output and no clock, as `sim/vehicle.py`: a `Runner` gives it times and datagrams.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from typing import NamedTuple

from msggen.base.qos import DEPTH
from msggen.link.xrce import client as xrce
from msggen.link.xrce.client_entities import Reader, Settings, Sync, Writer
from msggen.link.xrce.client_events import Connected, Disconnected, Received
from msggen.link.xrce.limits import Limits
from msggen.link.xrce.wire import ENCAPSULATION
from msggen.messages.firmware import REQUEST, RESPONSE, Known, answer_of, releases
from msggen.messages.names import stem_of, without_namespace
from msggen.recordings.decode.schemas import hash_of
from msggen.recordings.log.log import Log
from msggen.recordings.log.payloads import Sample
from msggen.recordings.topics.choice import Choice
from msggen.recordings.topics.topic import Topic

_OUT = re.compile(r"(?:/([A-Za-z0-9_/]+))?/fmu/out/[A-Za-z0-9_/]+")
_TYPE = re.compile(r"[A-Za-z0-9_]+(/[A-Za-z0-9_]+){2}")
"""A type in ROS 2: `px4_msgs/msg/VehicleStatus`."""
_LONGEST = Limits().text - len("::::dds__")
"""The most characters of a name or a type. DDS adds some."""
_FIRST_NUMBER = 3000
"""The first number of the topics that no release has: the releases have numbers below 2100."""
_MOST = (Limits().entities - 1) // 3
"""The most topics of a vehicle that msggen's agent takes: each has 3 entities, beside the participant."""
_NEVER = 1 << 62
_HEADER = len(ENCAPSULATION)


class Endpoints(NamedTuple):
    """The topics of the vehicle that a recording shows."""

    release: str
    """The embedded release that most of its definitions are of."""
    namespace: str
    writers: Mapping[str, Writer]
    """The topics to play, by their names in the log."""
    readers: Mapping[int, str]
    """The topics that the vehicle reads: their names by number."""
    hashes: Mapping[str, int]
    """The `message_hash` of uORB topics, as far as it is known."""
    settings: Settings
    left_out: Sequence[str] = ()
    """The topics that would be played if a vehicle could have more."""


def is_played(topic: Topic) -> bool:
    """Whether a vehicle publishes a topic, and a player does: answers to questions of long ago are not played.

    Of several definitions of a topic, the first one is played.
    """
    name = topic.recorded_name
    if not topic.is_cdr or topic.name not in (name, f"{name}#1") or max(len(name), len(topic.ros_type)) > _LONGEST:
        return False
    is_ours = _OUT.fullmatch(name) is not None and _TYPE.fullmatch(topic.ros_type) is not None
    return is_ours and not stem_of(name).endswith(RESPONSE)


def endpoints_of(log: Log, choice: Choice, key: int = 1, sync: Sync = "short") -> Endpoints:
    """Return the endpoints of a recording, of those of its topics that `choice` takes."""
    played = [topic for topic in log.topics if is_played(topic)]
    found = _OUT.fullmatch(played[0].recorded_name) if played else None
    namespace = (found and found[1]) or ""
    hashes = {topic.recorded_name: hash_of(topic.ros_type, topic.recorded_definition) for topic in played}
    known = {without_namespace(name, namespace): value for name, value in hashes.items()}
    release = max(releases(), key=lambda each: _likeness(known, releases()[each]))
    rows = releases()[release]
    front = f"/{namespace}" if namespace else ""
    others = [Writer(rows[RESPONSE].object_id, f"rt{front}{RESPONSE}", _px4_type(rows[RESPONSE]))] * (RESPONSE in rows)
    readers = {row.object_id: name for name, row in rows.items() if "/fmu/in/" in name}
    wanted = [topic for topic in played if choice.takes(topic.recorded_name, topic.ros_type)]
    wanted.sort(key=lambda topic: without_namespace(topic.recorded_name, namespace) not in rows)
    most = _MOST - len(readers) - len(others)
    free = count(_FIRST_NUMBER)
    writers = {}
    for topic in wanted[:most]:
        row = rows.get(without_namespace(topic.recorded_name, namespace))
        number = next(free) if row is None else row.object_id
        writers[topic.name] = Writer(number, f"rt{topic.recorded_name}", _dds_type(topic.ros_type))
    settings = Settings(
        [Reader(number, f"rt{front}{name}", _px4_type(rows[name]), DEPTH) for number, name in readers.items()],
        [*writers.values(), *others],
        key=key,
        namespace=namespace,
        sync=sync,
        silence=_NEVER,
    )
    left_out = [topic.name for topic in wanted[most:]]
    return Endpoints(release, namespace, writers, readers, _uorb_hashes(known, rows), settings, left_out)


def _likeness(hashes: Mapping[str, int | None], rows: Mapping[str, Known]) -> int:
    """Return how many topics of a release have these names and hashes."""
    return sum(name in rows and value in (None, rows[name].message_hash) for name, value in hashes.items())


def _uorb_hashes(hashes: Mapping[str, int | None], rows: Mapping[str, Known]) -> dict[str, int]:
    """Return the hashes by uORB topic: those of the recording, and if all are of the release, its others too."""
    found = {}
    if all(name in rows and rows[name].message_hash == value for name, value in hashes.items()):
        found = {row.uorb_topic: row.message_hash for row in rows.values()}
    for name, value in hashes.items():
        if value is not None:
            found[rows[name].uorb_topic if name in rows else stem_of(name).rpartition("/")[2]] = value
    return found


def _dds_type(ros_type: str) -> str:
    package, folder, name = ros_type.split("/")
    return f"{package}::{folder}::dds_::{name}_"


def _px4_type(row: Known) -> str:
    return _dds_type(f"px4_msgs/msg/{row.message}")


class Player:
    """Plays a recording to one agent, by log time.

    `rate` is the speed, `start` the time in s after the start of the recording. With `is_repeated`, it begins again at
    the end. Samples are never skipped: while the client waits for an answer of the agent, they wait too.
    """

    def __init__(
        self,
        log: Log,
        endpoints: Endpoints,
        *,
        rate: float = 1.0,
        start: float = 0.0,
        is_repeated: bool = False,
    ) -> None:
        self._log, self._endpoints, self._rate = log, endpoints, rate
        self._start, self._is_repeated = log.start + round(start * 1e9), is_repeated
        self._numbers = {name: writer.number for name, writer in endpoints.writers.items()}
        self._request = next((number for number, name in endpoints.readers.items() if name == REQUEST), None)
        self._client = xrce.Client(endpoints.settings)
        self._samples = self._read()
        self._next = next(self._samples, None)
        self._zero: int | None = None
        """The time of the client at which the sample at `_start` is due, None if the session has not begun."""
        self._position = self._start
        self.sent = 0
        """The number of samples that were sent."""
        self.received = 0
        """The number of samples that the vehicle was sent."""
        self.is_answered = False
        """Whether an agent ever answered."""
        self.changes: deque[str] = deque()
        """What happened and was not yet taken, for people to read."""

    # what the runner calls

    @property
    def is_done(self) -> bool:
        """Whether all samples were sent."""
        return self._next is None

    @property
    def is_closed(self) -> bool:
        """Whether the session has ended after `close`."""
        return self._client.is_closed

    @property
    def next_time(self) -> int:
        """The time in us at which `advance` is to be called next."""
        if self._next is None or self._zero is None or not self._client.is_ready:
            return self._client.next_time
        return min(self._due(self._next), self._client.next_time)

    def advance(self, now: int) -> None:
        """Send what is due."""
        self._client.advance(now)
        self._handle(now)
        while self._next is not None and self._zero is not None and self._due(self._next) <= now:
            if not self._client.write(self._numbers[self._next.topic], self._next.payload[_HEADER:]):
                return
            self.sent += 1
            self._position = max(self._next.time, self._start)
            self._next = next(self._samples, None)
            if self._next is None and self._is_repeated:
                self._repeat(now)
                return

    def receive(self, data: bytes, now: int) -> None:
        """Take a datagram of the newest connection, or the message of a frame. Never raises."""
        self._client.receive(data, now)
        self._handle(now)

    def refuse(self) -> None:
        """Tell that a datagram was refused, as on a host where no agent listens."""
        self._client.refuse()

    def take_outgoing(self) -> list[tuple[bytes, int]]:
        """Return the datagrams to send, each with the number of its connection."""
        return self._client.take_outgoing()

    def close(self, now: int) -> None:
        """End the session."""
        self._client.close(now)

    # samples

    def _read(self) -> Iterator[Sample]:
        seconds = (self._start - self._log.start) / 1e9
        return self._log.payloads(self._numbers, start=seconds or None)  # some samples are older than the start

    def _due(self, sample: Sample) -> int:
        assert self._zero is not None  # noqa: S101 - the callers check it
        return self._zero + round((sample.time - self._start) / 1000 / self._rate)

    def _repeat(self, now: int) -> None:
        self._samples = self._read()
        self._next = next(self._samples, None)
        self._zero = now

    def _handle(self, now: int) -> None:
        for event in self._client.take_events():
            if isinstance(event, Connected):
                self.is_answered = True
                self.changes.append("connected")
                self._zero = now - round((self._position - self._start) / 1000 / self._rate)
            elif isinstance(event, Disconnected):
                self.changes.append(f"disconnected: {event.reason}")
                self._zero = None
            elif isinstance(event, Received):
                self.received += 1
                if event.number == self._request:
                    self._answer(event.data, now)

    def _answer(self, request: bytes, now: int) -> None:
        """Answer a request for a definition, as PX4 does."""
        answer = answer_of(ENCAPSULATION + request, now + self._client.offset, self._endpoints.hashes.get)
        row = releases()[self._endpoints.release].get(RESPONSE)
        if answer is not None and row is not None:
            self._client.write(row.object_id, answer[_HEADER:])
