"""Tests of rows from samples in all encapsulations, against the slow codec."""

from __future__ import annotations

from itertools import chain
from random import Random
from typing import Any

import numpy as np
import pytest

from msggen.recordings.columns.arrays import columns_of
from msggen.recordings.decode.decoder import Decoder
from msggen.recordings.decode.left_out import Missing
from msggen.recordings.decode.schemas import read_schema
from msggen.recordings.source.source import Channel, Part
from support.examples import by_day
from support.reference import HEADERS, serialize, to_values

TEXTS = "string text\nwstring wide\nint64[] numbers\nPoint[] points\nPoint[2] two\nuint16[<=3] few\nEmpty none\n"
TEXTS += "string[] names\nstring[2] pair\nwstring[<=3] wides\n"
TEXTS += f"float64 last\n{'=' * 80}\nMSG: our_msgs/Point\nfloat32 x\nstring name\n{'=' * 80}\nMSG: our_msgs/Empty\n"


def part_of(payloads: list[bytes]) -> Part:
    """Return a part with these samples, and other bytes around them."""
    sizes = np.array([len(each) for each in payloads], np.int64)
    starts = 7 + np.cumsum(sizes + 3) - sizes - 3
    data = bytes(7) + b"".join(each + b"\xff" * 3 for each in payloads)
    times = np.arange(len(payloads), dtype=np.int64)
    return Part(0, np.frombuffer(data, np.uint8), starts, sizes, times)


@by_day("header", HEADERS, 3, ids=map(str, HEADERS))
def test_all_messages_have_the_same_rows_in_all_encapsulations(header: tuple[str, int], px4_types: Any) -> None:
    chance = Random(1)  # noqa: S311 - no secret
    for name in px4_types.msg.__all__:
        cls = getattr(px4_types, name)
        info = cls.__msg__
        schema = read_schema(info.ros_type, info.definition)
        decoder = Decoder(Channel(0, "/topic", info.ros_type, info.definition))
        missing: Missing = {}
        usual, others = [], []
        for _ in range(3):
            message = cls.decode(b"\0\1\0\0" + bytes(each & 1 for each in chance.randbytes(info.cdr_size)))
            values = to_values(schema.catalog, schema.message, message)
            usual.append(message.encode())
            others.append(serialize(schema.catalog, schema.message, values, *header) + bytes(chance.randrange(4)))
        mixed = [usual[0], others[1], usual[2]]
        expected = columns_of(decoder.rows(part_of(usual)).rows.view(decoder.dtype))
        assert expected["timestamp"].tolist() == [cls.decode(each).timestamp for each in usual]
        for payloads in (others, mixed):
            decoded = decoder.rows(part_of(payloads), missing)
            assert decoded.kept is None
            for column, found in columns_of(decoded.rows.view(decoder.dtype)).items():
                assert found.tobytes() == expected[column].tobytes(), column
        assert missing == {}


@pytest.mark.parametrize("header", HEADERS, ids=str)
def test_values_of_variable_size_are_those_of_the_slow_codec(header: tuple[str, int]) -> None:
    schema = read_schema("our_msgs/msg/Texts", TEXTS)
    decoder = Decoder(Channel(0, "/texts", "our_msgs/msg/Texts", TEXTS))
    chance = Random(2)  # noqa: S311 - no secret

    def point() -> dict[str, Any]:
        return {"x": float(chance.randrange(9)), "name": "ä" * chance.randrange(3)}

    every = [
        {
            "text": "x" * chance.randrange(6),
            "wide": "é𝄞" * chance.randrange(3),
            "numbers": [chance.randrange(-9, 9) for _ in range(chance.randrange(3))],
            "points": [point() for _ in range(chance.randrange(3))],
            "two": [point(), point()],
            "few": [chance.randrange(9) for _ in range(chance.randrange(4))],
            "none": {},
            "names": ["n" * chance.randrange(5) for _ in range(chance.randrange(4))],
            "pair": ["p" * chance.randrange(5) for _ in range(2)],
            "wides": ["é" * chance.randrange(3) for _ in range(chance.randrange(4))],
            "last": chance.random(),
        }
        for _ in range(30)
    ]
    payloads = [serialize(schema.catalog, schema.message, values, *header) for values in every]
    rows = decoder.rows(part_of(payloads)).rows
    assert len(rows) == 30
    for row, values in zip(rows, every, strict=True):
        for name in ("text", "wide", "points", "two", "names", "pair", "wides", "last"):
            assert row[name] == values[name]
        for name in ("numbers", "few"):
            assert row[name].tolist() == values[name]
    short = [payload[: chance.randrange(len(payload) - 8)] for payload in payloads]
    long = [payload + bytes(40) for payload in payloads]
    missing: Missing = {}
    assert len(decoder.rows(part_of(short + long), missing).rows) == 0
    assert sum(map(len, chain(*missing.values()))) == 60


def test_what_is_no_sample_is_left_out_and_counted(px4_types: Any) -> None:
    info = px4_types.VehicleStatus.__msg__
    decoder = Decoder(Channel(0, "/topic", info.ros_type, info.definition))
    good = px4_types.VehicleStatus(timestamp=5).encode()
    payloads = [b"", b"\0", good[:-9], good, b"\0\2" + good[2:], good + bytes(4), good + bytes(3), b"\0\1\0\0"]
    missing: Missing = {}
    decoded = decoder.rows(part_of(payloads), missing)
    assert decoded.kept is not None
    assert decoded.kept.tolist() == [3, 6]
    assert decoded.rows.view(decoder.dtype)["timestamp"].tolist() == [5, 5]
    assert sum(map(len, chain(*missing.values()))) == 6


def test_bools_become_0_or_1(px4_types: Any) -> None:
    info = px4_types.FailsafeFlags.__msg__
    decoder = Decoder(Channel(0, "/topic", info.ros_type, info.definition))
    payload = b"\0\1\0\0" + bytes(range(info.cdr_size))
    rows = decoder.rows(part_of([payload, payload])).rows.view(decoder.dtype)
    for name in rows.dtype.names or ():
        if rows.dtype[name] == np.dtype(bool):
            assert rows[name].view(np.uint8).tolist() == [1, 1]
