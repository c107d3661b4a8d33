"""Streams under loss, repetition, reordering and wrap, against models that count without a wrap."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link.xrce.streams import (
    INPUT_WINDOW,
    OUTPUT_WINDOW,
    BestEffortInput,
    Fragments,
    ReliableInput,
    ReliableOutput,
    distance,
)
from msggen.link.xrce.wire import WireError
from support.xrce_client import Network

NUMBERS = st.integers(0, 0xFFFF)


@given(NUMBERS, st.integers(-32768, 32767))
def test_a_distance_does_not_depend_on_the_wrap(start: int, steps: int) -> None:
    assert distance(start, (start + steps) % 65536) == steps


@given(NUMBERS, st.lists(st.integers(-300, 300), max_size=50))
def test_best_effort_takes_what_is_newer(start: int, steps: list[int]) -> None:
    """The model counts without a wrap."""
    stream, newest, number = BestEffortInput(start), start, start
    for step in steps:
        number += step
        missing = stream.accept(number % 65536)
        assert missing == (number - newest - 1 if number > newest else None)
        newest = max(newest, number)


def test_best_effort_begins_with_zero_or_with_anything() -> None:
    assert BestEffortInput().accept(0) == 0
    assert BestEffortInput().accept(3) == 3
    assert BestEffortInput(None).accept(3) == 0


@pytest.mark.parametrize("ahead", [32767, 32768, 32769])
def test_half_of_all_numbers_are_newer(ahead: int) -> None:
    assert (BestEffortInput(0).accept(ahead) is not None) == (ahead <= 32767)


@given(NUMBERS, st.lists(st.integers(-32768, 32767) | st.integers(-70, 70), max_size=30), st.integers(1, 64))
def test_a_stream_goes_to_a_number_that_is_far_away_when_the_next_one_follows(
    start: int, steps: list[int], near: int
) -> None:
    """The model looks at the whole history, and finds a far number followed by the next one."""
    stream, last, number = BestEffortInput(start, near), start, start
    far: int | None = None
    for step in steps:
        number = (number + step) % 65536
        ahead = distance(last, number)
        is_far = abs(ahead) >= near
        is_taken = (far is not None and number == (far + 1) % 65536) if is_far else ahead > 0
        assert stream.accept(number) == (max(ahead - 1, 0) if is_taken else None)
        if is_far:
            far = None if is_taken else number
        last = number if is_taken else last


def transfer(random: Random, start: int, count: int, network: Network) -> int:
    """Send messages through a bad network until all have arrived. Return the rounds that it took."""
    there: list[Any] = []
    back: list[Any] = []
    sender, receiver = ReliableOutput(start), ReliableInput(start)
    messages = [str(number).encode() for number in range(count)]
    arrived: list[bytes] = []
    sent = rounds = 0
    while sent < count or sender.heartbeat() is not None:
        rounds += 1
        for _ in range(random.randint(0, 5)):
            if sent < count and not sender.is_full:
                there.append((sender.send(messages[sent]), messages[sent]))
                sent += 1
        beat = sender.heartbeat()
        if beat is not None:
            there.append((*beat, 0))
        packets, there = network.carry(random, there), []
        for packet in packets:
            if isinstance(packet[1], bytes):
                arrived += receiver.receive(packet[0], packet[1])
            else:
                arrived += receiver.heartbeat(packet[0], packet[1])
            state = receiver.acknack()
            assert state is not None
            back.append(state)
        packets, back = network.carry(random, back), []
        for packet in packets:
            there += sender.acknack(packet[0], packet[1])
        assert len(receiver._waiting) < INPUT_WINDOW
        assert len(sender._kept) <= OUTPUT_WINDOW
        assert rounds < 50 * count + 1000
    assert arrived == messages
    return rounds


@given(st.integers(), st.sampled_from([0, 1, 65500, 65535]), st.integers(0, 60))
def test_reliable_messages_arrive_once_and_in_order(seed: int, start: int, count: int) -> None:
    random = Random(seed)  # noqa: S311
    transfer(random, start, count, Network(random.random() * 0.6, random.random() * 0.5, random.random()))


def test_many_reliable_messages_arrive() -> None:
    transfer(Random(1), 65_000, 20_000, Network(0.1, 0.1, 0.1))  # noqa: S311


def test_without_loss_an_acknack_asks_for_nothing() -> None:
    receiver = ReliableInput()
    for number in range(3):
        assert receiver.receive(number, b"x") == [b"x"]
        assert receiver.acknack() == (number + 1, 0)
    assert receiver.receive(1, b"x") == []  # doubled
    assert receiver.acknack() == (3, 0)


def test_an_acknack_tells_what_is_missing() -> None:
    receiver = ReliableInput(65534)
    assert receiver.receive(0, b"c") == []
    assert receiver.acknack() == (65534, 0b011)
    assert receiver.heartbeat(65534, 1) == []
    assert receiver.acknack() == (65534, 0b1011)
    assert receiver.receive(65534, b"a") == [b"a"]
    assert receiver.acknack() == (65535, 0b101)
    assert receiver.receive(65535, b"b") == [b"b", b"c"]
    assert receiver.acknack() == (1, 0b1)


def test_messages_that_the_sender_has_dropped_are_skipped() -> None:
    receiver = ReliableInput()
    assert receiver.receive(3, b"d") == []
    assert receiver.heartbeat(3, 5) == [b"d"]
    assert receiver.acknack() == (4, 0b11)
    assert receiver.receive(6, b"g") == []
    assert receiver.heartbeat(9, 9) == []
    assert receiver.acknack() == (9, 0b1)
    assert receiver._waiting == {}


def test_a_receiver_of_an_unknown_number_begins_with_the_first_one() -> None:
    receiver = ReliableInput(None)
    assert receiver.acknack() is None
    assert receiver.receive(700, b"a") == [b"a"]
    assert receiver.acknack() == (701, 0)
    receiver = ReliableInput(None)
    assert receiver.heartbeat(700, 701) == []
    assert receiver.acknack() == (700, 0b11)


@given(NUMBERS, NUMBERS, st.integers(0, OUTPUT_WINDOW), NUMBERS)
def test_a_false_acknack_removes_nothing(start: int, first: int, count: int, missing: int) -> None:
    sender = ReliableOutput(start)
    for number in range(count):
        sender.send(bytes([number]))
    again = sender.acknack(first, missing)
    ahead = (first - start) % 65536
    kept = [number % 65536 for number in range(start + (ahead if ahead <= count else 0), start + count)]
    assert list(sender._kept) == kept
    assert [number for number, _ in again] == [
        (first + bit) % 65536 for bit in range(16) if missing >> bit & 1 and ahead <= count and ahead + bit < count
    ]


@given(st.lists(st.binary(min_size=1, max_size=20), min_size=1, max_size=10))
def test_fragments_are_joined(parts: list[bytes]) -> None:
    fragments = Fragments(200)
    for part in parts[:-1]:
        assert fragments.add(part, last=False) is None
        assert fragments.is_begun
    assert fragments.add(parts[-1], last=True) == b"".join(parts)
    assert not fragments.is_begun


def test_fragments_that_never_end_are_bounded() -> None:
    fragments = Fragments(100)
    for _ in range(10):
        fragments.add(bytes(10), last=False)
    with pytest.raises(WireError, match="fragments beyond the limit"):
        fragments.add(b"x", last=False)
    assert fragments.add(b"ab", last=True) == b"ab"
