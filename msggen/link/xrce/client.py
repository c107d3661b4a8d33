"""The client side of a session, as PX4's client behaves: docs/xrce.md.

No input, output, clock or thread. Times are in us since the start of the client, which is the clock that it tells its
agent. A transport gives datagrams and times, and takes datagrams and events:

    client.advance(now)
    for data, connection in client.take_outgoing():
        sockets[connection].send(data)
    client.receive(sock.recv(4096), now)

PX4's client is one loop, which waits at many places. Here this loop is a generator, which yields the time until which
it waits, and continues at that time or after a datagram.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator
from typing import Final, TypeAlias

from msggen.link.xrce import wire
from msggen.link.xrce.client_entities import (
    Creation,
    Settings,
    create_participant,
    create_reader,
    create_server,
    create_writer,
)
from msggen.link.xrce.client_events import Connected, Disconnected, Event, Exchange, Received, Requested
from msggen.link.xrce.client_inbox import LOOP, Inbox
from msggen.link.xrce.client_liveness import Liveness, is_known
from msggen.link.xrce.client_streams import ClientStreams
from msggen.link.xrce.client_times import OffsetFilter, Question
from msggen.link.xrce.entities import READER, REPLIER, WRITER, object_id, object_number

_Steps: TypeAlias = "Generator[int, None, None]"
_Outcome: TypeAlias = "Generator[int, None, bool]"

_SECOND: Final = 1_000_000
_PING_ID: Final = b"\x00\x0a"
_DELETE_ID: Final = b"\x00\x02"
_ATTEMPTS: Final = 10
"""How often CREATE_CLIENT is sent, and how many TIMESTAMPs in a row may stay without an answer."""
_EXCHANGES: Final = {"px4": 500, "short": 20, "off": 0}
_SYNC_PAUSE: Final = {"px4": 10_000, "short": 100, "off": 0}
_SYNC_WAIT: Final = 10_000
_STATUSES: Final = 16
"""The number of STATUS that are kept. PX4's client waits for three at a time."""
_CREATION_WAIT: Final = 1_008_000
"""The time between two CREATE_CLIENTs."""
_PERIOD: Final = _SECOND + 1
"""More than 1 s: the time between two TIMESTAMPs."""


class Client:
    """A client. It begins to look for its agent at the first call of `advance`."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.is_connected = False
        """Whether all entities exist and samples flow."""
        self.is_closed = False
        """Whether the client has ended after `close`."""
        self.exchange = Exchange(0, 0, 0)
        """The last exchange of times."""
        self.refused: Counter[str] = Counter()
        """Datagrams that were refused, by reason."""
        self.connections = 0
        """The number of the newest connection."""
        self._now = 0
        self._until = 0
        self._outgoing: list[tuple[bytes, int]] = []  # of earlier connections
        self._events: list[Event] = []
        self._readers = {object_id(each.number, READER) for each in settings.readers}
        self._servers = {object_id(each.number, REPLIER) for each in settings.servers}
        self._is_waiting = self._is_paused = False
        self._has_received = False
        self._loop = LOOP
        self._steps = self._live()
        self._reset()

    def _reset(self) -> None:
        """Forget a session."""
        self.clock = OffsetFilter(_EXCHANGES[self.settings.sync])
        self._streams = ClientStreams(self.refused)
        self._inbox = Inbox()
        self._is_refused = False
        self._liveness = Liveness(self._now, has_received=self._has_received)
        self._knows: bool | None = None  # whether the agent knows the session: its last INFO
        self._agent: wire.StatusAgent | None = None
        self._question = Question()
        self._statuses: dict[bytes, int] = {}
        self._last_write = self._sync_time = self._now

    # What the transport calls

    @property
    def is_ready(self) -> bool:
        """Whether `write` sends. PX4's client sends nothing while it waits for a ping or a time."""
        return self.is_connected and not self._is_waiting

    @property
    def offset(self) -> int:
        """The agent's clock minus the client's in us, 0 if it is not known."""
        return self.clock.offset

    @property
    def next_time(self) -> int:
        """The time at which `advance` is to be called next."""
        until, heartbeat_time = self._until, self._streams.heartbeat_time
        if self._inbox and not self._is_paused:
            until = min(until, self._inbox.loop_end)
        return until if heartbeat_time is None else min(until, heartbeat_time)

    def take_outgoing(self) -> list[tuple[bytes, int]]:
        """Return the datagrams to send, each with the number of its connection.

        A new number means a new socket: the earlier ones are closed after their datagrams were sent.
        """
        self._collect_outgoing()
        taken, self._outgoing = self._outgoing, []
        return taken

    def take_events(self) -> list[Event]:
        """Return the events since the last call."""
        taken, self._events = self._events, []
        return taken

    def advance(self, now: int) -> None:
        """Do what is due."""
        self._now = max(now, self._now)
        self._streams.advance(self._now)
        if self._now >= self._until:
            self._continue()
        self._read()

    def receive(self, data: bytes, now: int) -> None:
        """Take a datagram, or the message of a frame. Never raises. A loop of the client reads up to ten of them."""
        self._now = max(now, self._now)
        if not self._inbox.add(data):
            self.refused["datagram beyond the buffer"] += 1
        self._read()

    def refuse(self) -> None:
        """Tell that a datagram was refused: nobody listens on the port of the agent."""
        self._is_refused = True

    def write(self, number: int, data: bytes) -> bool:
        """Send a sample, CDR without encapsulation, together with the others before the next call of `advance`.

        Return whether the client is ready.
        """
        if not self.is_ready:
            return False
        self._streams.write(object_id(number, WRITER), data)
        self._last_write = self._now
        self._liveness.written += len(data)
        return True

    def reply(self, number: int, identity: bytes, data: bytes) -> None:
        """Answer a request to a service, CDR without encapsulation."""
        if self.is_connected:
            sample = wire.Sample(self._streams.next_request(), object_id(number, REPLIER), identity + data)
            self._streams.collect(sample.pack(wire.WRITE_DATA))
            self._streams.flush(self._now)

    def close(self, now: int) -> None:
        """End the session. The client is closed when the agent has answered, or after 1 s."""
        self._now = max(now, self._now)
        if self.is_closed:
            return
        self.is_connected = self._is_paused = False
        self._steps = self._end()
        self._continue()

    # The loop of PX4's client

    def _continue(self) -> None:
        self._until = next(self._steps)

    def _live(self) -> _Steps:
        while True:
            yield from self._find_agent()
            reason = "the agent did not create a session"
            if (yield from self._open_session()):
                self._streams.is_open = True
                reason = yield from self._set_up()
                if not reason:
                    reason = yield from self._serve()
                self._streams.send(wire.Delete(_DELETE_ID).pack())
            was_connected, self.is_connected = self.is_connected, False
            self._events.append(Disconnected(reason))
            if not was_connected:
                yield from self._pause(_SECOND)
            self._collect_outgoing()
            self._reset()
            self.connections += 1

    def _end(self) -> _Steps:
        if self._streams.is_open:
            self._statuses.pop(_DELETE_ID, None)
            self._streams.send(wire.Delete(_DELETE_ID).pack())
            yield from self._wait(lambda: _DELETE_ID in self._statuses, _SECOND)
        self._collect_outgoing()
        self._reset()
        self.is_closed = True
        while True:
            yield self._now + 3600 * _SECOND

    def _wait(self, is_done: Callable[[], bool], time: int) -> _Outcome:
        """Wait until something is done. Return False if it is not in time."""
        end = self._now + time
        self._is_waiting = True
        self._streams.wait(self._now)
        while not is_done() and self._now < end:
            yield end
        self._is_waiting = False
        self._streams.wait(None)
        return is_done()

    def _pause(self, time: int) -> _Steps:
        """Let time pass, in which nothing is read."""
        end = self._now + time
        self._is_paused = True
        while self._now < end:
            yield end
        self._is_paused = False

    def _find_agent(self) -> _Steps:
        """Ask for an agent every second, or every other second if the question is refused."""
        while True:
            self._knows, self._is_refused = None, False
            self._streams.send(wire.GetInfo(_PING_ID).pack(), wire.NO_SESSION)
            if (yield from self._wait(lambda: self._knows is not None, _SECOND)):
                return
            if self._is_refused:
                yield from self._pause(_SECOND)

    def _open_session(self) -> _Outcome:
        create = wire.CreateClient(self.settings.key)
        for _ in range(_ATTEMPTS):
            self._streams.send(create.pack(), wire.NO_SESSION)
            if (yield from self._wait(lambda: self._agent is not None, _CREATION_WAIT)):
                return self._agent is not None and self._agent.status == wire.OK
        return False

    def _set_up(self) -> Generator[int, None, str]:
        """Synchronise the clocks and create all entities. Return why that failed, or ""."""
        if not (yield from self._create(create_participant(self.settings))):
            return "the agent refused the participant"
        if not (yield from self._synchronise()):
            return "the agent did not answer TIMESTAMP"
        for reader in self.settings.readers:
            if (yield from self._create(*create_reader(reader))):
                identity = object_id(reader.number, READER)
                self._streams.collect(wire.ReadData(self._streams.next_request(), identity).pack())
        for writer in self.settings.writers:
            if not (yield from self._create(*create_writer(writer))):
                return f"the agent refused the writer of {writer.name}"
        for server in self.settings.servers:
            identity = object_id(server.number, REPLIER)
            if (yield from self._create(create_server(server))):
                self._streams.collect(wire.ReadData(self._streams.next_request(), identity, wire.RELIABLE).pack())
        return ""

    def _create(self, *entities: Creation) -> _Outcome:
        """Create entities, each an object id and a representation. Return whether the agent made all of them in 1 s."""
        self._statuses.clear()
        requests = []
        for identity, representation in entities:
            requests.append(self._streams.next_request())
            self._streams.collect(wire.Create(requests[-1], identity, representation).pack())
        self._streams.flush(self._now)
        wanted = frozenset(requests)
        yield from self._wait(lambda: wanted <= self._statuses.keys(), _SECOND)
        return all(self._statuses.get(request) == wire.OK for request in requests)

    def _serve(self) -> Generator[int, None, str]:
        """Keep the session alive. Return why it ended.

        Samples are written at the start of each loop, and leave before the questions of the loop.
        """
        self._last_write = self._sync_time = self._now
        self._liveness = Liveness(self._now, has_received=self._has_received)
        self.is_connected = True
        self._events.append(Connected())
        silence = self.settings.silence
        next_time = self._now
        while True:
            yield next_time
            self._streams.flush(self._now)
            if self._now - self._last_write >= silence:
                return f"no sample was sent for {silence // _SECOND} s"
            if self.clock.window and self._now >= self._sync_time:
                is_done = yield from self._exchange(_SYNC_WAIT)
                self._sync_time = self._now + (_PERIOD if is_done and self.clock.is_converged else self._loop)
            if self._liveness.is_ping_due(self._now):
                yield from self._ping()
                if self._liveness.is_over:
                    return "the agent has ended, or does not answer; looking for the next one"
            next_time = min(self._liveness.next_time, self._last_write + silence)
            next_time = min(next_time, self._sync_time) if self.clock.window else next_time

    def _ping(self) -> _Outcome:
        """Ask whether the agent knows this session. Return whether it answers within 1 s."""
        self._knows = None
        self._streams.send(wire.GetInfo(_PING_ID).pack())
        return (yield from self._wait(lambda: self._knows is not None, _SECOND))

    def _synchronise(self) -> _Outcome:
        """Estimate the offset. Return False if the agent does not answer."""
        missed = 0
        while not self.clock.is_converged:
            if (yield from self._exchange(_SECOND)):
                missed = 0
            else:
                missed += 1
                if missed > _ATTEMPTS:
                    return False
            if not self.clock.is_converged:
                yield from self._pause(_SYNC_PAUSE[self.settings.sync])
        return True

    def _exchange(self, time: int) -> _Outcome:
        """Ask for the agent's time, and return whether it answers in time."""
        question = self._question
        self._streams.send(question.ask(self._now))
        yield from self._wait(lambda: question.is_answered(in_session=self.is_connected), time)
        if question.reply is None:
            return False
        self.exchange = question.add_to(self.clock, self._now) or self.exchange
        return True

    def _collect_outgoing(self) -> None:
        self._streams.flush_samples()
        self._outgoing += [(message, self.connections) for message in self._streams.outgoing]
        self._streams.outgoing.clear()

    # Receiving

    def _read(self) -> None:
        """Read datagrams: all while the client waits for an answer, else as many as a loop takes."""
        while not self._is_paused:
            data = self._inbox.take(self._now, is_limited=not self._is_waiting)
            if data is None:
                return
            for submessage in self._streams.receive(data, self._now):
                try:
                    self._take(submessage)
                except wire.WireError as error:
                    self.refused[str(error)] += 1
            if self._is_waiting:
                self._continue()

    def _take(self, submessage: wire.Submessage) -> None:
        take = _TAKE.get(submessage.id)
        if take is None:
            raise wire.WireError("submessage that no agent sends")
        take(self, submessage)

    def _take_info(self, submessage: wire.Submessage) -> None:
        """Take an INFO, asked for or not: it also ends the wait for another one."""
        knows = is_known(submessage.payload)
        if knows is not None:
            self._knows = knows
            self._liveness.is_answered |= knows

    def _take_status_agent(self, submessage: wire.Submessage) -> None:
        self._agent = wire.StatusAgent.unpack(submessage.payload)

    def _take_status(self, submessage: wire.Submessage) -> None:
        status = wire.Status.unpack(submessage.payload)
        if len(self._statuses) < _STATUSES:
            self._statuses[status.request_id] = status.status

    def _take_timestamp_reply(self, submessage: wire.Submessage) -> None:
        self._question.reply = wire.TimestampReply.unpack(submessage.payload)

    def _take_data(self, submessage: wire.Submessage) -> None:
        sample = wire.Sample.unpack(submessage.payload, submessage.flags)
        number = object_number(sample.object_id)
        if sample.object_id in self._servers:
            wire.Identity.unpack(sample.data)
            self._events.append(Requested(number, sample.data[:24], sample.data[24:]))
            return
        self._liveness.read += len(sample.data)  # requests do not count
        self._has_received = True
        if sample.object_id in self._readers:
            self._events.append(Received(number, sample.data))


_TAKE: Final = {
    wire.INFO: Client._take_info,  # noqa: SLF001 - a table of the methods above
    wire.STATUS_AGENT: Client._take_status_agent,  # noqa: SLF001
    wire.STATUS: Client._take_status,  # noqa: SLF001
    wire.TIMESTAMP_REPLY: Client._take_timestamp_reply,  # noqa: SLF001
    wire.DATA: Client._take_data,  # noqa: SLF001
}
