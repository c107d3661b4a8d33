"""Every parser and reader takes time in proportion to its input, even for the worst inputs known."""

from __future__ import annotations

from time import perf_counter

import pytest

from worst_inputs import READERS

SMALL, LARGE = 25_000, 200_000
MOST = 5 * LARGE / SMALL
"""Maximum ratio of the times for both sizes: 40. It is 8 for linear time and 64 for quadratic time."""

LEAST = 0.004
"""The time in seconds from which times are compared. Shorter ones are noise."""


def time_of(name: str, kind: str, size: int) -> float:
    data = READERS[name].inputs[kind](size)
    start = perf_counter()
    READERS[name].read(data)
    return perf_counter() - start


@pytest.mark.parametrize(("name", "kind"), [(name, kind) for name in READERS for kind in READERS[name].inputs])
def test_time_is_linear(name: str, kind: str) -> None:
    ratios = []
    for _ in range(3):
        ratios.append(time_of(name, kind, LARGE) / max(LEAST, time_of(name, kind, SMALL)))
        if ratios[-1] <= MOST:
            return
    pytest.fail(f"{LARGE} bytes took {min(ratios):.0f} times as long as {SMALL} bytes")
