"""A simulated vehicle in the place of PX4 v1.18's client in a capture: it gets the datagrams of the captured agent.

The clock of the captured client is that of its simulator, which counts in steps of 4 ms and lags behind on a busy
machine, by up to 0.1 s in one second. It stands in the captures, because the client waits by that clock.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from msggen.link.xrce import wire
from msggen.link.xrce.client_times import OffsetFilter
from msggen.sim import SimulatedVehicle
from support.simulation import SECOND
from support.xrce_agent import SmallAgent
from support.xrce_captures import load
from support.xrce_padding import masked

STEP = 4_000
"""The step of the clock of the captured client in us."""
_LATE = 8_000
"""The time in us by which a loop of the captured client may be late: what is due waits for it."""
_BEHIND = 50_000
"""The time in us by which that clock lags in 2 s: before a session, the client waits by the clock of the system."""
_BEFORE = 7 * SECOND
_IDENTITY = slice(10, 36)
"""The object id and the caller's bytes in a reply. The request id before them counts the samples of the vehicle."""


class History(NamedTuple):
    """What happened before a capture begins, as far as the capture shows it."""

    in_session: bool = True
    """Whether the capture begins in a session. Else, what comes before the first question for an agent is left out."""
    received: bool = False
    """Whether the vehicle was sent samples in an earlier session."""
    calls: int = 0
    """The requests to the service: the first reliable numbers tell them."""
    heartbeat: int | None = None
    """The last number in a HEARTBEAT, if all ACKNACKs report messages as missing."""
    best_effort: int | None = None
    """The last number on the best-effort stream, if the first one in the capture is not taken."""
    outliers: int = 0
    """The times in a row that did not count, if the filter restarts with fewer than 11 of the capture."""
    window: int = STEP
    """The time in us from the first ping to the end of a window in which bytes of samples are counted."""
    flows: bool = False
    """Whether samples flow in both directions."""


class Row(NamedTuple):
    """A datagram, and the clock of the client in us."""

    time: float
    sender: str
    data: bytes
    port: int
    clock: int


class Replay:
    """A replay of a capture. `sent` has the datagrams of the vehicle."""

    def __init__(self, package: Any, name: str, history: History = History()) -> None:  # noqa: B008
        self.capture = load(name)
        rows = [Row(row[0], row[1], bytes.fromhex(row[2]), *row[3:]) for row in self.capture["datagrams"]]
        begin = 0
        if not history.in_session:
            begin = next(place for place, row in enumerate(rows) if row.data[0] == wire.NO_SESSION)
        self.captured = rows[begin:]
        self.package = package
        self.sent: list[tuple[int, bytes]] = []
        self.now = self.captured[0].clock
        self.replies: list[tuple[Any, ...]] = []
        self._start(self.captured[0].port)
        if history.in_session:
            self._begin(history)
        else:
            self.vehicle._client._until = self.now
            self.vehicle._client._has_received = history.received

    def _start(self, port: int) -> None:
        """Start a client, at a port of the capture."""
        self.vehicle = SimulatedVehicle(self.package)
        self.vehicle._client._loop = 1  # each loop of the captured client is one of ours
        self._first_port = self._port = port

    # before the capture

    def _begin(self, history: History) -> None:
        """Bring the vehicle into the state in which the captured client is."""
        answers: list[bytes] = []
        agent = SmallAgent(answers.append)
        self._pass_time(agent, answers, self.now - _BEFORE, self.now - SECOND)
        assert self.vehicle.is_connected
        request = self.package.srv.VehicleCommand.Request().encode()
        for number in range(history.calls):
            agent.call(number, request)
        if history.heartbeat is not None:
            answers.append(wire.pack_message(0x81, 0, 0, wire.Heartbeat(0, history.heartbeat).pack()))
        if history.best_effort is not None:
            question = wire.Heartbeat(0, 0xFFFF).pack()
            answers.append(wire.pack_message(0x81, wire.BEST_EFFORT, history.best_effort, question))
        self._pass_time(agent, answers, self.now - SECOND, self.now)
        self._set_times(history)

    def _pass_time(self, agent: SmallAgent, answers: list[bytes], now: int, end: int) -> None:
        while now < end:
            self.vehicle.advance(now)
            for data, _ in self.vehicle.take_outgoing():
                agent.receive(data, now)
            for data in answers:
                self.vehicle.receive(data, now)
            soon = now + 1000
            now = min(soon if answers else max(soon, self.vehicle.next_time), end)
            answers.clear()
        self.vehicle.take_outgoing()

    def _set_times(self, history: History) -> None:
        """Take over when the captured client asks, and its estimate of the offset."""
        client = self.vehicle._client
        client._until = self.now
        client._sync_time = self._first(wire.TIMESTAMP)
        live = client._liveness
        live.ping_time = self._first(wire.GET_INFO)
        live._window_end = live.ping_time + history.window
        live._flows = history.flows
        client.clock = OffsetFilter(client.clock.window)
        for _ in range(client.clock.window):
            client.clock.add(self.now, self.now + self.capture["offset"], self.now)
        client.clock._outliers = history.outliers

    def _first(self, kind: int) -> int:
        found = (row.clock for row in self.captured if row.sender == "client" and row.data[4] == kind)
        return next(found, self.captured[-1].clock)

    # the capture

    def run(self) -> None:
        """Give the vehicle what the captured agent sent, at the time of the captured client."""
        stops = [time for time, text in self.capture["events"] if text == "client stopped"]
        client = self.vehicle._client
        reply = client.reply
        client.reply = lambda *values: self.replies.append(values)  # type: ignore[method-assign]
        for row in self.captured:
            if not (stops and row.data[4] == wire.DELETE):
                self._wait_until(row)
            if row.sender == "agent":
                if row.port == self._port:
                    self.vehicle.receive(row.data, self._pass(row.clock))
            elif row.data[4] == wire.DELETE and stops:
                self.vehicle.close(self._pass(row.clock))
            elif row.port > self._port and stops:
                stops.clear()
                self._start(row.port)
                self.vehicle._client._until = row.clock
                self.vehicle.advance(self._pass(row.clock))
            else:
                self.vehicle.advance(self._pass(row.clock))
            if is_reply(row) and self.replies:
                reply(*self.replies.pop(0))
            self._take(row)

    def _wait_until(self, row: Row) -> None:
        """Do what is due before a datagram."""
        while self.vehicle.next_time <= row.clock + self._ahead(row):
            self.vehicle.advance(self._pass(self.vehicle.next_time))
            self._take(row)
        if row.sender == "client" and row.data[0] == wire.NO_SESSION:  # back to the clock of the captured client
            self.now = self.vehicle._client._now = row.clock

    def _ahead(self, row: Row) -> int:
        """Return how much later than a datagram a time may be that comes before it."""
        client = self.vehicle._client
        is_client = row.sender == "client"
        if is_client and row.data[0] == wire.NO_SESSION:
            return _BEHIND
        if client._is_waiting:
            return STEP if is_client else 0  # it shows that the wait has ended in this step
        return -_LATE

    def _pass(self, clock: int) -> int:
        """Return the next time. It is a little later than the last one, which counts as a loop of its own."""
        self.now = max(self.now + 1, clock)
        return self.now

    def _take(self, row: Row) -> None:
        for data, connection in self.vehicle.take_outgoing():
            self._port = self._first_port + connection
            self.sent.append((self.now, data))
            if data[0] == wire.NO_SESSION and self._is_refused(row.time):
                self.vehicle.refuse()

    def _is_refused(self, time: float) -> bool:
        """Return whether nobody listens at a time, so that the captured system refused a datagram."""
        is_refused = False
        for at, text in self.capture["events"]:
            if at <= time and text == "agent killed":
                is_refused = True
            elif at <= time and "bound" in text:
                is_refused = False
        return is_refused

    # what is compared

    def ours(self) -> list[bytes]:
        """Return the datagrams of the vehicle, compared."""
        return [compared(data) for _, data in self.sent if is_compared(data)]

    def theirs(self) -> list[bytes]:
        """Return those of the captured client."""
        return [compared(row.data) for row in self.captured if row.sender == "client" and is_compared(row.data)]


def is_reply(row: Row) -> bool:
    """Return whether a datagram is a reply of the vehicle, which takes as long as its commander does."""
    return row.sender == "client" and row.data[1] == wire.RELIABLE and row.data[4] == wire.WRITE_DATA


def is_compared(data: bytes) -> bool:
    """Return whether a datagram is none of samples, which depend on what the vehicle does."""
    return data[1] != wire.BEST_EFFORT


def compared(data: bytes) -> bytes:
    """Return the part of a datagram that does not depend on clocks, on samples or on what is in memory."""
    if data[4] == wire.TIMESTAMP:
        return data[:8]
    if data[4] == wire.WRITE_DATA:
        return data[:8] + data[_IDENTITY]
    return masked(data) if data[1] == wire.RELIABLE else data
