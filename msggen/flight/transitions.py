"""What a VTOL flies by between hovering and forward flight: the setpoints of both."""

from __future__ import annotations

import math
from typing import Any

from msggen.flight.feeds import Feeds
from msggen.flight.setpoints import Values
from msggen.flight.telemetry import valid_estimate
from msggen.flight.trajectory import FREE
from msggen.flight.wings import Wings
from msggen.messages.setpoints import TRAJECTORY

_DECELERATION = 2.0
"""The wanted deceleration in m/s2: VT_B_DEC_MSS."""
_GAIN = 0.1
"""The change of pitch in rad/s for each m/s2 that is missing: VT_B_DEC_I."""
_STEEPEST = 0.3
"""The largest pitch in rad."""
_LONGEST = 2.0
"""The time in s without an estimate after which the deceleration begins anew."""
_GRAVITY = 9.81


class Transition:
    """Keeps the height and the direction, and brakes on the way back to hovering.

    PX4's own modes do this in transitions. In a mode of a program, PX4 needs the setpoints of the rotors and of the
    wings, and its controllers of both run.
    """

    def __init__(self, feeds: Feeds, estimate: Any, time: float, *, is_forward: bool) -> None:
        self._feeds, self._is_forward = feeds, is_forward
        self._heading = estimate.heading
        self._course = estimate.heading if is_forward else math.atan2(estimate.vy, estimate.vx)
        self._pitch, self._time = 0.0, time

    def at(self, time: float) -> Values:
        """Return the setpoints at a time in s."""
        braking = 0.0 if self._is_forward else self._braking(time)
        along = math.cos(self._heading), math.sin(self._heading)
        return {
            TRAJECTORY.topic: {
                "position": FREE,
                "velocity": (math.nan, math.nan, 0.0),
                "acceleration": (-braking * along[0], -braking * along[1], math.nan),
                "jerk": FREE,
                "yaw": self._heading,
                "yawspeed": math.nan,
            },
            **Wings(course=self._course, height_rate=0.0).values,
        }

    def _braking(self, time: float) -> float:
        """Return the deceleration to ask for: the pitch grows while the vehicle does not brake enough."""
        estimate, passed, self._time = valid_estimate(self._feeds), time - self._time, time
        if estimate is None or passed > _LONGEST:
            self._pitch = 0.0
        else:
            self._heading = estimate.heading
            braked = -(estimate.ax * math.cos(self._heading) + estimate.ay * math.sin(self._heading))
            self._pitch += _GAIN * (_DECELERATION - braked) * passed
            self._pitch = min(max(self._pitch, 0.0), _STEEPEST)
        return _GRAVITY * math.tan(self._pitch)
