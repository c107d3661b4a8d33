"""The land detector of a simulated multicopter: ground contact, maybe landed, landed. Times are in us."""

from __future__ import annotations

from msggen.sim.parameters import microseconds

_STAGE = microseconds("LNDMC_TRIG_TIME") // 3
_IDLE = 250_000
"""The time after ground contact until the thrust has fallen, which the second stage waits for."""
_CONTACT, _MAYBE, _LANDED = _STAGE, 2 * _STAGE + _IDLE, 3 * _STAGE + _IDLE
"""How long the vehicle rests until each stage."""


class LandDetector:
    """The stages of a landing. They begin on the ground."""

    def __init__(self) -> None:
        self.ground_contact = self.maybe_landed = self.landed = True
        self._since = 0
        """When the vehicle came to rest."""

    def step(self, time: int, *, is_resting: bool, is_disturbed: bool, is_armed: bool) -> None:
        """Move on to a time.

        `is_resting`: the vehicle stands on the ground, its motors do not push it up, and no setpoint of a program lets
        them carry it.
        `is_disturbed`: position control took a GotoSetpoint, whose speed is not that of a descent.
        """
        if not is_resting:
            self._since = time
            self.ground_contact = self.maybe_landed = self.landed = False
        elif not self.landed:
            if is_disturbed:
                self._since = time
            rest = time - self._since if is_armed else _LANDED
            self.ground_contact, self.maybe_landed, self.landed = rest >= _CONTACT, rest >= _MAYBE, rest >= _LANDED
