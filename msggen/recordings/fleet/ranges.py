"""Sets of numbers as few ranges: the recordings in a file are mostly all of those that one run has converted."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from itertools import pairwise

Ranges = Sequence[range]

_TEXT = re.compile(r"(?:\d{1,9}(?:-\d{1,9})?(?:,\d{1,9}(?:-\d{1,9})?)*)?", re.ASCII)


def ranges_of(numbers: Iterable[int]) -> tuple[range, ...]:
    """Return numbers as ranges, sorted."""
    known = sorted(set(numbers))
    ends = [*(low for low, high in pairwise(known) if high != low + 1), *known[-1:]]
    begins = [*known[:1], *(high for low, high in pairwise(known) if high != low + 1)]
    return tuple(range(begin, end + 1) for begin, end in zip(begins, ends, strict=True))


def has(ranges: Ranges, numbers: Iterable[int]) -> bool:
    """Whether one of some numbers is in ranges."""
    return any(number in each for number in numbers for each in ranges)


def within(ranges: Ranges, known: Sequence[int]) -> list[int]:
    """Return those of sorted numbers that are in ranges."""
    return [
        number for each in ranges for number in known[bisect_left(known, each.start) : bisect_left(known, each.stop)]
    ]


def count_of(ranges: Ranges) -> int:
    """Return how many numbers there are."""
    return sum(map(len, ranges))


def text_of(ranges: Ranges) -> str:
    """Return ranges as text: `0-9,12`."""
    return ",".join(f"{each[0]}-{each[-1]}" if len(each) > 1 else str(each[0]) for each in ranges)


def is_text(value: object) -> bool:
    """Whether this is what `text_of` returns. Anybody can have written it."""
    return isinstance(value, str) and _TEXT.fullmatch(value) is not None


def from_text(text: str) -> tuple[range, ...]:
    """Return the ranges in a text."""
    ends = (part.partition("-")[::2] for part in text.split(",") if part)
    found = (range(int(begin), int(end or begin) + 1) for begin, end in ends)
    return tuple(each for each in found if each)
