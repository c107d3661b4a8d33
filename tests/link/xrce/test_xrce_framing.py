"""Frames of a serial line: captured ones, noise, cuts, and resynchronisation."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link.xrce import framing
from msggen.link.xrce.framing import AGENT, CLIENT, Deframer, crc16, pack_frame
from support.xrce_captures import expected, rows

MESSAGES = st.binary(max_size=60) | st.lists(st.sampled_from([0x7D, 0x7E, 0x5D, 0x5E, 0]), max_size=30).map(bytes)


def slow_crc(data: bytes) -> int:
    """Return the CRC bit by bit: a shift register with polynomial x^16 + x^15 + x^2 + 1, lowest bit first."""
    register = 0
    for byte in data:
        for bit in range(8):
            out = (register ^ byte >> bit) & 1
            register = register >> 1 ^ 0b1010_0000_0000_0001 * out
    return register


def slow_frame(message: bytes, source: int, destination: int) -> bytes:
    content = [source, destination, len(message) % 256, len(message) // 256, *message]
    crc = slow_crc(message)
    frame = [0x7E]
    for byte in (*content, crc % 256, crc // 256):
        frame += [0x7D, byte ^ 0x20] if byte in (0x7D, 0x7E) else [byte]
    return bytes(frame)


@given(MESSAGES, st.integers(0, 255), st.integers(0, 255))
def test_a_frame_equals_the_reference(message: bytes, source: int, destination: int) -> None:
    assert crc16(message) == slow_crc(message)
    assert pack_frame(message, source, destination) == slow_frame(message, source, destination)


def test_the_page_has_a_real_frame() -> None:
    frame = bytes.fromhex("7e010010008000000002010800000afffd02000000cf12")
    assert Deframer().feed(frame) == [bytes.fromhex("8000000002010800000afffd02000000")]


@pytest.mark.parametrize(("sender", "own", "peer"), [("client", AGENT, CLIENT), ("agent", CLIENT, AGENT)])
def test_captured_frames_are_intact(sender: str, own: int, peer: int) -> None:
    chunks = [row.data for row in rows("session-serial") if row.sender == sender]
    deframer = Deframer(own)
    messages = [message for chunk in chunks for message in deframer.feed(chunk)]
    counts = (len(messages), deframer.frames, deframer.broken, deframer.skipped)
    frames = expected()["other_files"]["session-serial"][sender]["frames"]
    assert counts == (frames, frames, 0, 0)
    assert b"".join(pack_frame(message, peer, own) for message in messages) == b"".join(chunks)


@given(st.lists(MESSAGES, max_size=6), st.randoms(use_true_random=False))
def test_frames_survive_any_chunks(messages: list[bytes], random: Random) -> None:
    stream = b"".join(pack_frame(message, CLIENT, AGENT) for message in messages)
    deframer, found = Deframer(), []
    while stream:
        size = random.randint(1, 20)
        found += deframer.feed(stream[:size])
        stream = stream[size:]
    assert found == messages
    assert deframer.broken == deframer.skipped == 0


def test_an_escape_at_the_end_of_a_frame_is_cut_anywhere() -> None:
    """The last byte of the CRC is 7e or 7d in these messages."""
    messages = [bytes((a, b)) for a in range(256) for b in range(256) if crc16(bytes((a, b))) >> 8 in (0x7D, 0x7E)]
    assert len(messages) > 100
    deframer = Deframer()
    for message in messages:
        frame = pack_frame(message, CLIENT, AGENT)
        assert deframer.feed(frame[:-1]) == []
        assert deframer.feed(frame[-1:]) == [message]


def test_a_frame_that_is_cut_is_counted() -> None:
    deframer = Deframer()
    frame = pack_frame(b"abcdef", CLIENT, AGENT)
    assert deframer.feed(b"xy" + frame[:-3] + frame + b"z") == [b"abcdef"]
    assert (deframer.frames, deframer.broken, deframer.skipped) == (1, 1, 3)


@given(st.lists(MESSAGES, min_size=1, max_size=5), st.binary(max_size=40), MESSAGES, st.data())
def test_a_frame_after_noise_arrives(messages: list[bytes], noise: bytes, last: bytes, data: st.DataObject) -> None:
    """The begin byte of the next frame ends whatever the noise has begun."""
    stream = b"".join(pack_frame(message, CLIENT, AGENT) for message in messages)
    cut = data.draw(st.integers(0, len(stream)))
    deframer = Deframer()
    deframer.feed(stream[:cut] + noise.replace(b"\x7e", b""))
    assert deframer.feed(pack_frame(last, CLIENT, AGENT)) == [last]


@given(st.lists(MESSAGES, min_size=1, max_size=5), st.data())
def test_a_changed_byte_costs_no_other_frame(messages: list[bytes], data: st.DataObject) -> None:
    """One changed byte breaks its frame, and the next one if it becomes or was a begin byte."""
    frames = [pack_frame(message, CLIENT, AGENT) for message in messages]
    number = data.draw(st.integers(0, len(frames) - 1))
    at = data.draw(st.integers(0, len(frames[number]) - 1))
    changed = bytearray(frames[number])
    changed[at] ^= data.draw(st.integers(1, 255))
    deframer = Deframer()
    found = deframer.feed(b"".join([*frames[:number], bytes(changed), *frames[number + 1 :]]))
    assert found[:number] == messages[:number]
    rest = messages[number + 1 :]
    assert found[len(found) - len(rest) :] == rest


@given(st.lists(st.binary(max_size=50), max_size=30))
def test_noise_is_bounded(chunks: list[bytes]) -> None:
    deframer = Deframer()
    for chunk in chunks:
        deframer.feed(chunk)
        assert len(deframer._kept) <= 2 * (framing.LONGEST + 6)


def test_a_frame_that_never_ends_is_bounded() -> None:
    deframer = Deframer()
    deframer.feed(b"\x7e\1\0\xff\x0f")
    for _ in range(2000):
        deframer.feed(b"\x7d\x5d" * 10)
    assert len(deframer._kept) <= 2 * (framing.LONGEST + 6)
    assert (deframer.frames, deframer.broken) == (0, 1)
    message = bytes(framing.LONGEST)
    assert deframer.feed(pack_frame(message, CLIENT, AGENT)) == [message]


def test_a_frame_to_another_address_is_ignored() -> None:
    deframer = Deframer(AGENT)
    assert deframer.feed(pack_frame(b"abcd", CLIENT, 5)) == []
    assert (deframer.frames, deframer.broken) == (1, 0)


def test_a_message_that_is_too_long_is_refused() -> None:
    with pytest.raises(ValueError, match="a frame holds up to 4096"):
        pack_frame(bytes(4097))
    deframer = Deframer()
    assert deframer.feed(b"\x7e\1\0\x01\x10" + bytes(4097)) == []
    assert deframer.broken == 1
