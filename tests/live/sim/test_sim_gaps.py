"""Tests of the client while its agent is gone or another one: the datagrams of PX4 v1.18's client in captures.

The agent's datagrams go in at their times. The client's must come out: the same kinds in the same order, and the same
bytes where they do not depend on the clock. Samples depend on the vehicle, and are counted.
"""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from typing import Any

import pytest

from msggen.live.sim import Options, SimulatedVehicle
from msggen.live.xrce import wire
from msggen.live.xrce.offset import OffsetFilter
from support.simulation import SECOND
from support.xrce_agent import SmallAgent
from support.xrce_captures import Row, rows
from support.xrce_padding import masked

STEP = 4_000
"""The step of the clock of the captured client in us."""
LATE = 50_000
"""The time in us that a loop of the captured client may be late, on a busy machine: it is then repeated at its time."""


def is_question(data: bytes) -> bool:
    """Whether a datagram of the client has no samples: samples and replies depend on what the vehicle does."""
    return data[4] != wire.WRITE_DATA


class Replay:
    """A simulated vehicle that gets the datagrams of a captured agent. Times are those of the captured client."""

    def __init__(self, package: Any, captured: list[Row], options: Options = Options()) -> None:  # noqa: B008
        self.vehicle = SimulatedVehicle(package, options)
        self.captured = captured
        self.sent: list[tuple[int, bytes, int]] = []
        self.now = 0
        self.stamps = [
            (row.time, wire.Timestamp.unpack(row.data[8:]).time // 1000)
            for row in captured
            if row.sender == "client" and row.data[4] == wire.TIMESTAMP and row.port == captured[0].port
        ]
        self.boot = self.clock(0.0)

    def clock(self, time: float) -> int:
        """Return the time of the captured client, whose simulator counts in steps of 4 ms and lags behind."""
        before = [each for each in self.stamps if each[0] <= time]
        after = [each for each in self.stamps if each[0] > time]
        if not before or not after:
            near, value = before[-1] if before else after[0]
            value += round((time - near) * SECOND)
        else:
            (start, first), (end, last) = before[-1], after[0]
            value = first + round((time - start) / (end - start) * (last - first))
        return value - (value - self.stamps[0][1]) % STEP

    def begin(self) -> None:
        """Bring the vehicle into a session before the first datagram, with the times at which it asked last."""
        answers: list[bytes] = []
        agent = SmallAgent(answers.append)
        client = self.vehicle._client
        now = self.boot - 20 * SECOND
        while now < self.boot:
            self.vehicle.advance(now)
            for data, _ in self.vehicle.take_outgoing():
                agent.receive(data, now)
            for data in answers:
                self.vehicle.receive(data, now)
            answers.clear()
            now = max(now + 1, min(self.vehicle.next_time, self.boot))
        assert self.vehicle.is_connected
        asked = {kind: self.first(kind) for kind in (wire.TIMESTAMP, wire.GET_INFO)}
        client._sync_time = asked[wire.TIMESTAMP]
        client._liveness.ping_time = asked[wire.GET_INFO]
        client._until = self.boot
        reply = next(row.data for row in self.captured if row.data[4] == wire.TIMESTAMP_REPLY)
        stamp = wire.TimestampReply.unpack(reply[8:])
        client.clock = OffsetFilter(client.clock.window)
        for _ in range(client.clock.window):
            client.clock.add(stamp.originated // 1000, stamp.transmitted // 1000, stamp.originated // 1000)

    def first(self, kind: int) -> int:
        """Return when the client sent a submessage of a kind for the first time."""
        return next(self.clock(row.time) for row in self.captured if row.sender == "client" and row.data[4] == kind)

    def run(self) -> None:
        for row in self.captured:
            time = self.clock(row.time)
            late = STEP if row.data[4] == wire.INFO else 0  # it comes after the question
            while self.vehicle.next_time <= time + (late if self.vehicle._client._is_waiting else -LATE):
                self._advance(self.vehicle.next_time)
            if row.sender == "client":
                self._advance(time)
            else:
                self.now = max(self.now, time)
                self.vehicle.receive(row.data, self.now)
                self._take()

    def _advance(self, now: int) -> None:
        self.now = max(self.now, now)
        self.vehicle.advance(self.now)
        self._take()

    def _take(self) -> None:
        self.sent += [(self.now, *each) for each in self.vehicle.take_outgoing()]

    def ours(self) -> list[bytes]:
        """Return the datagrams without samples that the vehicle has sent."""
        return [data for _, data, _ in self.sent if is_question(data)]

    def theirs(self) -> list[bytes]:
        """Return those of the captured client."""
        return [row.data for row in self.captured if row.sender == "client" and is_question(row.data)]


def compared(data: bytes) -> bytes:
    """Return the part of a datagram that does not depend on the clock."""
    return data[:8] if data[4] == wire.TIMESTAMP else data


GAPS = {
    "gap-pings-2.5": "the third ping in a row is answered",
    "gap-pings-no-time": "pings are answered, and TIMESTAMP is not: one in each loop",
    "gap-info-no": "an INFO of an unknown session ends each ping, and the session after three of them",
    "gap-continued": "an INFO that comes while the client waits, and a HEARTBEAT among best-effort messages",
    "gap-hbfar": "a HEARTBEAT that tells of 4096 messages",
}


@pytest.mark.parametrize("name", GAPS)
def test_the_client_does_what_px4_did_in_a_gap(name: str, px4_types: Any) -> None:
    replay = Replay(px4_types, rows(name))
    replay.begin()
    replay.run()
    assert [compared(data) for data in replay.ours()] == [compared(data) for data in replay.theirs()], GAPS[name]


@pytest.mark.parametrize("name", GAPS)
def test_one_row_of_samples_leaves_between_two_pings_of_a_gap(name: str, px4_types: Any) -> None:
    """In one datagram, with a sample of each topic that has a new one, as the client has 2,048 bytes for them."""
    replay = Replay(px4_types, rows(name))
    replay.begin()
    replay.run()
    pings = [place for place, (_, data, _) in enumerate(replay.sent) if data[4] == wire.GET_INFO]
    waits = [(one, two) for one, two in pairwise(pings) if replay.sent[two][0] - replay.sent[one][0] > SECOND]
    between = [[data for _, data, _ in replay.sent[one:two] if not is_question(data)] for one, two in waits]
    blocked = [messages for messages in between if len(messages) < 3]
    assert all(len([*wire.submessages(messages[0][4:])]) >= 8 for messages in blocked)
    if name == "gap-pings-2.5":
        assert blocked


def test_the_session_begins_as_that_of_px4(px4_types: Any) -> None:
    """500 TIMESTAMPs, the entities with the ids of most boards, and the first TIMESTAMP of the session."""
    captured = [row for row in rows("gap-killed") if row.port == 1 and row.time < 6.5]
    replay = Replay(px4_types, captured)
    replay.vehicle._client._until = replay.clock(captured[0].time)
    replay.run()
    ours, theirs = replay.ours(), replay.theirs()
    created = [[masked(data) for data in each if data[1] == wire.RELIABLE] for each in (ours, theirs)]
    assert created[0] == created[1]
    assert len(created[0]) == 72
    counts = [Counter(data[4] for data in each) for each in (ours, theirs)]
    assert counts[0] == counts[1]
