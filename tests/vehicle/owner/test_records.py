"""Tests of the records between an owner and its programs."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.vehicle.owned.records import (
    EVENT,
    HEADER,
    LAST,
    LONGEST,
    RecordError,
    RecordReader,
    event_in,
    event_of,
    record_of,
)

RECORDS = st.tuples(
    st.integers(0, LAST),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**16 - 1),
    st.integers(-(2**63), 2**63 - 1),
    st.binary(max_size=50),
)


@given(records=st.lists(RECORDS, max_size=20), cuts=st.lists(st.integers(1, 30), min_size=1))
def test_records_are_read_as_they_were_written_however_they_are_cut(
    records: list[tuple[int, int, int, int, bytes]], cuts: list[int]
) -> None:
    data = b"".join(record_of(kind, body, vehicle, index, when) for kind, vehicle, index, when, body in records)
    reader, found, position = RecordReader(), [], 0
    while position < len(data):
        for cut in cuts:
            found += [*reader.add(data[position : position + cut])]
            position += cut
    assert found == records


@pytest.mark.parametrize("header", [HEADER.pack(LAST + 1, 0, 0, 0, 0), HEADER.pack(EVENT, 0, 0, 0, LONGEST + 1)])
def test_other_bytes_are_refused(header: bytes) -> None:
    with pytest.raises(RecordError):
        [*RecordReader().add(header)]


def test_a_reader_holds_no_more_than_a_record() -> None:
    reader = RecordReader(100)
    for _ in range(1000):
        assert [*reader.add(record_of(EVENT, bytes(100)))] == [(EVENT, 0, 0, 0, bytes(100))]
    with pytest.raises(RecordError):
        [*reader.add(record_of(EVENT, bytes(101)))]


@pytest.mark.parametrize("body", [b"", b"{}", b"[]", b"[1]", b"nul", b"\xff", b"[" * 100_000, b'"a"', b"[null]"])
def test_json_that_is_no_event_is_refused(body: bytes) -> None:
    with pytest.raises(RecordError):
        event_in(body)


def test_random_bytes_end_in_an_error_or_in_records() -> None:
    choose = random.Random(27)  # noqa: S311 - no secret
    for _ in range(2000):
        reader = RecordReader(1000)
        try:
            for kind, *_, body in reader.add(choose.randbytes(choose.randrange(200))):
                assert kind <= LAST
                assert len(body) <= 1000
        except RecordError:
            continue


def test_an_event_has_its_name_and_its_values() -> None:
    (record,) = RecordReader().add(event_of("opened", 3, "Route", ["/fmu/out/a", 1]))
    assert event_in(record[4]) == ("opened", [3, "Route", ["/fmu/out/a", 1]])
