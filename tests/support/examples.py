"""How many examples the random tests take."""

from __future__ import annotations

from hypothesis import settings

ALL_EXAMPLES = 100
"""The examples of a test that names no number, in the profile `night`."""


def examples(count: int, by_day: int = ALL_EXAMPLES) -> int:
    """Return how many of `count` examples a test takes in the present profile. Dear ones say how many `by_day`."""
    most = settings().max_examples
    some = max(1, count * most // ALL_EXAMPLES)
    return some if most == ALL_EXAMPLES else min(some, by_day)
