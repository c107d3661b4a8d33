"""How position control leaves the ground: the motors spool up, then the thrust grows for some seconds.

Times are in us, speeds in m/s upwards.
"""

from __future__ import annotations

import math

from msggen.sim.flight import GRAVITY, VELOCITY_GAIN
from msggen.sim.parameters import PARAMETERS, microseconds

_SPOOL_UP = microseconds("COM_SPOOLUP_TIME")
_RAMP = microseconds("MPC_TKO_RAMP_T")
_SPEED = PARAMETERS["MPC_TKO_SPEED"]
_NO_THRUST = -GRAVITY / VELOCITY_GAIN
"""The limit of the speed that gives no thrust."""
_PUSH = 0.3
"""The share of the thrust in hover above which the land detector sees no ground contact."""


class Lift:
    """The takeoff under position control. A vehicle that is in the air by other means counts as lifted."""

    def __init__(self) -> None:
        self.climb = -math.inf
        """The highest speed at present. Below 0 the vehicle does not leave the ground."""
        self._start: int | None = None

    @property
    def is_pushing(self) -> bool:
        """Whether the thrust is too high for ground contact."""
        return _NO_THRUST * (1 - _PUSH) < self.climb < math.inf

    def step(self, time: int, armed: int, *, is_wanted: bool, is_landed: bool) -> None:
        """Move on to a time. `armed` is that of arming, and `is_wanted` tells whether the mode takes off."""
        if self._start is None:
            if not is_landed:
                self.climb = math.inf
            elif is_wanted and time >= armed + _SPOOL_UP:
                self._start = time
            else:
                self.climb = -math.inf
                return
        if self._start is not None:
            self._grow(time - self._start, is_wanted=is_wanted, is_landed=is_landed)

    def reset(self) -> None:
        """Stop the motors."""
        self.climb, self._start = -math.inf, None

    def _grow(self, elapsed: int, *, is_wanted: bool, is_landed: bool) -> None:
        if elapsed >= _RAMP:
            self.climb, self._start = math.inf, None
        elif not is_wanted and is_landed:
            self.reset()
        else:
            self.climb = _NO_THRUST + (_SPEED - _NO_THRUST) * elapsed / _RAMP
