"""A small agent for tests of clients: it creates what is asked for, acknowledges, and keeps what it receives."""

from __future__ import annotations

from collections.abc import Callable

from msggen.link.xrce import entities, wire

EPOCH = 1_700_000_000_000_000
"""The agent's clock minus the client's in us."""


class SmallAgent:
    """One client. `send` takes each answer. Times are the client's, in us."""

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send_to = send
        self.is_away = False
        self.answers_time = True
        self.wrong_time: wire.TimestampReply | None = None
        self.status = wire.OK
        self.refused: frozenset[int] = frozenset()
        """The kinds of the entities that are not created."""
        self.reset()

    def reset(self) -> None:
        self.is_in_session = False
        self.participant = ""
        self.topics: dict[bytes, entities.TopicEntity] = {}
        self.names: dict[bytes, str] = {}
        self.reads: set[bytes] = set()
        self.samples: list[tuple[str, bytes]] = []
        self.replies: list[tuple[int, bytes]] = []
        self.lost = 0
        self._expected = self._next = self._next_best_effort = 0
        self._last_best_effort = -1
        self._waiting: dict[int, bytes] = {}
        self._kept: dict[int, bytes] = {}
        self._fragments = b""

    # out

    def _send(self, stream: int, body: bytes, session: int = wire.PX4_SESSION) -> None:
        sequence = 0
        if stream == wire.RELIABLE:
            sequence, self._next = self._next, self._next + 1 & 0xFFFF
        elif stream:
            sequence, self._next_best_effort = self._next_best_effort, self._next_best_effort + 1 & 0xFFFF
        message = wire.pack_message(session, stream, sequence, body)
        if stream == wire.RELIABLE:
            self._kept[sequence] = message
        self._send_to(message)

    def tick(self) -> None:
        """Ask for acknowledgements that are missing, and for the next message, which PX4 does not repeat by itself."""
        if self.is_in_session:
            self._send(0, wire.AckNack(self._expected, 1).pack())
        if self._kept:
            kept = list(self._kept)
            self._send(0, wire.Heartbeat(kept[0], kept[-1]).pack())

    def publish(self, name: str, sample: bytes) -> None:
        """Send a sample with its encapsulation to the reader of a topic."""
        identity = next(each for each, known in self.names.items() if known == name and each[1] & 15 == 6)
        assert identity in self.reads
        data = sample[4:] + bytes(-len(sample) & 3)
        self._send(wire.BEST_EFFORT, wire.Sample(wire.NO_REQUEST, identity, data).pack(wire.DATA))

    def call(self, number: int, request: bytes) -> None:
        """Send a request with its encapsulation to the only service."""
        identity = next(each for each in self.names if each[1] & 15 == entities.REPLIER)
        assert identity in self.reads
        data = wire.Identity(b"a caller's bytes", number).pack() + request[4:]
        self._send(wire.RELIABLE, wire.Sample(wire.NO_REQUEST, identity, data).pack(wire.DATA))

    # in

    def receive(self, data: bytes, now: int) -> None:
        if self.is_away:
            return
        header = wire.parse_header(data)
        self.now = now
        if header.stream == wire.NO_STREAM:
            self._take(data[4:], header.session_id)
        elif not self.is_in_session:
            return
        elif header.stream == wire.BEST_EFFORT:
            gap = header.sequence - self._last_best_effort - 1 & 0xFFFF
            if gap < 0x8000:
                self.lost += gap
                self._last_best_effort = header.sequence
                self._take(data[4:], header.session_id)
        else:
            if (header.sequence - self._expected & 0xFFFF) < 16:
                self._waiting[header.sequence] = data[4:]
            while self._expected in self._waiting:
                body = self._waiting.pop(self._expected)
                self._expected = self._expected + 1 & 0xFFFF
                self._take(body, header.session_id)
            self._acknowledge()

    def _acknowledge(self, last: int = -1) -> None:
        missing = [n for n in range(16) if (self._expected + n & 0xFFFF) not in self._waiting]
        newest = max([*self._waiting, last], default=-1)
        bits = sum(1 << n for n in missing if self._expected + n <= newest)
        self._send(0, wire.AckNack(self._expected, bits).pack())

    def _take(self, body: bytes, session: int) -> None:  # noqa: C901, PLR0912 - one branch for each submessage
        for kind, flags, payload in wire.submessages(body):
            if kind == wire.GET_INFO:
                info = wire.Info(wire.GetInfo.unpack(payload).request_id, self.is_in_session)
                self._send(0, info.pack(), session)
            elif kind == wire.CREATE_CLIENT:
                self.reset()
                self.key = wire.CreateClient.unpack(payload).key
                self.is_in_session = True
                self._send(0, wire.StatusAgent().pack())
            elif kind == wire.CREATE:
                self._create(wire.Create.unpack(payload, flags))
            elif kind == wire.READ_DATA:
                self.reads.add(wire.ReadData.unpack(payload).object_id)
            elif kind == wire.WRITE_DATA:
                self._write(wire.Sample.unpack(payload, flags))
            elif kind == wire.FRAGMENT:
                self._fragments += payload
                if flags & wire.LAST_FRAGMENT:
                    whole, self._fragments = self._fragments, b""
                    self._take(whole, session)
            elif kind == wire.TIMESTAMP:
                time = (self.now + EPOCH) * 1000
                reply = wire.TimestampReply(time, time, wire.Timestamp.unpack(payload).time)
                if self.answers_time:
                    self._send(0, (self.wrong_time or reply).pack())
            elif kind == wire.ACKNACK:
                acknowledged = wire.AckNack.unpack(payload)
                self._kept = {n: each for n, each in self._kept.items() if n - acknowledged.first & 0xFFFF < 0x8000}
                for number in range(16):
                    again = self._kept.get(acknowledged.first + number & 0xFFFF)
                    if again and acknowledged.missing >> number & 1:
                        self._send_to(again)
            elif kind == wire.HEARTBEAT:
                self._acknowledge(wire.Heartbeat.unpack(payload).last)
            elif kind == wire.DELETE:
                delete = wire.Delete.unpack(payload)
                self.is_in_session = False
                self._send(0, wire.Status(delete.request_id, delete.object_id).pack())

    def _create(self, create: wire.Create) -> None:
        found = entities.parse(create)
        if isinstance(found, entities.Participant):
            self.participant = found.name
        elif isinstance(found, entities.TopicEntity):
            self.topics[create.object_id] = found
        elif isinstance(found, entities.Endpoint):
            assert isinstance(found.topic, bytes)
            self.names[create.object_id] = self.topics[found.topic].name
        elif isinstance(found, entities.Replier):
            self.names[create.object_id] = found.request_topic
        status = wire.ERR_DDS_ERROR if create.object_id[1] & 15 in self.refused else self.status
        self._send(wire.RELIABLE, wire.Status(create.request_id, create.object_id, status).pack())

    def _write(self, sample: wire.Sample) -> None:
        if sample.object_id[1] & 15 == entities.REPLIER:
            self.replies.append((wire.Identity.unpack(sample.data).number, wire.ENCAPSULATION + sample.data[24:]))
        elif sample.object_id in self.names:
            self.samples.append((self.names[sample.object_id], wire.ENCAPSULATION + sample.data))
