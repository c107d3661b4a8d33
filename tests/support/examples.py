"""How many examples the random tests take, and which cases of dear tests are for the night."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeVar

import pytest
from hypothesis import settings

T = TypeVar("T")

ALL_EXAMPLES = 100
"""The examples of a test that names no number, in the profile `night`."""


def examples(count: int, by_day: int = ALL_EXAMPLES) -> int:
    """Return how many of `count` examples a test takes in the present profile. Dear ones say how many `by_day`."""
    most = settings().max_examples
    some = max(1, count * most // ALL_EXAMPLES)
    return some if most == ALL_EXAMPLES else min(some, by_day)


def some(cases: Iterable[T], step: int) -> list[T]:
    """Return what a dear test takes of `cases`: every `step`th, the first included, and at night all."""
    return [*cases][:: 1 if settings().max_examples == ALL_EXAMPLES else step]


def by_day(
    arguments: str | tuple[str, ...], cases: Iterable[Any], step: int, ids: Iterable[str] | None = None
) -> pytest.MarkDecorator:
    """Parametrize a dear test: each run takes every `step`th case, the first included, and the night the others."""
    given = [case if isinstance(arguments, tuple) else (case,) for case in cases]
    marked = [
        pytest.param(*case, marks=[pytest.mark.night] if place % step else []) for place, case in enumerate(given)
    ]
    return pytest.mark.parametrize(arguments, marked, ids=ids if ids is None else [*ids])
