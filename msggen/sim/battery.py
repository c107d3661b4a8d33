"""The battery of a simulated vehicle."""

from __future__ import annotations

_WARNINGS = (0.15, 0.07, 0.05)
"""The remaining charge below which each warning begins: low, critical, emergency."""


NEW, WORN = 0.02, 0.3
"""The internal resistance in Ohm: 5 mOhm a cell, which PX4 assumes (BAT1_R_INTERNAL), and 15 times of it."""


class Battery:
    """A battery of four cells that drains with the thrust."""

    cells = 4
    capacity = 5000.0
    """In mAh."""

    def __init__(self) -> None:
        self.discharged = 0.0
        self.resistance = NEW
        """In Ohm. It can be set."""
        self.current = 0.6
        self.temperature = 24.0

    @property
    def remaining(self) -> float:
        """The charge left, from 1 to 0. It can be set."""
        return max(0.0, 1.0 - self.discharged / self.capacity)

    @remaining.setter
    def remaining(self, share: float) -> None:
        self.discharged = self.capacity * (1.0 - share)

    @property
    def voltage(self) -> float:
        """The voltage under load."""
        return self.cells * (3.5 + 0.7 * self.remaining) - self.resistance * self.current

    @property
    def warning(self) -> int:
        """WARNING_NONE, _LOW, _CRITICAL or _EMERGENCY, at PX4's thresholds."""
        remaining = self.remaining
        return sum(remaining < limit for limit in _WARNINGS)

    def drain(self, seconds: float, thrust: float) -> None:
        """Take the current of a short time. `thrust` is 1 in hover, 0 with the motors off."""
        self.current = 0.6 + 14.0 * thrust**1.5
        self.discharged = min(self.capacity, self.discharged + self.current * seconds / 3.6)
