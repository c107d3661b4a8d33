"""Every parser and reader takes steps in proportion to its input, even for the worst inputs known.

Steps are counted, because times differ from run to run: `benchmarks/linear.py` measures those. Steps inside a regular
expression are not counted, so each reader must also come to the end of a large input.
"""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import Any

import pytest

from support.examples import by_day
from worst_inputs import READERS

SMALL, LARGE, HUGE = 4_000, 32_000, 200_000
MOST = 1.5 * LARGE / SMALL
"""Maximum ratio of the steps for both sizes: 12. It is 8 in proportion, and 64 if the steps grow with the square."""

FEW = 1_000
"""The number of steps from which counts are compared."""

ENOUGH = 60
"""Seconds of processor time after which a reader counts as one that does not end. The slowest takes about 3."""

CASES = [(name, kind) for name in READERS for kind in READERS[name].inputs]
BY_DAY = [
    pytest.param(name, kind, marks=[pytest.mark.night] * bool(place % 3))
    for name in READERS
    for place, kind in enumerate(READERS[name].inputs)
]
"""Of each reader, the first input and every third one are for each run."""


def steps_of(name: str, kind: str, size: int) -> int:
    """Return the number of lines that the interpreter executes to read an input."""
    data = READERS[name].inputs[kind](size)
    steps = 0

    def count(_frame: FrameType, event: str, _argument: Any) -> Any:
        nonlocal steps
        steps += event == "line"
        return count

    before = sys.gettrace()
    sys.settrace(count)
    try:
        READERS[name].read(data)
    finally:
        sys.settrace(before)
    return steps


@pytest.mark.parametrize(("name", "kind"), BY_DAY)
def test_the_number_of_steps_is_linear(name: str, kind: str) -> None:
    small, large = steps_of(name, kind, SMALL), steps_of(name, kind, LARGE)
    assert large <= MOST * max(FEW, small)


@by_day(("name", "kind"), CASES, 5)
def test_a_reader_comes_to_an_end(name: str, kind: str) -> None:
    data = READERS[name].inputs[kind](HUGE)

    def give_up(*_: object) -> None:
        pytest.fail(f"{HUGE} bytes took more than {ENOUGH} s")

    before = signal.signal(signal.SIGPROF, give_up)
    signal.setitimer(signal.ITIMER_PROF, ENOUGH)
    try:
        READERS[name].read(data)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
