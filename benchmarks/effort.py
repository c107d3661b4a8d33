"""How much is measured: everything, or a look at whether it works."""

from __future__ import annotations

from typing import NamedTuple

from messages import MESSAGES


class Effort(NamedTuple):
    """Numbers of things to do; times come out of minima, so that more of them makes times truer, not longer."""

    messages: tuple[str, ...]
    rounds: int
    """Turns of each contestant."""
    turn: float
    """About how many seconds one takes."""
    payloads: int
    """Samples that are decoded into columns; loops over other packages take a tenth, their cost is linear."""
    kept: int
    """Objects that are kept to see how much memory they take."""
    processes: int
    """Runs of each process."""
    copies: tuple[int, ...]
    """How many times the whole set of messages is generated."""


FULL = Effort(MESSAGES, 60, 0.002, 20_000, 2_000, 20, (1, 10, 100))
QUICK = Effort(("SensorCombined", "EscStatus"), 3, 0.0005, 500, 100, 1, (1, 2))
