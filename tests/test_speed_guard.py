"""Decoding stays as close to what `struct` alone takes as it is.

Both are measured in this process, taking turns, and the minima of many short turns are compared: the ratio depends
neither on the machine's speed nor on what else it does. A disturbed attempt is repeated.
"""

from __future__ import annotations

import sys
from typing import Any

import pytest

from codec import Entries, enter_all, measure
from contest import Entry
from effort import FULL
from messages import MESSAGES, read_samples
from peers import FLOOR, OURS
from rounds import Contestant

RECORDED = 2.8 if sys.version_info >= (3, 11) else 3.7
"""How many times as long as the floor decoding takes: geometric mean over the eleven messages.

Measured here with CPython 3.11.7 (2.8), 3.13.0 (2.8) and 3.10.13 (3.7). To be lowered when decoding gets faster.
"""
WORSE_BY_HALF = 1.5
ATTEMPTS = 4
SHORT = FULL._replace(rounds=40, turn=0.0004)


@pytest.fixture(scope="module")
def entries() -> Entries:
    return enter_all(read_samples(), (OURS, FLOOR))


def times_the_floor(entries: Entries) -> float:
    """Return the ratio."""
    return 1 / measure(entries, "decode", SHORT).mean(FLOOR.name)


def best_of_attempts(entries: Entries, limit: float) -> float:
    """Return the ratio, measured again while it is beyond the limit: the best of all attempts."""
    best = times_the_floor(entries)
    for _ in range(1, ATTEMPTS):
        best = best if best <= limit else min(best, times_the_floor(entries))
    return best


def test_decoding_is_within_half_of_the_recorded_ratio_to_the_floor(entries: Entries) -> None:
    limit = RECORDED * WORSE_BY_HALF
    assert best_of_attempts(entries, limit) <= limit


def test_the_guard_fails_when_decoding_takes_twice_as_long(entries: Entries) -> None:
    limit = RECORDED * WORSE_BY_HALF
    assert best_of_attempts({message: slowed(by_name) for message, by_name in entries.items()}, limit) > limit


def slowed(by_name: Any) -> dict[str, Entry]:
    """Return the contestants of one message with msggen's decode done twice."""
    ours = by_name[OURS.name].decode
    twice = Contestant(f"({ours.statement}, {ours.statement})", ours.names)
    return {**by_name, OURS.name: Entry(twice, "not measured")}


def test_all_eleven_messages_are_guarded(entries: Entries) -> None:
    assert len(MESSAGES) == 11
    timed = [entry.decode for by_name in entries.values() for entry in by_name.values()]
    assert [reason for reason in timed if isinstance(reason, str)] == []
    assert len(timed) == 2 * 11
