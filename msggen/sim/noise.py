"""The noise of simulated sensors and estimates: random numbers that cost little."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from typing import TypeAlias

Noise: TypeAlias = Callable[[], float]
"""Returns the next number of a normal distribution around 0, with a standard deviation of 1."""
_NUMBERS = 4093
"""How many numbers there are before they repeat: a prime, so that each sample begins at another one."""


def noise_of(seed: int, key: int, size: float = 1.0) -> Noise:
    """Return the noise of a vehicle, always the same for a seed and a key. `size` is the standard deviation."""
    chance = random.Random(f"noise {seed} {key}")  # noqa: S311 - not for secrets
    return itertools.cycle([chance.gauss(0.0, size) for _ in range(_NUMBERS)]).__next__
