"""How many examples the random tests take."""

from __future__ import annotations

from hypothesis import settings

ALL_EXAMPLES = 100
"""The examples of a test that names no number, in the profile `night`."""


def examples(count: int) -> int:
    """Return how many of `count` examples a test takes in the present profile."""
    return max(1, count * settings().max_examples // ALL_EXAMPLES)
