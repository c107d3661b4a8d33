"""Layouts against a slow reference, on captured and on mutated bytes, and against examples that a reader can check."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link.xrce import wire
from support import xrce_reference as reference
from support.xrce_captures import SESSIONS, sent

U16 = st.integers(0, 0xFFFF)
TIMES = st.integers(-(2**31) * 10**9, (2**31 - 1) * 10**9)

EXAMPLES: list[tuple[str, bytes]] = [
    ("02 01 0800 | 000a fffd 02000000", wire.GetInfo(b"\0\x0a").pack()),
    ("00 01 1000 | 58524345 0100 010f 00000001 81 00 fc01", wire.CreateClient(1).pack()),
    ("04 01 0b00 | 00 00 58524345 0100 010f 00", wire.StatusAgent().pack()),
    (
        "06 01 1c00 | 000a fffd 00 01 | 01 0d 58524345 0100 010f 00 | 01 0d 00 0100 0000 00000000",
        wire.Info(b"\0\x0a", known=True).pack(),
    ),
    ("03 01 0400 | 0002 fffe", wire.Delete(b"\0\2").pack()),
    ("05 01 0600 | 000b 8002 84 00", wire.Status(b"\0\x0b", b"\x80\2", wire.ERR_UNKNOWN_REFERENCE).pack()),
    ("08 01 1000 | 000e 8006 01 00 00 01 ffff 0000 0000 0000", wire.ReadData(b"\0\x0e", b"\x80\6").pack()),
    ("07 01 0600 | 00f9 0105 e03e", wire.Sample(b"\0\xf9", b"\1\5", b"\xe0\x3e").pack(wire.WRITE_DATA)),
    ("09 01 0500 | 000e 8006 97", wire.Sample(b"\0\x0e", b"\x80\6", b"\x97").pack(wire.DATA)),
    ("0a 01 0500 | 0100 8001 80", wire.AckNack(1, 0x8001).pack()),
    ("0b 01 0500 | 0400 0500 80", wire.Heartbeat(4, 5).pack()),
    ("0e 01 0800 | 01000000 d8ff0801", wire.Timestamp(1_017_367_000).pack()),
    (
        "0f 01 1800 | ab3d026b 7b552801 | ab3d026b de522801 | 01000000 d8ff0801",
        wire.TimestampReply(0x6B023DAB * 10**9 + 0x0128557B, 0x6B023DAB * 10**9 + 0x012852DE, 1_017_367_000).pack(),
    ),
]


@pytest.mark.parametrize(("text", "packed"), EXAMPLES, ids=[text[:2] for text, _ in EXAMPLES])
def test_a_submessage_is_packed_as_the_page_shows(text: str, packed: bytes) -> None:
    assert packed == bytes.fromhex(text.replace("|", ""))


def decoded(name: str, flags: int, payload: bytes) -> dict[str, Any]:
    """Return the fields of a payload by `wire`, named as in the reference."""
    if name == "CREATE_CLIENT":
        client = wire.CreateClient.unpack(payload)
        return {"key": client.key, "session": client.session_id, "mtu": client.mtu}
    if name == "STATUS_AGENT":
        return wire.StatusAgent.unpack(payload)._asdict()
    if name == "INFO":
        info = wire.Info.unpack(payload)
        return {"request": info.request_id, "object": info.object_id, "known": info.known, "available": info.available}
    if name in ("WRITE_DATA", "DATA"):
        sample = wire.Sample.unpack(payload, flags)
        return {"request": sample.request_id, "object": sample.object_id, "data": sample.data}
    simple: dict[str, Callable[[bytes], Any]] = {
        "GET_INFO": wire.GetInfo.unpack,
        "DELETE": wire.Delete.unpack,
        "STATUS": wire.Status.unpack,
        "READ_DATA": wire.ReadData.unpack,
        "ACKNACK": wire.AckNack.unpack,
        "HEARTBEAT": wire.Heartbeat.unpack,
        "TIMESTAMP": wire.Timestamp.unpack,
        "TIMESTAMP_REPLY": wire.TimestampReply.unpack,
    }
    fields = simple[name](payload)._asdict()
    return {key.removesuffix("_id"): value for key, value in fields.items()}


def compare(data: bytes) -> int:
    """Compare `wire` with the reference on one message. Return the number of payloads that both decode."""
    try:
        header, parts = reference.message(data)
    except reference.Bad:
        with pytest.raises(wire.WireError):
            list(wire.submessages(data[4 + len(wire.parse_header(data).key) :]))
        return 0
    ours = wire.parse_header(data)
    assert ours[:3] == (header["session"], header["stream"], header["sequence"])
    assert int.from_bytes(ours.key, "big") == header.get("key", 0)
    found = list(wire.submessages(data[4 + len(ours.key) :]))
    assert [(part.flags, part.payload) for part in found] == [part[1:] for part in parts]
    count = 0
    for name, flags, payload in parts:
        if name not in reference.NAMES or name in ("CREATE", "FRAGMENT", "RESET"):
            continue
        try:
            fields = reference.payload(name, flags, payload)
        except reference.Bad:
            with pytest.raises(wire.WireError):
                decoded(name, flags, payload)
            continue
        if name == "INFO":
            fields["available"] = fields["available"] > 0
            if fields.pop("cookie") != b"XRCE" or fields.pop("kind") != 13:
                continue
        assert decoded(name, flags, payload) == fields
        count += 1
    return count


@pytest.mark.parametrize("name", SESSIONS)
def test_captured_messages_equal_the_reference(name: str) -> None:
    datagrams = sent(name, "client") + sent(name, "agent")
    assert sum(map(compare, datagrams)) > 400


def test_mutated_messages_equal_the_reference() -> None:
    random = Random(1)  # noqa: S311
    datagrams = sorted({data[:40] for data in sent("session-service", "client") + sent("session-service", "agent")})
    for _ in range(5000):
        data = bytearray(random.choice(datagrams))
        for _ in range(random.randint(1, 3)):
            data[random.randrange(len(data))] = random.choice((0, 1, 2, 4, 5, 0x7F, 0x80, 0xFF, random.randrange(256)))
        compare(bytes(data[: random.choice((len(data), random.randrange(4, len(data) + 1)))]))


@given(st.lists(st.binary(max_size=9), max_size=4), st.integers(0, 255), st.integers(0, 255), U16)
def test_a_message_returns_what_was_packed(payloads: list[bytes], session: int, stream: int, sequence: int) -> None:
    key = b"abcd" if session < 0x80 else b""
    parts = [wire.pack_submessage(number, payload) for number, payload in enumerate(payloads)]
    message = wire.pack_message(session, stream, sequence, *parts, key=key)
    assert wire.parse_header(message) == (session, stream, sequence, key)
    found = list(wire.submessages(message[4 + len(key) :]))
    assert found == [(number, 1, payload) for number, payload in enumerate(payloads)]


@given(st.binary(min_size=4, max_size=4), st.tuples(U16, U16), st.integers(0, 255), st.tuples(TIMES, TIMES))
def test_a_submessage_returns_what_was_packed(
    ids: bytes, numbers: tuple[int, int], byte: int, times: tuple[int, int]
) -> None:
    (request, object_id), (first, last), (time, other) = (ids[:2], ids[2:]), numbers, times

    def body(packed: bytes) -> bytes:
        assert int.from_bytes(packed[2:4], "little") == len(packed) - 4
        return packed[4:]

    client = wire.CreateClient(first << 16 | last, byte, last)
    assert wire.CreateClient.unpack(body(client.pack())) == client
    assert wire.StatusAgent.unpack(body(wire.StatusAgent(byte).pack())) == (byte,)
    get_info = wire.GetInfo(request, object_id, first)
    assert wire.GetInfo.unpack(body(get_info.pack())) == get_info
    info = wire.Info(request, bool(byte & 1), object_id, bool(byte & 2))
    assert wire.Info.unpack(body(info.pack())) == info
    delete = wire.Delete(request, object_id)
    assert wire.Delete.unpack(body(delete.pack())) == delete
    status = wire.Status(request, object_id, byte)
    assert wire.Status.unpack(body(status.pack())) == status
    read = wire.ReadData(request, object_id, byte)
    assert wire.ReadData.unpack(body(read.pack())) == read
    acknack = wire.AckNack(first, last, byte)
    assert wire.AckNack.unpack(body(acknack.pack())) == acknack
    heartbeat = wire.Heartbeat(first, last, byte)
    assert wire.Heartbeat.unpack(body(heartbeat.pack())) == heartbeat
    reply = wire.TimestampReply(time, other, time)
    assert wire.TimestampReply.unpack(body(reply.pack())) == reply


@given(st.binary(min_size=16, max_size=16), st.integers(-(2**63), 2**63 - 1), st.binary(max_size=5))
def test_an_identity_returns_what_was_packed(writer: bytes, number: int, rest: bytes) -> None:
    identity = wire.Identity(writer, number)
    assert wire.Identity.unpack(identity.pack() + rest) == identity


def test_a_client_with_properties_is_read() -> None:
    text = "58524345 0100 010f 00000007 82 01 0000 01000000 02000000 6100 0000 03000000 626300 00 0002"
    assert wire.CreateClient.unpack(bytes.fromhex(text)) == (7, 0x82, 512)


def test_a_false_number_of_properties_costs_nothing() -> None:
    text = "58524345 0100 010f 00000007 82 01 0000 ffffffff"
    with pytest.raises(wire.WireError, match="payload too short"):
        wire.CreateClient.unpack(bytes.fromhex(text))


def test_a_time_after_2038_wraps() -> None:
    """The seconds on the wire have 32 bits with a sign."""
    reply = wire.answer_timestamp(b"12345678", 2**31 * 10**9 + 5)
    assert wire.TimestampReply.unpack(reply[4:]).transmitted == -(2**31) * 10**9 + 5
    assert reply.endswith(b"12345678")
