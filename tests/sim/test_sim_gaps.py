"""Tests of the client while its agent is gone or another one: the datagrams of PX4 v1.18's client in captures.

The agent's datagrams go in at the times of the captured client's clock. The client's must come out: the same datagrams
in the same order, but for clocks, request ids of replies, and padding. Samples depend on the vehicle: `is_compared`.
"""

from __future__ import annotations

from functools import cache
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import pytest

from msggen.link.xrce import client, client_liveness, wire
from support.examples import by_day
from support.gap_replay import History, Replay, is_compared
from support.simulation import SECOND
from support.xrce_captures import FOLDER


class Case(NamedTuple):
    """A capture, and what came before it."""

    name: str
    history: History = History()


AT_START = History(in_session=False)

ROWS = {
    "a ping is waited for by 1 s, and sent more than 1 s after the start of the last one": [
        Case("gap-pings-0.3"),
        Case("gap-pings-1.5"),
    ],
    "the third ping in a row can still be answered": [Case("gap-pings-2.5")],
    "an INFO of an unknown session ends the wait for each ping, and is a miss": [Case("gap-info-no")],
    "the fourth ping ends the session; the next one begins with 500 times and all entities": [
        Case("gap-killed", AT_START._replace(received=True))
    ],
    "an INFO needs no configuration": [Case("gap-info-bare")],
    "an INFO with availability 0 is no answer, also while the filter restarts": [
        Case("gap-info-avail0", History(outliers=7))
    ],
    "the answers of an agent that stood still are taken together": [Case("gap-stopped")],
    "an INFO without a question ends the wait for a ping": [Case("gap-continued")],
    "a TIMESTAMP without an answer is repeated in each loop, after 10 ms": [Case("gap-pings-no-time")],
    "there are no pings while samples flow both ways": [
        Case("gap-stale-reliable", History(calls=2, window=96_000)),
        Case("gap-stale", History(calls=4, flows=True)),
    ],
    "a TIMESTAMP at the start is waited for by 1 s; eleven time-outs in a row end the session": [
        Case("gap-sync-none", AT_START)
    ],
    "a HEARTBEAT that tells of 4096 messages sets 16 bits in all ACKNACKs": [Case("gap-hbfar")],
    "the start goes on with the next agent; nothing is read in the pauses of 10 ms": [
        Case("gap-sync-table", AT_START),
        Case("gap-sync-learnt", AT_START),
    ],
    "the eleventh outlier in a row restarts the filter: 500 TIMESTAMPs, one in each loop": [
        Case("gap-learnt", History(calls=2, outliers=4, best_effort=0x4000)),
        Case("gap-acklow", History(calls=4, outliers=6, best_effort=1, heartbeat=0x1000, window=100_000)),
    ],
    "before a session, a refused ping is repeated after 2 s; a client that is stopped sends DELETE": [
        Case("gap-client-restarted")
    ],
    "an ACKNACK that is too high does no harm; replies go on": [
        Case("gap-ackhigh", History(calls=2, heartbeat=0x1000, window=100_000))
    ],
}
"""What PX4's client does, and the captures that show it. In gap-acklow, an ACKNACK also ends all replies."""

BY_KIND = [Case("gap-publishing", History(flows=True, window=-4_020_000))]
"""Captures of which the TIMESTAMPs in a row are counted, within one: one is sent in each loop, of 12 ms here. The first
ping comes 1 s after the end of the first window without samples, and no datagram shows in which loop it ends."""

CASES = [case for cases in ROWS.values() for case in cases]


@pytest.fixture(autouse=True)
def _steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let more than 1 s be 1.001 s: the captured clock stands still for 4 ms, and ours goes on by 1 us a loop."""
    for module in (client, client_liveness):
        monkeypatch.setattr(module, "_PERIOD", SECOND + 1000)


@cache
def replayed(case: Case, package: Any) -> Replay:
    replay = Replay(package, case.name, case.history)
    replay.run()
    return replay


@by_day("case", CASES, 6, ids=[case.name for case in CASES])
def test_the_client_does_what_px4_did_in_a_gap(case: Case, px4_types: Any) -> None:
    replay = replayed(case, px4_types)
    assert replay.ours() == replay.theirs(), [row for row, cases in ROWS.items() if case in cases]


@pytest.mark.parametrize("case", BY_KIND, ids=lambda case: case.name)
def test_the_client_does_the_same_in_order(case: Case, px4_types: Any) -> None:
    replay = replayed(case, px4_types)
    ours, theirs = ([(data, len([*same])) for data, same in groupby(each)] for each in (replay.ours(), replay.theirs()))
    assert [data for data, _ in ours] == [data for data, _ in theirs]
    assert all(abs(one - two) <= 1 for (_, one), (_, two) in zip(ours, theirs, strict=True))
    assert max(number for _, number in theirs) > 150


def test_every_capture_of_a_gap_is_replayed() -> None:
    stored = {path.name.removesuffix(".json.gz") for path in FOLDER.glob("gap-*.json.gz")}
    assert stored == {case.name for case in [*CASES, *BY_KIND]}
    assert len(stored) == 21


@pytest.mark.parametrize("name", ["gap-pings-2.5", "gap-continued", "gap-info-avail0", "gap-publishing"])
def test_one_row_of_samples_leaves_between_two_pings_of_a_gap(name: str, px4_types: Any) -> None:
    """In one datagram, with a sample of each topic that has a new one, as the client has 2,048 bytes for them."""
    replay = replayed(next(case for case in [*CASES, *BY_KIND] if case.name == name), px4_types)
    pings = [place for place, (_, data) in enumerate(replay.sent) if data[4] == wire.GET_INFO]
    waits = [(one, two) for one, two in pairwise(pings) if replay.sent[two][0] - replay.sent[one][0] > SECOND]
    between = [[data for _, data in replay.sent[one:two] if not is_compared(data)] for one, two in waits]
    blocked = [messages for messages in between if len(messages) < 3]
    assert blocked
    assert all(len([*wire.submessages(messages[0][4:])]) >= 8 for messages in blocked)


def test_a_burst_is_read_by_ten_in_a_loop(px4_types: Any) -> None:
    """The ACKNACKs to HEARTBEATs tell when each was read. A loop takes 2 ms."""
    replay = Replay(px4_types, "gap-continued")
    vehicle, now = replay.vehicle, replay.now
    vehicle._client._liveness.ping_time = vehicle._client._sync_time = now + SECOND
    vehicle.advance(now)
    question = wire.pack_message(0x81, wire.NO_STREAM, 0, wire.Heartbeat(0, 0xFFFF).pack())
    for _ in range(25):
        vehicle.receive(question, now)
    read = []
    for step in (0, 1_999, 2_000, 4_000, 6_000):
        vehicle.advance(now + step)
        read.append(sum(data[4] == wire.ACKNACK for data, _ in vehicle.take_outgoing()))
    assert read == [10, 0, 10, 5, 0]
    assert vehicle.next_time > now + 6_000
