"""Tests that samples of several files come in one order, and that files are begun when they are reached."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from msggen.exports.convert.payloads import Block, ordered
from msggen.exports.convert.payloads import merged as merged_blocks
from msggen.recordings.log.payloads import Sample, merged

TIMES = st.lists(st.lists(st.integers(0, 30)), max_size=6)
SLACK = st.lists(st.integers(0, 3), min_size=6, max_size=6)


def stream(number: int, times: Sequence[int], begun: list[int]) -> Iterator[Sample]:
    begun.append(number)
    yield from (Sample(f"/{number}", time, bytes([index])) for index, time in enumerate(sorted(times)))


def blocks(number: int, times: Sequence[int], begun: list[int]) -> Iterator[Block]:
    """Yield blocks of two samples."""
    begun.append(number)
    for index in range(0, len(times), 2):
        stamps = np.array(times[index : index + 2], np.int64)
        yield Block(number, np.zeros((len(stamps), 1), np.uint8), stamps, stamps)


def lower(times: Sequence[int], slack: int) -> int:
    """Return a time that is not later than any of `times`."""
    return min(times, default=0) - slack


@given(TIMES, SLACK)
def test_samples_come_by_time_and_then_by_stream(times: list[list[int]], slack: list[int]) -> None:
    streams = [(lower(each, slack[n]), stream(n, each, [])) for n, each in enumerate(times)]
    expected = [each for number, of_stream in enumerate(times) for each in stream(number, of_stream, [])]
    assert list(merged(streams)) == sorted(expected, key=lambda each: each.time)


@given(TIMES, SLACK)
def test_blocks_come_by_time(times: list[list[int]], slack: list[int]) -> None:
    streams = [(lower(each, slack[n]), ordered(blocks(n, sorted(each), []))) for n, each in enumerate(times)]
    found: list[int] = []
    for some in merged_blocks(streams):
        own = sorted(int(time) for block in some for time in block.log_times)
        assert own[0] >= max(found, default=0)
        found += own
    assert found == sorted(time for each in times for time in each)


def test_a_stream_is_begun_when_its_time_is_reached() -> None:
    starts = (0, 10, 20, 15, 100)
    begun: list[int] = []
    samples = merged([(start, stream(n, range(start, start + 8), begun)) for n, start in enumerate(starts)])
    seen = []
    for sample in samples:
        assert begun == [n for n in (0, 1, 3, 2, 4) if starts[n] <= sample.time]
        seen.append(sample.time)
    assert len(seen) == 40
    begun.clear()
    some = merged_blocks(
        [(start, ordered(blocks(n, range(start, start + 8), begun))) for n, start in enumerate(starts)]
    )
    assert not begun
    first = next(some)
    assert begun == [0]
    assert max(int(block.log_times.max()) for block in first) == 7
    assert len([block for each in some for block in each]) >= 4
    assert begun == [0, 1, 3, 2, 4]
