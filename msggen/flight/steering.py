"""What a mode sends: the setpoints of its program, and those with which each vehicle holds its place or changes."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Sequence
from typing import Any

from msggen.flight.estimates import is_landed, valid_estimate
from msggen.flight.feeds import Feeds, Topics, filled
from msggen.flight.limits import Fence
from msggen.flight.rovers import stopping
from msggen.flight.sending import FREE
from msggen.flight.setpoints import Messages, Stream, Values
from msggen.flight.states import is_in_transition, is_on_wings, is_rover
from msggen.flight.wings import Way, Wings, circle_centre
from msggen.messages.setpoints import FIXED_WING, GOTO, TRAJECTORY, Kind

_BRAKING = 3.0
"""The deceleration in m/s2 with which PX4 comes to rest: MPC_ACC_HOR."""


class Steering:
    """Sends setpoints of the kinds that a mode declares, within its limits."""

    def __init__(self, stream: Stream, topics: Topics, feeds: Feeds, fence: Fence, kinds: Sequence[Kind]) -> None:
        self._stream, self._topics, self._feeds, self._fence, self._kinds = stream, topics, feeds, fence, kinds
        self._way: Way | None = None
        """What guides an aircraft on wings, if the mode does."""

    def set(self, kind: Kind, values: Values) -> None:
        """Send a setpoint from now on. Raises LimitError."""
        self._fence.check(kind, values)
        messages = self._filled(values)
        self._way = None
        self._stream.set(kind, lambda: messages)

    def guide(self, kind: Kind, make: Callable[[], Values]) -> None:
        """Send a setpoint from now on whose values a function returns each time, with places that are checked."""
        self._fence.check_guided(kind, make())
        self._way = make if isinstance(make, Way) else None
        self._stream.set(kind, lambda: self._filled(make()))

    def cross(self, estimate: Any, *, is_forward: bool) -> None:
        """Send the setpoints of a transition of a VTOL from now on."""
        clock = asyncio.get_running_loop().time
        transition = Transition(self._feeds, estimate, clock(), is_forward=is_forward)
        self.guide(TRAJECTORY, lambda: transition.at(clock()))

    def hold(self) -> bool:
        """Hold the place where the vehicle comes to rest, circle around it, or complete a transition.

        Return False if the place is not known, or if the mode declares no setpoints for that.
        """
        estimate, status = valid_estimate(self._feeds), self._feeds["vehicle_status"].latest
        if estimate is None or status is None:
            return False
        if is_in_transition(status):
            if {TRAJECTORY, FIXED_WING} <= {*self._kinds}:
                self.cross(estimate, is_forward=status.in_transition_to_fw)
                return True
            return False
        if is_on_wings(status):
            return FIXED_WING in self._kinds and self._circle(estimate)
        if is_rover(status):
            found = stopping(self._kinds, estimate)
            if found is not None:
                self.set(*found)
            return found is not None
        return self._hover(estimate)

    def _hover(self, estimate: Any) -> bool:
        place = self._fence.nearest(_stopped(estimate))
        if GOTO in self._kinds:
            self.set(GOTO, {GOTO.topic: {"position": place}})
        elif TRAJECTORY in self._kinds:
            rest = {"velocity": FREE, "acceleration": FREE, "jerk": FREE, "yawspeed": math.nan}
            self.set(TRAJECTORY, {TRAJECTORY.topic: {"position": place, "yaw": estimate.heading, **rest}})
        else:
            return False
        return True

    def _circle(self, estimate: Any) -> bool:
        """Fly around the place that was reached, or on a circle that begins here. On the ground, stand."""
        if is_landed(self._feeds):
            self._stream.pause()
        elif self._way is None or not self._way.is_there:
            centre = self._fence.nearest(circle_centre(estimate), is_circled=True)
            self.guide(FIXED_WING, Way.around(self._feeds, centre))
        return True

    def _filled(self, values: Values) -> Messages:
        return {topic: filled(self._topics.incoming(topic), **each) for topic, each in values.items()}


def _stopped(estimate: Any) -> tuple[float, float, float]:
    """Return where the vehicle comes to rest if it brakes now, so that it does not fly back."""
    speeds = estimate.vx, estimate.vy, estimate.vz
    seconds = math.hypot(*speeds) / _BRAKING / 2.0
    x, y, z = (here + speed * seconds for here, speed in zip((estimate.x, estimate.y, estimate.z), speeds, strict=True))
    return x, y, z


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
