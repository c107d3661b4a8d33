"""Tests of a playback, on a clock of the test."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import given
from hypothesis import strategies as st

from msggen.recordings.log.payloads import Sample
from msggen.show.view.recording import FASTEST, Playback

SECOND = 1_000_000_000
START = 1_790_000_000 * SECOND
times = st.lists(st.integers(0, 10 * SECOND), min_size=1, max_size=30).map(sorted)


def playback(offsets: list[int]) -> tuple[Playback, list[Sample]]:
    samples = [Sample("topic", START + offset, bytes([index])) for index, offset in enumerate(offsets)]

    def read(start: int) -> Iterator[Sample]:
        return (sample for sample in samples if sample.time >= start)

    return Playback(read, samples[0].time, samples[-1].time, 0), samples


@given(times, st.lists(st.integers(1, 3 * SECOND), min_size=1, max_size=10), st.floats(0.1, 10.0))
def test_each_sample_comes_once_when_its_time_has_come(offsets: list[int], steps: list[int], speed: float) -> None:
    played, samples = playback(offsets)
    played.control(0, is_playing=True, speed=speed, seek=None)
    now, got = 0, list[Sample]()
    for step in steps:
        now += step
        got += played.due(now)
        limit = min(samples[-1].time, samples[0].time + round(now * speed))
        assert got == [sample for sample in samples if sample.time <= limit]
        assert played.state(now).time == limit
    got += played.due(now + 1000 * SECOND)
    assert got == samples
    state = played.state(now + 1000 * SECOND)
    assert (state.is_playing, state.is_ended) == (False, True)


def test_older_samples_come_at_once() -> None:
    samples = [Sample("topic", START + offset, b"") for offset in (-START, -SECOND, 0, SECOND)]
    read = {START: samples}.__getitem__
    played = Playback(lambda start: iter(read(start)), START, START + SECOND, 0)
    assert list(played.due(0)) == samples[:3]
    assert played.state(0).time == START
    assert list(played.due(SECOND)) == samples[3:]


def test_pause_seek_and_speed() -> None:
    played, samples = playback([0, SECOND, 2 * SECOND, 3 * SECOND])
    assert list(played.due(SECOND // 2)) == samples[:1]
    played.control(SECOND // 2, is_playing=False, speed=0.0, seek=None)
    assert list(played.due(9 * SECOND)) == []
    assert played.state(9 * SECOND) == (False, START + SECOND // 2, 1.0, False)
    played.control(9 * SECOND, is_playing=True, speed=2.0, seek=START + 2 * SECOND)
    assert list(played.due(9 * SECOND)) == [samples[2]]
    assert list(played.due(9 * SECOND + SECOND // 2)) == [samples[3]]
    assert played.state(10 * SECOND).is_ended
    played.control(10 * SECOND, is_playing=True, speed=1e9, seek=None)  # from the start again
    assert list(played.due(10 * SECOND)) == samples[:1]
    assert played.state(10 * SECOND).speed == FASTEST


def test_seeking_outside_ends_at_the_border() -> None:
    played, samples = playback([0, SECOND])
    played.control(0, is_playing=False, speed=1.0, seek=0)
    assert played.state(5).time == samples[0].time
    played.control(0, is_playing=False, speed=1.0, seek=START * 2)
    assert played.state(5).time == samples[-1].time
    assert list(played.due(5)) == samples[-1:]
