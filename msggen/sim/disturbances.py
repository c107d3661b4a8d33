"""The noise of sensors and estimates, and what makes flying hard: more of it, a drifting height, and wind."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType
from typing import Final, TypeAlias

from msggen.sim.flight import Flight
from msggen.sim.parts import checked

Noise: TypeAlias = Callable[[], float]
"""Returns the next number of a normal distribution around 0, with a standard deviation of 1."""
_NUMBERS = 4093
"""How many numbers there are before they repeat: a prime, so that each sample begins at another one."""
HEIGHT_DRIFT: Final = "height-drift"
NOISE: Final = "noise"
WIND: Final = "wind"
DISTURBANCES: Mapping[str, str] = MappingProxyType(
    {
        HEIGHT_DRIFT: "in the air, the estimate of the height drifts by 2 cm/s, up or down as the seed decides: z of "
        "the ground does not stay 0",
        NOISE: "sensors and estimates have eight times the usual noise",
        WIND: "gusts push the vehicle with 0.5 m/s^2 (standard deviation), so that it does not stand still",
    }
)
"""What each does, by its name."""

_DRIFT = 0.02
"""How fast the estimate of the height drifts, in m/s: that of PX4's simulator in a captured flight is a little more."""
_MORE = 8.0
"""How many times the usual noise there is."""
_GUST, _GUST_TIME = 0.5, 2.0
"""The acceleration by gusts in m/s^2, and how long one lasts, in s."""


def noise_of(seed: int, key: int, size: float = 1.0) -> Noise:
    """Return the noise of a vehicle, always the same for a seed and a key. `size` is the standard deviation."""
    chance = random.Random(f"noise {seed} {key}")  # noqa: S311 - not for secrets
    return itertools.cycle([chance.gauss(0.0, size) for _ in range(_NUMBERS)]).__next__


def noise_with(disturbances: Collection[str], seed: int, key: int) -> Noise:
    """Return the noise of a vehicle."""
    return noise_of(seed, key, _MORE if NOISE in disturbances else 1.0)


class Disturbances:
    """What moves a vehicle beside its motors. The same seed gives the same gusts and the same drift."""

    def __init__(self, names: Collection[str] = (), seed: int = 0, key: int = 1) -> None:
        """Take names of `DISTURBANCES`. Raises ValueError for another one."""
        for name in names:
            checked("disturbance", name, DISTURBANCES)
        drift = random.Random(f"drift {seed} {key}").choice((-_DRIFT, _DRIFT))  # noqa: S311 - not for secrets
        self._drift = drift if HEIGHT_DRIFT in names else 0.0
        self._gusts = noise_of(seed, -key) if WIND in names else None
        self.is_calm = not self._drift and self._gusts is None

    def step(self, flight: Flight, seconds: float) -> None:
        """Move on by a short time."""
        if not flight.is_on_ground:
            flight.ground += self._drift * seconds  # the vehicle is flown by its estimate, in which the ground moves
        if self._gusts is not None:
            north, east = flight.gust
            share, gust = seconds / _GUST_TIME, _GUST * math.sqrt(2.0 * seconds / _GUST_TIME)
            flight.gust = (
                north * (1.0 - share) + gust * self._gusts(),
                east * (1.0 - share) + gust * self._gusts(),
            )
