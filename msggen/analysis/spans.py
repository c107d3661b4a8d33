"""Stretches of time, and what two lists of them have in common."""

from __future__ import annotations

from collections.abc import Sequence

Spans = tuple[tuple[float, float], ...]
"""Stretches of time from a begin to an end, in s after the start of the recording."""


def common(one: Sequence[tuple[float, float]], other: Sequence[tuple[float, float]]) -> Spans:
    """Return the times that are in both of two lists of spans, each in the order of time."""
    found, left, right = list[tuple[float, float]](), 0, 0
    while left < len(one) and right < len(other):
        begin, end = max(one[left][0], other[right][0]), min(one[left][1], other[right][1])
        if begin < end:
            found.append((begin, end))
        if one[left][1] < other[right][1]:
            left += 1
        else:
            right += 1
    return tuple(found)
