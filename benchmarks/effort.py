"""The amount of measuring: everything, or a short check that it works."""

from __future__ import annotations

from typing import NamedTuple

from messages import MESSAGES


class Effort(NamedTuple):
    """Numbers of repetitions. Times are minima, so more repetitions make them more accurate, not longer."""

    messages: tuple[str, ...]
    rounds: int
    """Turns of each contestant."""
    turn: float
    """Approximate seconds of a turn."""
    payloads: int
    """Samples that are decoded into columns. Loops over other packages use a tenth, because their cost is linear."""
    kept: int
    """Objects that are kept to measure their memory."""
    processes: int
    """Runs of each process."""
    copies: tuple[int, ...]
    """Numbers of copies of the whole set of messages to generate."""


FULL = Effort(MESSAGES, 60, 0.002, 20_000, 2_000, 20, (1, 10, 100))
QUICK = Effort(("SensorCombined", "EscStatus"), 3, 0.0005, 500, 100, 1, (1,))
